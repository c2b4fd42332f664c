//! Lens models and poses: from a point of the ground to a position in a photograph, and back to a ray.
//!
//! In: the parameters of COLMAP's camera models and poses, as an importer read them. Out: [`Photo`]s in a
//! [`CameraSet`], each with a [`Lens`] and a [`Pose`]. The chain is
//! `ground → camera` ([`Pose`]) `→ ray` (x/z, y/z) `→ photo` ([`Lens`]).
//!
//! Camera axes: x right, y down, z forward, metres; `X_camera = rotation · (X_ground − centre)`. Photo positions are
//! pixels, the top-left pixel's *centre* at (0.5, 0.5). EXIF orientation plays no part: a lens describes stored pixels.
//!
//! Promises: every function is a pure function of its arguments in plain f64 (+ − × ÷ √, and the arc tangent of the
//! crate `libm`, which is made of them), so the results are the same on every machine; nothing here allocates per point.
//! Fisheyes are exact up to 85° from the optical axis; omnidirectional models are named ([`LensModel`]) but not computed.

mod batch;
mod brown;
mod distortion;
mod lens;
mod model;
mod opencv;
mod photo;
mod polynomial;
mod pose;
mod radial;
mod radius;
mod rational;
mod ray_bounds;
mod wide;

pub use batch::{RAYS, Rays};
pub use lens::{Lens, LensError};
pub use model::LensModel;
pub use photo::{CameraSet, LeftOut, Photo, PhotoId};
pub use pose::{LocalPose, Pose, PoseError};

#[cfg(test)]
mod known_values;
#[cfg(test)]
mod tests;
