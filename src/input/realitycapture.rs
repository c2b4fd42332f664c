//! `RealityCapture`'s (`RealityScan`'s) cameras: a folder of XMP files, or its table of camera parameters.
//!
//! Format: the files themselves, and the templates that come with the program. Camera axes x right, y down, z forward;
//! `Rotation` is camera from ground, row by row, `Position` the projection centre. Lengths are in parts of the photo's
//! longer side L: focal length `FocalLength35mm / 36`, principal point from the middle of the photo. `AspectRatio` is fy / fx.
//! Six coefficients: k1 … k4 of r² … r⁸ and t1, t2, which are OpenCV's p2, p1. Sizes are those of the photos' files, which an
//! XMP file names by its own name. The files hold no tie points.
//!
//! The table has the header `#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2`, angles in degrees: camera axes
//! x right, y up, z backward are turned to the ground by `Rz(−heading) · Rx(pitch) · Ry(roll)`.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use super::cameras::{
    CameraOptions, Draft, DraftPhoto, MAX_PHOTOS, PhotoFolder, lens, pose, rotation_of_rows,
};
use super::labels::PhotoLabels;
use super::xml::{Node, read_xml};
use crate::camera::{Lens, LensModel, Pose};
use crate::geom::Size;
use crate::{Error, Result};

/// The width in millimetres of the picture that `FocalLength35mm` is meant for.
const WIDTH_35MM: f64 = 36.0;
/// The columns of the table after the name.
const COLUMNS: [&str; 15] = [
    "x", "y", "alt", "heading", "pitch", "roll", "f", "px", "py", "k1", "k2", "k3", "k4", "t1",
    "t2",
];
/// The longest table, bytes.
const MAX_BYTES: u64 = 1 << 29;

/// Whether a file that begins with `head` is such a table.
pub(super) fn is_table(head: &str) -> bool {
    let mut words = head.lines().next().unwrap_or_default().split(',').map(str::trim);
    words.next() == Some("#name") && words.eq(COLUMNS)
}

/// Whether a folder holds XMP files.
pub(super) fn is_folder(path: &Path) -> Result<bool> {
    Ok(!xmp_files(path)?.is_empty())
}

/// Reads the XMP files of a folder, or a table.
///
/// # Errors
/// [`Error::Corrupt`] with file and line for what is not of this format; [`Error::Usage`] without the folder of the photos;
/// [`Error::Limit`] for more than a million photos.
pub(super) fn read(path: &Path, options: &CameraOptions) -> Result<Draft> {
    let reader = Reader {
        path,
        folder: PhotoFolder(options.photos.as_deref()),
        labels: PhotoLabels::of(options.photos.as_deref())?,
    };
    let is_dir = path.metadata().map_err(|e| Error::io(path, e))?.is_dir();
    let photos = if is_dir {
        xmp_files(path)?.iter().map(|file| reader.xmp(file)).collect()
    } else {
        reader.table()
    };
    Ok(Draft { photos: photos?, ..Draft::default() })
}

/// The XMP files of a folder, by name.
fn xmp_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let path = entry.map_err(|e| Error::io(folder, e))?.path();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("xmp")) {
            files.push(path);
        }
        check_count(folder, files.len())?;
    }
    files.sort_unstable();
    Ok(files)
}

fn check_count(path: &Path, found: usize) -> Result<()> {
    if found <= MAX_PHOTOS {
        return Ok(());
    }
    let (limit, found) = (MAX_PHOTOS as u64, found as u64);
    Err(Error::Limit { what: format!("{}: photos", path.display()), limit, found })
}

/// The lens as the files state it.
struct Calibration {
    /// Focal length along x, principal point from the middle; all in parts of the longer side.
    focal: f64,
    principal: [f64; 2],
    /// fy / fx.
    aspect: f64,
    /// k1, k2, k3, k4, t1, t2.
    coefficients: [f64; 6],
}

impl Calibration {
    fn params(&self, size: Size) -> [f64; 11] {
        let (w, h) = (f64::from(size.width), f64::from(size.height));
        let longer = w.max(h);
        let (fx, [u, v]) = (self.focal * longer, self.principal);
        let [k1, k2, k3, k4, t1, t2] = self.coefficients;
        let (cx, cy) = (0.5 * w + u * longer, 0.5 * h + v * longer);
        // OpenCV's p1 is t2, its p2 t1.
        [fx, fx * self.aspect, cx, cy, 0.0, k1, k2, k3, k4, t2, t1]
    }
}

/// What photos are made with.
struct Reader<'a> {
    /// The folder or the table.
    path: &'a Path,
    folder: PhotoFolder<'a>,
    labels: PhotoLabels,
}

/// Lens and pose, or why the photo is left out.
type Orientation = std::result::Result<(Lens, Pose), String>;

impl Reader<'_> {
    /// The photo of one XMP file, which has its name.
    fn xmp(&self, file: &Path) -> Result<DraftPhoto> {
        let label = file.file_stem().unwrap_or_default().to_string_lossy();
        let place = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let (name, orientation) = match self.labels.name_of(&label) {
            Ok(name) => {
                let orientation = self.xmp_orientation(file, &name)?;
                (name, orientation)
            }
            Err(reason) => (label.into_owned(), Err(reason)),
        };
        Ok(DraftPhoto { name, place, orientation })
    }

    fn xmp_orientation(&self, file: &Path, name: &str) -> Result<Orientation> {
        let document = read_xml(file, &[])?;
        let nodes = document.root();
        let description = nodes.find("Description").unwrap_or(nodes);
        let Some((centre, rotation)) = xmp_pose(description)? else {
            return Ok(Err("its XMP file holds no pose".into()));
        };
        let calibration = match xmp_calibration(description)? {
            Ok(calibration) => calibration,
            Err(reason) => return Ok(Err(reason)),
        };
        let [a, b, c, d, e, f, g, h, i] = rotation;
        let rotation = rotation_of_rows([[a, b, c], [d, e, f], [g, h, i]]);
        let exterior = (rotation, DVec3::from(centre));
        self.oriented((file, &description.place()), name, &calibration, exterior)
    }

    fn oriented(
        &self,
        (path, place): (&Path, &str),
        name: &str,
        calibration: &Calibration,
        (rotation, centre): (DMat3, DVec3),
    ) -> Result<Orientation> {
        let pose =
            pose(rotation, centre).map_err(|e| Error::corrupt(path, place, e.expected, e.found))?;
        let size = match self.folder.size_of(self.path, name)? {
            Ok(size) => size,
            Err(reason) => return Ok(Err(reason)),
        };
        let lens = lens((path, place), LensModel::Brown, size, &calibration.params(size))?;
        Ok(lens.map(|lens| (lens, pose)))
    }

    /// The photos of a table.
    fn table(&self) -> Result<Vec<DraftPhoto>> {
        let path = self.path;
        let bytes = path.metadata().map_err(|e| Error::io(path, e))?.len();
        if bytes > MAX_BYTES {
            let what = format!("{}: bytes of a table", path.display());
            return Err(Error::Limit { what, limit: MAX_BYTES, found: bytes });
        }
        let text = fs::read(path).map_err(|e| Error::io(path, e))?;
        let text = String::from_utf8(text).map_err(|e| {
            let place = format!("byte {}", e.utf8_error().valid_up_to());
            Error::corrupt(path, place, "text in UTF-8", "other bytes")
        })?;
        let text = text.trim_start_matches('\u{feff}');
        if !is_table(text) {
            let found: String = text.lines().next().unwrap_or_default().chars().take(120).collect();
            let expected = format!("the columns #name,{}", COLUMNS.join(","));
            return Err(Error::corrupt(path, "line 1", expected, format!("{found:?}")));
        }
        let mut photos = Vec::new();
        for (number, line) in text.lines().enumerate().skip(1) {
            if !line.trim().is_empty() {
                photos.push(self.row(line, format!("line {}", number + 1))?);
                check_count(path, photos.len())?;
            }
        }
        Ok(photos)
    }

    /// The photo of a line of the table.
    fn row(&self, line: &str, place: String) -> Result<DraftPhoto> {
        let corrupt = |expected: String, found: String| {
            Error::corrupt(self.path, place.clone(), expected, found)
        };
        let mut words = line.split(',').map(str::trim);
        let label = words.next().unwrap_or_default().trim_matches('"');
        let mut values = [0.0; COLUMNS.len()];
        for (value, column) in values.iter_mut().zip(COLUMNS) {
            let word = words.next().unwrap_or_default();
            let number = word.parse().ok().filter(|v: &f64| v.is_finite());
            *value = number.ok_or_else(|| {
                corrupt(format!("a finite number as {column}"), format!("{word:?}"))
            })?;
        }
        if words.next().is_some() {
            return Err(corrupt(format!("{} columns", COLUMNS.len() + 1), "more".into()));
        }
        let [x, y, alt, heading, pitch, roll, f, px, py, k1, k2, k3, k4, t1, t2] = values;
        let calibration = Calibration {
            focal: f / WIDTH_35MM,
            principal: [px, py],
            aspect: 1.0,
            coefficients: [k1, k2, k3, k4, t1, t2],
        };
        let rotation = camera_from_ground([heading, pitch, roll]);
        let (name, orientation) = match self.labels.name_of(label) {
            Ok(name) => {
                let exterior = (rotation, DVec3::new(x, y, alt));
                let oriented = self.oriented((self.path, &place), &name, &calibration, exterior)?;
                (name, oriented)
            }
            Err(reason) => (label.to_owned(), Err(reason)),
        };
        Ok(DraftPhoto { name, place, orientation })
    }
}

/// Position and rotation as they stand.
type StatedPose = ([f64; 3], [f64; 9]);

/// Position and rotation, where the file holds both.
fn xmp_pose(description: Node) -> Result<Option<StatedPose>> {
    let (Some(position), Some(rotation)) =
        (value(description, "Position"), value(description, "Rotation"))
    else {
        return Ok(None);
    };
    Ok(Some((description.numbers_in(position)?, description.numbers_in(rotation)?)))
}

/// A value that stands as an attribute or as a child.
fn value<'a>(description: Node<'a>, name: &str) -> Option<&'a str> {
    description.attribute(name).or_else(|| description.child(name).map(Node::text))
}

/// The calibration; inside, why it cannot be used.
fn xmp_calibration(description: Node) -> Result<std::result::Result<Calibration, String>> {
    let number = |name: &str, otherwise: f64| match value(description, name) {
        Some(text) => description.numbers_in::<1>(text).map(|[v]| v),
        None => Ok(otherwise),
    };
    let focal = number("FocalLength35mm", 0.0)?;
    if focal == 0.0 {
        return Ok(Err("its XMP file holds no focal length".into()));
    }
    if number("Skew", 0.0)? != 0.0 {
        return Ok(Err("a camera with skew is not supported".into()));
    }
    let coefficients = match value(description, "DistortionCoeficients") {
        Some(text) => description.numbers_in::<6>(text)?,
        None => [0.0; 6],
    };
    let model = value(description, "DistortionModel").unwrap_or("perspective");
    // How many of k1 … k4 and whether t1, t2 play a part.
    let (radial, tangential) = match model {
        "perspective" => (0, false),
        "brown3" => (3, false),
        "brown4" => (4, false),
        "brown3t2" => (3, true),
        "brown4t2" => (4, true),
        _ if coefficients.iter().all(|k| *k == 0.0) => (0, false),
        _ => return Ok(Err(format!("a camera with distortion model {model} is not supported"))),
    };
    let mut used = coefficients;
    used[radial..4].fill(0.0);
    if !tangential {
        used[4..].fill(0.0);
    }
    Ok(Ok(Calibration {
        focal: focal / WIDTH_35MM,
        principal: [number("PrincipalPointU", 0.0)?, number("PrincipalPointV", 0.0)?],
        aspect: number("AspectRatio", 1.0)?,
        coefficients: used,
    }))
}

/// Camera axes x right, y down, z forward from heading, pitch and roll in degrees.
fn camera_from_ground(degrees: [f64; 3]) -> DMat3 {
    let turns = degrees.map(|angle| {
        let (sin, cos) = libm::sincos(angle * (std::f64::consts::PI / 180.0));
        [sin, cos]
    });
    let [[sh, ch], [sp, cp], [sr, cr]] = turns;
    let heading = rotation_of_rows([[ch, sh, 0.0], [-sh, ch, 0.0], [0.0, 0.0, 1.0]]);
    let pitch = rotation_of_rows([[1.0, 0.0, 0.0], [0.0, cp, -sp], [0.0, sp, cp]]);
    let roll = rotation_of_rows([[cr, 0.0, sr], [0.0, 1.0, 0.0], [-sr, 0.0, cr]]);
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    flip * (heading * pitch * roll).transpose()
}

#[cfg(test)]
mod tests;
