//! How a point cloud streams from a foreign file into the triangulation, whatever the format.
//!
//! In: nothing but a promise of about how many points there are. Out: ground positions as chunks, in file order, as often as
//! the receiver likes, each time from the start and with the same result. Memory: one chunk of the file.

use std::fmt::Debug;
use std::path::Path;

use glam::DVec3;

use crate::Result;

/// Greatest absolute coordinate of a point, metres: 2⁴⁰, as of a mesh.
pub const POINT_LIMIT_M: f64 = 1_099_511_627_776.0;

/// A point cloud that can be streamed: a file whose head has been checked.
pub trait PointSource: Sync + Debug {
    /// The file, for messages.
    fn path(&self) -> &Path;

    /// About how many points the file holds.
    fn about(&self) -> u64;

    /// Streams the points from the first.
    ///
    /// # Errors
    /// If the file cannot be opened or read, or is malformed before its points.
    fn points(&self) -> Result<Box<dyn PointStream + '_>>;
}

/// The points of a [`PointSource`], in file order, without those that the file marks as not to be used.
pub trait PointStream: Send {
    /// Replaces `out` by the next 1 to `max` points, ground frame, metres; by none at the end. Each coordinate is finite
    /// and within [`POINT_LIMIT_M`].
    ///
    /// # Errors
    /// If the file cannot be read, is cut, or is malformed; the message names the point or its line.
    fn next_points(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()>;

    /// Points passed over so far, because the file marks them as withheld or as noise.
    fn passed_over(&self) -> u64;
}
