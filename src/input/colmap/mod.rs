//! COLMAP's camera models: the folder with `cameras` and `images`, binary or text.
//!
//! Format: COLMAP's `doc/format.rst` and `src/colmap/scene/reconstruction_io_*.cc`. The newer files of rigs
//! and frames are not read: `images` holds every photo's pose in both generations. Of keypoints and points only a bounded
//! sample is held.

mod binary;
mod folder;
mod keypoints;
mod model;
mod text;

pub(super) use folder::read;

#[cfg(test)]
mod tests;
