//! `groundel demo`: a synthetic façade and photos of it, rendered, with previews, beside the known answer.

mod answer;
mod files;
mod picture;
mod preview;
mod run;
mod set;

pub(super) use run::run;
