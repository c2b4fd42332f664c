//! [`PendingFile`]: a file that appears under its name all at once, or not at all.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// Added to the name of a file while it is written.
const SUFFIX: &str = ".unfinished";

/// A file under construction: `<name>.unfinished` beside its final place, locked against a second writer.
///
/// [`Self::commit`] makes it durable and renames it into place, where it replaces what was there; dropped before, it
/// is deleted. A killed process leaves the unfinished file, which the next writer of the same name overwrites.
#[derive(Debug)]
pub struct PendingFile {
    file: File,
    unfinished: PathBuf,
    target: PathBuf,
    committed: bool,
}

impl PendingFile {
    /// Begins a file that will be called `target`; its folder must exist.
    ///
    /// # Errors
    /// If it cannot be created, or another process is writing it.
    pub fn create(target: impl AsRef<Path>) -> Result<Self> {
        let target = target.as_ref().to_path_buf();
        let name = target.file_name().ok_or_else(|| {
            Error::usage(format!("{}: expected the name of a file", target.display()))
        })?;
        let mut unfinished_name = OsString::from(name);
        unfinished_name.push(SUFFIX);
        let unfinished = target.with_file_name(unfinished_name);
        let fail = |e| Error::io(&unfinished, e);
        // The lock comes before the cut. A file that another writer renamed away in between is not ours, whatever stands
        // under its name by now: it may be finished. Nor is what a link leads to. Try again.
        let file = loop {
            if fs::symlink_metadata(&unfinished).is_ok_and(|m| m.is_symlink()) {
                fs::remove_file(&unfinished).map_err(fail)?;
            }
            let file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(&unfinished)
                .map_err(fail)?;
            lock(&file).map_err(fail)?;
            if is_at(&file, &unfinished).map_err(fail)? {
                break file;
            }
        };
        file.set_len(0).map_err(fail)?;
        Ok(Self { file, unfinished, target, committed: false })
    }

    /// The final place.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Waits until what was written is on the disk.
    ///
    /// # Errors
    /// If the disk refuses.
    pub fn sync(&self) -> Result<()> {
        self.file.sync_all().map_err(|e| Error::io(&self.unfinished, e))
    }

    /// Makes the file durable and renames it into place.
    ///
    /// # Errors
    /// If the disk refuses; then nothing is left, and what was there before stays.
    pub fn commit(mut self) -> Result<()> {
        self.sync()?;
        fs::rename(&self.unfinished, &self.target).map_err(|e| Error::io(&self.target, e))?;
        self.committed = true;
        sync_folder(&self.target)
    }
}

/// Writes `bytes` to a file that appears all at once.
///
/// # Errors
/// As [`PendingFile`].
pub fn write_atomically(target: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
    let mut file = PendingFile::create(&target)?;
    file.write_all(bytes).map_err(|e| Error::io(&target, e))?;
    file.commit()
}

/// Whether an open file is what stands under a name, and no link to it.
#[cfg(unix)]
fn is_at(file: &File, name: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let own = file.metadata()?;
    match fs::symlink_metadata(name) {
        Ok(there) => Ok((own.dev(), own.ino()) == (there.dev(), there.ino())),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(e) => Err(e),
    }
}

/// Where a file that is open cannot be renamed away by others, it is there if its name is.
#[cfg(not(unix))]
fn is_at(_file: &File, name: &Path) -> io::Result<bool> {
    fs::exists(name)
}

/// Locks a file, without waiting.
pub(crate) fn lock(file: &File) -> io::Result<()> {
    file.try_lock().map_err(|e| match e {
        TryLockError::WouldBlock => {
            io::Error::new(io::ErrorKind::ResourceBusy, "another process is writing this file")
        }
        TryLockError::Error(e) => e,
    })
}

/// Makes a rename durable, where the system has folders that can be opened (Windows has not, and needs it not).
pub(crate) fn sync_folder(file: &Path) -> Result<()> {
    let folder = match file.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    File::open(folder).map_or(Ok(()), |f| f.sync_all().map_err(|e| Error::io(folder, e)))
}

impl Write for PendingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for PendingFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

impl Drop for PendingFile {
    fn drop(&mut self) {
        if !self.committed {
            // Nothing can be done if it stays: the next writer of the same name overwrites it.
            drop(fs::remove_file(&self.unfinished));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_dropped_before_its_commit_leaves_the_old_one_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.tif");
        write_atomically(&target, b"old").unwrap();
        let mut file = PendingFile::create(&target).unwrap();
        file.write_all(b"new").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"old");
        drop(file);
        assert_eq!(fs::read(&target).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["a.tif"]);
    }

    #[test]
    fn a_second_writer_of_the_same_file_is_refused_and_a_killed_one_forgotten() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.tif");
        let first = PendingFile::create(&target).unwrap();
        assert_eq!(PendingFile::create(&target).unwrap_err().exit_code(), 4);
        first.commit().unwrap();
        fs::write(folder.path().join("a.tif.unfinished"), b"left by a killed process").unwrap();
        write_atomically(&target, b"new").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.tif"]);
    }

    #[test]
    fn three_writers_leave_one_whole_file_each_time() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.tif");
        let write = |byte: u8| {
            for _ in 0..300 {
                // One that is refused because another writes has written nothing.
                if let Err(e) = write_atomically(&target, &[byte; 3000]) {
                    assert_eq!(e.exit_code(), 4, "{e}");
                }
                let found = fs::read(&target).unwrap_or_else(|_| vec![byte; 3000]);
                assert!(found.len() == 3000 && found.iter().all(|&b| b == found[0]));
            }
        };
        std::thread::scope(|scope| {
            for byte in 1..=3 {
                let write = &write;
                scope.spawn(move || write(byte));
            }
        });
        assert_eq!(names(folder.path()), ["a.tif"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_under_the_unfinished_name_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let (target, precious) = (folder.path().join("a.tif"), folder.path().join("precious"));
        fs::write(&precious, b"precious").unwrap();
        std::os::unix::fs::symlink(&precious, folder.path().join("a.tif.unfinished")).unwrap();
        write_atomically(&target, b"new").unwrap();
        assert_eq!(fs::read(&precious).unwrap(), b"precious");
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.tif", "precious"]);
    }
}
