//! What the mosaic is drawn on, and the way between its pixels and the ground.
//!
//! In: a frame as the user wrote it ([`FrameTable`], the keys of a frame file or of the project file's `[frame]`). Out: a
//! checked [`FrameSpec`], and for a plane the [`Mosaic`]: its grid of pixels, which [`LocalMosaic`] relates to the local
//! coordinates of a mesh store. [`frame_toml`] writes the frame beside a mosaic; what it writes reads back to the
//! same bytes.
//!
//! Promises: pure functions in plain f64 (+ − × ÷ √), the same on every machine; the upper-left corner of the upper-left
//! pixel is exactly (`u_min`, `v_max`); mosaic → ground → mosaic closes to 1e-6 pixel or 4 ulp of the largest coordinate.
//! Cylinders and perspective views are parsed and checked, but not drawn yet. Nothing here reads files, or knows whether
//! an EPSG code exists.

mod check;
mod cover;
mod mosaic;
mod plane;
mod spec;
mod table;
mod text;

pub use check::FrameError;
pub use mosaic::{LocalMosaic, Mosaic};
pub use plane::Plane;
pub use spec::{Cylinder, Facing, FrameSpec, Orientation, Perspective};
pub use table::{CameraTable, FrameTable, PoseTable};
pub use text::frame_toml;

#[cfg(test)]
mod tests;
