//! `groundel ortho`: inputs → stores → plan → tiles → files → report.

mod choices;
mod inputs;
mod job;
mod outputs;
mod precision;
mod reporting;
mod run;
mod stores;

pub use run::ExitStatus;
pub(super) use run::run;
