//! Foreign formats, checked at the door and streamed.
//!
//! In: files of other tools and of the user: meshes, COLMAP's camera models, frame files, project files. Out: the crate's own
//! types, every number checked. Nothing read from a file is used before a limit has seen it; memory never grows with
//! a file's size, only with what is kept of it. Errors name the file, the line or byte, what was expected and what was
//! found. Nothing here decides what to do with an input.

mod colmap;
mod glob;
mod mesh;
pub mod photo;
mod ply;
mod project;
mod toml_file;

pub use colmap::read_cameras;
pub use glob::glob_matches;
pub use mesh::open_mesh;
pub use ply::PlyMesh;
pub use project::Project;
pub use toml_file::read_frame;
