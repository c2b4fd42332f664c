//! `groundel ortho`: inputs → stores → plan → tiles → files → report.

mod choices;
mod inputs;
mod job;
mod masks;
mod outputs;
mod precision;
mod profile;
mod reporting;
mod run;
mod stores;

pub use run::ExitStatus;
pub(super) use run::run;
