//! Bounded, buffered reading of a foreign file: it is read, never mapped, and a file cut short is an error. A
//! compressed file is read as what was compressed.

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use super::content::{Compression, Content};
use crate::{Error, Result};

/// Bytes of the buffer: large enough that the system call costs nothing beside the parsing.
const BUFFER_BYTES: usize = 1 << 19;

/// A file, read forwards through one buffer.
#[derive(Debug)]
pub(super) struct ByteReader<'a> {
    path: &'a Path,
    content: Content<'a>,
    buffer: Box<[u8]>,
    start: usize,
    end: usize,
    /// Place in the content of `buffer[end]`.
    offset: u64,
    most_bytes: u64,
}

impl<'a> ByteReader<'a> {
    /// Opens a file, compressed or not, to be read from place `offset` of its content on.
    pub(super) fn open(path: &'a Path, offset: u64) -> Result<Self> {
        let (content, file_bytes) = Content::open(path)?;
        let most_bytes = match content.compression() {
            Compression::None => file_bytes,
            Compression::Gzip | Compression::Zstd => u64::MAX,
        };
        let mut reader = Self::of(path, content, most_bytes);
        reader.skip(offset)?;
        Ok(reader)
    }

    /// Opens a file as it is to be read from `offset` on, whatever its first bytes look like.
    pub(super) fn open_as_it_is(path: &'a Path, offset: u64) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let file_bytes = file.metadata().map_err(|e| Error::io(path, e))?.len();
        let mut reader = Self::of(path, Content::File(file), file_bytes);
        reader.skip(offset)?;
        Ok(reader)
    }

    /// Reads bytes that were found in the file at `path`.
    pub(super) fn of_memory(path: &'a Path, bytes: &'a [u8]) -> Self {
        Self::of(path, Content::Memory(bytes), bytes.len() as u64)
    }

    fn of(path: &'a Path, content: Content<'a>, most_bytes: u64) -> Self {
        let buffer = vec![0; BUFFER_BYTES].into_boxed_slice();
        Self { path, content, buffer, start: 0, end: 0, offset: 0, most_bytes }
    }

    /// The file.
    pub(super) fn path(&self) -> &'a Path {
        self.path
    }

    /// How the file is compressed.
    pub(super) fn compression(&self) -> Compression {
        self.content.compression()
    }

    /// Length of the content when it was opened, [`u64::MAX`] if that of a compressed file, which is not known.
    pub(super) fn most_bytes(&self) -> u64 {
        self.most_bytes
    }

    /// Length of the content; if compressed, all of it is gone past to know it.
    pub(super) fn content_bytes(&mut self) -> Result<u64> {
        if self.compression() == Compression::None {
            return Ok(self.most_bytes);
        }
        self.skip(u64::MAX)?;
        Ok(self.position())
    }

    /// Place in the content of the next byte.
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
            match self.content.read(&mut self.buffer[self.end..]) {
                Ok(0) => break,
                Ok(read) => {
                    self.end += read;
                    self.offset += read as u64;
                }
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(self.content.error(self.path, self.offset, e)),
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

    /// Goes past `count` bytes that [`Self::fill`] gave, and gives them.
    #[inline]
    pub(super) fn take(&mut self, count: usize) -> &[u8] {
        let start = self.start;
        self.consume(count);
        &self.buffer[start..self.start]
    }

    /// Goes past `count` bytes, in the buffer or not, perhaps beyond the end of the file.
    pub(super) fn skip(&mut self, count: u64) -> Result<()> {
        let held = self.end - self.start;
        if let Some(step) = usize::try_from(count).ok().filter(|&step| step <= held) {
            self.start += step;
            return Ok(());
        }
        if let Content::File(file) = &mut self.content {
            self.start = self.end;
            self.offset = self.offset.saturating_add(count - held as u64);
            file.seek(SeekFrom::Start(self.offset)).map_err(|e| Error::io(self.path, e))?;
            return Ok(());
        }
        let mut left = count;
        while left > 0 {
            let held = self.fill(1)?.len();
            let step = usize::try_from(left).unwrap_or(usize::MAX).min(held);
            if step == 0 {
                break;
            }
            self.consume(step);
            left -= step as u64;
        }
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
    use std::io::Write;

    use super::*;
    use crate::input::reading::gzip;

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

    #[test]
    fn compressed_content_is_read_like_plain_and_a_cut_stream_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let bytes: Vec<u8> = (0..1 << 18_u32).flat_map(u32::to_le_bytes).collect();
        let (one, two) = bytes.split_at(300_000);
        // Two members, two frames.
        for (name, packed) in [
            ("gz", [gzip(one), gzip(two)].concat()),
            ("zst", [checked_zstd(one), checked_zstd(two)].concat()),
        ] {
            let path = dir.path().join(name);
            std::fs::write(&path, &packed).unwrap();
            for (offset, step) in [(0, 5), (7, 100_000), (299_999, 600_000), (1 << 20, 1)] {
                let mut reader = ByteReader::open(&path, offset).unwrap();
                let mut at = usize::try_from(offset).unwrap();
                while at < bytes.len() {
                    assert_eq!(reader.position(), at as u64);
                    let next = reader.fill(4).unwrap();
                    assert!(
                        next.len() >= (bytes.len() - at).min(4) && bytes[at..].starts_with(next)
                    );
                    reader.skip(step).unwrap();
                    at += usize::try_from(step).unwrap();
                }
                assert_eq!(reader.fill(4).unwrap(), b"");
            }
            std::fs::write(&path, &packed[..packed.len() - 3]).unwrap();
            let error = ByteReader::open(&path, 0).and_then(|mut r| r.skip(u64::MAX)).unwrap_err();
            let said = error.to_string();
            assert!(matches!(error, Error::Corrupt { .. }) && said.contains("stream"), "{said}");
            let mut broken = packed.clone();
            broken[packed.len() / 3] ^= 0x55;
            std::fs::write(&path, &broken).unwrap();
            let error = ByteReader::open(&path, 0).and_then(|mut r| r.skip(u64::MAX)).unwrap_err();
            assert!(matches!(error, Error::Corrupt { .. }), "{error}");
        }
    }

    #[test]
    fn a_stream_that_needs_a_great_window_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.zst");
        let mut encoder = zstd::Encoder::new(std::fs::File::create(&path).unwrap(), 1).unwrap();
        encoder.window_log(27).unwrap();
        encoder.write_all(&vec![5; 1 << 20]).unwrap();
        encoder.finish().unwrap();
        let error = ByteReader::open(&path, 0).and_then(|mut r| r.skip(9)).unwrap_err();
        let said = error.to_string();
        assert!(matches!(error, Error::Unsupported { .. }) && said.contains("--long"), "{said}");
    }

    /// With a checksum, as the command `zstd` writes it.
    fn checked_zstd(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = zstd::Encoder::new(Vec::new(), 1).unwrap();
        encoder.include_checksum(true).unwrap();
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }
}
