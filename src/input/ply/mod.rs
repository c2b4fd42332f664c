//! PLY, the polygon file format: text, and binary of either byte order.
//!
//! In: a foreign file, which is read through one bounded buffer. Out: a [`crate::geom::MeshSource`]. Promises:
//! nothing that the file states is used before it has been compared with the file's length; a cut or malformed
//! file is an error that names the element and its number; memory does not grow with the file, nor with a
//! polygon or list. Does not: read colours, normals or texture coordinates.
//!
//! G. Turk (1994), "The PLY polygon file format", Stanford University. Departure: coordinates may be of any
//! number type, counts and indices too if they are whole numbers.

mod ascii;
mod binary;
mod header;
mod records;
mod scalar;
mod source;
#[cfg(test)]
mod tests;

pub use source::PlyMesh;
