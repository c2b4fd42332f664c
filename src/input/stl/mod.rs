//! STL, the stereolithography format: triangles, each with its own three vertices, as text or binary.
//!
//! In: a foreign file, compressed or not. Out: a [`crate::geom::MeshSource`]; vertices 3k, 3k + 1, 3k + 2 are face k. Normals
//! and attributes are passed over. Promises: a binary file has exactly the length that its count of faces gives it, and
//! a text ends with `endsolid`; anything else is an error that names face or line. Memory does not grow with the file.
//!
//! 3D Systems (1989), "Stereolithography interface specification". Coordinates of a binary file are 32-bit floats.

mod binary;
mod text;

pub(super) use binary::StlMesh;
pub(super) use binary::{HEAD_BYTES, bytes_of};
pub(super) use text::StlText;
