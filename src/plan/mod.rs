//! What is settled once, before the first tile: the mosaic's extent and its pixel size.
//!
//! [`fit_plane`] finds the façade that the photos look at.
//!
//! In: the mesh as [`Partitions`], the photos' orientation, a frame. Out: [`default_extent`] of a plane, [`default_arc`] of a
//! cylinder, [`default_pixel_size`], the checks that refuse a job before it begins ([`check_meeting`], [`check_pixels`]), and an
//! estimate of what is needed of each photo ([`photo_needs`]).
//!
//! [`Reach`] tells which tiles a photo may touch.
//!
//! Before anything is built, [`Forecast`] says what it will take of memory, disk and time, from a [`Survey`] of the mosaic.
//!
//! Promises: everything is a function of the mesh, the photos and the frame, by rules that do not depend on threads
//! or memory; one partition at a time is in memory. Which partitions and photos a tile needs is found when it is
//! rendered: occluders may lie far outside the tile's column.

mod arc;
mod extent;
mod fit;
mod forecast;
mod needs;
mod partitions;
mod pixel_size;
mod reach;
mod survey;
#[cfg(test)]
mod tests;

pub use arc::default_arc;
pub use extent::{check_meeting, check_pixels, check_shown, default_extent};
pub use fit::fit_plane;
pub use forecast::{Forecast, JobDemand, tile_weight};
pub use needs::{PhotoNeed, photo_needs};
pub use partitions::{Base, Partitions, Slab};
pub use pixel_size::default_pixel_size;
pub use reach::Reach;
pub use survey::{Survey, WorkAmount};
