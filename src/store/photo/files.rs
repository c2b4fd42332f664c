//! Reading at a position, from many files with few of them open.

use std::fs::{File, Metadata};
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use crate::Result;

/// Most store files kept open; opening one takes some microseconds, decoding a tile some hundred.
const MAX_OPEN: usize = 64;

/// A file that threads read at positions of their own.
#[derive(Debug)]
pub(super) struct PositionedFile {
    #[cfg(unix)]
    file: File,
    #[cfg(not(unix))]
    file: Mutex<File>,
}

impl PositionedFile {
    /// Opens a file and gives its length and times.
    pub(super) fn open(path: &Path) -> io::Result<(Self, Metadata)> {
        let file = File::open(path)?;
        let meta = file.metadata()?;
        #[cfg(not(unix))]
        let file = Mutex::new(file);
        Ok((Self { file }, meta))
    }

    /// Fills `buffer` from `offset` on.
    #[cfg(unix)]
    pub(super) fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, buffer, offset)
    }

    /// Fills `buffer` from `offset` on.
    #[cfg(not(unix))]
    pub(super) fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        use std::io::{Read, Seek, SeekFrom};
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(offset))?;
        file.read_exact(buffer)
    }
}

/// Open files by number, the most recently used first.
#[derive(Debug)]
pub(super) struct OpenFiles<T = PositionedFile> {
    recent: Mutex<Vec<(usize, Arc<T>)>>,
}

impl<T> Default for OpenFiles<T> {
    fn default() -> Self {
        Self { recent: Mutex::default() }
    }
}

impl<T> OpenFiles<T> {
    /// The file of this number, from `open` unless it is open.
    pub(super) fn get(&self, number: usize, open: impl FnOnce() -> Result<T>) -> Result<Arc<T>> {
        if let Some(file) = self.find(number) {
            return Ok(file);
        }
        let file = Arc::new(open()?);
        let mut recent = self.recent.lock().unwrap_or_else(PoisonError::into_inner);
        recent.truncate(MAX_OPEN - 1);
        recent.insert(0, (number, Arc::clone(&file)));
        Ok(file)
    }

    /// Number of open files.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.recent.lock().unwrap_or_else(PoisonError::into_inner).len()
    }

    fn find(&self, number: usize) -> Option<Arc<T>> {
        let mut recent = self.recent.lock().unwrap_or_else(PoisonError::into_inner);
        let at = recent.iter().position(|(n, _)| *n == number)?;
        recent[..=at].rotate_right(1);
        Some(Arc::clone(&recent[0].1))
    }
}
