//! [`PhotoHeader`]: what a photo file holds.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

use super::{JpegCoding, jpeg, png, tiff};
use crate::geom::Size;
use crate::{Error, Result};

/// What a photo file holds, read without decoding a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PhotoHeader {
    /// The format and what of it matters to a decoder.
    pub format: PhotoFormat,
    /// Width and height in pixels, both at least 1.
    pub size: Size,
    /// Samples a pixel once decoded: 1 (grey) or 3 (RGB); alpha is not counted.
    pub channels: usize,
    /// Bits a sample once decoded: 8 or 16.
    pub bits: u32,
    /// Length of the file.
    pub file_bytes: u64,
}

/// Formats of photos that can be decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PhotoFormat {
    /// JPEG, Huffman coded, 8 bit.
    Jpeg {
        /// How its scans are laid out.
        coding: JpegCoding,
        /// Coefficients for each pixel, all components together, in quarters: 4 grey, 6 for 4:2:0, 12 for 4:4:4.
        quarter_coefficients: u64,
    },
    /// PNG.
    Png {
        /// Whether its rows come in seven passes (Adam7), so that it has to be decoded as a whole.
        interlaced: bool,
    },
    /// TIFF or BigTIFF, its first page.
    Tiff {
        /// Memory that decoding takes, in bytes: rows, a row of tiles, what the decompressor keeps.
        decoding_bytes: u64,
    },
}

impl PhotoHeader {
    /// Bytes of all its samples, decoded: `height × width × channels` of 1 or 2 bytes.
    pub fn decoded_bytes(&self) -> u64 {
        self.size.area() * self.channels as u64 * u64::from(self.bits / 8)
    }
}

/// First bytes of formats that are photographs, but not supported, at an offset.
const FOREIGN: &[(usize, &[u8], &str)] = &[
    (8, b"WEBP", "a WebP photo"),
    (0, b"GIF8", "a GIF picture"),
    (0, b"BM", "a BMP picture"),
    (0, b"8BPS", "a Photoshop document"),
    (4, b"ftypavif", "an AVIF photo"),
    (4, b"ftypcrx", "a Canon raw photo"),
    (4, b"ftyp", "a HEIF photo"),
    (0, b"\xFF\x0A", "a JPEG XL photo"),
    (0, b"\0\0\0\x0CJXL ", "a JPEG XL photo"),
    (0, b"\0\0\0\x0CjP  ", "a JPEG 2000 photo"),
    (0, b"\xFF\x4F\xFF\x51", "a JPEG 2000 photo"),
    (0, b"FUJIFILM", "a Fujifilm raw photo"),
];

/// Reads the header of the photo at `path`.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read, [`Error::Corrupt`] if it is no picture or its header is broken,
/// [`Error::Unsupported`] with the format's or feature's name, [`Error::Limit`] for a PNG or TIFF of more than 2³⁰ pixels.
pub fn read_photo_header(path: &Path) -> Result<PhotoHeader> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let meta = file.metadata().map_err(|e| Error::io(path, e))?;
    if meta.is_dir() {
        return Err(Error::io(path, std::io::ErrorKind::IsADirectory.into()));
    }
    header_of(&mut BufReader::new(file), path, meta.len())
}

/// Reads a header from the start of `reader`; `path` is for messages.
fn header_of<R: BufRead + Seek>(
    reader: &mut R,
    path: &Path,
    file_bytes: u64,
) -> Result<PhotoHeader> {
    let mut start = Vec::with_capacity(16);
    reader.by_ref().take(16).read_to_end(&mut start).map_err(|e| Error::io(path, e))?;
    reader.rewind().map_err(|e| Error::io(path, e))?;
    if start.starts_with(jpeg::SIGNATURE) {
        return jpeg::read_header(reader, path, file_bytes);
    }
    if start.starts_with(png::SIGNATURE) {
        return png::read_header(reader, path, file_bytes);
    }
    if tiff::SIGNATURES.iter().any(|s| start.starts_with(s)) {
        let mut directory = tiff::Directory::read(reader, path, file_bytes)?;
        let layout = tiff::Layout::read(&mut directory, path, file_bytes)?;
        return Ok(tiff_header(&layout, file_bytes));
    }
    let foreign =
        FOREIGN.iter().find(|(at, magic, _)| start[(*at).min(start.len())..].starts_with(magic));
    Err(match foreign {
        Some((_, _, name)) => Error::Unsupported {
            path: path.to_path_buf(),
            what: (*name).to_string(),
            hint: Some("convert it to TIFF, PNG or JPEG".to_string()),
        },
        None if start.is_empty() => {
            Error::corrupt(path, "byte 0", "a JPEG, PNG or TIFF photo", "an empty file")
        }
        None => Error::corrupt(
            path,
            "byte 0",
            "a JPEG, PNG or TIFF photo",
            format!("the bytes {}", hex(&start[..start.len().min(8)])),
        ),
    })
}

fn tiff_header(layout: &tiff::Layout, file_bytes: u64) -> PhotoHeader {
    PhotoHeader {
        format: PhotoFormat::Tiff { decoding_bytes: layout.decoding_bytes() },
        size: layout.size,
        channels: layout.channels,
        bits: layout.bits,
        file_bytes,
    }
}

/// Bytes as hexadecimal pairs, for messages.
fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02X}")).collect::<Vec<_>>().join(" ")
}
