//! Faces as the stages see them: borrowed blocks of triangles.

use glam::DVec3;

use super::Bounds3;

/// 0-based ordinal of a face in the mesh file(s), polygons counted once, dropped faces counted too.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, bytemuck::Pod, bytemuck::Zeroable,
)]
#[repr(transparent)]
pub struct FaceId(pub u32);

impl FaceId {
    /// The value that stands for "no face" in the face layer and in id buffers.
    pub const NONE: Self = Self(u32::MAX);
}

/// A borrowed block of triangles, as a partition of the mesh store or a synthetic scene gives it.
///
/// All triangles of one polygon bear the polygon's id, so an id may occur more than once.
#[derive(Debug, Clone, Copy)]
pub struct FaceBlock<'a> {
    /// Vertex positions, local frame, metres.
    pub positions: &'a [DVec3],
    /// Three indices into `positions` a triangle, in the file's winding.
    pub triangles: &'a [[u16; 3]],
    /// One id a triangle.
    pub ids: &'a [FaceId],
    /// Bounds that hold every position.
    pub bounds: Bounds3,
}

impl FaceBlock<'_> {
    /// The three corners of triangle `k`.
    ///
    /// # Panics
    /// If `k` is not below the number of triangles.
    pub fn corners(&self, k: usize) -> [DVec3; 3] {
        self.triangles[k].map(|i| self.positions[usize::from(i)])
    }
}
