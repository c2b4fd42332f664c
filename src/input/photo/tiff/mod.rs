//! TIFF photos (TIFF 6.0 with Adobe's technical notes 1 and 2; BigTIFF), row by row.
//!
//! In: the first page of a file, in strips or tiles: 8 or 16 bit, grey (either polarity) or RGB, with or without extra
//! samples, which are dropped, alpha too; uncompressed, `PackBits`, LZW, Deflate, Zstandard, or JPEG (8 bit). Out: the
//! page's size and samples, and its rows from top to bottom. Promises: every size that the file states is checked
//! against the file's length or a limit before memory is reserved; strips pass row by row, however large they are, and
//! tiles by rows of tiles; missing data, and checksums that do not fit, are errors. The orientation tag is not applied.
//!
//! The `tiff` crate decodes strips as a whole, reads past the end of uncompressed ones, takes JPEG data that are cut
//! short, and applies the predictor wrongly where it drops extra samples; hence these files.

mod bytes;
mod directory;
mod layout;
mod rows;
#[cfg(test)]
mod tests;

pub(super) use directory::{Directory, SIGNATURES, tag};
pub(super) use layout::Layout;
pub(super) use rows::decode;
