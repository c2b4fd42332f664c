//! Whether the disk can hold what a job writes, asked before it begins.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use fs4::FsStats;

use super::super::config::Config;
use crate::plan::JobDemand;
use crate::{Error, Result};

/// A forecast may be this much too high, relative: what is short by more is surely short.
const DOUBT: f64 = 0.3;

/// What the disk is to hold, and what it has.
#[derive(Debug)]
pub(super) struct Room {
    /// Where it is short, if it may be.
    shortage: Option<Shortage>,
}

#[derive(Debug)]
struct Shortage {
    folder: PathBuf,
    needed_bytes: u64,
    free_bytes: u64,
}

impl Room {
    /// Compares what `demand` writes with the free space of the file systems of work folder and output. What an
    /// interrupted run left in the work folder need not be written again.
    ///
    /// # Errors
    /// [`Error::Io`] if a file system does not answer.
    pub(super) fn of(config: &Config, demand: &JobDemand) -> Result<Self> {
        let output = config.out.parent().filter(|p| !p.as_os_str().is_empty());
        let [work, output] = [Some(config.work.as_path()), output].map(existing);
        let (of_work, of_output) = (stats(&work)?, stats(&output)?);
        let there = size_of(&config.work.join("photos"))? + size_of_jobs(&config.work)?;
        let needs = if is_same(&of_work, &of_output) {
            vec![(work, demand.disk_bytes().saturating_sub(there), of_work)]
        } else {
            vec![
                (work, demand.temporary_bytes().saturating_sub(there), of_work),
                (output, demand.output_bytes, of_output),
            ]
        };
        let short =
            needs.into_iter().filter(|(_, needed, stats)| *needed > stats.available_space());
        let shortage = |(folder, needed_bytes, stats): (PathBuf, u64, FsStats)| Shortage {
            folder,
            needed_bytes,
            free_bytes: stats.available_space(),
        };
        Ok(Self { shortage: short.map(shortage).max_by_key(|s| s.needed_bytes - s.free_bytes) })
    }

    /// Refuses a job that is surely too large.
    ///
    /// # Errors
    /// [`Error::NoRoom`].
    pub(super) fn check(&self) -> Result<()> {
        match &self.shortage {
            Some(s) if (s.free_bytes as f64) < s.needed_bytes as f64 / (1.0 + DOUBT) => {
                Err(Error::NoRoom {
                    folder: s.folder.clone(),
                    needed_bytes: s.needed_bytes,
                    free_bytes: s.free_bytes,
                })
            }
            _ => Ok(()),
        }
    }

    /// What to tell the user of a job that may be too large.
    pub(super) fn warning(&self) -> Option<String> {
        let s = self.shortage.as_ref()?;
        let (needed, free) = (s.needed_bytes.div_ceil(1 << 20), s.free_bytes >> 20);
        let folder = s.folder.display();
        Some(format!(
            "{folder} may be short of disk: about {needed} MiB are needed, {free} MiB free"
        ))
    }
}

/// The folder, or the nearest above it that is there.
fn existing(folder: Option<&Path>) -> PathBuf {
    let here = Path::new(".");
    let above = folder.unwrap_or(here).ancestors().find(|p| p.is_dir());
    above.unwrap_or(here).to_path_buf()
}

fn stats(folder: &Path) -> Result<FsStats> {
    fs4::statvfs(folder).map_err(|e| Error::io(folder, e))
}

/// Whether two answers come from one file system: they agree in every number. Should they not, because something
/// was written in between, each folder is asked for its own part alone: less is refused, never more.
fn is_same(a: &FsStats, b: &FsStats) -> bool {
    a.total_space() == b.total_space() && a.available_space() == b.available_space()
}

/// Bytes of the files in a folder; 0 if it is not there.
fn size_of(folder: &Path) -> Result<u64> {
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(0),
        entries => entries.map_err(|e| Error::io(folder, e))?,
    };
    let mut bytes = 0;
    for entry in entries {
        // What goes meanwhile takes no room.
        bytes +=
            entry.and_then(|e| e.metadata()).map_or(0, |m| if m.is_file() { m.len() } else { 0 });
    }
    Ok(bytes)
}

/// Bytes of unfinished jobs.
fn size_of_jobs(work: &Path) -> Result<u64> {
    let Ok(entries) = fs::read_dir(work) else { return Ok(0) };
    let is_job =
        |p: &PathBuf| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("job-"));
    entries.flatten().map(|e| e.path()).filter(is_job).map(|job| size_of(&job)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room(needed_bytes: u64, free_bytes: u64) -> Room {
        let folder = PathBuf::from("work");
        Room { shortage: Some(Shortage { folder, needed_bytes, free_bytes }) }
    }

    #[test]
    fn what_is_surely_short_is_refused_and_what_may_be_is_only_warned_of() {
        assert_eq!(room(1300, 900).check().unwrap_err().exit_code(), 3);
        assert!(room(1300, 1100).check().is_ok() && room(1300, 1100).warning().is_some());
        let none = Room { shortage: None };
        assert!(none.check().is_ok() && none.warning().is_none());
    }

    #[test]
    fn a_folder_to_be_made_lies_where_the_nearest_folder_above_it_does() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("a/b/c");
        assert_eq!(existing(Some(&deep)), folder.path());
        assert_eq!(existing(None), Path::new("."));
        assert!(stats(folder.path()).unwrap().total_space() > 0);
        fs::create_dir_all(folder.path().join("job-1")).unwrap();
        fs::write(folder.path().join("job-1/part-0"), [0; 77]).unwrap();
        assert_eq!(size_of_jobs(folder.path()).unwrap(), 77);
        assert_eq!(size_of(&deep).unwrap(), 0);
    }
}
