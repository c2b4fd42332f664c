//! [`read_cameras`]: the one way in for cameras of any format.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use super::{CameraFormat, CameraOptions, Draft, Proof};
use crate::camera::CameraSet;
use crate::input::{
    alicevision, bundler, colmap, metashape, micmac, openmvg, opensfm, pix4d, realitycapture, table,
};
use crate::{Error, Result};

/// Bytes at the start of a file by which its format is known.
const HEAD_BYTES: u64 = 1 << 16;

/// Cameras read from a file or a folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Cameras {
    /// The photos.
    pub set: CameraSet,
    /// The format that they came in.
    pub format: CameraFormat,
    /// How well they see their own tie points, where there are any.
    pub proof: Option<Proof>,
}

/// Reads a camera set of any format, found from the content unless `options` names it.
///
/// Photos that cannot be used, such as those of a camera model that is known but not supported, are left out, named
/// with the reason. Where the file holds tie points, a sample of them proves the cameras.
///
/// # Errors
/// [`Error::Io`] if a file cannot be read; [`Error::Unsupported`] for a format that is not known; [`Error::Corrupt`] with
/// the place for what the format does not allow, a name given twice or leading out of the photo folder, and for
/// cameras that miss their own tie points by more than [`Proof::MOST_PX`], unless forced; [`Error::Limit`] for more
/// than a million photos; [`Error::Usage`] for an option that the format needs.
pub fn read_cameras(path: impl AsRef<Path>, options: &CameraOptions) -> Result<Cameras> {
    let path = path.as_ref();
    let format = match options.format {
        Some(format) => format,
        None => format_of(path)?,
    };
    let mut draft = read(path, format, options)?;
    if let (CameraFormat::OpenSfm, Some(offset)) = (format, options.odm_offset) {
        draft.shift(offset);
    }
    let proof = Proof::of(&draft);
    if let Some(proof) = &proof
        && !options.force
    {
        proof.check(path)?;
    }
    Ok(Cameras { set: draft.finish(path)?, format, proof })
}

/// The parser of each format.
fn read(path: &Path, format: CameraFormat, options: &CameraOptions) -> Result<Draft> {
    match format {
        CameraFormat::Colmap => colmap::read(path),
        CameraFormat::Table => table::read(path, options),
        CameraFormat::Bundler => bundler::read(path, options),
        CameraFormat::OpenSfm => opensfm::read(path),
        CameraFormat::OpenMvg => openmvg::read(path, options),
        CameraFormat::AliceVision => alicevision::read(path, options),
        CameraFormat::Metashape => metashape::read(path, options),
        CameraFormat::MicMac => micmac::read(path, options),
        CameraFormat::Pix4d => pix4d::read(path, options),
        CameraFormat::RealityCapture => realitycapture::read(path, options),
    }
}

/// Whether the file at `path` holds cameras in a format that is known by its content.
///
/// # Errors
/// [`Error::Io`] if it cannot be read.
pub fn is_camera_file(path: &Path) -> Result<bool> {
    Ok(format_of_file(path)?.is_some())
}

/// The format of the file or folder at `path`, from its content.
fn format_of(path: &Path) -> Result<CameraFormat> {
    let metadata = path.metadata().map_err(|e| Error::io(path, e))?;
    if metadata.is_dir() {
        return format_of_folder(path);
    }
    format_of_file(path)?.ok_or_else(|| unknown(path))
}

/// The format of a folder; one without any is refused by COLMAP's reader, which says what is missing.
fn format_of_folder(path: &Path) -> Result<CameraFormat> {
    let is_model = |end: &&str| path.join("cameras").with_extension(end).is_file();
    if ["bin", "txt"].iter().any(is_model) {
        Ok(CameraFormat::Colmap)
    } else if micmac::is_folder(path)? {
        Ok(CameraFormat::MicMac)
    } else if realitycapture::is_folder(path)? {
        Ok(CameraFormat::RealityCapture)
    } else {
        Ok(CameraFormat::Colmap)
    }
}

fn format_of_file(path: &Path) -> Result<Option<CameraFormat>> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut head = Vec::new();
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(|e| Error::io(path, e))?;
    Ok(format_of_head(&head))
}

/// The format of a file that begins with `head`.
fn format_of_head(head: &[u8]) -> Option<CameraFormat> {
    let head = String::from_utf8_lossy(head);
    let head = head.trim_start_matches('\u{feff}').trim_start();
    match head.chars().next()? {
        '#' if head.starts_with("# Bundle file") => Some(CameraFormat::Bundler),
        '[' if head.contains("\"shots\"") || head.contains("\"cameras\"") => {
            Some(CameraFormat::OpenSfm)
        }
        '{' if head.contains("\"sfm_data_version\"") => Some(CameraFormat::OpenMvg),
        '{' if head.contains("\"viewId\"") => Some(CameraFormat::AliceVision),
        '<' if metashape::is_metashape(head) => Some(CameraFormat::Metashape),
        '#' if realitycapture::is_table(head) => Some(CameraFormat::RealityCapture),
        _ if pix4d::is_pix4d(head) => Some(CameraFormat::Pix4d),
        _ if table::is_header(head.lines().next()?) => Some(CameraFormat::Table),
        _ => None,
    }
}

fn unknown(path: &Path) -> Error {
    Error::Unsupported {
        path: path.to_path_buf(),
        what: "a camera file of this kind".into(),
        hint: Some(format!("--camera-format takes {}", CameraFormat::words().join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_known_by_its_files() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(format_of(folder.path()).unwrap(), CameraFormat::Colmap);
        for (name, format) in [
            ("a.xmp", CameraFormat::RealityCapture),
            ("Orientation-a.jpg.xml", CameraFormat::MicMac),
            ("cameras.txt", CameraFormat::Colmap),
        ] {
            std::fs::write(folder.path().join(name), "").unwrap();
            assert_eq!(format_of(folder.path()).unwrap(), format, "{name}");
        }
    }

    #[test]
    fn a_format_is_known_by_its_first_bytes() {
        for (head, format) in [
            ("# Bundle file v0.3\n1 0\n", Some(CameraFormat::Bundler)),
            ("[{\"cameras\": {}, \"shots\": {}}]", Some(CameraFormat::OpenSfm)),
            ("\n { \"sfm_data_version\": \"0.3\"}", Some(CameraFormat::OpenMvg)),
            (
                "{\"version\": [], \"views\": [{\"viewId\": \"1\"}]}",
                Some(CameraFormat::AliceVision),
            ),
            (
                "\u{feff}name,X0,Y0,Z0,omega,phi,kappa,c,x0,y0,k1,k2,k3,p1,p2\r\n",
                Some(CameraFormat::Table),
            ),
            (
                "<?xml version='1.0'?>\n<document version='1.2.0'>\n <chunk>",
                Some(CameraFormat::Metashape),
            ),
            ("fileName imageWidth imageHeight \r\n", Some(CameraFormat::Pix4d)),
            (
                "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n",
                Some(CameraFormat::RealityCapture),
            ),
            ("{\"views\": 1}", None),
            ("<?xml", None),
            ("", None),
        ] {
            assert_eq!(format_of_head(head.as_bytes()), format, "{head}");
        }
    }
}
