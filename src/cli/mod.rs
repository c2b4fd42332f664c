//! The command line: [`Args`] (as typed) → [`Config`] (as built) → command. The only module that prints.
//!
//! In: the arguments of the process, and the project file that they name. Out: an exit code, the command's answer on
//! standard output, progress and errors on standard error: `groundel: error: …`, once, and nothing after it.
//! Promises: flags override the project file; nothing is read or written before all settings make sense; every
//! setting that a run depends on stands in [`Config`]. Decides nothing about pixels.

mod args;
mod choice;
mod compare;
mod config;
mod console;
mod demo;
mod frame_choice;
mod info;
mod interrupt;
mod job;
mod job_args;
mod locate;
mod ortho;
mod picture;
mod print_size;
mod progress;
mod project;
mod run;
mod sections;
mod settings;
mod sidecars;
mod values;

pub use args::{Args, CameraArgs, Command, DemoArgs, OrthoArgs};
pub use choice::PhotoChoice;
pub use config::Config;
pub use job_args::{AssembleArgs, PlanArgs, RenderArgs};
pub use ortho::ExitStatus;
pub use progress::Progress;
pub use run::run;
pub use settings::{
    BlendRule, Cad, ColourRule, Edges, Interpolation, Levelling, Outliers, View, Weights,
};
