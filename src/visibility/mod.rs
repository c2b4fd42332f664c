//! Where one photo sees the surface that a block of the mosaic shows.
//!
//! In: a [`SurfaceTile`](crate::surface::SurfaceTile), a photo, and the partitions in the shaft between the block's
//! points and the perspective centre, in any order. Out: the pixels whose surface point the photo sees, and for a
//! part of them a [`ViewTile`]: photo position, pyramid footprint and weight of each.
//!
//! A photo sees a point P of a face iff P lies in front of it, inside the lens model's valid radius and inside the
//! frame, the perspective centre C lies on the face's side that the mosaic's viewer is on, and no other face cuts the
//! segment from C to P before |CP| − ε. Each of these is an f64 predicate on the point, the face and the photo alone
//! (`FaceTest` for the last); the cells, bounds and shafts only skip what they prove, so the answer does not depend
//! on the block, the order of the partitions or the size of the cells.
//!
//! The occlusion test is an irregular z-buffer: T. Aila, S. Laine (2004), "Alias-free shadow maps", Eurographics
//! Symposium on Rendering, doi:10.2312/EGWR/EGSR04/161-166; G. S. Johnson, J. Lee, C. A. Burns, W. R. Mark (2005),
//! "The irregular z-buffer", ACM Transactions on Graphics 24(4), doi:10.1145/1095878.1095889. Departures: central
//! projection of a photo instead of a light's, points streamed against faces of the whole mesh in f64, no raster.

mod candidates;
mod cells;
mod edges;
mod face_test;
mod photo;
mod points;
mod sight;
mod view;

pub use cells::{OcclusionScratch, PointCells};
pub use edges::EdgeMap;
pub use photo::ViewPhoto;
pub use points::{BlockPoints, RayPoints, SUB_BLOCK};
pub use sight::{Sight, Tolerance};
pub use view::ViewTile;

#[cfg(test)]
mod tests;
