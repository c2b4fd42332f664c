//! Reading windows of indexed JPEGs.

use std::io::ErrorKind;
use std::sync::{Mutex, PoisonError};

use super::super::files::{OpenFiles, PositionedFile};
use super::build::{IndexedJpeg, modified, open_header};
use super::frame::Frame;
use super::layout::Header;
use super::scan::STEP;
use super::window::{RowData, Units, write};
use crate::geom::{PixelRect, Size};
use crate::input::photo::decode_jpeg;
use crate::{Error, Result};

/// Reads windows from many indexed photos; keeps files open and buffers at hand.
#[derive(Debug, Default)]
pub(in super::super) struct IndexedFiles {
    open: OpenFiles<OpenPhoto>,
    /// As many as threads have read at the same time.
    buffers: Mutex<Vec<Buffers>>,
}

/// Samples of a rectangle of a photo, `height × width × channels`.
#[derive(Debug)]
pub(in super::super) struct Part {
    pub(in super::super) rect: PixelRect,
    pub(in super::super) samples: Vec<u8>,
}

impl Part {
    /// Copies the samples of `rect`, which lies in the part, to `out`.
    pub(in super::super) fn copy(&self, rect: PixelRect, channels: usize, out: &mut [u8]) {
        let from = |at: i64, begin: i64| usize::try_from(at - begin).unwrap_or(0);
        let (stride, row) = (self.rect.width() * channels, rect.width() * channels);
        let left = from(rect.x0, self.rect.x0) * channels;
        let rows = self.samples.chunks_exact(stride).skip(from(rect.y0, self.rect.y0));
        for (out, samples) in out.chunks_exact_mut(row).zip(rows) {
            out.copy_from_slice(&samples[left..left + row]);
        }
    }
}

#[derive(Debug)]
struct OpenPhoto {
    photo: PositionedFile,
    index: PositionedFile,
    frame: Frame,
}

#[derive(Debug, Default)]
struct Buffers {
    rows: Vec<u8>,
    data: Vec<u8>,
    jpeg: Vec<u8>,
}

impl IndexedFiles {
    /// Decodes a part of a photo that holds `rect`, which lies in the photo, and a margin around. `number` is the
    /// photo's.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if the photo or its index is not what it was, [`Error::Io`].
    pub(in super::super) fn read(
        &self,
        number: usize,
        indexed: &IndexedJpeg,
        rect: PixelRect,
    ) -> Result<Part> {
        let open = self.open.get(number, || OpenPhoto::open(indexed))?;
        let units = Units::around(&open.frame, rect);
        let mut buffers = self.lock().pop().unwrap_or_default();
        let part = open.part(indexed, units, &mut buffers);
        self.lock().push(buffers);
        part
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Buffers>> {
        self.buffers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Number of open photos.
    #[cfg(test)]
    pub(super) fn open_count(&self) -> usize {
        self.open.len()
    }
}

/// The data of a row of units in the buffer, and where they begin.
struct Row {
    checkpoint: super::scan::Checkpoint,
    data: std::ops::Range<usize>,
}

impl OpenPhoto {
    /// Opens photo and index, if they are still the same.
    fn open(indexed: &IndexedJpeg) -> Result<Self> {
        let (index, header) = open_header(&indexed.path)?;
        if header != indexed.header {
            let place = "bytes 12 to 107";
            return Err(Error::corrupt(
                &indexed.path,
                place,
                "the photo of the job",
                "another one",
            ));
        }
        let frame = indexed.frame(&index)?;
        let (photo, meta) =
            PositionedFile::open(&indexed.photo).map_err(|e| Error::io(&indexed.photo, e))?;
        if (meta.len(), modified(&meta)) != (header.photo_bytes, header.modified) {
            return Err(changed(indexed));
        }
        Ok(Self { photo, index, frame })
    }

    fn part(&self, indexed: &IndexedJpeg, units: Units, buffers: &mut Buffers) -> Result<Part> {
        let Buffers { rows, data, jpeg } = buffers;
        let found = self.data(indexed, units, rows, data)?;
        let row = |y: u32| {
            let Row { checkpoint, data: range } = found.get((y - units.y0) as usize)?;
            Some(RowData { checkpoint: *checkpoint, data: data.get(range.clone())? })
        };
        write(&self.frame, units, row, jpeg).ok_or_else(|| changed(indexed))?;
        let rect = units.pixels(&self.frame);
        let side = |length: usize| u32::try_from(length).unwrap_or(0);
        let size = Size::new(side(rect.width()), side(rect.height()));
        let samples = decode_jpeg(&indexed.photo, jpeg, size, self.frame.channels)?;
        Ok(Part { rect, samples })
    }

    /// Reads the checkpoints and the coded data of the rows of a window.
    fn data(
        &self,
        indexed: &IndexedJpeg,
        units: Units,
        rows: &mut Vec<u8>,
        data: &mut Vec<u8>,
    ) -> Result<Vec<Row>> {
        let header = &indexed.header;
        // The next row tells where the data of the last one end.
        let end_row = (units.y1 + 1).min(header.mcus().height);
        let row_bytes = header.row_bytes();
        rows.resize((end_row - units.y0) as usize * row_bytes, 0);
        self.index
            .read_exact_at(rows, header.row_offset(units.y0))
            .map_err(|e| Error::io(&indexed.path, e))?;
        let checkpoint = |row: u32, column: usize| {
            let bytes = rows.chunks_exact(row_bytes).nth((row - units.y0) as usize);
            let row_checked = bytes.and_then(|bytes| Header::checked_row(row, bytes));
            row_checked.and_then(|bytes| header.checkpoint(bytes, column)).ok_or_else(|| {
                let place = format!("checkpoints of row {row}");
                Error::corrupt(&indexed.path, place, "their checksum", "another one")
            })
        };
        data.clear();
        let mut found = Vec::with_capacity((units.y1 - units.y0) as usize);
        for y in units.y0..units.y1 {
            let first = checkpoint(y, (units.x0 / STEP) as usize)?;
            let past = units.x1.div_ceil(STEP) as usize;
            let end = if past < header.columns() {
                checkpoint(y, past)?.byte.into()
            } else if y + 1 < end_row {
                checkpoint(y + 1, 0)?.byte.into()
            } else {
                header.data_bytes
            };
            // A byte that both share, which a zero may follow.
            let end = (end + 2).min(header.photo_bytes - header.data_at);
            let length = end.checked_sub(first.byte.into()).ok_or_else(|| changed(indexed))?;
            let begin = data.len();
            data.resize(begin + usize::try_from(length).unwrap_or(0), 0);
            self.photo
                .read_exact_at(&mut data[begin..], header.data_at + u64::from(first.byte))
                .map_err(|e| match e.kind() {
                    ErrorKind::UnexpectedEof => changed(indexed),
                    _ => Error::io(&indexed.photo, e),
                })?;
            found.push(Row { checkpoint: first, data: begin..data.len() });
        }
        Ok(found)
    }
}

fn changed(indexed: &IndexedJpeg) -> Error {
    let expected = "the photo as it was when its index was made";
    Error::corrupt(&indexed.photo, "picture data", expected, "another one")
}
