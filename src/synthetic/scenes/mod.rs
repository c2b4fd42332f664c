//! Test scenes, one for each way in which an orthoimage goes wrong.
//!
//! Each is a [`TestScene`](super::TestScene): a mesh of some thousand faces, three to five photos of 320 × 240 pixels or so, and a
//! mosaic of about ten thousand pixels, so that the brute-force oracle answers every pixel of every photo in
//! seconds.

mod aligned;
mod all;
mod colonnade;
mod room;
mod surfaces;

pub use aligned::grid_aligned;
pub use all::all;
pub use colonnade::{columns, hidden_section, oblique, radial, wide_angle};
pub use room::{photo_inside, through_photo_plane};
pub use surfaces::{huge_and_tiny, sub_pixel, untidy};

#[cfg(test)]
mod tests;
