//! Tone of the photos: what exposure, white balance and lens make of one and the same surface.
//!
//! In: [`Observation`]s, the colours that several photos show of the same surface points. Out: a [`PhotoTone`] for each
//! photo, a smooth function of the position in its frame, such that colours divided by it agree as well as they can:
//! [`solve`]. A [`ToneGrid`] applies it to samples.
//!
//! The model is that of gain and vignetting compensation for panoramas (M. Brown, D. G. Lowe (2007), "Automatic
//! panoramic image stitching using invariant features", doi:10.1007/s11263-006-0002-3, §6; D. B. Goldman, J.-H. Chen (2005),
//! "Vignette and exposure calibration and compensation", doi:10.1109/ICCV.2005.249), in logarithms, so that it is linear:
//! log of the photo's colour = log of the surface's + gain (photo, channel) + vignetting (camera) + a gentle field (photo,
//! channel). Departures: the surface is known, so that each point is compared in all photos that see it at once; weights are
//! found anew as the solution goes on (iteratively reweighted least squares), so that what is not the surface does not
//! count; no response curve, since measured exponents lie within 1 % of one.
//!
//! Promises: the answer depends on the observations and their order alone; one thread, f64. Does not sample: see
//! [`crate::render`].

mod conjugate;
mod field;
mod grid;
mod groups;
mod model;
mod solve;
#[cfg(test)]
mod tests;

pub use grid::ToneGrid;
pub use model::{Levelling, PhotoTone};
pub use solve::{Observation, PhotoFit, Problem, Tones, solve};
