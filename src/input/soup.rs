//! Faces of a file that gives each triangle its own three vertices.
//!
//! Nothing is welded here: the mesh store rounds every vertex to one lattice by a function of its coordinates alone,
//! so that equal vertices are one there, and faces that share them do not crack apart.

use crate::geom::{FaceStream, TriangleChunk};
use crate::{Error, Result};

/// The faces 3k, 3k + 1, 3k + 2 in order.
#[derive(Debug)]
pub(super) struct SoupFaces {
    next: u32,
    count: u32,
}

impl SoupFaces {
    /// The faces of a soup of `count` triangles.
    pub(super) fn new(count: u32) -> Self {
        Self { next: 0, count }
    }

    /// `found` triangles as a number whose vertices 32 bits can number.
    ///
    /// # Errors
    /// [`Error::Limit`] if they cannot.
    pub(super) fn checked(path: &std::path::Path, found: u64) -> Result<u32> {
        let limit = u32::MAX / 3;
        u32::try_from(found).ok().filter(|&n| n <= limit).ok_or_else(|| Error::Limit {
            what: format!("number of triangles in {}", path.display()),
            limit: limit.into(),
            found,
        })
    }
}

impl FaceStream for SoupFaces {
    fn next_faces(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        out.clear();
        let max = u32::try_from(max).unwrap_or(u32::MAX).max(1);
        let end = self.count.min(self.next.saturating_add(max));
        for face in self.next..end {
            out.push(face, [3 * face, 3 * face + 1, 3 * face + 2]);
        }
        self.next = end;
        Ok(())
    }
}
