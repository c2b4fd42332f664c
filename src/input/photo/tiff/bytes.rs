//! [`ChunkBytes`]: the samples of a strip or tile as a stream of bytes.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, ErrorKind, Read, Seek, SeekFrom, Take};
use std::path::Path;

use weezl::{BitOrder, LzwStatus};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use super::layout::{Chunk, Compression, JpegColour, Layout};
use crate::geom::Size;
use crate::input::photo::{JpegCoding, PhotoFormat, jpeg};
use crate::{Error, Result};

/// Bytes read at once.
const BUFFER: usize = 1 << 16;

type Raw<'a> = BufReader<Take<&'a File>>;

/// A decompressor over the bytes of a strip or tile.
pub(super) enum ChunkBytes<'a> {
    None(Raw<'a>),
    PackBits(PackBits<Raw<'a>>),
    Lzw(Lzw<Raw<'a>>),
    Deflate(flate2::bufread::ZlibDecoder<Raw<'a>>),
    Zstd(zstd::stream::read::Decoder<'static, Raw<'a>>),
    Jpeg(Cursor<Vec<u8>>),
}

impl<'a> ChunkBytes<'a> {
    /// Starts a strip or tile of `size`, of which `rows` are of the page.
    pub(super) fn open(
        file: &'a File,
        path: &Path,
        layout: &Layout,
        (chunk, rows): (Chunk, u32),
    ) -> Result<Self> {
        let mut file = file;
        file.seek(SeekFrom::Start(chunk.at)).map_err(|e| Error::io(path, e))?;
        let mut raw = BufReader::with_capacity(BUFFER, file.take(chunk.length));
        Ok(match layout.compression {
            Compression::None => Self::None(raw),
            Compression::PackBits => Self::PackBits(PackBits { inner: raw, run: Run::Literal(0) }),
            Compression::Lzw => {
                let start = raw.fill_buf().map_err(|e| Error::io(path, e))?;
                if matches!(start, [0, second, ..] if second & 1 == 1) {
                    return Err(Error::unsupported(path, "a TIFF with old-style LZW compression"));
                }
                let decoder = weezl::decode::Configuration::with_tiff_size_switch(BitOrder::Msb, 8)
                    .with_yield_on_full_buffer(true)
                    .build();
                Self::Lzw(Lzw { inner: raw, decoder })
            }
            Compression::Deflate => Self::Deflate(flate2::bufread::ZlibDecoder::new(raw)),
            Compression::Zstd => {
                let decoder = zstd::stream::read::Decoder::with_buffer(raw);
                Self::Zstd(decoder.map_err(|e| Error::io(path, e))?.single_frame())
            }
            Compression::Jpeg(colour) => {
                let mut bytes = Vec::new();
                raw.read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
                Self::Jpeg(Cursor::new(decode_jpeg(path, layout, colour, bytes, rows)?))
            }
        })
    }

    /// Checks what ends the stream: a checksum, where there is one.
    pub(super) fn finish(mut self) -> io::Result<()> {
        match &mut self {
            // Reading on makes the decoder check; more samples than needed are no harm.
            Self::Deflate(stream) => stream.read(&mut [0]).map(|_| ()),
            Self::Zstd(stream) => stream.read(&mut [0]).map(|_| ()),
            _ => Ok(()),
        }
    }
}

impl Read for ChunkBytes<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::None(stream) => stream.read(buffer),
            Self::PackBits(stream) => stream.read(buffer),
            Self::Lzw(stream) => stream.read(buffer),
            Self::Deflate(stream) => stream.read(buffer),
            Self::Zstd(stream) => stream.read(buffer),
            Self::Jpeg(stream) => stream.read(buffer),
        }
    }
}

/// The run of equal or different bytes that is being read.
enum Run {
    Literal(usize),
    Repeated(u8, usize),
}

/// Decoder of Apple's `PackBits` (TIFF 6.0, section 9).
pub(super) struct PackBits<R> {
    inner: R,
    run: Run,
}

impl<R: BufRead> Read for PackBits<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while matches!(self.run, Run::Literal(0) | Run::Repeated(_, 0)) {
            let mut byte = [0];
            if self.inner.read(&mut byte)? == 0 {
                return Ok(0);
            }
            let n = usize::from(byte[0]);
            if n < 128 {
                self.run = Run::Literal(n + 1);
            } else if n > 128 {
                self.inner.read_exact(&mut byte)?;
                self.run = Run::Repeated(byte[0], 257 - n);
            }
        }
        match &mut self.run {
            Run::Literal(left) => {
                let n = buffer.len().min(*left);
                let read = self.inner.read(&mut buffer[..n])?;
                if read == 0 && n > 0 {
                    return Err(ErrorKind::UnexpectedEof.into());
                }
                *left -= read;
                Ok(read)
            }
            Run::Repeated(byte, left) => {
                let n = buffer.len().min(*left);
                buffer[..n].fill(*byte);
                *left -= n;
                Ok(n)
            }
        }
    }
}

/// Decoder of TIFF's LZW.
pub(super) struct Lzw<R> {
    inner: R,
    decoder: weezl::decode::Decoder,
}

impl<R: BufRead> Read for Lzw<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let step = self.decoder.decode_bytes(self.inner.fill_buf()?, buffer);
            self.inner.consume(step.consumed_in);
            match step.status {
                Ok(LzwStatus::Ok) if step.consumed_out == 0 && !buffer.is_empty() => {}
                Ok(LzwStatus::Ok | LzwStatus::Done) => return Ok(step.consumed_out),
                Ok(LzwStatus::NoProgress) => return Err(ErrorKind::UnexpectedEof.into()),
                Err(e) => return Err(io::Error::new(ErrorKind::InvalidData, e)),
            }
        }
    }
}

/// The samples of a strip or tile of JPEG data (Adobe's technical note 2), checked as a photo's are: `rows` of them or
/// more, interleaved.
fn decode_jpeg(
    path: &Path,
    layout: &Layout,
    colour: JpegColour,
    bytes: Vec<u8>,
    rows: u32,
) -> Result<Vec<u8>> {
    let bytes = with_tables(path, &layout.jpeg_tables, bytes)?;
    let broken = |found: String| Error::corrupt(path, "JPEG data", "a whole picture", found);
    let header = jpeg::read_header(&mut Cursor::new(&bytes[..]), path, bytes.len() as u64)?;
    if !matches!(header.format, PhotoFormat::Jpeg { coding: JpegCoding::Sequential, .. }) {
        return Err(Error::unsupported(path, "a TIFF with JPEG data in several scans"));
    }
    let Size { width, height } = header.size;
    let is_expected = width == layout.chunk.width && (rows..=layout.chunk.height).contains(&height);
    if !is_expected || header.channels != layout.channels {
        let expected = format!("{} × {} × {} samples", layout.chunk.width, rows, layout.channels);
        let found = format!("{width} × {height} × {}", header.channels);
        return Err(Error::corrupt(path, "JPEG data", expected, found));
    }
    jpeg::check_whole(path, &bytes)?;
    let mut decoder = JpegDecoder::new(ZCursor::new(&bytes[..]));
    decoder.decode_headers().map_err(|e| broken(e.to_string()))?;
    let stored = decoder.input_colorspace().ok_or_else(|| broken("no colour".into()))?;
    let wanted = match colour {
        JpegColour::YCbCr => ColorSpace::RGB,
        JpegColour::Plain => stored,
    };
    if colour == JpegColour::YCbCr && stored != ColorSpace::YCbCr {
        return Err(broken(format!("{stored:?} samples where YCbCr was announced")));
    }
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(width as usize)
        .set_max_height(height as usize)
        .jpeg_set_out_colorspace(wanted);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&bytes[..]), options);
    let samples = decoder.decode().map_err(|e| broken(e.to_string()))?;
    if samples.len() as u64 != header.decoded_bytes() {
        return Err(broken(format!("{} samples", samples.len())));
    }
    Ok(samples)
}

/// JPEG data behind the tables that all of a page share: both are whole streams, of which one follows the other.
fn with_tables(path: &Path, tables: &[u8], bytes: Vec<u8>) -> Result<Vec<u8>> {
    if !bytes.starts_with(b"\xFF\xD8") {
        return Err(Error::corrupt(path, "JPEG data", "a start-of-image marker", "other bytes"));
    }
    if tables.is_empty() {
        return Ok(bytes);
    }
    let shared = tables.strip_suffix(b"\xFF\xD9").filter(|t| t.starts_with(b"\xFF\xD8"));
    let shared = shared.ok_or_else(|| {
        Error::corrupt(path, "tag 347 (JPEGTables)", "a JPEG stream of tables", "other bytes")
    })?;
    Ok([shared, &bytes[2..]].concat())
}
