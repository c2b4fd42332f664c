//! The mesh store: input meshes of any size, cut into partitions along a space-filling curve.
//!
//! In: meshes as streams ([`crate::geom::MeshSource`]) and a memory budget. Out: one immutable, checksummed
//! file, mapped and queried by [`MeshStore`]. Promises: every vertex has one value, an integer on one
//! power-of-two lattice; the file's bytes are a function of the meshes alone, not of budget or threads. Memory:
//! the budget while building; while reading, what is loaded, or all of it if that is allowed. Does not know any mesh
//! format.

mod buckets;
mod build;
mod curve;
mod cut;
mod join;
mod key;
mod lattice;
mod layout;
mod order;
mod partition;
mod place;
mod plan;
mod progress;
mod read;
mod scatter;
#[cfg(test)]
mod tests;
mod vertices;
mod write;

pub use build::MeshBuild;
pub(super) use build::{TemporaryFolder, lock};
pub use key::MeshKey;
pub(super) use key::add_file;
pub use layout::MeshCounts;
pub use partition::PartitionBuffer;
pub use plan::MeshDiskForecast;
pub use progress::{BuildStage, OnProgress};
pub use read::{MeshStore, PartitionId};
