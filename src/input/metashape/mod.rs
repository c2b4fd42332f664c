//! Agisoft Metashape's cameras: the XML of its "Export cameras".
//!
//! Format: the files themselves, and the Metashape manual, appendix C, for what the numbers mean. Camera axes x right, y
//! down, z forward; pixels from the corner of the first one; the principal point from the middle of the photo;
//! `u = w/2 + cx + x' (f + b1) + y' b2`, `v = h/2 + cy + y' f`; its `p1`, `p2` are OpenCV's `p2`, `p1`. A camera's transform
//! leads from the camera to the chunk, the component's or the chunk's from there to the ground.
//!
//! Frame cameras and equidistant fisheyes are read. Cameras that are not aligned, disabled, of a rig or of another kind
//! are left out with the reason. The file holds no tie points but markers, if they are exported too: those with
//! coordinates prove the cameras.

mod document;
mod markers;
mod sensor;

pub(super) use document::{is_metashape, read};

#[cfg(test)]
mod tests;
