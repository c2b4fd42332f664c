//! Whether the files of a job can be written, asked before hours are spent on them.

use std::fs;
use std::path::{Path, PathBuf};

use super::super::config::Config;
use super::inputs::Inputs;
use crate::output::Meaning;
use crate::{Error, Result};

/// Refuses outputs that are folders, lie in no folder or one that cannot be written to, or are inputs of the job.
///
/// # Errors
/// [`Error::Usage`] naming the file; [`Error::Io`] for a folder that refuses.
pub(super) fn check(config: &Config, inputs: &Inputs) -> Result<()> {
    let mut files: Vec<PathBuf> = config.layers.iter().map(|l| config.layer_file(*l)).collect();
    files.extend([config.layer_file(Meaning::Mosaic), config.frame_file()]);
    files.extend(config.sidecars.iter().map(|sidecar| config.sidecar_file(*sidecar)));
    files.extend(config.report.clone());
    for file in &files {
        check_folder(file)?;
        if file.is_dir() {
            let file = file.display();
            return Err(Error::usage(format!("{file}: expected a file to write, found a folder")));
        }
    }
    if config.work.exists() && !config.work.is_dir() {
        let work = config.work.display();
        return Err(Error::usage(format!("--work {work}: expected a folder, found a file")));
    }
    let photos = inputs.photos.iter().map(|photo| config.photos.join(&photo.name));
    let masks = inputs.masks.iter().map(|mask| mask.source.path.clone());
    let read: Vec<PathBuf> = config.meshes.iter().cloned().chain(photos).chain(masks).collect();
    for file in files.iter().filter_map(|file| fs::canonicalize(file).ok()) {
        if let Some(input) = read.iter().find(|i| fs::canonicalize(i).is_ok_and(|i| i == file)) {
            let input = input.display();
            return Err(Error::usage(format!("{input}: would be overwritten, but it is an input")));
        }
    }
    Ok(())
}

/// The folder of `file` must be there and take new files.
fn check_folder(file: &Path) -> Result<()> {
    let folder = match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        let (file, folder) = (file.display(), folder.display());
        return Err(Error::usage(format!("{file}: expected a folder {folder}, found none")));
    }
    tempfile::tempfile_in(folder).map(drop).map_err(|e| Error::io(folder, e))
}
