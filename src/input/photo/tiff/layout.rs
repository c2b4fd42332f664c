//! [`Layout`]: what a page's samples are and where they stand.

use std::io::{Read, Seek};
use std::path::Path;

use super::directory::{Directory, Order, tag};
use crate::geom::Size;
use crate::input::photo::limits::check_size;
use crate::{Error, Result};

/// Most strips or tiles; their table takes 16 bytes each.
const MAX_CHUNKS: u64 = 1 << 20;
/// Most samples a pixel, those that are dropped counted.
const MAX_SAMPLES: u64 = 64;
/// Most bytes of JPEG tables; they are some hundred.
const MAX_TABLES: u64 = 1 << 16;
/// The largest window that a Zstandard decoder reserves unless told otherwise.
const ZSTD_WINDOW_BYTES: u64 = 1 << 27;
/// Bytes of buffers beside rows and windows: of files, of the decompressors.
const BUFFER_BYTES: u64 = 1 << 20;

/// How strips and tiles are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compression {
    None,
    PackBits,
    Lzw,
    Deflate,
    Zstd,
    Jpeg(JpegColour),
}

/// What the components of the JPEG data are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum JpegColour {
    /// The samples themselves.
    Plain,
    /// Luminance and chrominance, to be turned into RGB.
    YCbCr,
}

/// A strip or tile in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Chunk {
    pub(super) at: u64,
    pub(super) length: u64,
}

/// A page that can be decoded, checked against the length of its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::input::photo) struct Layout {
    pub(in crate::input::photo) size: Size,
    /// 8 or 16.
    pub(in crate::input::photo) bits: u32,
    /// Samples a pixel, decoded: 1 or 3.
    pub(in crate::input::photo) channels: usize,
    /// Samples a pixel in the file.
    pub(super) stored: usize,
    pub(super) order: Order,
    /// White is zero.
    pub(super) is_inverted: bool,
    /// Each sample is stored as the difference to the one of the pixel before.
    pub(super) is_predicted: bool,
    pub(super) compression: Compression,
    /// Size of a tile, or width × rows of a strip; may reach beyond the page.
    pub(super) chunk: Size,
    /// Row by row.
    pub(super) chunks: Vec<Chunk>,
    pub(super) is_tiled: bool,
    pub(super) jpeg_tables: Vec<u8>,
}

impl Layout {
    /// Reads and checks the tags of a page.
    ///
    /// # Errors
    /// [`Error::Unsupported`] naming what was found, [`Error::Corrupt`], [`Error::Limit`], [`Error::Io`].
    pub(in crate::input::photo) fn read<R: Read + Seek>(
        directory: &mut Directory<'_, R>,
        path: &Path,
        file_bytes: u64,
    ) -> Result<Self> {
        if directory.has(tag::DNG_VERSION) {
            return Err(unsupported(path, "a DNG raw photo"));
        }
        let size = page_size(directory, path)?;
        let (channels, is_inverted, jpeg_colour) = colour(directory, path)?;
        let stored = directory.number(tag::SAMPLES, 1)?;
        if stored > MAX_SAMPLES {
            let what = format!("{}: samples a pixel", path.display());
            return Err(Error::Limit { what, limit: MAX_SAMPLES, found: stored });
        }
        let stored = usize::try_from(stored).expect("at most 64");
        if stored < channels {
            let expected = format!("{channels} or more");
            return Err(directory.wrong(tag::SAMPLES, expected, stored.to_string()));
        }
        let bits = sample_bits(directory, path, stored)?;
        let compression = compression(directory, path, jpeg_colour)?;
        let is_predicted = predictor(directory, path, compression)?;
        if stored > 1 && directory.number(tag::PLANAR, 1)? != 1 {
            return Err(unsupported(path, "a TIFF with a plane for each colour"));
        }
        if directory.number(tag::FILL_ORDER, 1)? != 1 {
            return Err(unsupported(path, "a TIFF with reversed bits (FillOrder 2)"));
        }
        let (is_tiled, chunk) = chunk_size(directory, path, size)?;
        let jpeg_tables = directory.bytes(tag::JPEG_TABLES, MAX_TABLES)?.unwrap_or_default();
        let mut layout = Self {
            size,
            bits,
            channels,
            stored,
            order: directory.order,
            is_inverted,
            is_predicted,
            compression,
            chunk,
            chunks: Vec::new(),
            is_tiled,
            jpeg_tables,
        };
        if matches!(compression, Compression::Jpeg(_)) {
            layout.check_jpeg(path)?;
        }
        layout.chunks = layout.read_chunks(directory, path, file_bytes)?;
        Ok(layout)
    }

    fn check_jpeg(&self, path: &Path) -> Result<()> {
        if self.bits != 8 || self.stored != self.channels {
            let what = format!("JPEG in a TIFF of {} × {} bits", self.stored, self.bits);
            return Err(unsupported(path, what));
        }
        Ok(())
    }

    /// The table of strips or tiles: all of them there, within the file, and, where they are not compressed, long
    /// enough.
    fn read_chunks<R: Read + Seek>(
        &self,
        directory: &mut Directory<'_, R>,
        path: &Path,
        file_bytes: u64,
    ) -> Result<Vec<Chunk>> {
        let (offsets_tag, lengths_tag, name) = if self.is_tiled {
            (tag::TILE_OFFSETS, tag::TILE_LENGTHS, "tile")
        } else {
            (tag::STRIP_OFFSETS, tag::STRIP_LENGTHS, "strip")
        };
        let wanted = u64::from(self.across()) * u64::from(self.down());
        if wanted > MAX_CHUNKS {
            let what = format!("{}: {name}s", path.display());
            return Err(Error::Limit { what, limit: MAX_CHUNKS, found: wanted });
        }
        let mut table = |tag| -> Result<Vec<u64>> {
            let numbers = directory.numbers(tag, MAX_CHUNKS)?.unwrap_or_default();
            if numbers.len() as u64 == wanted {
                Ok(numbers)
            } else {
                Err(directory.wrong(tag, format!("{wanted} values"), numbers.len().to_string()))
            }
        };
        let (offsets, lengths) = (table(offsets_tag)?, table(lengths_tag)?);
        let mut chunks = Vec::with_capacity(offsets.len());
        for (number, (at, length)) in (0_u32..).zip(offsets.into_iter().zip(lengths)) {
            let place = || format!("{name} {number}");
            if length == 0 {
                return Err(unsupported(path, format!("a TIFF with an empty {}", place())));
            }
            if at.checked_add(length).is_none_or(|end| end > file_bytes) {
                let expected = format!("{length} bytes at {at}");
                let found = format!("the end of the file at {file_bytes}");
                return Err(Error::corrupt(path, place(), expected, found));
            }
            let rows = u64::from(self.rows_in(number / self.across()));
            if self.compression == Compression::None && length < rows * self.stored_row_bytes() {
                let expected = format!("{} bytes", rows * self.stored_row_bytes());
                return Err(Error::corrupt(path, place(), expected, length.to_string()));
            }
            chunks.push(Chunk { at, length });
        }
        Ok(chunks)
    }

    /// Tiles in a row; 1 for strips.
    pub(super) fn across(&self) -> u32 {
        self.size.width.div_ceil(self.chunk.width)
    }

    /// Rows of tiles; strips.
    pub(super) fn down(&self) -> u32 {
        self.size.height.div_ceil(self.chunk.height)
    }

    /// Rows of the page in a row of chunks, from 0.
    pub(super) fn rows_in(&self, row: u32) -> u32 {
        let before = row.saturating_mul(self.chunk.height);
        self.size.height.saturating_sub(before).min(self.chunk.height)
    }

    /// Bytes of a sample.
    fn sample_bytes(&self) -> u64 {
        u64::from(self.bits / 8)
    }

    /// Bytes of a row of a chunk as it is stored, decompressed.
    pub(super) fn stored_row_bytes(&self) -> u64 {
        u64::from(self.chunk.width) * self.stored as u64 * self.sample_bytes()
    }

    /// Memory that decoding takes, beside what takes the rows: the tables, a row, a row of tiles unless one tile is as
    /// wide as the page, and what the decompressor keeps.
    pub(in crate::input::photo) fn decoding_bytes(&self) -> u64 {
        let rows = u64::from(self.chunk.height.min(self.size.height));
        let row_of_tiles = if self.across() > 1 { rows } else { 1 };
        let kept = u64::from(self.size.width) * self.channels as u64 * self.sample_bytes();
        let chunk_bytes = rows.saturating_mul(self.stored_row_bytes());
        let decompressor = match self.compression {
            Compression::Jpeg(_) => {
                let longest = self.chunks.iter().map(|c| c.length).max().unwrap_or(0);
                // Its bytes twice, with and without the tables; its samples; some rows of blocks as 16-bit numbers.
                let blocks = u64::from(self.chunk.width.next_multiple_of(32));
                2 * longest + chunk_bytes + blocks * 64 * 3 * 2
            }
            Compression::Zstd => chunk_bytes.min(ZSTD_WINDOW_BYTES),
            _ => 0,
        };
        let tables = 16 * self.chunks.len() as u64;
        let needs = [tables, 3 * self.stored_row_bytes(), kept.saturating_mul(row_of_tiles)];
        needs.into_iter().chain([decompressor, BUFFER_BYTES]).fold(0, u64::saturating_add)
    }
}

fn page_size<R: Read + Seek>(directory: &mut Directory<'_, R>, path: &Path) -> Result<Size> {
    let sides = [directory.needed(tag::WIDTH)?, directory.needed(tag::LENGTH)?];
    let side = |v: u64| u32::try_from(v).unwrap_or(u32::MAX);
    let size = Size::new(side(sides[0]), side(sides[1]));
    check_size(path, "tags 256 and 257", size)?;
    Ok(size)
}

/// Channels kept, whether white is zero, and what JPEG data would hold.
fn colour<R: Read + Seek>(
    directory: &mut Directory<'_, R>,
    path: &Path,
) -> Result<(usize, bool, JpegColour)> {
    let what = match directory.needed(tag::PHOTOMETRIC)? {
        0 => return Ok((1, true, JpegColour::Plain)),
        1 => return Ok((1, false, JpegColour::Plain)),
        2 => return Ok((3, false, JpegColour::Plain)),
        6 if directory.number(tag::COMPRESSION, 1)? == 7 => {
            return Ok((3, false, JpegColour::YCbCr));
        }
        3 => "a palette TIFF".to_string(),
        4 => "a TIFF mask".to_string(),
        5 => "a CMYK TIFF".to_string(),
        6 => "a YCbCr TIFF without JPEG".to_string(),
        8..=10 => "a CIE L*a*b* TIFF".to_string(),
        32803 | 34892 => "a raw TIFF (colour filter array)".to_string(),
        n => format!("a TIFF with photometric interpretation {n}"),
    };
    Err(Error::Unsupported {
        path: path.to_path_buf(),
        what,
        hint: Some("convert it to RGB or grey".into()),
    })
}

fn sample_bits<R: Read + Seek>(
    directory: &mut Directory<'_, R>,
    path: &Path,
    stored: usize,
) -> Result<u32> {
    let formats = directory.numbers(tag::SAMPLE_FORMAT, MAX_SAMPLES)?.unwrap_or_default();
    if let Some(format) = formats.into_iter().find(|&f| f != 1) {
        let name = match format {
            2 => "signed".to_string(),
            3 => "floating-point".to_string(),
            4 => "undefined".to_string(),
            5 | 6 => "complex".to_string(),
            n => format!("format {n}"),
        };
        return Err(unsupported(path, format!("a TIFF of {name} samples")));
    }
    let bits = directory.numbers(tag::BITS, MAX_SAMPLES)?.unwrap_or_else(|| vec![1]);
    // libtiff takes one value for all samples, too.
    let is_whole = bits.len() == stored || bits.len() == 1;
    match bits.first() {
        Some(&first) if is_whole && bits.iter().all(|&b| b == first) => match first {
            8 => Ok(8),
            16 => Ok(16),
            n => Err(unsupported(path, format!("a TIFF of {n} bits a sample"))),
        },
        _ if is_whole => {
            let list: Vec<_> = bits.iter().map(u64::to_string).collect();
            Err(unsupported(path, format!("a TIFF of {} bits a sample", list.join(" + "))))
        }
        _ => Err(directory.wrong(tag::BITS, format!("{stored} values"), bits.len().to_string())),
    }
}

fn compression<R: Read + Seek>(
    directory: &mut Directory<'_, R>,
    path: &Path,
    jpeg_colour: JpegColour,
) -> Result<Compression> {
    let name = match directory.number(tag::COMPRESSION, 1)? {
        1 => return Ok(Compression::None),
        5 => return Ok(Compression::Lzw),
        7 => return Ok(Compression::Jpeg(jpeg_colour)),
        8 | 32946 => return Ok(Compression::Deflate),
        32773 => return Ok(Compression::PackBits),
        50000 => return Ok(Compression::Zstd),
        2..=4 => "fax".to_string(),
        6 => "old-style JPEG".to_string(),
        34712 => "JPEG 2000".to_string(),
        34887 => "LERC".to_string(),
        34925 => "LZMA".to_string(),
        50001 => "WebP".to_string(),
        50002 | 52546 => "JPEG XL".to_string(),
        n => format!("number {n}"),
    };
    Err(unsupported(path, format!("a TIFF with {name} compression")))
}

/// Whether samples are differences; the tag means something to these compressions only.
fn predictor<R: Read + Seek>(
    directory: &mut Directory<'_, R>,
    path: &Path,
    compression: Compression,
) -> Result<bool> {
    if !matches!(compression, Compression::Lzw | Compression::Deflate | Compression::Zstd) {
        return Ok(false);
    }
    match directory.number(tag::PREDICTOR, 1)? {
        1 => Ok(false),
        2 => Ok(true),
        n => Err(unsupported(path, format!("a TIFF with predictor {n}"))),
    }
}

/// Whether the page is tiled, and the size of a tile or strip.
fn chunk_size<R: Read + Seek>(
    directory: &mut Directory<'_, R>,
    path: &Path,
    size: Size,
) -> Result<(bool, Size)> {
    let is_tiled = directory.has(tag::TILE_OFFSETS) || directory.has(tag::TILE_WIDTH);
    if !is_tiled {
        let rows = directory.number(tag::ROWS_PER_STRIP, u64::from(u32::MAX))?;
        if rows == 0 {
            return Err(directory.wrong(tag::ROWS_PER_STRIP, "1 or more", "0"));
        }
        let rows = u32::try_from(rows).unwrap_or(u32::MAX).min(size.height);
        return Ok((false, Size::new(size.width, rows)));
    }
    let mut side = |tag| -> Result<u32> {
        let found = directory.needed(tag)?;
        match u32::try_from(found) {
            Ok(side) if side > 0 => Ok(side),
            _ => Err(directory.wrong(tag, "a size in pixels", found.to_string())),
        }
    };
    let tile = Size::new(side(tag::TILE_WIDTH)?, side(tag::TILE_LENGTH)?);
    check_size(path, "tags 322 and 323", tile)?;
    Ok((true, tile))
}

fn unsupported(path: &Path, what: impl Into<String>) -> Error {
    Error::Unsupported {
        path: path.to_path_buf(),
        what: what.into(),
        hint: Some("save it as an 8- or 16-bit RGB or grey TIFF with Deflate".into()),
    }
}
