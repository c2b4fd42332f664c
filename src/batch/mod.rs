//! Jobs in parts: which tiles there are, which are done, and how they become files.
//!
//! A [`Manifest`] says what all parts of a job have in common. [`run`] renders tiles into a part file and can be
//! killed at any moment: the next run over the same part renders what is missing, and the bytes come out the same.
//! [`assemble`] makes the files of finished parts. `ortho` is one run over all tiles and an assembly; a cluster makes
//! many runs over some tiles each, and one run that renders nothing, which joins the overviews between them.
//!
//! Promises: the files are the same bytes for any number of threads, order of tiles, cut into parts, and number of
//! interruptions. No half-written file stands under a final name.

mod address;
mod assemble;
mod gauge;
mod keep;
mod known;
mod manifest;
mod notes;
mod part;
mod part_reader;
mod part_writer;
mod parts;
mod run;
mod scene;
#[cfg(test)]
mod tests;

pub use address::{TileAddress, curve_order};
pub use assemble::{Assembly, assemble, join};
pub use keep::keep;
pub use manifest::Manifest;
pub use notes::notes;
pub use part_reader::{PartReader, PartState};
pub use part_writer::PartWriter;
pub use parts::{Claim, Parts, Rivals};
pub use run::{Progress, Rendered, Run, RunSummary, TileRenderer, completed, run};
pub use scene::{SceneTiles, statistics};
