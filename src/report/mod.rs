//! What a run found, as JSON and as a short text to read.
//!
//! In: counts that the readers and the renderer gathered, put into a [`Report`] by the command. Out: a JSON
//! document ([`Report::to_json`]) and a summary for the terminal ([`Report::summary`]). Promise: everything in a
//! report is a function of inputs and settings, except what stands under its key `run` (times, memory, threads).
//! Does not measure pictures and does not write files.

mod document;
mod memory;
mod photos;
mod stages;
mod summary;

pub use document::{
    CameraInput, Coverage, FrameSummary, Inputs, LeftOut, MemoryUse, MeshInput, OutputFile,
    PhotoPixels, Report, Run, SectionReport, TinInput,
};
pub use memory::{peak_resident_bytes, physical_bytes, resident_bytes};
pub use photos::{PhotoLevelling, PhotoReport, PhotoTally, suspicious};
pub use stages::{Stage, StageLog};
