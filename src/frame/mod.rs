//! What the mosaic is drawn on, and the way between its pixels and the ground.
//!
//! In: a frame as the user wrote it ([`FrameTable`], the keys of a frame file or of the project file's `[frame]`). Out: a
//! checked [`FrameSpec`], and the [`Mosaic`]: its grid of pixels, which [`LocalMosaic`] relates to the local coordinates
//! of a mesh store. Of a cylinder and of a perspective view, [`Block`] holds the lines of a rectangle of pixels.
//! [`frame_toml`] writes the frame beside a mosaic; what it writes reads back to the same bytes.
//!
//! Promises: pure functions in plain f64 (+ − × ÷ √), the same on every machine; the upper-left corner of the upper-left
//! pixel is exactly (`u_min`, `v_max`); mosaic → ground → mosaic closes to 1e-6 pixel or 4 ulp of the largest coordinate.
//! Angles are libm's, the same on every machine. Nothing here reads files, or knows whether an EPSG code exists.

mod central;
mod check;
mod cover;
mod cylinder;
mod local;
mod local_plane;
mod locator;
mod mosaic;
mod plane;
mod spec;
mod table;
mod text;

pub use central::{CentralBlock, LocalCentral};
pub use check::FrameError;
pub use cylinder::{AroundAxis, CylinderBlock, LocalCylinder};
pub use local::{Block, LocalMosaic, PixelRay};
pub use local_plane::LocalPlane;
pub use locator::Locator;
pub use mosaic::{CentralView, Mosaic, MosaicFrame};
pub use plane::Plane;
pub use spec::{Cylinder, Facing, FrameSpec, GivenCamera, Orientation, Perspective};
pub use table::{CameraTable, FrameTable, PoseTable};
pub use text::frame_toml;

#[cfg(test)]
mod tests;
