//! Windows of a JPEG from the photo's own file: an index of its entropy-coded data, and no second copy.
//!
//! In: a baseline or extended sequential JPEG of 8 bits with all components in one scan. Out: an index file of one or
//! two percent of its length ([`IndexedJpeg`]), and windows ([`IndexedFiles`]). Any other JPEG, and any whose header
//! or data are in the least unusual, has no index: the ordinary decoder is to judge it.
//!
//! 1. One pass over the Huffman codes notes, every 32 units (MCUs) of every row of units, the byte and bit position and
//!    the DC values. It reads all of the data, so that a photo that is cut is found before anything is rendered.
//! 2. A window's units, and one more around, are written as a small JPEG: the bits of the AC coefficients copied, DC
//!    values as differences anew, the same tables. Only the byte ranges of its rows are read.
//! 3. The ordinary decoder decodes that, and what was more is cut off. Not one sample differs from a full decode: each
//!    block has the same coefficients, and colour that is stored smaller is interpolated from the nearest neighbours
//!    alone, beyond the photo's edge as in the whole photo.
//!
//! # File layout, version 1
//!
//! Little-endian. The header, 112 bytes:
//!
//! | bytes | what |
//! |---|---|
//! | 0–7 | `GRNDJIDX` |
//! | 8–11 | version |
//! | 12–15 | units between checkpoints, 32 |
//! | 16–23 | width, height |
//! | 24–27 | channels, width and height of a unit, 0 |
//! | 28–31 | length of the segments |
//! | 32–47 | fingerprint of the photo |
//! | 48–55 | length of the file |
//! | 56–71 | offset and length of the photo's coded data |
//! | 72–79 | length of the photo |
//! | 80–95 | its time of modification, ns since 1970 |
//! | 96–99 | CRC-32 of the segments |
//! | 100–107 | 0 |
//! | 108–111 | CRC-32 of bytes 0–107 |
//!
//! The segments of the photo's header that matter follow: tables, frame and scan header. Then a row of checkpoints for
//! each row of units: byte of the coded data (4), bits of it already read (1), the DC value of each component (2), and
//! after the row the CRC-32 of its number and its bytes (4).

mod bits;
mod build;
mod frame;
mod huffman;
mod layout;
mod read;
mod scan;
#[cfg(test)]
mod tests;
mod window;

pub(super) use build::{IndexedJpeg, working_bytes};
pub(super) use read::IndexedFiles;
