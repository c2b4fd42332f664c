//! [`read`]: which files of the folder to read.

use std::io;
use std::path::{Path, PathBuf};

use super::{binary, text};
use crate::input::cameras::Draft;
use crate::{Error, Result};

/// Reads a folder with a COLMAP model. The binary files are preferred to the text files where both are complete, as
/// COLMAP does.
///
/// # Errors
/// [`Error::Io`] if the folder or a file cannot be read; [`Error::Unsupported`] for anything but a folder;
/// [`Error::Corrupt`] with the line or byte for a folder without a model, a file that is cut, an unknown camera model, a
/// photo whose camera is missing, a name given twice or leading out of the photo folder, or numbers that make no lens or
/// pose; [`Error::Limit`] for more than a million photos or cameras.
pub(in crate::input) fn read(path: &Path) -> Result<Draft> {
    let metadata = path.metadata().map_err(|e| Error::io(path, e))?;
    if !metadata.is_dir() {
        return Err(Error::Unsupported {
            path: path.to_path_buf(),
            what: "a COLMAP model in a file".into(),
            hint: Some("give its folder".into()),
        });
    }
    if let [Some(cameras), Some(images)] = pair(path, "bin")? {
        return binary::read(&cameras, &images, file(path, "points3D", "bin")?.as_deref());
    }
    if let [Some(cameras), Some(images)] = pair(path, "txt")? {
        return text::read(&cameras, &images, file(path, "points3D", "txt")?.as_deref());
    }
    let expected = "a COLMAP model: cameras.bin and images.bin, or cameras.txt and images.txt";
    Err(Error::corrupt(path, "the folder", expected, "no such pair of files"))
}

/// The two files with this extension, where they exist.
fn pair(folder: &Path, extension: &str) -> Result<[Option<PathBuf>; 2]> {
    Ok([file(folder, "cameras", extension)?, file(folder, "images", extension)?])
}

/// A file of the folder, where it exists.
fn file(folder: &Path, name: &str, extension: &str) -> Result<Option<PathBuf>> {
    let path = folder.join(name).with_extension(extension);
    match path.metadata() {
        Ok(m) if m.is_file() => Ok(Some(path)),
        Ok(_) => Ok(None),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(Error::io(path, e)),
    }
}
