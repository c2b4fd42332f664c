//! COLMAP's camera models: the folder with `cameras` and `images`, binary or text.
//!
//! Format: COLMAP's `doc/format.rst` and `src/colmap/scene/reconstruction_io_*.cc`. The points are not read, nor the newer
//! files of rigs and frames: `images` holds every photo's pose in both generations. Keypoints are passed over without
//! being held.

mod binary;
mod folder;
mod model;
mod text;

pub use folder::read_cameras;

#[cfg(test)]
mod tests;
