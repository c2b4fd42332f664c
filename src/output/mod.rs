//! Output files: layers, tiles, overviews and Cloud Optimized GeoTIFF files. Knows no rendering.
//!
//! A [`Layer`] says what a file holds; a [`Raster`] is the pixels of one tile of it; [`encode_tile`] makes the bytes
//! that stand in the file, and [`decode_tile`] reads them back. All of these are pure functions: the same pixels are
//! the same bytes, whatever the thread, the order or the machine.

mod codec;
mod layer;
mod predictor;
mod raster;
#[cfg(test)]
mod test_pixels;
mod tile;

pub use crate::image::{Colour, Depth};
pub use codec::{Compression, Scratch, TileDamage};
pub use layer::{Layer, Meaning, NO_FACE, NO_PHOTO, NO_SURFACE};
pub use raster::{Raster, SampleType};
pub use tile::{decode_tile, encode_tile};
