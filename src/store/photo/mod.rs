//! The photo store: every photo with its pyramid, in tiles, behind [`PhotoStore::window`].
//!
//! In: photo files. Out: windows of any level of any photo; masks likewise, as photos of one channel. Behind them
//! stand, as [`prepare_photos`] chooses by cost, one immutable file of tiles a photo ([`PhotoTiles`]), tiles in memory, or
//! the photo's own file with an index (`jpeg/`). Promises: a window's samples are those of a full decode, whatever the cache, the threads and the order of
//! requests; decoded tiles stay within a budget; a store file that is cut, foreign, stale or damaged is an error or
//! is rebuilt ([`prepare_photos`]), never misread. It does not colour-correct, rotate or undistort anything.
//!
//! Level 0 is the photo as stored, each next level the mean of 2 × 2 pixels of the one before, rounded half up; at
//! an odd edge the mean of what is there. Position x of level 0 is x / 2^ℓ at level ℓ, its size is rounded up.
//! The last level is the first whose shorter side is at most 16 pixels.
//!
//! # File layout, version 1
//!
//! Little-endian. The header, 64 bytes:
//!
//! | bytes | what |
//! |---|---|
//! | 0–7 | `GRNDPHOT` |
//! | 8–11 | version |
//! | 12–15 | side of a tile, 256 |
//! | 16–23 | width, height |
//! | 24–27 | channels, bits, levels, 0 |
//! | 28–31 | number of tiles |
//! | 32–47 | fingerprint of the photo |
//! | 48–55 | length of the file |
//! | 56–59 | CRC-32 of the index |
//! | 60–63 | CRC-32 of bytes 0–59 |
//!
//! The index follows, 16 bytes a tile: offset (8), length (4), CRC-32 of the tile's number and its bytes (4). Tiles
//! are numbered level by level, row by row. Then the tiles, in the order in which they were made. A tile is predicted
//! (`codec.rs`) and compressed by Zstandard.

mod build;
mod cache;
mod choice;
mod codec;
mod files;
mod format;
mod halve;
mod jpeg;
mod memory;
mod parallel;
mod placement;
mod prepare;
mod prepared;
mod pyramid;
mod reader;
mod source;
mod survey;
#[cfg(test)]
mod tests;
mod tile_file;
mod touched;

pub use build::{PhotoFingerprint, PhotoTiles, working_bytes};
pub use choice::Reading;
pub use prepare::{Preparation, Progress, prepare_masks, prepare_photos};
pub use prepared::{Demand, PreparedPhoto};
pub use reader::{CacheStatistics, PhotoStore};
pub use survey::{LeftOut, PhotoSource, check_headers};
