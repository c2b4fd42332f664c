//! The plain table of classical photogrammetry: CSV, a photo a line.
//!
//! ```text
//! name,X0,Y0,Z0,omega,phi,kappa,c,x0,y0,k1,k2,k3,p1,p2
//! ```
//!
//! The header stands as it is written here; lines that begin with `#` are passed over. `X0, Y0, Z0` is the projection
//! centre, ground, metres. `R = Rx(ω) · Ry(φ) · Rz(κ)` turns camera axes to the ground, the camera's x right, y *up* and z
//! *backward*; the unit of the angles is an option and never guessed. `c` is the camera constant, `x0, y0` the principal
//! point from the picture's centre, x right and y *up*: pixels, or millimetres with a pixel pitch. The photos' sizes are
//! those of their files. What the coefficients mean: [`TableLens`].

use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};
use glam::{DMat3, DVec2, DVec3};

use super::cameras::{
    CameraOptions, Draft, DraftPhoto, PhotoFolder, TableLens, lens, pose, rotation_of_rows,
};
use super::corrections::{Corrections, inverse};
use crate::camera::{LensModel, Pose};
use crate::geom::Size;
use crate::{Error, Result};

/// The columns after the name.
const COLUMNS: [&str; 14] =
    ["X0", "Y0", "Z0", "omega", "phi", "kappa", "c", "x0", "y0", "k1", "k2", "k3", "p1", "p2"];
/// The longest file, bytes: that of a million photos with names of a hundred letters and fifteen digits a number.
const MAX_BYTES: u64 = 1 << 29;

/// Whether a table begins with this line.
pub(super) fn is_header(line: &str) -> bool {
    let mut words = line.trim().split(',').map(|word| word.trim().trim_matches('"'));
    words.next() == Some("name") && words.eq(COLUMNS)
}

/// Reads a table.
///
/// # Errors
/// [`Error::Usage`] without a unit of angles or, since sizes are those of the files, without the folder of the photos;
/// [`Error::Corrupt`] with line and column for anything that is no such table; [`Error::Limit`] above 512 MiB.
pub(super) fn read(path: &Path, options: &CameraOptions) -> Result<Draft> {
    let Some(unit) = options.angle_unit else {
        let path = path.display();
        return Err(Error::usage(format!(
            "--angle-unit is missing (in a project file: `angle_unit`): {path} does not state whether its angles are deg, gon or rad"
        )));
    };
    let bytes = path.metadata().map_err(|e| Error::io(path, e))?.len();
    if bytes > MAX_BYTES {
        let what = format!("{}: bytes of a table", path.display());
        return Err(Error::Limit { what, limit: MAX_BYTES, found: bytes });
    }
    let mut table = ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(Trim::All)
        .from_path(path)
        .map_err(|e| fault(path, e))?;
    let header = table.headers().map_err(|e| fault(path, e))?;
    if header.get(0) != Some("name") || !header.iter().skip(1).eq(COLUMNS) {
        let expected = format!("the columns name,{}", COLUMNS.join(","));
        let found = header.iter().collect::<Vec<_>>().join(",");
        let found: String = found.chars().take(200).collect();
        return Err(Error::corrupt(path, "line 1", expected, format!("{found:?}")));
    }
    let reader = Reader { path, options, unit_rad: unit.radians() };
    let mut draft = Draft::default();
    for record in table.records() {
        let record = record.map_err(|e| fault(path, e))?;
        draft.photos.push(reader.photo(&record)?);
    }
    Ok(draft)
}

/// What the CSV reader finds fault with.
fn fault(path: &Path, error: csv::Error) -> Error {
    let place =
        error.position().map_or_else(|| "the whole".into(), |p| format!("line {}", p.line()));
    let is_io = error.is_io_error();
    match error.into_kind() {
        csv::ErrorKind::Io(e) if is_io => Error::io(path, e),
        csv::ErrorKind::UnequalLengths { len, .. } => {
            let found = format!("{len} columns");
            Error::corrupt(path, place, format!("{} columns", COLUMNS.len() + 1), found)
        }
        csv::ErrorKind::Utf8 { .. } => Error::corrupt(path, place, "text in UTF-8", "other bytes"),
        _ => Error::corrupt(path, place, "comma-separated values", "something else"),
    }
}

/// Makes photos of lines.
struct Reader<'a> {
    path: &'a Path,
    options: &'a CameraOptions,
    /// A unit of the angles.
    unit_rad: f64,
}

impl Reader<'_> {
    fn photo(&self, record: &StringRecord) -> Result<DraftPhoto> {
        let line = record.position().map_or(0, csv::Position::line);
        let place = format!("line {line}");
        let mut values = [0.0; COLUMNS.len()];
        for ((value, column), text) in values.iter_mut().zip(COLUMNS).zip(record.iter().skip(1)) {
            let number = text.parse::<f64>().ok().filter(|v| v.is_finite());
            *value = number.ok_or_else(|| {
                let place = format!("{place}, column {column}");
                Error::corrupt(self.path, place, "a finite number", format!("{text:?}"))
            })?;
        }
        let name = record.get(0).unwrap_or_default().replace('\\', "/");
        let [x0, y0, z0, omega, phi, kappa, ..] = values;
        let angles = [omega, phi, kappa].map(|angle| angle * self.unit_rad);
        let pose = pose(camera_from_ground(angles), DVec3::new(x0, y0, z0))
            .map_err(|e| Error::corrupt(self.path, place.clone(), e.expected, e.found))?;
        let orientation = self.orientation(&name, &place, pose, &values[6..])?;
        Ok(DraftPhoto { name, place, orientation })
    }

    /// The lens of `c, x0, y0, k1, k2, k3, p1, p2`, and the pose.
    fn orientation(
        &self,
        name: &str,
        place: &str,
        pose: Pose,
        inner: &[f64],
    ) -> Result<std::result::Result<(crate::camera::Lens, Pose), String>> {
        // A name that leads out of the photo folder is refused before anything is opened.
        if let Some((expected, found)) = super::cameras::name_fault(name) {
            return Err(Error::corrupt(self.path, place, expected, found));
        }
        let photos = PhotoFolder(self.options.photos.as_deref());
        let size = match photos.size_of(self.path, name)? {
            Ok(size) => size,
            Err(reason) => return Ok(Err(reason)),
        };
        let (model, params) = match self.params(size, inner) {
            Ok(found) => found,
            Err(reason) => return Ok(Err(reason)),
        };
        let lens = lens((self.path, place), model, size, &params)?;
        Ok(lens.map(|lens| (lens, pose)))
    }

    /// The model, `FULL_OPENCV` without a denominator but for corrections, and its parameters; else why the photo is left
    /// out.
    fn params(
        &self,
        size: Size,
        inner: &[f64],
    ) -> std::result::Result<(LensModel, Vec<f64>), String> {
        let &[c, x0, y0, k1, k2, k3, p1, p2] = inner else { return Err("no lens".into()) };
        let scale = match self.options.lens {
            TableLens::OpenCv => 1.0,
            // Positions in units of c are c times as great as those divided by it.
            TableLens::Classical | TableLens::Corrections => c,
        };
        let square = scale * scale;
        let pixel = self.options.pixel_pitch_mm.unwrap_or(1.0);
        let centre = DVec2::new(f64::from(size.width), f64::from(size.height)) * 0.5;
        let principal = centre + DVec2::new(x0, -y0) / pixel;
        let focal = c / pixel;
        let [k1, k2, k3] = [k1 * square, k2 * square * square, k3 * square * square * square];
        let [p1, p2] = [p1 * scale, p2 * scale];
        let mut params = vec![focal, focal, principal.x, principal.y];
        if self.options.lens == TableLens::Corrections && focal > 0.0 {
            let corrections = Corrections { k: [k1, k2, k3], p: [p1, p2] };
            let [k1, k2, k3, k4, p1, p2] =
                inverse(&corrections, size, principal, focal).map_err(|off| {
                    format!("the lens nearest to its corrections is off by {off:.3} pixel")
                })?;
            params.extend([0.0, k1, k2, k3, k4, p1, p2]);
            return Ok((LensModel::Brown, params));
        }
        params.extend([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]);
        Ok((LensModel::FullOpenCv, params))
    }
}

/// `diag(1, −1, −1) · (Rx(ω) · Ry(φ) · Rz(κ))ᵀ`: ground to camera axes with y down and z forward; angles in radians.
fn camera_from_ground([omega, phi, kappa]: [f64; 3]) -> DMat3 {
    let sin_cos = |angle: f64| (libm::sin(angle), libm::cos(angle));
    let ((so, co), (sp, cp), (sk, ck)) = (sin_cos(omega), sin_cos(phi), sin_cos(kappa));
    let about_x = rotation_of_rows([[1.0, 0.0, 0.0], [0.0, co, -so], [0.0, so, co]]);
    let about_y = rotation_of_rows([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]]);
    let about_z = rotation_of_rows([[ck, -sk, 0.0], [sk, ck, 0.0], [0.0, 0.0, 1.0]]);
    let ground_from_camera = about_x * about_y * about_z;
    DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * ground_from_camera.transpose()
}
