//! (stage store)

pub mod mesh;
mod mmap;
