//! `groundel ortho`: inputs → mesh store → grid → photo store → plan → tiles → files → report.

mod choices;
mod disk;
mod forecast;
mod grid;
mod inputs;
mod job;
mod masks;
mod outputs;
mod precision;
mod profile;
mod reporting;
mod run;
mod speed;
mod stores;

pub(super) use grid::of_view as mosaic_of_view;
pub use run::ExitStatus;
pub(super) use run::run;
