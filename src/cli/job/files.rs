//! [`Files`]: the names of the mosaic, its layers and its frame.

use std::path::{Path, PathBuf};

use crate::batch::Manifest;
use crate::output::Meaning;
use crate::{Error, Result};

/// Where the files of a job go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::cli) struct Files {
    /// One for each layer of the manifest, in its order, the mosaic first.
    pub(in crate::cli) layers: Vec<PathBuf>,
    /// The frame.
    pub(in crate::cli) frame: PathBuf,
}

impl Files {
    /// The files of a job whose mosaic is `out`.
    pub(in crate::cli) fn of(manifest: &Manifest, out: &Path) -> Self {
        let layers = manifest.layers().iter().map(|l| layer_file(out, l.meaning())).collect();
        Self { layers, frame: frame_file(out) }
    }

    /// All of them.
    pub(in crate::cli) fn all(&self) -> impl Iterator<Item = &Path> {
        self.layers.iter().chain([&self.frame]).map(PathBuf::as_path)
    }
}

/// The file of a layer: `<out stem>.<layer>.tif` beside the mosaic `out`; of [`Meaning::Mosaic`]: the mosaic.
pub(in crate::cli) fn layer_file(out: &Path, layer: Meaning) -> PathBuf {
    match layer {
        Meaning::Mosaic => out.to_path_buf(),
        _ => beside(out, &format!("{}.tif", layer.name())),
    }
}

/// The frame written beside the mosaic: `<out stem>.frame.toml`.
pub(in crate::cli) fn frame_file(out: &Path) -> PathBuf {
    beside(out, "frame.toml")
}

fn beside(out: &Path, ending: &str) -> PathBuf {
    let mut name = out.file_stem().unwrap_or_default().to_os_string();
    name.push(".");
    name.push(ending);
    out.with_file_name(name)
}

/// A mosaic's name ends in `.tif` or `.tiff`, so that its layers' names can be made from it.
///
/// # Errors
/// [`Error::Usage`] for any other name.
pub(in crate::cli) fn check_name(out: PathBuf) -> Result<PathBuf> {
    let extension = out.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    if matches!(extension.as_deref(), Some("tif" | "tiff")) {
        return Ok(out);
    }
    Err(Error::usage(format!("--out: expected a name ending in .tif, found {}", out.display())))
}

/// Refuses files that are folders, lie in no folder or one that cannot be written to.
///
/// # Errors
/// [`Error::Usage`] naming the file; [`Error::Io`] for a folder that refuses.
pub(in crate::cli) fn check_writable<'a>(files: impl Iterator<Item = &'a Path>) -> Result<()> {
    for file in files {
        check_folder(file)?;
        if file.is_dir() {
            let file = file.display();
            return Err(Error::usage(format!("{file}: expected a file to write, found a folder")));
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
