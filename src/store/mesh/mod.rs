//! The mesh store: input meshes of any size, cut into partitions along a space-filling curve.
//!
//! In: meshes as streams ([`crate::geom::MeshSource`]) and a memory budget. Out: one immutable, checksummed
//! file, mapped and queried by [`MeshStore`]. Promises: every vertex has one value, an integer on one
//! power-of-two lattice; the file's bytes are a function of the meshes alone, not of budget or threads. Memory:
//! the budget while building; while reading, what is loaded and not released. Does not know any mesh format.

mod key;
mod lattice;
mod layout;
mod partition;
mod read;

pub use key::MeshKey;
pub use layout::MeshCounts;
pub use partition::PartitionBuffer;
pub use read::{MeshStore, PartitionId};
