//! [`Parts`]: the folder of a job's part files, and who may write which.
//!
//! | file | what |
//! |---|---|
//! | `batch-00007.part` | a finished batch: complete, or not there |
//! | `batch-00007.*.unfinished` | a batch that a process is rendering, or that one left behind; locked while it is written |
//! | `kept-*.part` | tiles of an earlier plan that still hold |
//! | `joined.part` | overviews between batches |
//!
//! A process that begins a batch locks an unfinished file that nobody holds and goes on with it, else begins one of its
//! own; when all tiles are there, it renames it, and only then lets it go. Two processes at one batch do no harm: both
//! make the same tiles, and the later file takes the earlier one's place whole. File locks must work on the file system
//! (NFS from version 4 on; Lustre with `flock`).

use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::{Manifest, PartState};
use crate::output::{lock, sync_folder};
use crate::{Error, Result};

const FINISHED: &str = ".part";
const UNFINISHED: &str = ".unfinished";
const KEPT: &str = "kept-";

/// How often a new file may be taken by another process before it is locked.
const MOST_TRIES: usize = 100;

/// The part files of a job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parts {
    folder: PathBuf,
}

/// What to do about another process that renders the same batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rivals {
    /// Render it too: the other one may be lost without having ended.
    Ignore,
    /// Leave it alone.
    Refuse,
}

/// A batch that this process renders: nobody else takes its file while this is alive.
#[derive(Debug)]
pub struct Claim {
    part: PathBuf,
    file: File,
    batch: u32,
}

impl Claim {
    /// The unfinished file: the part of a [`Run`](super::Run).
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// The same, locked.
    pub fn file(&self) -> &File {
        &self.file
    }
}

impl Parts {
    /// The parts in `folder`; made if it is not there.
    ///
    /// # Errors
    /// If the folder cannot be made.
    pub fn open(folder: &Path) -> Result<Self> {
        fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        Ok(Self { folder: folder.to_path_buf() })
    }

    /// The file of a finished batch.
    pub fn finished_file(&self, batch: u32) -> PathBuf {
        self.folder.join(format!("batch-{batch:05}{FINISHED}"))
    }

    /// Whether a batch is finished, and of this job.
    ///
    /// # Errors
    /// If its file cannot be read, or is no part.
    pub fn is_finished(&self, manifest: &Manifest, batch: u32) -> Result<bool> {
        let state = PartState::of(&self.finished_file(batch), manifest)?;
        Ok(matches!(state, PartState::Own(part) if part.is_finished()))
    }

    /// The finished parts of this job, by name.
    ///
    /// # Errors
    /// If the folder or a part cannot be read.
    pub fn finished(&self, manifest: &Manifest) -> Result<Vec<PathBuf>> {
        let mut found = Vec::new();
        for path in self.files(|name| name.ends_with(FINISHED))? {
            if matches!(PartState::of(&path, manifest)?, PartState::Own(part) if part.is_finished())
            {
                found.push(path);
            }
        }
        Ok(found)
    }

    /// The parts of an earlier plan that hold tiles of this one, by name.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn kept(&self) -> Result<Vec<PathBuf>> {
        self.files(|name| name.starts_with(KEPT) && name.ends_with(FINISHED))
    }

    /// A name for a part of kept tiles that is not in use.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn new_kept(&self) -> Result<PathBuf> {
        let used = self.files(|name| name.starts_with(KEPT))?;
        let name = |k: usize| self.folder.join(format!("{KEPT}{k}{FINISHED}"));
        Ok((0..=used.len()).map(name).find(|path| !used.contains(path)).unwrap_or_else(|| name(0)))
    }

    /// The part of the overviews between batches.
    pub fn joined(&self) -> PathBuf {
        self.folder.join(format!("joined{FINISHED}"))
    }

    /// Takes a batch that is not finished.
    ///
    /// # Errors
    /// If the folder refuses new files, or another process is at the batch and `rivals` says to leave it alone.
    pub fn claim(&self, batch: u32, rivals: Rivals) -> Result<Claim> {
        let mut left: Option<(u64, PathBuf, File)> = None;
        for part in self.unfinished(batch)? {
            match hold(&part) {
                Ok(Some(file)) => {
                    let bytes = file.metadata().map_err(|e| Error::io(&part, e))?.len();
                    // The one in which most is done.
                    if left.as_ref().is_none_or(|(most, ..)| bytes > *most) {
                        left = Some((bytes, part, file));
                    }
                }
                Ok(None) => {}
                Err(busy) if rivals == Rivals::Refuse => return Err(busy),
                Err(_busy) => {}
            }
        }
        if let Some((_, part, file)) = left {
            return Ok(Claim { part, file, batch });
        }
        self.begin(batch)
    }

    /// Begins a file of this process's own.
    fn begin(&self, batch: u32) -> Result<Claim> {
        for _ in 0..MOST_TRIES {
            let file = tempfile::Builder::new()
                .prefix(&format!("batch-{batch:05}."))
                .suffix(UNFINISHED)
                .tempfile_in(&self.folder)
                .map_err(|e| Error::io(&self.folder, e))?;
            let (_, part) = file.keep().map_err(|e| Error::io(&self.folder, e.error))?;
            // Another process may have seen it before it was locked, and gone on with it or removed it.
            match hold(&part) {
                Ok(Some(file)) => return Ok(Claim { part, file, batch }),
                Ok(None) => {}
                Err(Error::Io { source, .. }) if source.kind() == ErrorKind::ResourceBusy => {}
                Err(e) => return Err(e),
            }
        }
        let why = format!("other processes took {MOST_TRIES} new files of batch {batch}");
        Err(Error::io(&self.folder, std::io::Error::new(ErrorKind::ResourceBusy, why)))
    }

    /// Gives a finished part its name, and removes what others left of the batch.
    ///
    /// # Errors
    /// If the folder refuses.
    pub fn publish(&self, claim: Claim) -> Result<()> {
        let to = self.finished_file(claim.batch);
        fs::rename(&claim.part, &to).map_err(|e| Error::io(&claim.part, e))?;
        sync_folder(&to)?;
        let batch = claim.batch;
        drop(claim);
        self.unfinished(batch)?.iter().try_for_each(|path| discard(path, |_| Ok(true)))
    }

    /// Removes what belongs to no part of this job: parts of other jobs, and unfinished files that nobody holds.
    ///
    /// # Errors
    /// If the folder refuses.
    pub fn tidy(&self, manifest: &Manifest) -> Result<()> {
        for path in self.files(|name| name.ends_with(FINISHED))? {
            if !matches!(PartState::of(&path, manifest)?, PartState::Own(_)) {
                remove(&path)?;
            }
        }
        let is_foreign = |path: &Path| {
            PartState::of(path, manifest).map(|state| !matches!(state, PartState::Own(_)))
        };
        let unfinished = self.files(|name| name.ends_with(UNFINISHED))?;
        unfinished.iter().try_for_each(|path| discard(path, is_foreign))
    }

    /// Removes unfinished files that nobody holds: of a job of which all batches are finished they are left over.
    ///
    /// # Errors
    /// If the folder refuses.
    pub fn sweep(&self) -> Result<()> {
        let unfinished = self.files(|name| name.ends_with(UNFINISHED))?;
        unfinished.iter().try_for_each(|path| discard(path, |_| Ok(true)))
    }

    /// Removes all parts.
    ///
    /// # Errors
    /// If the folder refuses.
    pub fn remove(self) -> Result<()> {
        fs::remove_dir_all(&self.folder).map_err(|e| Error::io(&self.folder, e))
    }

    fn unfinished(&self, batch: u32) -> Result<Vec<PathBuf>> {
        let prefix = format!("batch-{batch:05}.");
        self.files(|name| name.starts_with(&prefix) && name.ends_with(UNFINISHED))
    }

    /// The files with such a name, sorted.
    fn files(&self, is_meant: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>> {
        let io = |e| Error::io(&self.folder, e);
        let mut found = Vec::new();
        for entry in fs::read_dir(&self.folder).map_err(io)? {
            let name = entry.map_err(io)?.file_name();
            if name.to_str().is_some_and(&is_meant) {
                found.push(self.folder.join(name));
            }
        }
        found.sort_unstable();
        Ok(found)
    }
}

/// Locks an unfinished file; `None` if it has gone.
fn hold(path: &Path) -> Result<Option<File>> {
    let fail = |e| Error::io(path, e);
    let file = match File::options().write(true).open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(fail(e)),
    };
    lock(&file).map_err(fail)?;
    // Its name is never used again: if it is there, it is this file's.
    let is_there = fs::exists(path).map_err(fail)?;
    Ok(is_there.then_some(file))
}

/// Removes an unfinished file that nobody holds, if it is as it `must` be.
fn discard(path: &Path, must: impl Fn(&Path) -> Result<bool>) -> Result<()> {
    match hold(path) {
        Ok(Some(_held)) if must(path)? => remove(path),
        _ => Ok(()),
    }
}

/// Removes a file that another process may remove too.
fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(path, e)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::names;
    use super::*;

    #[test]
    fn a_file_that_nobody_holds_is_gone_on_with_and_one_that_is_held_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let parts = Parts::open(&folder.path().join("parts")).unwrap();
        let left = parts.claim(3, Rivals::Refuse).unwrap().part;
        fs::write(&left, "some tiles").unwrap();
        let first = parts.claim(3, Rivals::Refuse).unwrap();
        assert_eq!(first.part, left);
        let refused = parts.claim(3, Rivals::Refuse).unwrap_err();
        assert_eq!(refused.exit_code(), 4);
        let second = parts.claim(3, Rivals::Ignore).unwrap();
        assert_ne!(second.part, first.part);
        // Another batch is another matter.
        assert!(parts.claim(4, Rivals::Refuse).is_ok());
        // Whoever is done first leaves the other's file alone, and later the last one is there whole.
        parts.publish(second).unwrap();
        assert!(first.part.exists() && parts.finished_file(3).exists());
        parts.publish(first).unwrap();
        assert_eq!(fs::read(parts.finished_file(3)).unwrap(), b"some tiles");
        assert!(
            !names(&parts.folder)
                .iter()
                .any(|n| { n.starts_with("batch-00003.") && n.ends_with(UNFINISHED) })
        );
    }

    #[test]
    fn the_file_in_which_most_is_done_comes_first_and_the_others_go_when_it_is_finished() {
        let folder = tempfile::tempdir().unwrap();
        let parts = Parts::open(folder.path()).unwrap();
        for (name, bytes) in [("a", 10), ("b", 30), ("c", 20)] {
            let name = format!("batch-00000.{name}{UNFINISHED}");
            fs::write(folder.path().join(name), vec![0; bytes]).unwrap();
        }
        let claim = parts.claim(0, Rivals::Refuse).unwrap();
        assert!(claim.part.ends_with("batch-00000.b.unfinished"));
        parts.publish(claim).unwrap();
        assert_eq!(names(folder.path()), ["batch-00000.part"]);
    }
    #[test]
    fn processes_that_take_and_finish_one_batch_at_the_same_time_all_end_well() {
        let folder = tempfile::tempdir().unwrap();
        let parts = Parts::open(folder.path()).unwrap();
        // A lock is of an opened file: threads stand for processes.
        std::thread::scope(|scope| {
            for k in 0..4_u8 {
                let parts = &parts;
                scope.spawn(move || {
                    for _ in 0..200 {
                        let claim = parts.claim(0, Rivals::Ignore).unwrap();
                        fs::write(&claim.part, vec![k; 1000]).unwrap();
                        // Nobody else has written into it.
                        assert_eq!(fs::read(&claim.part).unwrap(), vec![k; 1000]);
                        parts.publish(claim).unwrap();
                    }
                });
            }
        });
        assert_eq!(names(folder.path()), ["batch-00000.part"]);
    }
}
