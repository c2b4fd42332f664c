//! Many samples → one pixel: the blending stage.
//!
//! In: a [`SampleTile`], the samples of a block of mosaic pixels, photo by photo in id order. Out: an
//! [`OrthoTile`], colour and layers of a rectangle of the mosaic, and [`Statistics`] for the report.
//! [`blend_into`] drops outliers, or makes them weigh less, averages what is left, and rounds once.
//!
//! T. Grammatikopoulos, I. Kalisperakis, G. Karras, T. Kokkinos, E. Petsa (2004), "Automatic multi-image
//! photo-texturing of 3D surface models obtained with laser scanning", CIPA workshop on vision techniques applied to
//! the rehabilitation of city centres, Lisbon, §2.3. Departures: for colour the paper's test of grey values becomes
//! a test of Euclidean distances over the channels, and it has a relative guard of 1e-6, a floor of half an 8-bit
//! grey value and an answer for β < 1 (see [`Outliers::Sigma`]). [`Outliers::Robust`] and [`Weights::Sharp`] are a rule of
//! our own.
//!
//! Promises: a pixel depends on its own samples alone; sums run in photo id order, in f64; statistics are
//! integers, so that they are equal for any order of the tiles. Nothing is allocated a pixel.

mod block;
mod counting;
mod robust;
mod settings;
mod sigma;
mod stack;
mod statistics;
mod strip;
#[cfg(test)]
mod tests;
mod tile;

pub use block::{blend_into, blend_parts_into};
pub use settings::{Blend, Edges, Outliers, Settings, Weights};
pub use stack::{PhotoSamples, SampleTile, SoftSamples};
pub use statistics::{Parts, PhotoStats, Statistics};
pub use tile::OrthoTile;
