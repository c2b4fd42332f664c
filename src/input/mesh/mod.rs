//! Mesh files by their content: which format it is, and the mesh in it.

mod format;
mod open;
mod shifted;

pub use format::{MeshFormat, MeshKind, mesh_format};
pub use open::open_mesh;
pub use shifted::shifted;
