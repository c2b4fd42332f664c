//! [`read`]: the orientations of a folder.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};

use super::calibration::{lens_of, other_convention};
use crate::camera::{Lens, Pose};
use crate::input::cameras::{
    CameraOptions, Draft, DraftPhoto, MAX_PHOTOS, MOST_TIES, Thinned, Tie, pose, rotation_of_rows,
};
use crate::input::labels::PhotoLabels;
use crate::input::xml::{Node, read_xml};
use crate::{Error, Result};

/// Begin and end of an orientation's file name; between them stands the photo's.
const NAME: [&str; 2] = ["Orientation-", ".xml"];

/// A calibration's lens, or why its photos are left out.
type CalibrationLens = std::result::Result<Lens, String>;

/// Whether the folder holds orientations.
pub(in crate::input) fn is_folder(path: &Path) -> Result<bool> {
    Ok(!orientations(path)?.is_empty())
}

/// Reads the orientations in the folder at `path`.
///
/// # Errors
/// [`Error::Corrupt`] with file and line for what is not of this format, or a calibration that is not beside its
/// orientation; [`Error::Limit`] for more than a million photos.
pub(in crate::input) fn read(path: &Path, options: &CameraOptions) -> Result<Draft> {
    let mut reader = Reader {
        labels: PhotoLabels::of(options.photos.as_deref())?,
        calibrations: BTreeMap::new(),
        ties: Thinned::new(MOST_TIES),
    };
    let files = orientations(path)?;
    if files.is_empty() {
        let expected = format!("files {}PHOTO{}", NAME[0], NAME[1]);
        return Err(Error::corrupt(path, "the folder", expected, "none"));
    }
    let mut photos = Vec::new();
    for (label, file) in files {
        photos.push(reader.photo(photos.len(), &label, &file)?);
    }
    Ok(Draft { photos, ties: reader.ties.into_items() })
}

/// Photos' names and their files, by name.
fn orientations(folder: &Path) -> Result<Vec<(String, PathBuf)>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let entry = entry.map_err(|e| Error::io(folder, e))?;
        let Ok(name) = entry.file_name().into_string() else { continue };
        let Some(label) = name.strip_prefix(NAME[0]).and_then(|n| n.strip_suffix(NAME[1])) else {
            continue;
        };
        if files.len() == MAX_PHOTOS {
            let (limit, what) = (MAX_PHOTOS as u64, format!("{}: photos", folder.display()));
            return Err(Error::Limit { what, limit, found: limit + 1 });
        }
        files.push((label.to_owned(), entry.path()));
    }
    files.sort_unstable();
    Ok(files)
}

/// What photos are made with.
struct Reader {
    labels: PhotoLabels,
    /// By file.
    calibrations: BTreeMap<PathBuf, CalibrationLens>,
    ties: Thinned<Tie>,
}

impl Reader {
    /// The photo of number `index`, named in the name of its file.
    fn photo(&mut self, index: usize, label: &str, file: &Path) -> Result<DraftPhoto> {
        let place = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let document = read_xml(file, &[])?;
        let root = document.root();
        let Some(orientation) = root.find("OrientationConique") else {
            return Err(
                root.corrupt("an element <OrientationConique>", format!("<{}>", root.name()))
            );
        };
        let oriented = self.oriented(file, orientation)?;
        if oriented.is_ok() {
            self.add_ties(index, orientation)?;
        }
        let (name, orientation) = match self.labels.name_of(label) {
            Ok(name) => (name, oriented),
            Err(reason) => (label.to_owned(), oriented.and(Err(reason))),
        };
        Ok(DraftPhoto { name, place, orientation })
    }

    /// Lens and pose; inside, why the photo is left out.
    fn oriented(
        &mut self,
        file: &Path,
        node: Node,
    ) -> Result<std::result::Result<(Lens, Pose), String>> {
        if let Some(kind) = node.child("TypeProj").map(Node::text)
            && kind != "eProjStenope"
        {
            return Ok(Err(format!("the projection {kind} is not supported")));
        }
        if let Some(affinity) = node.child("OrIntImaM2C")
            && !is_identity(affinity)?
        {
            return Ok(Err("an orientation with OrIntImaM2C is not supported".into()));
        }
        let exterior = node.needed_child("Externe")?;
        let convention =
            other_convention(exterior).or_else(|| node.child("ConvOri").and_then(other_convention));
        if let Some(reason) = convention {
            return Ok(Err(reason));
        }
        let rotation = exterior.needed_child("ParamRotation")?;
        let Some(matrix) = rotation.child("CodageMatr") else {
            return Ok(Err("a rotation without CodageMatr is not supported".into()));
        };
        let row = |name: &str| matrix.needed_child(name)?.numbers::<3>();
        let ground_from_camera = rotation_of_rows([row("L1")?, row("L2")?, row("L3")?]);
        let centre = DVec3::from(exterior.needed_child("Centre")?.numbers::<3>()?);
        let pose = pose(ground_from_camera.transpose(), centre)
            .map_err(|e| matrix.corrupt(e.expected, e.found))?;
        Ok(self.lens(file, node)?.map(|lens| (lens, pose)))
    }

    /// The lens, in the orientation itself or in the file that it names, which lies beside it.
    fn lens(&mut self, file: &Path, node: Node) -> Result<CalibrationLens> {
        if let Some(calibration) = node.child("Interne") {
            return lens_of(file, calibration);
        }
        let named = node.needed_child("FileInterne")?;
        let name = named.text().rsplit(['/', '\\']).next().unwrap_or_default();
        let path = file.with_file_name(name);
        if let Some(lens) = self.calibrations.get(&path) {
            return Ok(lens.clone());
        }
        if name.is_empty() || !path.is_file() {
            let found = format!("no {name:?}");
            return Err(named.corrupt("a calibration file beside this one", found));
        }
        let document = read_xml(&path, &[])?;
        let root = document.root();
        let Some(calibration) = root.find("CalibrationInternConique") else {
            return Err(
                root.corrupt("an element <CalibrationInternConique>", format!("<{}>", root.name()))
            );
        };
        let lens = lens_of(&path, calibration)?;
        self.calibrations.insert(path, lens.clone());
        Ok(lens)
    }

    /// The points that `MicMac` itself projected for a check.
    fn add_ties(&mut self, photo: usize, node: Node) -> Result<()> {
        let Some(check) = node.child("Verif") else { return Ok(()) };
        for point in check.children_named("Appuis") {
            let position: [f64; 2] = point.needed_child("Im")?.numbers()?;
            let ground: [f64; 3] = point.needed_child("Ter")?.numbers()?;
            self.ties.offer(|| Tie {
                photo,
                position_px: DVec2::from(position) + 0.5,
                point_ground: DVec3::from(ground),
            });
        }
        Ok(())
    }
}

/// Whether an affine map of the image does nothing.
fn is_identity(affinity: Node) -> Result<bool> {
    for (name, wanted) in [("I00", DVec2::ZERO), ("V10", DVec2::X), ("V01", DVec2::Y)] {
        let found = DVec2::from(affinity.needed_child(name)?.numbers::<2>()?);
        if found != wanted {
            return Ok(false);
        }
    }
    Ok(true)
}
