//! Photographs at the door: what a file holds, read from its header, and its pixels, row by row.
//!
//! In: a JPEG, PNG or TIFF file, told by its content, not by its extension. Out: a [`PhotoHeader`] without decoding a
//! pixel, and [`decode_photo`], which hands over rows from top to bottom, 1 (grey) or 3 (RGB) samples a pixel, 8
//! or 16 bits. Promises: a size has passed a limit before anything is allocated for it; a file that is cut short
//! is an error, never a picture that ends in grey; one decoder for a format, whose samples are the same on every
//! machine. What it cannot promise: damage in mid-stream that still decodes (a JPEG has no checksum) stays
//! undetected. EXIF orientation, colour profiles and gamma are not applied: cameras describe stored pixels.

mod decode;
mod header;
mod jpeg;
mod limits;
mod mask;
mod png;
mod profile;
#[cfg(test)]
mod tests;
mod tiff;

pub use decode::{Rows, decode_jpeg, decode_photo};
pub use header::{PhotoFormat, PhotoHeader, read_photo_header};
pub use jpeg::JpegCoding;
pub use mask::{decode_mask, read_mask_header};
pub use profile::{MAX_PROFILE_BYTES, Profile, profile_channels, read_profile};
