//! Jobs in a folder: planned once, rendered in batches by any process or machine, assembled into files.
//!
//! In: the plan of `super::ortho`. Out: `manifest.json` ([`JobRecord`]) beside `stores/` and `parts/`, from which any
//! process that sees the folder and the photographs renders the same tiles to the same bytes. `groundel ortho` is the
//! three in one process.
//!
//! Promises: a part is complete or not there; a batch may be rendered twice, also at the same time; an input that is not
//! the one that was planned with is refused. Does not start processes on other machines: schedulers do.

mod assemble;
mod batches;
mod camera;
mod changed;
mod files;
mod folder;
mod open;
mod plan;
mod record;
mod render;
mod stamp;
mod tiles;

pub(super) use assemble::{assemble_files, run as assemble};
pub(super) use camera::CameraRecord;
pub(super) use files::{Files, check_name, check_writable, frame_file, layer_file, sidecar_file};
pub(super) use folder::JobFolder;
pub(super) use plan::run as plan;
pub(super) use record::{
    FileRecord, JobRecord, Levelled, MeshRecord, PhotoRecord, Rendering, section_mosaics,
};
pub(super) use render::run as render;
pub(super) use stamp::{Stamp, Thoroughness};
pub(super) use tiles::BatchRun;
