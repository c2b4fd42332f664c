//! Bounded, buffered reading of a foreign file: it is read, never mapped, and a file cut short is an error.

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use crate::{Error, Result};

/// Bytes of the buffer: large enough that the system call costs nothing beside the parsing.
const BUFFER_BYTES: usize = 1 << 19;

/// A file, read forwards through one buffer.
#[derive(Debug)]
pub(super) struct ByteReader<'a> {
    path: &'a Path,
    file: File,
    buffer: Box<[u8]>,
    start: usize,
    end: usize,
    /// Place in the file of `buffer[end]`.
    offset: u64,
    file_bytes: u64,
}

impl<'a> ByteReader<'a> {
    /// Opens a file to be read from `offset` on.
    pub(super) fn open(path: &'a Path, offset: u64) -> Result<Self> {
        let mut file = File::open(path).map_err(|e| Error::io(path, e))?;
        let file_bytes = file.metadata().map_err(|e| Error::io(path, e))?.len();
        file.seek(SeekFrom::Start(offset)).map_err(|e| Error::io(path, e))?;
        let buffer = vec![0; BUFFER_BYTES].into_boxed_slice();
        Ok(Self { path, file, buffer, start: 0, end: 0, offset, file_bytes })
    }

    /// The file.
    pub(super) fn path(&self) -> &'a Path {
        self.path
    }

    /// Length of the file when it was opened.
    pub(super) fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Place in the file of the next byte.
    pub(super) fn position(&self) -> u64 {
        self.offset - (self.end - self.start) as u64
    }

    /// The next bytes, at least `want` of them unless the file ends; `want` must be at most 64 KiB.
    #[inline]
    pub(super) fn fill(&mut self, want: usize) -> Result<&[u8]> {
        if self.end - self.start < want {
            self.refill(want)?;
        }
        Ok(&self.buffer[self.start..self.end])
    }

    fn refill(&mut self, want: usize) -> Result<()> {
        debug_assert!(want <= 1 << 16, "a request is much smaller than the buffer");
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        while self.end < want {
            match self.file.read(&mut self.buffer[self.end..]) {
                Ok(0) => break,
                Ok(read) => {
                    self.end += read;
                    self.offset += read as u64;
                }
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(Error::io(self.path, e)),
            }
        }
        Ok(())
    }

    /// Goes past `count` bytes that [`Self::fill`] gave.
    #[inline]
    pub(super) fn consume(&mut self, count: usize) {
        debug_assert!(count <= self.end - self.start);
        self.start += count;
    }

    /// Goes past `count` bytes, in the buffer or not, perhaps beyond the end of the file.
    pub(super) fn skip(&mut self, count: u64) -> Result<()> {
        let held = self.end - self.start;
        if let Some(step) = usize::try_from(count).ok().filter(|&step| step <= held) {
            self.start += step;
            return Ok(());
        }
        self.start = self.end;
        self.offset = self.offset.saturating_add(count - held as u64);
        self.file.seek(SeekFrom::Start(self.offset)).map_err(|e| Error::io(self.path, e))?;
        Ok(())
    }

    /// The error for a file that ends within `element` number `ordinal`.
    #[cold]
    pub(super) fn cut(&self, element: &str, ordinal: u64) -> Error {
        let place = format!("{element} {ordinal}");
        Error::corrupt(self.path, place, "a whole element", "the end of the file")
    }

    /// The error for malformed bytes in `element` number `ordinal`.
    #[cold]
    pub(super) fn malformed(
        &self,
        element: &str,
        ordinal: u64,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Error {
        let place = format!("{element} {ordinal} (byte {})", self.position());
        Error::corrupt(self.path, place, expected, found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_in_order_across_refills_and_skips() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("bytes");
        let bytes: Vec<u8> = (0..1 << 19_u32).flat_map(u32::to_le_bytes).collect();
        std::fs::write(&path, &bytes).unwrap();
        let mut reader = ByteReader::open(&path, 8).unwrap();
        let mut at = 8;
        while at < bytes.len() {
            let step = [1, 700, 60_000, 900_000][at % 4];
            assert_eq!(reader.position(), at as u64);
            let next = reader.fill(4).unwrap();
            let expected = &bytes[at..];
            assert!(next.len() >= expected.len().min(4) && expected.starts_with(next));
            reader.skip(step).unwrap();
            at += usize::try_from(step).unwrap();
        }
        assert_eq!(reader.fill(4).unwrap(), b"");
    }
}
