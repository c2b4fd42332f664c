//! Point clouds: LAS, LAZ and plain text.
//!
//! In: a file, its format known by its content. Out: a [`crate::geom::PointSource`]. Points that a LAS file marks as withheld,
//! and those of the noise classes 7 and 18, are passed over and counted. The header of LAS is read here, whole chunks of LAZ
//! are decompressed by the crate `laz`; no length is believed that the file cannot hold.

mod guard;
mod las;
mod laz;
mod open;
mod record;
mod text;

pub use open::{PointFormat, open_points, point_format};
