//! [`decode`]: the rows of a page.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use super::bytes::ChunkBytes;
use super::directory::{Directory, Order};
use super::layout::Layout;
use crate::input::photo::decode::{Sink, changed};
use crate::input::photo::{PhotoHeader, Rows};
use crate::{Error, Result};

/// Hands the rows of the TIFF photo at `path`, whose header is `header`, to `sink`.
///
/// # Errors
/// [`Error::Corrupt`] naming the strip or tile, [`Error::Io`], the sink's.
pub(in crate::input::photo) fn decode(
    path: &Path,
    header: &PhotoHeader,
    sink: Sink<'_>,
) -> Result<()> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let file_bytes = file.metadata().map_err(|e| Error::io(path, e))?.len();
    let mut directory = Directory::read(BufReader::new(&file), path, file_bytes)?;
    let layout = Layout::read(&mut directory, path, file_bytes)?;
    if (layout.size, layout.channels, layout.bits) != (header.size, header.channels, header.bits) {
        let found = format!("{} × {}", layout.size.width, layout.size.height);
        return Err(changed(path, header.size, found));
    }
    drop(directory);
    if layout.bits == 16 {
        Reader::<u16>::new(&file, path, &layout).pass(sink)
    } else {
        Reader::<u8>::new(&file, path, &layout).pass(sink)
    }
}

/// A sample of a page.
trait Sample: Copy + Default {
    const BYTES: usize;
    fn of(bytes: &[u8], order: Order) -> Self;
    fn plus(self, other: Self) -> Self;
    fn inverted(self) -> Self;
    fn rows(samples: &[Self]) -> Rows<'_>;
}

impl Sample for u8 {
    const BYTES: usize = 1;

    fn of(bytes: &[u8], _: Order) -> Self {
        bytes[0]
    }

    fn plus(self, other: Self) -> Self {
        self.wrapping_add(other)
    }

    fn inverted(self) -> Self {
        !self
    }

    fn rows(samples: &[Self]) -> Rows<'_> {
        Rows::U8(samples)
    }
}

impl Sample for u16 {
    const BYTES: usize = 2;

    fn of(bytes: &[u8], order: Order) -> Self {
        match order {
            Order::Little => Self::from_le_bytes([bytes[0], bytes[1]]),
            Order::Big => Self::from_be_bytes([bytes[0], bytes[1]]),
        }
    }

    fn plus(self, other: Self) -> Self {
        self.wrapping_add(other)
    }

    fn inverted(self) -> Self {
        !self
    }

    fn rows(samples: &[Self]) -> Rows<'_> {
        Rows::U16(samples)
    }
}

/// Reads a page chunk by chunk, reusing its memory.
struct Reader<'a, S> {
    file: &'a File,
    path: &'a Path,
    layout: &'a Layout,
    /// A row of a chunk as it is stored.
    bytes: Vec<u8>,
    stored: Vec<S>,
}

impl<'a, S: Sample> Reader<'a, S> {
    fn new(file: &'a File, path: &'a Path, layout: &'a Layout) -> Self {
        Self { file, path, layout, bytes: Vec::new(), stored: Vec::new() }
    }

    fn pass(&mut self, sink: Sink<'_>) -> Result<()> {
        let layout = self.layout;
        let width = layout.size.width as usize * layout.channels;
        let mut rows: Vec<S> = Vec::new();
        for down in 0..layout.down() {
            let height = layout.rows_in(down);
            if layout.across() == 1 {
                rows.resize(width, S::default());
                self.chunk(down, height, |_, row| {
                    for (to, &from) in rows.iter_mut().zip(row) {
                        *to = from;
                    }
                    sink(S::rows(&rows))
                })?;
                continue;
            }
            rows.resize(width * height as usize, S::default());
            for across in 0..layout.across() {
                let left = across as usize * layout.chunk.width as usize * layout.channels;
                self.chunk(down * layout.across() + across, height, |y, row| {
                    let line = &mut rows[y * width..(y + 1) * width];
                    for (to, &from) in line[left..].iter_mut().zip(row) {
                        *to = from;
                    }
                    Ok(())
                })?;
            }
            sink(S::rows(&rows))?;
        }
        Ok(())
    }

    /// Gives the first `height` rows of a chunk to `take`, `chunk width × channels` samples each.
    fn chunk(
        &mut self,
        number: u32,
        height: u32,
        mut take: impl FnMut(usize, &[S]) -> Result<()>,
    ) -> Result<()> {
        let layout = self.layout;
        let chunk = layout.chunks[number as usize];
        let mut stream = ChunkBytes::open(self.file, self.path, layout, (chunk, height))?;
        let length = usize::try_from(layout.stored_row_bytes()).ok();
        let length = length.ok_or_else(|| self.too_wide())?;
        self.bytes.resize(length, 0);
        for y in 0..height as usize {
            stream.read_exact(&mut self.bytes).map_err(|e| self.broken(number, e))?;
            self.unpack_row();
            take(y, &self.stored)?;
        }
        stream.finish().map_err(|e| self.broken(number, e))
    }

    /// Turns the bytes of a row into its samples: predictor undone, extra samples dropped, black made zero.
    fn unpack_row(&mut self) {
        let layout = self.layout;
        let samples = self.bytes.chunks_exact(S::BYTES).map(|b| S::of(b, layout.order));
        self.stored.clear();
        self.stored.extend(samples);
        if layout.is_predicted {
            for k in layout.stored..self.stored.len() {
                self.stored[k] = self.stored[k].plus(self.stored[k - layout.stored]);
            }
        }
        if layout.stored > layout.channels {
            let pixels = self.stored.len() / layout.stored;
            for pixel in 0..pixels {
                let from = pixel * layout.stored;
                self.stored.copy_within(from..from + layout.channels, pixel * layout.channels);
            }
            self.stored.truncate(pixels * layout.channels);
        }
        if layout.is_inverted {
            self.stored.iter_mut().for_each(|s| *s = s.inverted());
        }
    }

    fn too_wide(&self) -> Error {
        let expected = "a row that this machine can address";
        Error::corrupt(self.path, "tag 256 (ImageWidth)", expected, "more")
    }

    /// What a failed read means: the disk's fault, or the data's.
    fn broken(&self, number: u32, e: std::io::Error) -> Error {
        if e.raw_os_error().is_some() {
            return Error::io(self.path, e);
        }
        let name = if self.layout.is_tiled { "tile" } else { "strip" };
        let found = match e.kind() {
            std::io::ErrorKind::UnexpectedEof => "the end of its data".to_string(),
            _ => e.to_string(),
        };
        Error::corrupt(self.path, format!("{name} {number}"), "whole rows of samples", found)
    }
}
