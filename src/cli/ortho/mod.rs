//! `groundel ortho`: inputs → TIN of point clouds → mesh store → grid → photo store → plan → tiles → files → report.
//!
//! What it plans is a job, which `super::job` renders and assembles; `groundel plan` stops there.

mod disk;
mod forecast;
mod grid;
mod inputs;
mod job;
mod levelling;
mod masks;
mod outputs;
mod planning;
mod points;
mod precision;
mod profile;
mod reporting;
mod run;
mod shelf;
mod speed;
mod stores;

pub(super) use grid::of_view as mosaic_of_view;
pub(super) use inputs::Inputs;
pub(super) use job::{Job, Place, canvas, scene};
pub(super) use planning::{Planned, budget, plan, tile_demand};
pub(super) use points::add_tin;
pub(super) use reporting::{Outcome, found};
pub use run::ExitStatus;
pub(super) use run::{on_threads, run};
pub(super) use shelf::Shelf;
pub(super) use stores::Stores;
