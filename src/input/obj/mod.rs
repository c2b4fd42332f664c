//! OBJ, the geometry format of Wavefront's Advanced Visualizer: vertices `v` and polygons `f`.
//!
//! In: a text, compressed or not. Out: a [`crate::geom::MeshSource`]. Read: the first three coordinates of each `v`
//! (weights and colours behind them are passed over), and of each corner of an `f` the vertex, counted from 1, or
//! backwards from the last vertex above the line if negative. Polygons may have any number of corners and be spread
//! over lines by backslashes; vertices and faces may come in any order. Passed over: normals, texture coordinates,
//! points, lines, groups, materials. Refused: free-form surfaces and calls of other files, which would leave holes.
//! Memory does not grow with the file, nor with a polygon.
//!
//! Wavefront Technologies (1993), "Advanced Visualizer manual", appendix B1. Departure: a comment is not continued by
//! a backslash at its end, which is more often that of a path.

mod source;
mod statements;
#[cfg(test)]
mod tests;

pub(super) use source::ObjMesh;
pub(super) use statements::is_keyword;
