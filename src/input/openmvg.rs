//! OpenMVG's `sfm_data.json`.
//!
//! Format: OpenMVG's documentation, `sfm_data` format, and the `serialize` functions of its cameras. `rotation` holds the
//! rows of `camera_from_ground`, `center` the projection centre; camera axes x right, y down, z forward; focal length and
//! principal point in pixels. Positions are taken as they stand: OpenMVG does not say whether (0, 0) is the corner or the
//! centre of the first pixel, and its default principal point says the corner.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, DVec3};
use serde::Deserialize;

use super::cameras::{CameraOptions, Draft, PhotoFolder, lens, pose, rotation_of_rows};
use super::json::{self, Id};
use super::views::{Landmark, View, Views};
use crate::camera::{Lens, LensModel};
use crate::geom::Size;
use crate::{Error, Result};

#[derive(Debug, Deserialize)]
struct Scene {
    #[serde(deserialize_with = "json::items")]
    views: Vec<Entry<Pointer<ViewData>>>,
    #[serde(deserialize_with = "json::items")]
    intrinsics: Vec<Entry<Pointer<Camera>>>,
    #[serde(deserialize_with = "json::items")]
    extrinsics: Vec<Entry<PoseData>>,
    #[serde(default, deserialize_with = "json::sampled_items")]
    structure: Vec<Entry<Point>>,
}

#[derive(Debug, Deserialize)]
struct Entry<T> {
    key: Id,
    value: T,
}

#[derive(Debug, Deserialize)]
struct Pointer<T> {
    ptr_wrapper: Data<T>,
}

#[derive(Debug, Deserialize)]
struct Data<T> {
    data: T,
}

#[derive(Debug, Deserialize)]
struct ViewData {
    #[serde(default)]
    local_path: String,
    filename: String,
    id_intrinsic: Id,
    id_pose: Id,
}

#[derive(Debug, Deserialize)]
struct Camera {
    width: u32,
    height: u32,
    focal_length: Option<f64>,
    principal_point: Option<[f64; 2]>,
    disto_k1: Option<[f64; 1]>,
    disto_k3: Option<[f64; 3]>,
    /// `k1, k2, k3, t1, t2`.
    disto_t2: Option<[f64; 5]>,
    fisheye: Option<[f64; 4]>,
}

#[derive(Debug, Deserialize)]
struct PoseData {
    rotation: [[f64; 3]; 3],
    center: [f64; 3],
}

#[derive(Debug, Deserialize)]
struct Point {
    #[serde(rename = "X")]
    position: [f64; 3],
    #[serde(default, deserialize_with = "json::sampled_items")]
    observations: Vec<Entry<Observation>>,
}

#[derive(Debug, Deserialize)]
struct Observation {
    x: [f64; 2],
}

/// Reads a scene.
///
/// # Errors
/// [`Error::Corrupt`] with the line, or the view, intrinsic or extrinsic, for what is no such file.
pub(super) fn read(path: &Path, options: &CameraOptions) -> Result<Draft> {
    let scene: Scene = json::read(path, "a scene of OpenMVG")?;
    let mut all = Views::default();
    for Entry { key, value } in scene.intrinsics {
        let lens = value.ptr_wrapper.data.lens((path, &format!("intrinsic {}", key.0)))?;
        insert(&mut all.cameras, key, lens, (path, "intrinsic"))?;
    }
    for Entry { key, value } in scene.extrinsics {
        let pose = pose(rotation_of_rows(value.rotation), DVec3::from(value.center));
        let place = || format!("extrinsic {}", key.0);
        let pose = pose.map_err(|e| Error::corrupt(path, place(), e.expected, e.found))?;
        insert(&mut all.poses, key, pose, (path, "extrinsic"))?;
    }
    all.photos = scene.views.into_iter().map(view).collect();
    all.landmarks = scene.structure.into_iter().map(landmark).collect();
    all.draft(path, PhotoFolder(options.photos.as_deref()))
}

/// Adds an entry whose key must be new.
fn insert<T>(
    map: &mut BTreeMap<Id, T>,
    key: Id,
    value: T,
    (path, what): (&Path, &str),
) -> Result<()> {
    let place = format!("{what} {}", key.0);
    match map.insert(key, value) {
        None => Ok(()),
        Some(_) => Err(Error::corrupt(path, place, "a key of its own", "it once more")),
    }
}

fn view(Entry { key, value }: Entry<Pointer<ViewData>>) -> View {
    let ViewData { local_path, filename, id_intrinsic, id_pose } = value.ptr_wrapper.data;
    let path = format!("{local_path}/{filename}");
    View { id: key, camera: Some(id_intrinsic), pose: Some(id_pose), path }
}

fn landmark(Entry { value, .. }: Entry<Point>) -> Landmark {
    let seen = value.observations.into_iter();
    let seen = seen.map(|Entry { key, value }| (key, DVec2::from(value.x))).collect();
    Landmark { point_ground: DVec3::from(value.position), seen }
}

impl Camera {
    fn lens(&self, at: (&Path, &str)) -> Result<std::result::Result<Lens, String>> {
        let (Some(focal), Some([x, y])) = (self.focal_length, self.principal_point) else {
            return Ok(Err(
                "its camera has no focal length: spherical photos are not supported".into()
            ));
        };
        let (model, rest) = if let Some([k1, k2, k3, k4]) = self.fisheye {
            (LensModel::OpenCvFisheye, vec![k1, k2, k3, k4])
        } else if let Some([k1, k2, k3, t1, t2]) = self.disto_t2 {
            (LensModel::FullOpenCv, vec![k1, k2, t1, t2, k3, 0.0, 0.0, 0.0])
        } else if let Some([k1, k2, k3]) = self.disto_k3 {
            (LensModel::FullOpenCv, vec![k1, k2, 0.0, 0.0, k3, 0.0, 0.0, 0.0])
        } else {
            let [k1] = self.disto_k1.unwrap_or_default();
            (LensModel::OpenCv, vec![k1, 0.0, 0.0, 0.0])
        };
        let params = [&[focal, focal, x, y], &rest[..]].concat();
        lens(at, model, Size::new(self.width, self.height), &params)
    }
}
