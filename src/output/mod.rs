//! Output files: layers, tiles, overviews and Cloud Optimized GeoTIFF files. Knows no rendering.
//!
//! A [`Layer`] says what a file holds; a [`Raster`] is the pixels of one tile of it; [`encode_tile`] makes the bytes
//! that stand in the file, and [`decode_tile`] reads them back. All of these are pure functions: the same pixels are
//! the same bytes, whatever the thread, the order or the machine.

mod codec;
mod cog;
mod dxf;
mod geokeys;
mod halve;
mod icc;
mod ifd;
mod layer;
mod metadata;
mod overview;
mod pending;
mod predictor;
mod pyramid;
mod raster;
mod resolution;
mod sidecar;
#[cfg(test)]
mod test_pixels;
mod tile;
mod world_file;

pub use crate::image::{Colour, Depth};
pub use codec::{Compression, Scratch, TileDamage};
pub use cog::{BigTiff, CogSpec, CogWriter};
pub use dxf::{dxf_name, image_dxf};
pub use geokeys::{Georeference, parse_crs};
pub use halve::halve;
pub use icc::IccProfile;
pub use layer::{Layer, Meaning, NO_FACE, NO_PHOTO, NO_SURFACE};
pub use overview::{Gathered, OverviewBuilder, Quarter};
pub use pending::{PendingFile, write_atomically};
pub(crate) use pending::{lock, sync_folder};
pub use pyramid::{Pyramid, TileFormat, TileKey};
pub use raster::{Raster, SampleType};
pub use resolution::PrintResolution;
pub use sidecar::Sidecar;
pub use tile::{decode_tile, encode_tile};
pub use world_file::world_file;
