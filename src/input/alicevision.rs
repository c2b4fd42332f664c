//! `AliceVision`'s and Meshroom's `.sfm`, as JSON, in which numbers may be texts.
//!
//! Format: `sfmDataIO/jsonIO.cpp` of `AliceVision`. The nine numbers of `rotation` are the *columns* of `camera_from_ground`,
//! `center` is the projection centre; camera axes x right, y down, z forward. The principal point is the offset from the
//! picture's centre, in pixels; before version 1.2.1 it counted from the corner. The focal length is in millimetres of
//! `sensorWidth`; before 1.2.2 it was `pxFocalLength`.

use std::path::Path;

use glam::{DMat3, DVec2, DVec3};
use serde::Deserialize;

use super::cameras::{CameraOptions, Draft, PhotoFolder, lens, pose};
use super::json::{self, Id, Number};
use super::views::{Landmark, View, Views};
use crate::camera::{Lens, LensModel};
use crate::geom::Size;
use crate::{Error, Result};

#[derive(Debug, Deserialize)]
struct Scene {
    version: [Number; 3],
    #[serde(default, deserialize_with = "json::items")]
    views: Vec<ViewData>,
    #[serde(default, deserialize_with = "json::items")]
    intrinsics: Vec<Camera>,
    #[serde(default, deserialize_with = "json::items")]
    poses: Vec<PoseEntry>,
    #[serde(default, deserialize_with = "json::sampled_items")]
    structure: Vec<Point>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct ViewData {
    view_id: Id,
    pose_id: Option<Id>,
    intrinsic_id: Option<Id>,
    path: String,
    /// `0` for a photo of a rig, whose pose is that of the rig.
    is_pose_independant: Option<Id>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Camera {
    intrinsic_id: Id,
    width: Number,
    height: Number,
    #[serde(default)]
    r#type: String,
    #[serde(default)]
    distortion_type: String,
    #[serde(default)]
    undistortion_type: String,
    sensor_width: Option<Number>,
    focal_length: Option<Number>,
    px_focal_length: Option<OneOrTwo>,
    pixel_ratio: Option<Number>,
    principal_point: Option<[Number; 2]>,
    #[serde(default, deserialize_with = "json::items")]
    distortion_params: Vec<Number>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged)]
enum OneOrTwo {
    One(Number),
    Two([Number; 2]),
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct PoseEntry {
    pose_id: Id,
    pose: PoseData,
}

#[derive(Debug, Deserialize)]
struct PoseData {
    transform: Transform,
}

#[derive(Debug, Deserialize)]
struct Transform {
    rotation: [Number; 9],
    center: [Number; 3],
}

#[derive(Debug, Deserialize)]
struct Point {
    #[serde(rename = "X")]
    position: [Number; 3],
    #[serde(default, deserialize_with = "json::sampled_items")]
    observations: Vec<Observation>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Observation {
    observation_id: Id,
    x: Option<[Number; 2]>,
}

/// Reads a scene.
///
/// # Errors
/// [`Error::Corrupt`] with the line, or the view, intrinsic or pose, for what is no such file.
pub(super) fn read(path: &Path, options: &CameraOptions) -> Result<Draft> {
    let scene: Scene = json::read(path, "a scene of AliceVision")?;
    let version = scene.version.map(|n| n.0);
    let mut all = Views::default();
    for camera in scene.intrinsics {
        let place = format!("intrinsic {}", camera.intrinsic_id.0);
        let lens = camera.lens((path, &place), version)?;
        if all.cameras.insert(camera.intrinsic_id, lens).is_some() {
            return Err(Error::corrupt(path, place, "an id of its own", "it once more"));
        }
    }
    for PoseEntry { pose_id, pose: PoseData { transform } } in scene.poses {
        let place = format!("pose {}", pose_id.0);
        let rotation = DMat3::from_cols_array(&transform.rotation.map(|n| n.0));
        let pose = pose(rotation, DVec3::from(transform.center.map(|n| n.0)))
            .map_err(|e| Error::corrupt(path, place.clone(), e.expected, e.found))?;
        if all.poses.insert(pose_id, pose).is_some() {
            return Err(Error::corrupt(path, place, "an id of its own", "it once more"));
        }
    }
    all.photos = scene.views.into_iter().map(view).collect();
    all.landmarks = scene.structure.into_iter().map(landmark).collect();
    all.draft(path, PhotoFolder(options.photos.as_deref()))
}

fn view(data: ViewData) -> View {
    // The pose of a rig is not that of its photos.
    let of_rig = data.is_pose_independant.is_some_and(|id| id.0 == "0" || id.0 == "false");
    let pose = data.pose_id.filter(|_| !of_rig);
    View { id: data.view_id, camera: data.intrinsic_id, pose, path: data.path }
}

fn landmark(point: Point) -> Landmark {
    let seen = point.observations.into_iter();
    let seen = seen.filter_map(|o| Some((o.observation_id, DVec2::from(o.x?.map(|n| n.0)))));
    Landmark { point_ground: DVec3::from(point.position.map(|n| n.0)), seen: seen.collect() }
}

impl Camera {
    fn lens(
        &self,
        at: (&Path, &str),
        version: [f64; 3],
    ) -> Result<std::result::Result<Lens, String>> {
        let model = match self.model() {
            Ok(model) => model,
            Err(reason) => return Ok(Err(reason)),
        };
        let size = [self.width.0, self.height.0];
        let Some(focal) = self.focal_px(version) else {
            return Ok(Err("its camera has no focal length".into()));
        };
        let corner = if version < [1.0, 2.0, 1.0] { [0.0; 2] } else { size.map(|side| 0.5 * side) };
        let offset = self.principal_point.map_or([0.0; 2], |p| p.map(|n| n.0));
        let centre = [corner[0] + offset[0], corner[1] + offset[1]];
        let k = |i: usize| self.distortion_params.get(i).map_or(0.0, |n| n.0);
        let rest = match model {
            LensModel::OpenCvFisheye => vec![k(0), k(1), k(2), k(3)],
            LensModel::FullOpenCv => vec![k(0), k(1), k(3), k(4), k(2), 0.0, 0.0, 0.0],
            _ => Vec::new(),
        };
        let params = [&focal, &centre, &rest[..]].concat();
        let whole = |side: f64| {
            let fits = side >= 0.0 && side <= f64::from(u32::MAX) && side.fract() == 0.0;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
            fits.then_some(side as u32)
        };
        let [Some(width), Some(height)] = size.map(whole) else {
            let found = format!("{} x {}", size[0], size[1]);
            return Err(Error::corrupt(at.0, at.1, "a photo size in whole pixels", found));
        };
        lens(at, model, Size::new(width, height), &params)
    }

    /// The model; else why its photos are left out.
    fn model(&self) -> std::result::Result<LensModel, String> {
        let names = [self.r#type.as_str(), self.distortion_type.as_str()];
        let is_plain = matches!(self.undistortion_type.as_str(), "" | "none");
        match names.map(str::trim) {
            ["pinhole", "" | "none"] if is_plain => Ok(LensModel::Pinhole),
            ["radial1" | "radial3" | "brown", _]
            | ["pinhole", "radialk1" | "radialk3" | "brown"]
                if is_plain =>
            {
                Ok(LensModel::FullOpenCv)
            }
            ["fisheye4", _] | ["pinhole", "fisheye4"] if is_plain => Ok(LensModel::OpenCvFisheye),
            [kind, distortion] => {
                Err(format!("the camera {kind:?} {distortion:?} of AliceVision is not supported"))
            }
        }
    }

    /// Focal lengths along x and y, pixels.
    fn focal_px(&self, version: [f64; 3]) -> Option<[f64; 2]> {
        if version < [1.0, 2.0, 2.0] {
            return Some(match self.px_focal_length? {
                OneOrTwo::One(focal) => [focal.0; 2],
                OneOrTwo::Two(focal) => focal.map(|n| n.0),
            });
        }
        let focal = self.focal_length?.0 / self.sensor_width?.0 * self.width.0;
        let ratio = self.pixel_ratio.map_or(1.0, |n| n.0);
        // Before 1.2.5 the ratio of the focal lengths stood under this name.
        let down = if version < [1.0, 2.0, 5.0] { focal / ratio } else { focal * ratio };
        Some([focal, down])
    }
}
