//! [`read`]: the reconstruction.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat3, DVec3};
use serde::Deserialize;

use super::camera::Camera;
use super::tracks;
use crate::camera::{Lens, Pose};
use crate::geom::Size;
use crate::input::cameras::{Draft, DraftPhoto, lens, pose, rotation_of_rows};
use crate::input::json;
use crate::{Error, Result};

/// The file's list of reconstructions.
#[derive(Debug, Deserialize)]
#[serde(transparent)]
struct Reconstructions {
    #[serde(deserialize_with = "json::items")]
    list: Vec<Reconstruction>,
}

#[derive(Debug, Deserialize)]
struct Reconstruction {
    #[serde(deserialize_with = "json::members")]
    cameras: Vec<(String, Camera)>,
    #[serde(deserialize_with = "json::members")]
    shots: Vec<(String, Shot)>,
    #[serde(default, deserialize_with = "json::sampled_members")]
    points: Vec<(String, Point)>,
}

#[derive(Debug, Deserialize)]
struct Shot {
    camera: String,
    rotation: [f64; 3],
    translation: [f64; 3],
}

#[derive(Debug, Deserialize)]
struct Point {
    coordinates: [f64; 3],
}

/// A lens with the photo's size, or why its photos are left out.
type CameraLens = (Size, std::result::Result<Lens, String>);

/// Reads a reconstruction, and the tie points of the tracks beside it.
///
/// # Errors
/// [`Error::Corrupt`] with the line, or the camera or shot, for what is no such file.
pub(in crate::input) fn read(path: &Path) -> Result<Draft> {
    let Reconstructions { list } = json::read(path, "a reconstruction of OpenSfM")?;
    let mut list = list.into_iter();
    let mut draft = Draft::default();
    let Some(Reconstruction { cameras, shots, mut points }) = list.next() else {
        return Ok(draft);
    };
    let cameras = lenses(path, cameras)?;
    let mut sizes = BTreeMap::new();
    for (name, shot) in shots {
        let place = format!("shot {name:?}");
        let Some((size, lens)) = cameras.get(&shot.camera) else {
            let found = format!("{:?}", shot.camera);
            return Err(Error::corrupt(path, place, "the name of a camera of the file", found));
        };
        let pose = shot_pose(path, &place, &shot)?;
        sizes.insert(name.clone(), (draft.photos.len(), *size));
        let orientation = lens.clone().map(|lens| (lens, pose));
        draft.photos.push(DraftPhoto { name, place, orientation });
    }
    for (name, _) in list.flat_map(|other| other.shots) {
        // A photo may stand in several reconstructions.
        if !sizes.contains_key(&name) {
            sizes.insert(name.clone(), (draft.photos.len(), Size::new(1, 1)));
            let reason = "it belongs to another reconstruction of the file than the first";
            let place = format!("shot {name:?}");
            draft.photos.push(DraftPhoto { name, place, orientation: Err(reason.into()) });
        }
    }
    points.sort_by(|a, b| a.0.cmp(&b.0));
    let points: Vec<_> = points.into_iter().map(|(id, p)| (id, p.coordinates.into())).collect();
    draft.ties = tracks::read(&path.with_file_name("tracks.csv"), &sizes, &points)?;
    Ok(draft)
}

fn lenses(path: &Path, cameras: Vec<(String, Camera)>) -> Result<BTreeMap<String, CameraLens>> {
    let mut lenses = BTreeMap::new();
    for (name, camera) in cameras {
        let place = format!("camera {name:?}");
        let made = match camera.lens() {
            Ok((model, params)) => lens((path, &place), model, camera.size(), &params)?,
            Err(reason) => Err(reason),
        };
        if lenses.insert(name, (camera.size(), made)).is_some() {
            return Err(Error::corrupt(path, place, "a camera name of its own", "it once more"));
        }
    }
    Ok(lenses)
}

fn shot_pose(path: &Path, place: &str, shot: &Shot) -> Result<Pose> {
    let rotation = rotation_about(DVec3::from(shot.rotation));
    let centre = -(rotation.transpose() * DVec3::from(shot.translation));
    pose(rotation, centre).map_err(|e| Error::corrupt(path, place, e.expected, e.found))
}

/// The rotation about an axis by the axis' length, radians: Rodrigues' formula.
fn rotation_about(axis: DVec3) -> DMat3 {
    let angle = axis.length();
    if angle == 0.0 {
        return DMat3::IDENTITY;
    }
    let DVec3 { x, y, z } = axis / angle;
    let cross = rotation_of_rows([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]);
    DMat3::IDENTITY + cross * libm::sin(angle) + cross * cross * (1.0 - libm::cos(angle))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_about_z_sends_x_to_y() {
        let turn = rotation_about(DVec3::Z * std::f64::consts::FRAC_PI_2);
        assert!((turn * DVec3::X - DVec3::Y).length() < 1e-15);
        assert_eq!(rotation_about(DVec3::ZERO), DMat3::IDENTITY);
    }
}
