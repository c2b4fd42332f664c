//! How far the building of a store has come.

use crate::Result;

/// A part of the building.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum BuildStage {
    /// Reading vertices for their bounds; counted in vertices.
    Bounds,
    /// Placing vertices on the lattice; counted in vertices.
    Vertices,
    /// Scattering faces into buckets; counted in faces.
    Faces,
    /// Sorting and writing partitions; counted in triangles.
    Partitions,
}

/// Takes word of progress: the stage, what is done of it, and all of it. Its error ends the building.
pub type OnProgress<'a> = &'a mut (dyn FnMut(BuildStage, u64, u64) -> Result<()> + Send);

/// Tells of progress.
pub(super) struct Meter<'a>(pub(super) OnProgress<'a>);

impl Meter<'_> {
    /// Tells that `done` of `total` are done.
    ///
    /// # Errors
    /// What the receiver says: the building is to end.
    pub(super) fn tell(&mut self, stage: BuildStage, done: u64, total: u64) -> Result<()> {
        (self.0)(stage, done, total)
    }
}
