//! [`read_cameras`]: which files of the folder to read.

use std::io;
use std::path::Path;

use super::{binary, text};
use crate::camera::CameraSet;
use crate::{Error, Result};

/// Reads a camera set: a folder with a COLMAP model. The binary files are preferred to the text files where both are
/// complete, as COLMAP does.
///
/// Photos with a camera model that is known but not supported are left out, named with the reason.
///
/// # Errors
/// [`Error::Io`] if the folder or a file cannot be read; [`Error::Unsupported`] for anything but a folder;
/// [`Error::Corrupt`] with the line or byte for a folder without a model, a file that is cut, an unknown camera model, a
/// photo whose camera is missing, a name given twice or leading out of the photo folder, or numbers that make no lens or
/// pose; [`Error::Limit`] for more than a million photos or cameras.
pub fn read_cameras(path: impl AsRef<Path>) -> Result<CameraSet> {
    let path = path.as_ref();
    let metadata = path.metadata().map_err(|e| Error::io(path, e))?;
    if !metadata.is_dir() {
        return Err(Error::Unsupported {
            path: path.to_path_buf(),
            what: "a camera file of this kind".into(),
            hint: Some("give the folder of a COLMAP model".into()),
        });
    }
    if let [Some(cameras), Some(images)] = pair(path, "bin")? {
        return binary::read(&cameras, &images);
    }
    if let [Some(cameras), Some(images)] = pair(path, "txt")? {
        return text::read(&cameras, &images);
    }
    let expected = "a COLMAP model: cameras.bin and images.bin, or cameras.txt and images.txt";
    Err(Error::corrupt(path, "the folder", expected, "no such pair of files"))
}

/// The two files with this extension, where they exist.
fn pair(folder: &Path, extension: &str) -> Result<[Option<std::path::PathBuf>; 2]> {
    let file = |name: &str| {
        let path = folder.join(name).with_extension(extension);
        match path.metadata() {
            Ok(m) if m.is_file() => Ok(Some(path)),
            Ok(_) => Ok(None),
            Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(e) => Err(Error::io(path, e)),
        }
    };
    Ok([file("cameras")?, file("images")?])
}
