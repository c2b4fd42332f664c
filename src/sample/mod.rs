//! Colour of photo positions: the sampling stage.
//!
//! In: one [`Window`](crate::image::Window) of a photo and positions on that photo, in level-0 photo pixels
//! ([`sample_into`]). Out: one RGB triplet a position, f32, in the photo's own range (0–255 or 0–65535), neither
//! clamped nor rounded; grey is replicated. [`level_of`] chooses the pyramid level from a pixel's footprint, and
//! [`taps_of`] tells which window the positions need.
//!
//! Promises: a sample depends on its position, the level and the photo alone, never on the window, its
//! neighbours or the machine; an area of one colour keeps that colour to the last bit; nothing is allocated.
//!
//! Does not know cameras or meshes, reads no files, and does not repeat edges: a window that hangs over the
//! photo's edge already holds the repeated samples.

mod kernels;
mod level;
mod taps;

pub use kernels::sample_into;
pub use level::level_of;
pub use taps::{Interpolation, taps, taps_of};
