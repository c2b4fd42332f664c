//! Read-only maps of groundel's own immutable files.
//!
//! In: a file of the work folder and the length that its checked header states. Out: its bytes as slices, with
//! advice to the operating system about single ranges, because clean mapped pages count as resident memory.
//! Promises: no byte beyond the stated length is touched. Does not: map foreign files, which may be cut short
//! under the map; they are read.

#![expect(
    unsafe_code,
    reason = "mapping a file is unsafe in itself; the argument stands at each block"
)]

use std::fs::File;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// Linux maps pages that are in its cache up to this far around the one touched, whatever it was advised: on
/// release those must go too, or reading a store from end to end leaves all of it resident.
const FAULT_AROUND_BYTES: usize = 1 << 16;

/// A map of one of our own files, which are written under a temporary name, renamed into place, and never
/// changed after that: the one argument on which every unsafe block here rests.
#[derive(Debug)]
pub(crate) struct MappedFile {
    map: memmap2::Mmap,
    path: PathBuf,
}

impl MappedFile {
    /// Maps `file`, which lies at `path` and must be exactly `bytes` long.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if the length differs: a file cut short is never mapped. [`Error::Io`] if the system
    /// refuses.
    pub(crate) fn map(file: &File, path: &Path, bytes: u64) -> Result<Self> {
        let found = file.metadata().map_err(|e| Error::io(path, e))?.len();
        if found != bytes {
            let (expected, found) = (format!("{bytes} bytes"), format!("{found} bytes"));
            return Err(Error::corrupt(path, "file length", expected, found));
        }
        // SAFETY: the file is ours and immutable once it bears its name, the map is read-only, and the length was
        // compared just now, so every mapped page has bytes behind it.
        let map = unsafe { memmap2::Mmap::map(file) }.map_err(|e| Error::io(path, e))?;
        if map.len() as u64 != bytes {
            let found = format!("{} bytes", map.len());
            return Err(Error::corrupt(path, "file length", format!("{bytes} bytes"), found));
        }
        Ok(Self { map, path: path.to_path_buf() })
    }

    /// The mapped file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The bytes of a range, or `None` if it does not lie within the file.
    pub(crate) fn get(&self, range: Range<usize>) -> Option<&[u8]> {
        self.map.get(range)
    }

    /// Tells the system that access will be random: no read-ahead beyond what [`Self::will_need`] asks for.
    /// A hint; that it is refused changes no result.
    pub(crate) fn advise_random(&self) {
        #[cfg(unix)]
        drop::<io::Result<()>>(self.map.advise(memmap2::Advice::Random));
    }

    /// Asks the system to read a range ahead of its use. A hint, as above.
    pub(crate) fn will_need(&self, range: Range<usize>) {
        #[cfg(unix)]
        if self.get(range.clone()).is_some_and(|bytes| !bytes.is_empty()) {
            drop::<io::Result<()>>(self.map.advise_range(
                memmap2::Advice::WillNeed,
                range.start,
                range.len(),
            ));
        }
    }

    /// Lets the system take the pages of a range back, and of its neighbourhood, which came with them; they are
    /// read again when touched. A hint, as above.
    pub(crate) fn release(&self, range: Range<usize>) {
        let start = range.start.saturating_sub(FAULT_AROUND_BYTES);
        let range = start..range.end.saturating_add(FAULT_AROUND_BYTES).min(self.map.len());
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
        assert!(MappedFile::map(&file, &path, 10_000).is_ok());
        file.set_len(9_999).unwrap();
        let error = MappedFile::map(&file, &path, 10_000).unwrap_err();
        assert!(matches!(error, Error::Corrupt { .. }), "{error}");
    }

    #[test]
    fn released_pages_come_back_with_the_same_bytes() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("store");
        let bytes: Vec<u8> = (0..40_000_u32).flat_map(u32::to_le_bytes).collect();
        std::fs::write(&path, &bytes).unwrap();
        let file = File::open(&path).unwrap();
        let map = MappedFile::map(&file, &path, bytes.len() as u64).unwrap();
        map.advise_random();
        for _ in 0..2 {
            map.will_need(5_001..90_000);
            assert_eq!(map.get(5_001..90_000).unwrap(), &bytes[5_001..90_000]);
            map.release(5_001..90_000);
        }
        assert_eq!(map.get(0..bytes.len()).unwrap(), bytes);
        map.will_need(150_000..200_000);
        map.release(usize::MAX - 1..usize::MAX);
        assert_eq!(map.get(159_999..160_001), None);
    }
}
