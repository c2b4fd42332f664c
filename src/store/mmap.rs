//! Read-only maps of groundel's own immutable files.
//!
//! In: a file of the work folder and the length that its checked header states. Out: its bytes, as slices of the map
//! or copied into a buffer. Promises: no byte beyond the stated length is touched; what is copied leaves no page of
//! the map resident. Does not: map foreign files, which may be cut short under the map; they are read.
//!
//! Clean mapped pages count as resident memory, and Linux maps more of them than are touched: giving back the pages
//! of each block after use left 20 to 90 % of a file resident. So a file that may not stay resident is copied from.

#![expect(
    unsafe_code,
    reason = "mapping a file is unsafe in itself; the argument stands at each block"
)]

use std::fs::File;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// A map of one of our own files, which are written under a temporary name, renamed into place, and never
/// changed after that: the one argument on which every unsafe block here rests.
#[derive(Debug)]
pub(crate) struct MappedFile {
    map: memmap2::Mmap,
    file: File,
    path: PathBuf,
}

impl MappedFile {
    /// Maps `file`, which lies at `path` and must be exactly `bytes` long.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if the length differs: a file cut short is never mapped. [`Error::Io`] if the system
    /// refuses.
    pub(crate) fn map(file: File, path: &Path, bytes: u64) -> Result<Self> {
        let found = file.metadata().map_err(|e| Error::io(path, e))?.len();
        if found != bytes {
            let (expected, found) = (format!("{bytes} bytes"), format!("{found} bytes"));
            return Err(Error::corrupt(path, "file length", expected, found));
        }
        // SAFETY: the file is ours and immutable once it bears its name, the map is read-only, and the length was
        // compared just now, so every mapped page has bytes behind it.
        let map = unsafe { memmap2::Mmap::map(&file) }.map_err(|e| Error::io(path, e))?;
        if map.len() as u64 != bytes {
            let found = format!("{} bytes", map.len());
            return Err(Error::corrupt(path, "file length", format!("{bytes} bytes"), found));
        }
        Ok(Self { map, file, path: path.to_path_buf() })
    }

    /// The mapped file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The bytes of a range, or `None` if it does not lie within the file.
    pub(crate) fn get(&self, range: Range<usize>) -> Option<&[u8]> {
        self.map.get(range)
    }

    /// Replaces `out` by a copy of the bytes of a range, without touching the map.
    ///
    /// # Errors
    /// [`Error::Io`] if the range does not lie within the file, or the system refuses.
    pub(crate) fn read(&self, range: Range<usize>, out: &mut Vec<u8>) -> Result<()> {
        out.resize(range.len(), 0);
        self.read_at(range.start as u64, out).map_err(|e| Error::io(&self.path, e))
    }

    #[cfg(unix)]
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, out, offset)
    }

    #[cfg(windows)]
    fn read_at(&self, mut offset: u64, mut out: &mut [u8]) -> io::Result<()> {
        while !out.is_empty() {
            match std::os::windows::fs::FileExt::seek_read(&self.file, out, offset)? {
                0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                read => (offset, out) = (offset + read as u64, &mut out[read..]),
            }
        }
        Ok(())
    }

    /// Lets the system take the mapped pages of a range back; they come again when touched. A hint: that it is
    /// refused changes no result.
    pub(crate) fn release(&self, range: Range<usize>) {
        #[cfg(not(unix))]
        drop(range);
        #[cfg(unix)]
        if self.get(range.clone()).is_some_and(|bytes| !bytes.is_empty()) {
            let advice = memmap2::UncheckedAdvice::DontNeed;
            // SAFETY: the map is shared, read-only and backed by an immutable file, so that a page dropped here
            // comes back with the same bytes even if another thread is reading it at this moment.
            let done = unsafe { self.map.unchecked_advise_range(advice, range.start, range.len()) };
            drop::<io::Result<()>>(done);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_cut_short_is_never_mapped() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store");
        std::fs::write(&path, [7; 10_000]).unwrap();
        let file = File::options().read(true).write(true).open(&path).unwrap();
        assert!(MappedFile::map(file.try_clone().unwrap(), &path, 10_000).is_ok());
        file.set_len(9_999).unwrap();
        let error = MappedFile::map(file, &path, 10_000).unwrap_err();
        assert!(matches!(error, Error::Corrupt { .. }), "{error}");
    }

    #[test]
    fn bytes_are_the_same_mapped_copied_and_after_release() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store");
        let bytes: Vec<u8> = (0..40_000_u32).flat_map(u32::to_le_bytes).collect();
        std::fs::write(&path, &bytes).unwrap();
        let map = MappedFile::map(File::open(&path).unwrap(), &path, bytes.len() as u64).unwrap();
        let mut copy = vec![1; 7];
        for range in [5_001..90_000, 0..bytes.len(), 9..9, 159_999..160_000] {
            assert_eq!(map.get(range.clone()).unwrap(), &bytes[range.clone()]);
            map.release(range.clone());
            assert_eq!(map.get(range.clone()).unwrap(), &bytes[range.clone()]);
            map.read(range.clone(), &mut copy).unwrap();
            assert_eq!(copy, &bytes[range]);
        }
        map.release(usize::MAX - 1..usize::MAX);
        assert_eq!(map.get(159_999..160_001), None);
        assert!(map.read(159_999..160_001, &mut copy).is_err());
    }
}
