//! [`Files`]: the names of a mosaic, or of each section, of its layers and its frame.

use std::path::{Path, PathBuf};

use super::super::sections;
use super::record::JobRecord;
use crate::output::{Layer, Meaning, Sidecar};
use crate::{Error, Result};

/// Where the files of a job go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::cli) struct Files {
    /// One for each layer of the manifest, in its order, of each section the mosaic first.
    pub(in crate::cli) layers: Vec<PathBuf>,
    /// The mosaic of each section.
    pub(in crate::cli) mosaics: Vec<PathBuf>,
    /// The frame of each section.
    pub(in crate::cli) frames: Vec<PathBuf>,
    /// What else lies beside each.
    pub(in crate::cli) sidecars: Vec<Vec<PathBuf>>,
}

impl Files {
    /// The files of a job whose mosaic is `out`, or those of its sections beside it.
    pub(in crate::cli) fn of(record: &JobRecord, out: &Path) -> Self {
        let mosaic = |section: usize| match record.sections.get(section) {
            Some(&elevation) => sections::file(out, elevation),
            None => out.to_path_buf(),
        };
        let layer = |l: &Layer| layer_file(&mosaic(l.section().into()), l.meaning());
        let layers = record.manifest.layers().iter().map(layer).collect();
        let mosaics: Vec<_> = (0..record.manifest.sections()).map(mosaic).collect();
        let frames = mosaics.iter().map(|mosaic| frame_file(mosaic)).collect();
        let kinds = record.manifest.sidecars();
        let beside =
            |mosaic: &PathBuf| kinds.iter().map(|&kind| sidecar_file(mosaic, kind)).collect();
        let sidecars = mosaics.iter().map(beside).collect();
        Self { layers, mosaics, frames, sidecars }
    }

    /// All of them.
    pub(in crate::cli) fn all(&self) -> impl Iterator<Item = &Path> {
        self.layers
            .iter()
            .chain(&self.frames)
            .chain(self.sidecars.iter().flatten())
            .map(PathBuf::as_path)
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

/// A file beside the mosaic that can be asked for: `<out stem>.tfw`, `<out stem>.dxf`.
pub(in crate::cli) fn sidecar_file(out: &Path, kind: Sidecar) -> PathBuf {
    beside(out, kind.extension())
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
