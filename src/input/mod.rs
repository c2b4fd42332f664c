//! Foreign formats, checked at the door and streamed.
//!
//! In: files of other tools and of the user: meshes (PLY, OBJ, STL, XYZ triplets, glTF), point clouds (LAS, LAZ, text), cameras of many tools, frame
//! files, project files. Out: the crate's own types, every number checked. Nothing read from a file is used before a limit has seen it; memory never grows with
//! a file's size, only with what is kept of it. Errors name the file, the line or byte, what was expected and what was
//! found. Nothing here decides what to do with an input.

mod alicevision;
mod bundler;
mod byte_reader;
mod cameras;
mod colmap;
mod content;
mod corrections;
mod glob;
mod gltf;
mod json;
mod labels;
mod mesh;
mod metashape;
mod micmac;
#[cfg(test)]
mod mutation;
mod obj;
mod openmvg;
mod opensfm;
pub mod photo;
mod pix4d;
mod ply;
mod points;
mod project;
#[cfg(test)]
mod reading;
mod realitycapture;
mod shift;
mod soup;
mod stl;
mod table;
mod text;
mod toml_file;
mod views;
mod xml;
mod xyz;

pub use cameras::{
    AngleUnit, CameraFormat, CameraOptions, Cameras, MeshProof, Proof, Reading, TableLens,
    is_camera_file, read_cameras,
};
pub use content::Compression;
pub use glob::glob_matches;
pub use mesh::{MeshFormat, MeshKind, mesh_format, open_mesh, shifted};
pub use ply::PlyMesh;
pub use points::{PointFormat, open_points, point_format};
pub use project::Project;
pub use shift::Shift;
pub use toml_file::read_frame;
