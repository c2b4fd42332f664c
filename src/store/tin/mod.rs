//! The TIN of point clouds: a Delaunay triangulation over a plane, made block by block.
//!
//! In: point clouds as streams ([`crate::geom::PointSource`]), a plane ([`TinPlane`]), a memory budget. Out: one PLY file in
//! the work folder, which is then a mesh like any other. Promises: every point keeps its coordinates to the last bit; of
//! points at one place of the plane the highest stays; the triangles are those of the Delaunay triangulation of all points,
//! by exact predicates, without those that have an edge longer than is asked for: no cracks and no overlaps, whatever the
//! blocks; the file's bytes are a function of the clouds and settings alone, not of budget or threads. Memory: the budget.
//! Does not know any format of clouds.
//!
//! How: the points are sorted along a Z-order curve on disk (`sort`) and cut into leaves of a few thousand
//! (`leaves`). A block, a run of leaves, is triangulated with all points within the greatest edge of it (`block`): a
//! triangle of the whole whose vertices are there is a triangle of the part too, so none is missed; one of the part is one
//! of the whole if its circle holds no point elsewhere, which is asked of the leaves that the circle meets (`circle`).
//! Where more than three points lie on one circle, the triangulation is not unique; the fan from the first of them is
//! taken (`delaunay`), a rule that holds in every part that it holds in the whole. Each triangle belongs to the block of
//! its first vertex.

mod block;
mod build;
mod circle;
mod delaunay;
mod file;
mod key;
mod leaves;
mod plane;
mod sort;
#[cfg(test)]
mod tests;

pub use build::{TinBuild, TinProgress};
pub use file::{Tin, TinCounts};
pub use plane::TinPlane;
