//! [`JobFolder`]: where the files of a job lie.

use std::fs;
use std::path::{Component, Path, PathBuf};

use crate::batch::Parts;
use crate::{Error, Result};

/// The folder of a job: `manifest.json`, `parts/` and, where the job is to be moved, `stores/`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::cli) struct JobFolder {
    path: PathBuf,
}

impl JobFolder {
    pub(in crate::cli) fn new(path: &Path) -> Self {
        Self { path: path.to_path_buf() }
    }

    pub(in crate::cli) fn path(&self) -> &Path {
        &self.path
    }

    /// What the job is.
    pub(in crate::cli) fn manifest(&self) -> PathBuf {
        self.path.join("manifest.json")
    }

    /// The stores of a job that is planned to be rendered elsewhere.
    pub(in crate::cli) fn stores(&self) -> PathBuf {
        self.path.join("stores")
    }

    /// Its part files.
    ///
    /// # Errors
    /// If their folder cannot be made.
    pub(in crate::cli) fn parts(&self) -> Result<Parts> {
        Parts::open(&self.path.join("parts"))
    }

    /// A path that a manifest states, found again from where the job lies now.
    pub(in crate::cli) fn resolve(&self, stated: &str) -> PathBuf {
        self.path.join(stated)
    }

    /// `path` as a manifest states it: from the job's folder, with `/`; as it is where it lies on another disk, or its name
    /// is no text.
    ///
    /// # Errors
    /// If the folder or what `path` names is not there.
    pub(in crate::cli) fn state(&self, path: &Path) -> Result<String> {
        let absolute = |path: &Path| fs::canonicalize(path).map_err(|e| Error::io(path, e));
        let (from, to) = (absolute(&self.path)?, absolute(path)?);
        let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
        let starts_alike = common > 0;
        let up = from.components().skip(common).map(|_| Some(".."));
        let down = to.components().skip(common).map(|part| match part {
            Component::Normal(name) => name.to_str(),
            _ => None,
        });
        let steps: Option<Vec<&str>> = up.chain(down).collect();
        Ok(match steps {
            Some(steps) if starts_alike && !steps.is_empty() => steps.join("/"),
            Some(_) if starts_alike => ".".into(),
            _ => to.display().to_string(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_that_moves_with_its_photos_finds_them_again() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        fs::create_dir_all(at("a/photos of the wall")).unwrap();
        fs::create_dir_all(at("a/jobs/one/stores")).unwrap();
        let job = JobFolder::new(&at("a/jobs/one"));
        let stated = job.state(&at("a/photos of the wall")).unwrap();
        assert_eq!(stated, "../../photos of the wall");
        assert_eq!(job.state(&at("a/jobs/one")).unwrap(), ".");
        assert_eq!(job.state(&at("a/jobs/one/stores")).unwrap(), "stores");
        fs::rename(at("a"), at("b")).unwrap();
        let moved = JobFolder::new(&at("b/jobs/one"));
        assert!(moved.resolve(&stated).join(".").is_dir());
        assert!(job.state(&at("nowhere")).is_err());
    }
}
