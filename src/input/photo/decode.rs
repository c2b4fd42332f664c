//! [`decode_photo`]: the samples of a photo, row by row.

use std::fs::File;
use std::io::{BufReader, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use super::{PhotoFormat, PhotoHeader, jpeg, tiff};
use crate::geom::Size;
use crate::{Error, Result};

/// Whole rows of a photo, `rows × width × channels`, row-major, interleaved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rows<'a> {
    /// Of an 8-bit photo.
    U8(&'a [u8]),
    /// Of a 16-bit photo.
    U16(&'a [u16]),
}

/// What takes the rows of a photo, top to bottom.
pub(super) type Sink<'a> = &'a mut dyn FnMut(Rows<'_>) -> Result<()>;

/// Decodes the photo at `path` and hands its rows to `sink`, top to bottom, one or more at a time.
///
/// `header` is the file's own, from [`super::read_photo_header`]. A JPEG is decoded as a whole (see
/// [`PhotoHeader::decoded_bytes`]), and its file is held in memory meanwhile; a PNG passes row by row, unless it is
/// interlaced, and so does a TIFF, in tiles by rows of tiles. `sink` may have been called when an error comes.
///
/// # Errors
/// [`Error::Corrupt`] if the file is cut, broken, or not what `header` says; [`Error::Io`]; the sink's.
pub fn decode_photo(path: &Path, header: &PhotoHeader, sink: Sink<'_>) -> Result<()> {
    // A decoder that panics on a hostile file must not take the job with it.
    let decoded = catch_unwind(AssertUnwindSafe(|| match header.format {
        PhotoFormat::Jpeg { .. } => decode_jpeg_file(path, header, sink),
        PhotoFormat::Png { .. } => decode_png(path, header, sink),
        PhotoFormat::Tiff { .. } => tiff::decode(path, header, sink),
    }));
    decoded.unwrap_or_else(|_| Err(broken(path, "a stream at which the decoder gave up")))
}

fn decode_jpeg_file(path: &Path, header: &PhotoHeader, sink: Sink<'_>) -> Result<()> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    jpeg::check_whole(path, &bytes)?;
    let samples = decode_stream(path, &bytes, header.size, header.channels)?;
    drop(bytes);
    sink(Rows::U8(&samples))
}

/// Decodes a JPEG of `size` in memory, as [`decode_photo`] decodes a whole one: `height × width × channels`. `path` is
/// for messages.
///
/// # Errors
/// [`Error::Corrupt`] if it is broken or of another size.
pub fn decode_jpeg(path: &Path, bytes: &[u8], size: Size, channels: usize) -> Result<Vec<u8>> {
    let decoded = catch_unwind(AssertUnwindSafe(|| decode_stream(path, bytes, size, channels)));
    decoded.unwrap_or_else(|_| Err(broken(path, "a stream at which the decoder gave up")))
}

fn decode_stream(path: &Path, bytes: &[u8], size: Size, channels: usize) -> Result<Vec<u8>> {
    let colour = if channels == 1 { ColorSpace::Luma } else { ColorSpace::RGB };
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(size.width as usize)
        .set_max_height(size.height as usize)
        .jpeg_set_out_colorspace(colour);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| broken(path, e.to_string()))?;
    let (width, height) = decoder.dimensions().unwrap_or_default();
    if (width, height) != (size.width as usize, size.height as usize) {
        return Err(changed(path, size, format!("{width} × {height}")));
    }
    let samples = decoder.decode().map_err(|e| broken(path, e.to_string()))?;
    if samples.len() as u64 != size.area() * channels as u64 {
        return Err(changed(path, size, format!("{} samples", samples.len())));
    }
    Ok(samples)
}

fn decode_png(path: &Path, header: &PhotoHeader, sink: Sink<'_>) -> Result<()> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut decoder = png::Decoder::new(BufReader::with_capacity(1 << 16, file));
    decoder.set_transformations(png::Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let row_bytes = 8 * header.size.width as usize;
    decoder.set_limits(png::Limits { bytes: (64 << 20) + 4 * row_bytes });
    let mut reader = decoder.read_info().map_err(|e| png_error(path, e))?;
    let found = Size::new(reader.info().width, reader.info().height);
    let (colour, depth) = reader.output_color_type();
    let is_16_bit = depth == png::BitDepth::Sixteen;
    let stored = colour.samples();
    let kept = if stored < 3 { 1 } else { 3 };
    if found != header.size || kept != header.channels || is_16_bit != (header.bits == 16) {
        return Err(changed(path, header.size, format!("{} × {}", found.width, found.height)));
    }
    let mut rows = PngRows { stored, kept, is_16_bit, bytes: Vec::new(), words: Vec::new() };
    if reader.info().interlaced {
        let length = reader
            .output_buffer_size()
            .ok_or_else(|| broken(path, "more bytes than this machine can address"))?;
        let mut whole = vec![0; length];
        reader.next_frame(&mut whole).map_err(|e| png_error(path, e))?;
        let row_bytes = length / header.size.height as usize;
        whole.chunks_exact(row_bytes).try_for_each(|row| rows.pass(row, sink))?;
    } else {
        for y in 0..header.size.height {
            let row = reader.next_row().map_err(|e| png_error(path, e))?;
            let row = row.ok_or_else(|| broken(path, format!("the end of the data at row {y}")))?;
            rows.pass(row.data(), sink)?;
        }
    }
    reader.finish().map_err(|e| png_error(path, e))
}

/// Drops alpha from rows and turns big-endian samples into numbers.
struct PngRows {
    stored: usize,
    kept: usize,
    is_16_bit: bool,
    bytes: Vec<u8>,
    words: Vec<u16>,
}

impl PngRows {
    fn pass(&mut self, row: &[u8], sink: Sink<'_>) -> Result<()> {
        let kept = self.kept;
        if self.is_16_bit {
            self.words.clear();
            for pixel in row.chunks_exact(2 * self.stored) {
                let samples = pixel[..2 * kept].chunks_exact(2);
                self.words.extend(samples.map(|s| u16::from_be_bytes([s[0], s[1]])));
            }
            return sink(Rows::U16(&self.words));
        }
        if kept == self.stored {
            return sink(Rows::U8(row));
        }
        self.bytes.clear();
        for pixel in row.chunks_exact(self.stored) {
            self.bytes.extend_from_slice(&pixel[..kept]);
        }
        sink(Rows::U8(&self.bytes))
    }
}

fn png_error(path: &Path, error: png::DecodingError) -> Error {
    match error {
        png::DecodingError::IoError(e) if e.kind() != ErrorKind::UnexpectedEof => {
            Error::io(path, e)
        }
        e => broken(path, e.to_string()),
    }
}

fn broken(path: &Path, found: impl Into<String>) -> Error {
    Error::corrupt(path, "picture data", "a whole picture", found)
}

pub(super) fn changed(path: &Path, size: Size, found: String) -> Error {
    let expected = format!("{} × {} pixels, as its header says", size.width, size.height);
    Error::corrupt(path, "picture data", expected, found)
}
