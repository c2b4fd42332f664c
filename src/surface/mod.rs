//! What the projection sees: elevation and face per mosaic pixel.
//!
//! In: a rectangle of the mosaic and the mesh's partitions that may cover it, in ascending order. Out: a
//! [`SurfaceTile`]. Of the faces whose projection holds a pixel's centre, the one with the greatest elevation within
//! the slab wins, in a perspective view the one with the least depth; ties go to the lowest face id. Promise: the answer for a pixel depends on the mesh and the mosaic
//! alone, not on the rectangle. Does not ask whether any photo sees it.
//!
//! T. Grammatikopoulos, I. Kalisperakis, G. Karras, T. Kokkinos, E. Petsa (2004), "Automatic multi-image
//! photo-texturing of 3D surface models obtained with laser scanning", CIPA workshop on vision techniques applied to
//! the rehabilitation of city centres, Lisbon, §2.1. Departures: the projection may have any attitude; the slab clips
//! per point, so that a face that crosses it is cut, not dropped.

mod build;
mod rays;
mod tile;

pub use build::SurfaceBuilder;
pub use tile::{SurfaceFace, SurfaceTile};

#[cfg(test)]
mod tests;
