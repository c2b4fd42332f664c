//! [`FrameSpec`]: a checked frame of any kind.

use glam::DVec3;

use super::check::{self, FrameError};
use super::plane::Plane;
use super::table::{CameraTable, FrameTable, PoseTable};
use crate::camera::{Lens, LensModel, Pose};
use crate::geom::Size;

/// What the mosaic is drawn on.
#[derive(Debug, Clone, PartialEq)]
pub enum FrameSpec {
    /// Parallel projection on a plane.
    Plane(Plane),
    /// Development of a cylinder; not drawn yet.
    Cylinder(Cylinder),
    /// Central projection; not drawn yet.
    Perspective(Perspective),
}

/// A cylinder frame: u = s · radius · angle, v along the axis, elevation from the surface towards the viewer.
#[derive(Debug, Clone, PartialEq)]
pub struct Cylinder {
    /// The point of the axis where v = 0, ground, metres.
    pub origin: DVec3,
    /// Unit vector along +v.
    pub axis: DVec3,
    /// Unit vector in which u = 0, square to the axis.
    pub zero: DVec3,
    /// Metres.
    pub radius: f64,
    /// Where the viewer stands.
    pub facing: Facing,
    /// Side of a pixel, metres.
    pub pixel_size: Option<f64>,
    /// `[u_min, v_min, u_max, v_max]`, metres.
    pub extent: Option<[f64; 4]>,
    /// `[min, max]` of elevation, metres.
    pub elevation: Option<[f64; 2]>,
}

/// From where a cylinder is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Facing {
    /// From outside, towards the axis.
    Outside,
    /// From the axis outward.
    Inside,
}

/// A perspective frame: the mosaic is what a camera sees.
#[derive(Debug, Clone, PartialEq)]
pub struct Perspective {
    /// The camera.
    pub orientation: Orientation,
    /// `[min, max]` of depth, metres.
    pub elevation: Option<[f64; 2]>,
}

/// Interior and exterior orientation of a perspective frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Orientation {
    /// Those of a photo of the whole camera set.
    OfPhoto {
        /// Its name.
        name: String,
        /// Whether the lens's distortion is drawn too.
        distorted: bool,
    },
    /// Given in the frame; drawn as the model says.
    Given(Box<GivenCamera>),
}

impl Facing {
    /// As frame files have it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Outside => "outside",
            Self::Inside => "inside",
        }
    }
}

/// A camera stated in a frame: checked, and as it was typed.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenCamera {
    /// Interior orientation.
    pub lens: Lens,
    /// Exterior orientation.
    pub pose: Pose,
    /// As typed.
    pub(super) camera: CameraTable,
    /// As typed.
    pub(super) pose_table: PoseTable,
}

impl Cylinder {
    /// Checks that an extent spans at most one turn.
    pub(super) fn check_span(&self, extent: &[f64; 4]) -> std::result::Result<(), FrameError> {
        let (turn, span) = (2.0 * std::f64::consts::PI * self.radius, extent[2] - extent[0]);
        if span > turn * (1.0 + 1e-9) {
            let expected = format!("a span in u of at most one turn, {turn:?} m");
            return Err(FrameError::new("extent", expected, format!("{span:?} m")));
        }
        Ok(())
    }
}

impl FrameTable {
    /// The frame, every key checked.
    ///
    /// # Errors
    /// The first key that is missing, does not belong to the kind, or has a value that makes no sense.
    pub fn check(self) -> std::result::Result<FrameSpec, FrameError> {
        match self.kind.as_str() {
            "plane" => self.plane().map(FrameSpec::Plane),
            "cylinder" => self.cylinder().map(FrameSpec::Cylinder),
            "perspective" => self.perspective().map(FrameSpec::Perspective),
            other => {
                let expected = "\"plane\", \"cylinder\" or \"perspective\"";
                Err(FrameError::new("kind", expected, format!("{other:?}")))
            }
        }
    }

    fn plane(self) -> std::result::Result<Plane, FrameError> {
        self.refuse(&["axis", "zero", "radius", "facing", "photo", "distorted", "camera", "pose"])?;
        let plane = Plane::new(
            self.need("origin", self.origin)?,
            self.need("u_axis", self.u_axis)?,
            self.need("v_axis", self.v_axis)?,
        )?;
        let plane = Plane {
            pixel_size: self.pixel_size.map(|p| check::positive("pixel_size", p)).transpose()?,
            extent: self.extent.map(check::extent).transpose()?,
            elevation: self.elevation.map(check::elevation).transpose()?,
            ..plane
        };
        match &self.crs {
            Some(crs) => plane.with_crs(crs),
            None => Ok(plane),
        }
    }

    fn cylinder(self) -> std::result::Result<Cylinder, FrameError> {
        self.refuse(&["u_axis", "v_axis", "crs", "photo", "distorted", "camera", "pose"])?;
        let origin = check::finite("origin", self.need("origin", self.origin)?)?;
        let axis = check::finite("axis", self.need("axis", self.axis)?)?;
        let zero = check::finite("zero", self.need("zero", self.zero)?)?;
        let [axis, zero] = check::orthonormal(["axis", "zero"], axis, zero)?;
        let radius = check::positive("radius", self.need("radius", self.radius)?)?;
        let facing = match self.need("facing", self.facing.as_deref())? {
            "outside" => Facing::Outside,
            "inside" => Facing::Inside,
            other => {
                let found = format!("{other:?}");
                return Err(FrameError::new("facing", "\"outside\" or \"inside\"", found));
            }
        };
        let extent = self.extent.map(check::extent).transpose()?;
        let cylinder = Cylinder {
            origin,
            axis,
            zero,
            radius,
            facing,
            pixel_size: self.pixel_size.map(|p| check::positive("pixel_size", p)).transpose()?,
            extent,
            elevation: self.elevation.map(check::elevation).transpose()?,
        };
        if let Some(extent) = &extent {
            cylinder.check_span(extent)?;
        }
        Ok(cylinder)
    }

    fn perspective(self) -> std::result::Result<Perspective, FrameError> {
        self.refuse(&["pixel_size", "extent", "origin", "u_axis", "v_axis", "crs"])?;
        self.refuse(&["axis", "zero", "radius", "facing"])?;
        let elevation = self.elevation.map(check::elevation).transpose()?;
        let orientation = match (&self.photo, &self.camera, &self.pose) {
            (Some(name), None, None) => Orientation::OfPhoto {
                name: name.clone(),
                distorted: self.distorted.unwrap_or(false),
            },
            (None, Some(camera), Some(pose)) => {
                if self.distorted.is_some() {
                    let expected = "only a photo to be drawn with or without distortion";
                    return Err(FrameError::new("distorted", expected, "a camera of its own"));
                }
                Orientation::Given(Box::new(GivenCamera {
                    lens: lens(camera)?,
                    pose: self::pose(pose)?,
                    camera: camera.clone(),
                    pose_table: pose.clone(),
                }))
            }
            (Some(_), ..) => {
                let expected = "either a photo or a camera with a pose";
                return Err(FrameError::new("photo", expected, "both"));
            }
            (None, None, _) => {
                return Err(FrameError::new("camera", "a photo, or a camera with a pose", "none"));
            }
            (None, Some(_), None) => {
                return Err(FrameError::new("pose", "a pose with the camera", "none"));
            }
        };
        Ok(Perspective { orientation, elevation })
    }

    fn need<T>(&self, key: &'static str, value: Option<T>) -> std::result::Result<T, FrameError> {
        let expected = || format!("a value, which a {} needs", self.kind);
        value.ok_or_else(|| FrameError::new(key, expected(), "none"))
    }

    /// An error if one of these keys is given.
    fn refuse(&self, keys: &[&'static str]) -> std::result::Result<(), FrameError> {
        let is_given = |key: &str| match key {
            "origin" => self.origin.is_some(),
            "u_axis" => self.u_axis.is_some(),
            "v_axis" => self.v_axis.is_some(),
            "pixel_size" => self.pixel_size.is_some(),
            "extent" => self.extent.is_some(),
            "crs" => self.crs.is_some(),
            "axis" => self.axis.is_some(),
            "zero" => self.zero.is_some(),
            "radius" => self.radius.is_some(),
            "facing" => self.facing.is_some(),
            "photo" => self.photo.is_some(),
            "distorted" => self.distorted.is_some(),
            "camera" => self.camera.is_some(),
            _ => self.pose.is_some(),
        };
        match keys.iter().find(|key| is_given(key)) {
            Some(key) => {
                let expected = format!("no such key in a {} frame", self.kind);
                Err(FrameError::new(key, expected, "one"))
            }
            None => Ok(()),
        }
    }
}

fn lens(camera: &CameraTable) -> std::result::Result<Lens, FrameError> {
    let model = LensModel::from_name(&camera.model).ok_or_else(|| {
        FrameError::new("camera", "a camera model of COLMAP", format!("{:?}", camera.model))
    })?;
    Lens::new(model, Size::new(camera.width, camera.height), &camera.params)
        .map_err(|e| FrameError::new("camera", "a lens", e.to_string()))
}

fn pose(pose: &PoseTable) -> std::result::Result<Pose, FrameError> {
    Pose::from_colmap(pose.rotation, DVec3::from(pose.translation))
        .map_err(|e| FrameError::new("pose", e.expected, e.found))
}
