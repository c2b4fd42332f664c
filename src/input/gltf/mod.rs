//! glTF 2.0, as GLB (one binary file) or as JSON with buffers beside it or within it.
//!
//! In: a foreign file. Out: a [`crate::geom::MeshSource`]: the triangles of all primitives of the default scene, in the order
//! of its nodes, under the nodes' transforms, which are read and multiplied as doubles. Coordinates are taken as they
//! stand: glTF calls y up, and nothing is turned. Each triangle is a face. Promises: nothing that the file states is
//! used before it has been compared with the file; nodes are a tree; buffers of files are streamed, only those within the
//! JSON are held, and the JSON has a limit. Refused by name: compressed and quantised meshes, sparse accessors, skins,
//! morph targets, modes other than triangles, and extensions that might change the geometry.
//!
//! The Khronos Group (2021), "glTF 2.0 specification", ISO/IEC 12113:2022.

mod base64;
mod buffers;
mod document;
mod layout;
mod nodes;
mod source;
mod streams;
#[cfg(test)]
mod tests;

pub(super) use source::GltfMesh;
