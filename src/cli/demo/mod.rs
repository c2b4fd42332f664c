//! `groundel demo`: a synthetic façade and photos of it, rendered, with previews, beside the known answer.

mod answer;
mod preview;
mod run;

pub(super) use run::run;
