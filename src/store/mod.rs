//! Our immutable files, written once, then mapped or read.
//!
//! In: meshes, point clouds and photos as streams. Out: stores that answer queries within a memory budget. Promises: under a
//! final name there is a whole file or none; a cut, foreign or damaged file is an error, never misread.

pub mod mesh;
mod mmap;
pub mod photo;
mod sampled;
pub mod tin;

pub(crate) use sampled::{SAMPLE_BYTES, visit_samples};
