//! [`FrameTable`]: a frame's keys as typed, before any check.

use serde::Deserialize;

/// The keys of a frame file, or of the project file's `[frame]`: all kinds together, each key optional but `kind`.
///
/// [`FrameTable::check`] turns it into a [`FrameSpec`](super::FrameSpec).
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameTable {
    /// `plane`, `cylinder` or `perspective`.
    pub kind: String,
    /// Plane, cylinder: ground point, metres.
    pub origin: Option<[f64; 3]>,
    /// Plane: direction of the columns.
    pub u_axis: Option<[f64; 3]>,
    /// Plane: direction against the rows.
    pub v_axis: Option<[f64; 3]>,
    /// Plane, cylinder: side of a pixel, metres.
    pub pixel_size: Option<f64>,
    /// Plane, cylinder: `[u_min, v_min, u_max, v_max]`, metres.
    pub extent: Option<[f64; 4]>,
    /// Any kind: `[min, max]` of elevation, metres.
    pub elevation: Option<[f64; 2]>,
    /// Plane: `EPSG:n`.
    pub crs: Option<String>,
    /// Cylinder: direction of the axis, +v.
    pub axis: Option<[f64; 3]>,
    /// Cylinder: direction in which u = 0.
    pub zero: Option<[f64; 3]>,
    /// Cylinder: metres.
    pub radius: Option<f64>,
    /// Cylinder: `outside` or `inside`.
    pub facing: Option<String>,
    /// Perspective: name of a photo of the set.
    pub photo: Option<String>,
    /// Perspective with `photo`: draw with the lens's distortion.
    pub distorted: Option<bool>,
    /// Perspective without `photo`: interior orientation.
    pub camera: Option<CameraTable>,
    /// Perspective without `photo`: exterior orientation.
    pub pose: Option<PoseTable>,
}

/// `camera = { model, width, height, params }`, as COLMAP.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraTable {
    /// COLMAP's name of the model.
    pub model: String,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Parameters in COLMAP's order.
    pub params: Vec<f64>,
}

/// `pose = { rotation, translation }`, `photo_from_ground`, as COLMAP.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseTable {
    /// `[qw, qx, qy, qz]`.
    pub rotation: [f64; 4],
    /// `[tx, ty, tz]`, metres.
    pub translation: [f64; 3],
}
