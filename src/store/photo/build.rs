//! [`PhotoTiles`]: one photo's store file, built or opened.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use tempfile::NamedTempFile;
use xxhash_rust::xxh3::{Xxh3Default, xxh3_64};

use super::codec::{Encoder, Sample};
use super::files::PositionedFile;
use super::format::{ENTRY_BYTES, Entry, HEADER_BYTES, Header, Shape, VERSION, tile_crc};
use super::pyramid::Pyramid;
use crate::geom::Size;
use crate::input::photo::{JpegCoding, PhotoFormat, PhotoHeader, Rows, decode_mask, decode_photo};
use crate::store::visit_samples;
use crate::{Error, Result};

/// How the names of unfinished store files begin.
pub(super) const UNFINISHED_PREFIX: &str = ".unfinished-";
/// What encoder, decoder and file buffers take beside the strips, and a margin for the allocator.
const FIXED_BYTES: u64 = 4 << 20;

/// What a store file is made from: a photo's name, length, time of modification, and the hash of its first, middle
/// and last MiB, with the store's version.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PhotoFingerprint(u128);

impl PhotoFingerprint {
    /// The fingerprint of the photo at `path`, which the job knows as `name`.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn of(name: &str, path: &Path) -> Result<Self> {
        let io = |e| Error::io(path, e);
        let mut file = File::open(path).map_err(io)?;
        let meta = file.metadata().map_err(io)?;
        // A file system without times leaves the content alone to tell.
        let modified = meta.modified().ok().and_then(|t| t.duration_since(UNIX_EPOCH).ok());
        let mut hash = Xxh3Default::new();
        hash.update(&VERSION.to_le_bytes());
        hash.update(&(name.len() as u64).to_le_bytes());
        hash.update(name.as_bytes());
        hash.update(&meta.len().to_le_bytes());
        hash.update(&modified.map_or(0, |t| t.as_nanos()).to_le_bytes());
        let mut add = |sample: &[u8]| hash.update(&xxh3_64(sample).to_le_bytes());
        visit_samples(&mut file, meta.len(), &mut add).map_err(io)?;
        Ok(Self(hash.digest128()))
    }
}

impl PhotoFingerprint {
    /// As a number, as it stands in files.
    pub(super) fn number(self) -> u128 {
        self.0
    }

    /// From its number.
    pub(super) fn from_number(number: u128) -> Self {
        Self(number)
    }
}

/// What a store file is made from a picture for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Content {
    /// A photo: its samples.
    Photo,
    /// A mask: 0 or 255, one channel.
    Mask,
}

impl Content {
    /// The shape of the pyramid of a picture.
    pub(super) fn shape(self, header: &PhotoHeader) -> Shape {
        match self {
            Self::Photo => {
                Shape { size: header.size, channels: header.channels, bits: header.bits }
            }
            Self::Mask => Shape { size: header.size, channels: 1, bits: 8 },
        }
    }
}

/// A photo's store file: its pyramid in tiles.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PhotoTiles {
    pub(super) path: PathBuf,
    pub(super) shape: Shape,
    fingerprint: PhotoFingerprint,
    file_bytes: u64,
}

impl PhotoTiles {
    /// Decodes the photo at `photo`, whose header is `header`, and writes its tiles to `store`, which is replaced by a
    /// single renaming once it is complete. Takes [`working_bytes`] of memory.
    ///
    /// # Errors
    /// Those of [`decode_photo`], naming the photo; [`Error::Io`] naming the store.
    pub fn build(
        photo: &Path,
        header: &PhotoHeader,
        fingerprint: PhotoFingerprint,
        store: &Path,
    ) -> Result<Self> {
        Self::build_of(Content::Photo, photo, header, fingerprint, store)
    }

    /// Like [`Self::build`], for any content.
    pub(super) fn build_of(
        content: Content,
        picture: &Path,
        header: &PhotoHeader,
        fingerprint: PhotoFingerprint,
        store: &Path,
    ) -> Result<Self> {
        let shape = content.shape(header);
        match content {
            Content::Photo if shape.bits == 16 => Builder::<u16>::new(shape, store)?
                .build(fingerprint, |sink| decode_photo(picture, header, sink)),
            Content::Photo => Builder::<u8>::new(shape, store)?
                .build(fingerprint, |sink| decode_photo(picture, header, sink)),
            Content::Mask => Builder::<u8>::new(shape, store)?
                .build(fingerprint, |sink| decode_mask(picture, header, sink)),
        }
    }

    /// Opens a store file: header and length are checked here, each tile when it is read.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Corrupt`] if it is cut, foreign or of another version.
    pub fn open(store: &Path) -> Result<Self> {
        let (_, header) = open_header(store)?;
        Ok(Self {
            path: store.to_path_buf(),
            shape: header.shape,
            fingerprint: PhotoFingerprint(header.fingerprint),
            file_bytes: header.file_bytes,
        })
    }

    /// Opens a store file like [`Self::open`] and checks its index too.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_checked(store: &Path) -> Result<Self> {
        let (file, header) = open_header(store)?;
        let mut crc = crc32fast::Hasher::new();
        let mut block = vec![0; 1 << 16];
        let mut at = HEADER_BYTES as u64;
        while at < header.shape.tiles_offset() {
            let left = header.shape.tiles_offset() - at;
            let length = usize::try_from(left).map_or(block.len(), |left| left.min(block.len()));
            file.read_exact_at(&mut block[..length], at).map_err(|e| Error::io(store, e))?;
            crc.update(&block[..length]);
            at += length as u64;
        }
        if crc.finalize() != header.index_crc {
            return Err(Error::corrupt(store, "index", "its checksum", "another one"));
        }
        Self::open(store)
    }

    /// Opens the file again, if it is still the same one.
    pub(super) fn open_again(&self) -> Result<PositionedFile> {
        let (file, header) = open_header(&self.path)?;
        if (header.shape, header.fingerprint) != (self.shape, self.fingerprint.0) {
            let place = "bytes 12 to 47";
            return Err(Error::corrupt(&self.path, place, "the photo of the job", "another one"));
        }
        Ok(file)
    }

    /// The store file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Width and height of the photo in pixels.
    pub fn size(&self) -> Size {
        self.shape.size
    }

    /// Samples a pixel: 1 or 3.
    pub fn channels(&self) -> usize {
        self.shape.channels
    }

    /// Bits a sample: 8 or 16.
    pub fn bits(&self) -> u32 {
        self.shape.bits
    }

    /// Number of pyramid levels.
    pub fn levels(&self) -> u32 {
        self.shape.levels()
    }

    /// What it was made from.
    pub fn fingerprint(&self) -> PhotoFingerprint {
        self.fingerprint
    }

    /// Length of the store file.
    pub fn file_bytes(&self) -> u64 {
        self.file_bytes
    }
}

fn open_header(store: &Path) -> Result<(PositionedFile, Header)> {
    let (file, meta) = PositionedFile::open(store).map_err(|e| Error::io(store, e))?;
    let length = meta.len();
    let mut bytes = [0; HEADER_BYTES];
    file.read_exact_at(&mut bytes, 0).map_err(|e| match e.kind() {
        ErrorKind::UnexpectedEof => {
            let expected = format!("{HEADER_BYTES} bytes or more");
            Error::corrupt(store, "length", expected, length.to_string())
        }
        _ => Error::io(store, e),
    })?;
    let header = Header::check(&bytes, store, length)?;
    Ok((file, header))
}

/// Memory that building a photo's store takes at most, in bytes, from its header alone.
///
/// A JPEG needs its file and its decoded samples, a progressive one its coefficients (2 bytes each) too; a PNG,
/// unless interlaced, only some rows; a TIFF some rows, or a row of tiles. A job must be allowed at least the greatest of its photos'. Stated and measured
/// (peak resident memory of a process that builds one, itself included) in MiB: 100 Mpx sequential 335, 318;
/// progressive 620, 602; a PNG of 24 Mpx 12, 12;
/// TIFFs of 100 Mpx in one strip of Deflate 19, 19, of Zstandard 147, 27 (its window may be that large), in tiles of
/// 512 pixels of LZW 34, 34, of JPEG 35, 35.
pub fn working_bytes(header: &PhotoHeader) -> u64 {
    let shape = Shape { size: header.size, channels: header.channels, bits: header.bits };
    let strips =
        if header.bits == 16 { Pyramid::<u16>::bytes(shape) } else { Pyramid::<u8>::bytes(shape) };
    // Blocks at the edges are whole ones of up to 32 pixels.
    let blocks = |side: u32| u64::from(side.next_multiple_of(32));
    let decoding = match header.format {
        PhotoFormat::Jpeg { coding, quarter_coefficients } => {
            let coefficients = match coding {
                JpegCoding::Sequential => 0,
                JpegCoding::SequentialScans | JpegCoding::Progressive => {
                    let area = blocks(header.size.width) * blocks(header.size.height);
                    area * quarter_coefficients / 2
                }
            };
            // Rows of blocks, upsampled, as 16-bit numbers: some 64 rows of 3 components.
            let rows = blocks(header.size.width) * 64 * 3 * 2;
            header.file_bytes + header.decoded_bytes() + coefficients + rows
        }
        // With alpha as it is stored: at most 4 samples where 3 are kept, 2 where 1 is.
        PhotoFormat::Png { interlaced: true } => 2 * header.decoded_bytes(),
        PhotoFormat::Png { interlaced: false } => 16 * 8 * u64::from(header.size.width),
        PhotoFormat::Tiff { decoding_bytes } => decoding_bytes,
    };
    FIXED_BYTES.saturating_add(strips).saturating_add(decoding)
}

/// A store file being written.
struct Builder<S> {
    shape: Shape,
    store: PathBuf,
    file: BufWriter<NamedTempFile>,
    pyramid: Pyramid<S>,
    tiles: TileWriter<S>,
}

struct TileWriter<S> {
    encoder: Encoder<S>,
    entries: Vec<Entry>,
    at: u64,
}

impl<S: Sample> Builder<S> {
    fn new(shape: Shape, store: &Path) -> Result<Self> {
        let io = |e| Error::io(store, e);
        let folder = store.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let temp =
            tempfile::Builder::new().prefix(UNFINISHED_PREFIX).tempfile_in(folder).map_err(io)?;
        let mut file = BufWriter::with_capacity(1 << 18, temp);
        file.seek(SeekFrom::Start(shape.tiles_offset())).map_err(io)?;
        let tiles = usize::try_from(shape.tiles()).expect("at most 2^32 pixels in tiles of 2^16");
        let entries = vec![Entry::default(); tiles];
        let writer =
            TileWriter { encoder: Encoder::new(store)?, entries, at: shape.tiles_offset() };
        let pyramid = Pyramid::new(shape);
        Ok(Self { shape, store: store.to_path_buf(), file, pyramid, tiles: writer })
    }

    /// Cuts the rows that `decode` hands over into tiles.
    fn build(
        self,
        fingerprint: PhotoFingerprint,
        decode: impl FnOnce(&mut dyn FnMut(Rows<'_>) -> Result<()>) -> Result<()>,
    ) -> Result<PhotoTiles> {
        let Self { shape, store, mut file, mut pyramid, mut tiles } = self;
        let mut sink = |tile, view: super::codec::TileView<'_, S>| {
            let ordinal = shape.ordinal(tile);
            tiles.write(ordinal, view, &mut file, &store)
        };
        decode(&mut |rows| {
            let rows = S::rows(rows).expect("the type of samples follows from the header");
            pyramid.push(rows, &mut sink)
        })?;
        pyramid.finish(&mut sink)?;
        finish(shape, &store, file, &tiles, fingerprint)
    }
}

/// Writes index and header, and gives the file its name.
fn finish<S>(
    shape: Shape,
    store: &Path,
    mut file: BufWriter<NamedTempFile>,
    tiles: &TileWriter<S>,
    fingerprint: PhotoFingerprint,
) -> Result<PhotoTiles> {
    let io = |e| Error::io(store, e);
    let mut index = Vec::with_capacity(tiles.entries.len() * ENTRY_BYTES);
    for entry in &tiles.entries {
        index.extend_from_slice(&entry.to_bytes());
    }
    let index_crc = crc32fast::hash(&index);
    let header = Header { shape, fingerprint: fingerprint.0, file_bytes: tiles.at, index_crc };
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    file.write_all(&header.to_bytes()).map_err(io)?;
    file.write_all(&index).map_err(io)?;
    let temp = file.into_inner().map_err(|e| io(e.into_error()))?;
    temp.persist(store).map_err(|e| io(e.error))?;
    let path = store.to_path_buf();
    Ok(PhotoTiles { path, shape, fingerprint, file_bytes: tiles.at })
}

impl<S: Sample> TileWriter<S> {
    fn write(
        &mut self,
        ordinal: u64,
        view: super::codec::TileView<'_, S>,
        file: &mut impl Write,
        store: &Path,
    ) -> Result<()> {
        let stored = self.encoder.encode(view, store)?;
        file.write_all(stored).map_err(|e| Error::io(store, e))?;
        let length = u32::try_from(stored.len()).expect("a tile is below 1 MiB");
        let slot = usize::try_from(ordinal).expect("it was one of the entries");
        self.entries[slot] = Entry { offset: self.at, length, crc: tile_crc(ordinal, stored) };
        self.at += u64::from(length);
        Ok(())
    }
}
