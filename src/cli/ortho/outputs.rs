//! Whether the files of a job can be written, asked before hours are spent on them.

use std::fs;
use std::path::{Path, PathBuf};

use super::super::config::Config;
use super::super::job::check_writable;
use super::inputs::Inputs;
use crate::{Error, Result};

/// Refuses outputs that are folders, lie in no folder or one that cannot be written to, or are inputs of the job.
///
/// # Errors
/// [`Error::Usage`] naming the file; [`Error::Io`] for a folder that refuses.
pub(super) fn check(config: &Config, inputs: &Inputs) -> Result<()> {
    let mut files = config.files();
    files.extend(config.report.clone());
    check_writable(files.iter().map(PathBuf::as_path))?;
    if config.work.exists() && !config.work.is_dir() {
        let work = config.work.display();
        return Err(Error::usage(format!("--work {work}: expected a folder, found a file")));
    }
    refuse_inputs(config, inputs, files.iter().map(PathBuf::as_path))
}

/// Refuses files that are inputs of the job.
fn refuse_inputs<'a>(
    config: &Config,
    inputs: &Inputs,
    files: impl Iterator<Item = &'a Path>,
) -> Result<()> {
    let photos = inputs.photos.iter().map(|photo| config.photos.join(&photo.name));
    let masks = inputs.masks.iter().map(|mask| mask.source.path.clone());
    let surfaces = config.meshes.iter().chain(&config.points).cloned();
    let read: Vec<PathBuf> = surfaces.chain(photos).chain(masks).collect();
    for file in files.filter_map(|file| fs::canonicalize(file).ok()) {
        if let Some(input) = read.iter().find(|i| fs::canonicalize(i).is_ok_and(|i| i == file)) {
            let input = input.display();
            return Err(Error::usage(format!("{input}: would be overwritten, but it is an input")));
        }
    }
    Ok(())
}
