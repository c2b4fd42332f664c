//! Which kind of file or folder it is.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::{cameras, job, mesh, photo, settings, tiff};
use crate::input::{CameraOptions, is_camera_file, mesh_format};
use crate::{Error, Result};

/// First bytes of a file that are enough to know it by.
const HEAD_BYTES: u64 = 16;

/// What `groundel info` can tell about.
const KNOWN: &str = "known are jobs, COLMAP folders, camera files of other tools, PLY, OBJ, STL, XYZ triplets, glTF, JPEG, PNG, TIFF, mesh stores, frame and project files (.toml)";

/// What is in the file or folder at `path`, a few lines, each ending in a newline. Cameras are read with `options`, and
/// proven on the mesh, if one is named.
///
/// # Errors
/// [`Error::Unsupported`] for what groundel does not know, and what reading the file gives.
pub(in crate::cli) fn describe(
    path: &Path,
    mesh_path: Option<&Path>,
    options: &CameraOptions,
) -> Result<String> {
    if job::is_job(path) {
        return job::describe(path);
    }
    let cameras = || cameras::describe(path, mesh_path, options);
    if path.is_dir() || mesh_path.is_some() || options.format.is_some() {
        return cameras();
    }
    match &head(path)?[..] {
        [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => tiff::describe(path),
        [0xFF, 0xD8, 0xFF, ..] | [0x89, b'P', b'N', b'G', ..] => photo::describe(path),
        head if head.starts_with(b"GROUNDMS") => mesh::describe_store(path),
        _ if path.extension().is_some_and(|extension| extension == "toml") => {
            settings::describe(path)
        }
        _ if mesh_format(path)?.is_some() => mesh::describe(path),
        _ if is_camera_file(path)? => cameras(),
        _ => Err(Error::Unsupported {
            path: path.to_path_buf(),
            what: "this kind of file".into(),
            hint: Some(KNOWN.into()),
        }),
    }
}

fn head(path: &Path) -> Result<Vec<u8>> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut head = Vec::new();
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(|e| Error::io(path, e))?;
    Ok(head)
}
