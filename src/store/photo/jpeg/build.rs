//! [`IndexedJpeg`]: one photo's index file, built or opened.

use std::fs::Metadata;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use super::super::build::{PhotoFingerprint, UNFINISHED_PREFIX};
use super::super::files::PositionedFile;
use super::super::format::Shape;
use super::frame::Frame;
use super::layout::{HEADER_BYTES, Header};
use super::scan::{STEP, Scanned, scan};
use super::window::{RowData, Units, write};
use crate::geom::{PixelRect, Size};
use crate::input::photo::{PhotoHeader, decode_jpeg};
use crate::{Error, Result};

/// What buffers and tables take beside the photo's file and the checkpoints, and a margin for the allocator.
const FIXED_BYTES: u64 = 4 << 20;
/// Side of the window that is decoded to see whether the decoder takes the header, pixels.
const SAMPLE_SIDE: i64 = 64;

/// A photo that has an index file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in super::super) struct IndexedJpeg {
    /// The photo.
    pub(super) photo: PathBuf,
    /// Its index.
    pub(super) path: PathBuf,
    pub(super) header: Header,
}

/// Memory that building a photo's index takes at most, in bytes, from its header alone.
pub(in super::super) fn working_bytes(header: &PhotoHeader) -> u64 {
    // Checkpoints of 12 bytes, and as they are written; units are 8 pixels a side at least.
    let blocks = |side: u32| u64::from(side.div_ceil(8));
    let checkpoints = blocks(header.size.width).div_ceil(STEP.into()) * blocks(header.size.height);
    FIXED_BYTES + header.file_bytes + 24 * checkpoints
}

/// The time of modification of a file, nanoseconds since 1970; 0 where the file system does not tell.
pub(super) fn modified(meta: &Metadata) -> u128 {
    let since = meta.modified().ok().and_then(|t| t.duration_since(UNIX_EPOCH).ok());
    since.map_or(0, |t| t.as_nanos())
}

impl IndexedJpeg {
    /// Reads all of the photo at `photo` and writes its index to `store`, which is replaced by a single renaming once it is
    /// complete. `None` if the photo is not a JPEG for windows, or not in order: the ordinary decoder is to judge it.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(in super::super) fn build(
        photo: &Path,
        header: &PhotoHeader,
        fingerprint: PhotoFingerprint,
        store: &Path,
    ) -> Result<Option<Self>> {
        let meta = std::fs::metadata(photo).map_err(|e| Error::io(photo, e))?;
        let bytes = std::fs::read(photo).map_err(|e| Error::io(photo, e))?;
        let Some((frame, data_at, scanned)) = examine(photo, header, &bytes) else {
            return Ok(None);
        };
        let index = Header {
            size: frame.size,
            channels: frame.channels,
            mcu: frame.mcu,
            kept_bytes: u32::try_from(frame.kept.len()).unwrap_or(u32::MAX),
            kept_crc: crc32fast::hash(&frame.kept),
            fingerprint: fingerprint.number(),
            data_at: data_at as u64,
            data_bytes: scanned.end as u64,
            photo_bytes: bytes.len() as u64,
            modified: modified(&meta),
        };
        drop(bytes);
        let mut out = Vec::from(index.to_bytes());
        out.extend_from_slice(&frame.kept);
        for (row, checkpoints) in (0..).zip(scanned.checkpoints.chunks(index.columns())) {
            index.write_row(row, checkpoints, &mut out);
        }
        let io = |e| Error::io(store, e);
        let folder = store.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut temp =
            tempfile::Builder::new().prefix(UNFINISHED_PREFIX).tempfile_in(folder).map_err(io)?;
        temp.write_all(&out).map_err(io)?;
        temp.persist(store).map_err(|e| io(e.error))?;
        Ok(Some(Self { photo: photo.to_path_buf(), path: store.to_path_buf(), header: index }))
    }

    /// Opens the index file at `store` of the photo at `photo`, and checks all of it.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Corrupt`] if it is cut, foreign, damaged or of another version.
    pub(in super::super) fn open_checked(store: &Path, photo: &Path) -> Result<Self> {
        let (file, header) = open_header(store)?;
        let opened = Self { photo: photo.to_path_buf(), path: store.to_path_buf(), header };
        opened.frame(&file)?;
        let mut row = vec![0; header.row_bytes()];
        for number in 0..header.mcus().height {
            let at = header.row_offset(number);
            file.read_exact_at(&mut row, at).map_err(|e| Error::io(store, e))?;
            if Header::checked_row(number, &row).is_none() {
                let place = format!("checkpoints of row {number}");
                return Err(Error::corrupt(store, place, "their checksum", "another one"));
            }
        }
        Ok(opened)
    }

    /// The frame of the segments in the index file.
    pub(super) fn frame(&self, file: &PositionedFile) -> Result<Frame> {
        let bad = |found: &str| {
            Error::corrupt(&self.path, "segments", "those of the photo's header", found)
        };
        let mut kept = vec![0; self.header.kept_bytes as usize];
        file.read_exact_at(&mut kept, HEADER_BYTES as u64).map_err(|e| Error::io(&self.path, e))?;
        if crc32fast::hash(&kept) != self.header.kept_crc {
            return Err(bad("another checksum"));
        }
        let (frame, end) = Frame::parse(&kept).ok_or_else(|| bad("something else"))?;
        let is_same = (frame.size, frame.channels, frame.mcu)
            == (self.header.size, self.header.channels, self.header.mcu);
        if is_same && end == kept.len() { Ok(frame) } else { Err(bad("another frame")) }
    }

    /// The index file.
    pub(in super::super) fn path(&self) -> &Path {
        &self.path
    }

    /// The photo.
    pub(in super::super) fn photo(&self) -> &Path {
        &self.photo
    }

    /// What the index was made from.
    pub(in super::super) fn fingerprint(&self) -> PhotoFingerprint {
        PhotoFingerprint::from_number(self.header.fingerprint)
    }

    /// The shape of the photo's pyramid.
    pub(in super::super) fn shape(&self) -> Shape {
        Shape { size: self.header.size, channels: self.header.channels, bits: 8 }
    }
}

/// Opens an index file and checks its header.
pub(super) fn open_header(store: &Path) -> Result<(PositionedFile, Header)> {
    let (file, meta) = PositionedFile::open(store).map_err(|e| Error::io(store, e))?;
    let mut bytes = [0; HEADER_BYTES];
    file.read_exact_at(&mut bytes, 0).map_err(|e| match e.kind() {
        ErrorKind::UnexpectedEof => {
            let expected = format!("{HEADER_BYTES} bytes or more");
            Error::corrupt(store, "length", expected, meta.len().to_string())
        }
        _ => Error::io(store, e),
    })?;
    let header = Header::check(&bytes, store, meta.len())?;
    Ok((file, header))
}

/// Frame, offset of the coded data and checkpoints of a JPEG all of which is in order.
fn examine(path: &Path, header: &PhotoHeader, bytes: &[u8]) -> Option<(Frame, usize, Scanned)> {
    let (frame, data_at) = Frame::parse(bytes)?;
    let is_same = (frame.size, frame.channels) == (header.size, header.channels);
    if !is_same || u32::try_from(bytes.len()).is_err() {
        return None;
    }
    let data = &bytes[data_at..];
    let scanned = scan(&frame, data)?;
    // The end of the image follows at once; what comes after that is not looked at.
    let code = data[scanned.end..].iter().find(|&&byte| byte != 0xFF)?;
    if *code != 0xD9 {
        return None;
    }
    let sample = frame.size.rect().intersection(&PixelRect::new(0, 0, SAMPLE_SIDE, SAMPLE_SIDE));
    let units = Units::around(&frame, sample);
    let columns = frame.mcus.width.div_ceil(STEP) as usize;
    let row = |y: u32| {
        let checkpoint = *scanned.checkpoints.get(y as usize * columns)?;
        Some(RowData { checkpoint, data: data.get(checkpoint.byte as usize..)? })
    };
    let mut window = Vec::new();
    write(&frame, units, row, &mut window)?;
    let pixels = units.pixels(&frame);
    let side = |length: usize| u32::try_from(length).unwrap_or(0);
    let size = Size::new(side(pixels.width()), side(pixels.height()));
    decode_jpeg(path, &window, size, frame.channels).ok()?;
    Some((frame, data_at, scanned))
}
