//! How a budget of memory is shared out while a store is built.
//!
//! In: the budget, and how many vertices and faces there are. Out: sizes of chunks, caches and buckets; how much
//! memory and disk that takes. None of it changes a byte of the store.

use std::ops::Range;

use super::buckets::RECORD_BYTES;
use super::curve::{CLASSES, COARSE_CELLS, CURVE_BITS, Curve};
use super::order::{BYTES_PER_TRIANGLE, balanced};
use super::vertices::PACKED_BYTES;

/// Sizes of the working memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Plan {
    /// Vertices or triangles read at a time.
    pub(super) chunk: usize,
    /// Whether all vertices are held in memory.
    pub(super) holds_vertices: bool,
    /// Vertices of a block of those that are not.
    pub(super) block_vertices: u32,
    /// Bytes of such blocks held.
    pub(super) cache_bytes: usize,
    /// Bytes that buckets may hold before they are written to files.
    pub(super) spill_bytes: usize,
    /// Triangles of the largest bucket that is sorted in memory.
    pub(super) capacity: usize,
    /// Whether all triangles are held in memory.
    pub(super) holds_triangles: bool,
    faces: u64,
    vertices: u64,
}

/// Temporary and lasting disk that a store takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshDiskForecast {
    /// Bytes of temporary files at most, the unfinished store not counted.
    pub temporary_bytes: u64,
    /// Bytes of the finished store, about.
    pub store_bytes: u64,
    /// Bytes of temporary files and the growing store together that are to be expected: a bucket's file shrinks by
    /// compression, and goes when its part of the store is written.
    pub likely_bytes: u64,
    /// Memory that the building holds, about.
    pub working_bytes: u64,
}

/// Bytes of a compressed record and of a finished store's face, about: façades of 1 to 30 million faces gave 14 to 16.
const LIKELY_RECORD_BYTES: u64 = 16;
const LIKELY_FACE_BYTES: u64 = 16;
/// Bytes of a triangle where all are held in memory: 3 million faces took 187 MB beside the process itself.
const LIKELY_HELD_BYTES: u64 = 62;

/// Triangles of a bucket where all are held in memory: while one is written, the next is sorted, and both stay near the
/// processor.
const SORTED_AT_ONCE: u64 = 1 << 19;

impl Plan {
    /// Shares out `budget_bytes` for meshes of so many vertices and faces in all.
    pub(super) fn new(budget_bytes: usize, vertices: u64, faces: u64) -> Self {
        let share = |percent: usize| budget_bytes / 100 * percent;
        // Two buckets at a time; but where all fit, even one that holds everything does.
        let all = (share(75) / BYTES_PER_TRIANGLE).max(2048);
        let holds_triangles = faces <= all as u64 / 10 * 9;
        let capacity = if holds_triangles { all } else { all.div_ceil(2) };
        Self {
            chunk: (budget_bytes / 4096).clamp(256, 1 << 16),
            holds_vertices: vertices.saturating_mul(PACKED_BYTES as u64) <= share(45) as u64,
            block_vertices: 1 << (budget_bytes / 8192).clamp(16, 4096).ilog2(),
            cache_bytes: share(40),
            spill_bytes: share(if holds_triangles { 75 } else { 25 }),
            capacity,
            holds_triangles,
            faces,
            vertices,
        }
    }

    /// The ranges of keys of the buckets, given the vertices in each coarse cell: each is meant to hold somewhat
    /// less than fits.
    pub(super) fn ranges(&self, cells: &[u32]) -> Vec<Range<u64>> {
        let end = CLASSES << CURVE_BITS;
        if self.faces <= SORTED_AT_ONCE {
            return std::iter::once(0..end).collect();
        }
        // Faces are spread as vertices are.
        let weights = cells.iter().map(|&n| {
            let faces = u128::from(n) * u128::from(self.faces) / u128::from(self.vertices.max(1));
            u64::try_from(faces).unwrap_or(u64::MAX)
        });
        let first_class = 1 << CURVE_BITS;
        let fitting = self.capacity as u64 / 10 * 6;
        let target = if self.holds_triangles { SORTED_AT_ONCE.min(fitting) } else { fitting };
        let start_of = |cell: usize| Curve::coarse_key(cell.min(COARSE_CELLS));
        let mut ranges = balanced(weights, start_of, target, first_class);
        ranges.extend((1..CLASSES).map(|class| class << CURVE_BITS..(class + 1) << CURVE_BITS));
        ranges
    }

    /// The disk that the building takes at most, if polygons are triangles.
    pub(super) fn forecast(&self) -> MeshDiskForecast {
        // Vertices, and for a join of faces with vertices all over the file, requests and answers.
        let join = self.faces * 3 * (4 + PACKED_BYTES as u64);
        let vertices =
            if self.holds_vertices { 0 } else { self.vertices * PACKED_BYTES as u64 + join };
        // A bucket that turns out too large is written twice; records shrink by a third or more.
        let records = if self.holds_triangles { 0 } else { self.faces * RECORD_BYTES as u64 };
        let store_bytes = self.faces.saturating_mul(LIKELY_FACE_BYTES);
        let packed = self.vertices.saturating_mul(PACKED_BYTES as u64);
        let likely = |held: bool, each: u64| if held { 0 } else { each };
        let likely_bytes = likely(self.holds_vertices, packed)
            + likely(self.holds_triangles, self.faces.saturating_mul(LIKELY_RECORD_BYTES));
        MeshDiskForecast {
            temporary_bytes: vertices + records,
            store_bytes,
            likely_bytes: likely_bytes.max(store_bytes),
            working_bytes: self.working_bytes(),
        }
    }

    /// All triangles are held, and those of two buckets are sorted. If not all can be, the process held about as much as
    /// the two that are sorted at a time may take (3 and 30 million faces, budgets of 102 and 410 MiB: 0.7 to 0.8 of the budget).
    fn working_bytes(&self) -> u64 {
        if self.holds_triangles {
            self.faces.saturating_mul(LIKELY_HELD_BYTES)
        } else {
            (2 * self.capacity * BYTES_PER_TRIANGLE) as u64
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_mesh_needs_no_files() {
        let plan = Plan::new(120 << 20, 250_000, 500_000);
        assert!(plan.holds_vertices);
        assert_eq!(plan.ranges(&[]).len(), 1);
        assert_eq!(plan.forecast().temporary_bytes, 0);
    }

    #[test]
    fn the_buckets_of_a_large_mesh_cover_all_keys_and_hold_about_the_same() {
        let plan = Plan::new(120 << 20, 15_000_000, 30_000_000);
        assert!(!plan.holds_vertices);
        let mut cells = vec![0; COARSE_CELLS];
        for k in 0..15_000 {
            cells[(k * 7919) % COARSE_CELLS] += 1000;
        }
        let ranges = plan.ranges(&cells);
        assert_eq!((ranges[0].start, ranges.last().unwrap().end), (0, CLASSES << CURVE_BITS));
        assert!(ranges.windows(2).all(|w| w[0].end == w[1].start));
        let of_class_0 = ranges.iter().filter(|r| r.start < 1 << CURVE_BITS).count();
        assert!((50..120).contains(&of_class_0), "{of_class_0}");
    }
}
