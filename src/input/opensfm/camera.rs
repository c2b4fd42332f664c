//! [`Camera`]: a camera of OpenSfM as a lens.

use serde::Deserialize;

use crate::camera::LensModel;
use crate::geom::Size;

/// A camera as it stands in the file; lengths are divided by the greater side of the photo.
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Camera {
    projection_type: String,
    width: u32,
    height: u32,
    focal: Option<f64>,
    focal_x: Option<f64>,
    focal_y: Option<f64>,
    #[serde(default)]
    c_x: f64,
    #[serde(default)]
    c_y: f64,
    #[serde(default)]
    k1: f64,
    #[serde(default)]
    k2: f64,
    #[serde(default)]
    k3: f64,
    #[serde(default)]
    k4: f64,
    #[serde(default)]
    p1: f64,
    #[serde(default)]
    p2: f64,
}

impl Camera {
    /// Width and height of its photos, pixels.
    pub(super) fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }

    /// COLMAP's model and parameters; else why its photos are left out.
    pub(super) fn lens(&self) -> Result<(LensModel, Vec<f64>), String> {
        let Self { k1, k2, k3, k4, p1, p2, .. } = *self;
        let (model, rest): (_, &[f64]) = match self.projection_type.as_str() {
            "perspective" | "radial" | "simple_radial" => (LensModel::OpenCv, &[k1, k2, 0.0, 0.0]),
            "brown" => (LensModel::FullOpenCv, &[k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]),
            "fisheye" => (LensModel::OpenCvFisheye, &[k1, k2, 0.0, 0.0]),
            "fisheye_opencv" => (LensModel::OpenCvFisheye, &[k1, k2, k3, k4]),
            other => return Err(format!("the projection {other:?} of OpenSfM is not supported")),
        };
        let focal_x = self.focal_x.or(self.focal);
        let Some(focal_x) = focal_x else { return Err("its camera has no focal length".into()) };
        let (width, height) = (f64::from(self.width), f64::from(self.height));
        let side = width.max(height);
        let centre = [side * self.c_x + 0.5 * width, side * self.c_y + 0.5 * height];
        let focal = [side * focal_x, side * self.focal_y.unwrap_or(focal_x)];
        Ok((model, [&focal, &centre, rest].concat()))
    }
}
