//! Third reading of the meshes: faces into buckets.
//!
//! In: streams of triangles, and the vertices. Out: triangles with area, with their corners, id and key, in
//! buckets; the rest counted. A face that uses a vertex which is not finite is an error that names both.

use std::path::Path;

use rayon::prelude::*;

use super::buckets::{Buckets, RECORD_BYTES, encode, id_of, key_of};
use super::curve::Curve;
use super::join::Join;
use super::lattice::{GROUND_LIMIT, LatticePoint};
use super::layout::MeshCounts;
use super::partition::Triangle;
use super::progress::{BuildStage, Meter};
use super::vertices::Vertices;
use crate::geom::{MeshSource, TriangleChunk};
use crate::{Error, Result};

/// Triangles that a thread takes at a time.
const BATCH: usize = 1 << 12;
/// Triangles whose keys are made together; they stay in the fastest memory.
const KEYS_AT_ONCE: usize = 256;

/// Scatters meshes, one after the other.
pub(super) struct Scatter<'a> {
    pub(super) curve: Curve,
    pub(super) buckets: Buckets,
    /// Triangles read at a time.
    pub(super) chunk: usize,
    pub(super) counts: MeshCounts,
    pub(super) meter: Meter<'a>,
    batches: Vec<Batch>,
    last_kept: Option<u32>,
}

/// What a thread makes of its triangles.
#[derive(Debug, Default)]
struct Batch {
    records: Vec<u8>,
    /// Triangles whose keys are still to be made.
    kept: Vec<Triangle>,
    dropped: u64,
    /// Triangle and corner of the first vertex that is not finite.
    unusable: Option<(usize, usize)>,
}

/// A mesh being scattered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scattered<'a> {
    pub(super) source: &'a dyn MeshSource,
    /// The id of its first face.
    pub(super) first_id: u32,
    /// Where temporary files go, and memory for a join of faces and vertices.
    pub(super) folder: &'a Path,
    pub(super) join_bytes: usize,
}

impl<'a> Scatter<'a> {
    /// Before the first mesh.
    pub(super) fn new(
        curve: Curve,
        buckets: Buckets,
        chunk: usize,
        counts: MeshCounts,
        meter: Meter<'a>,
    ) -> Self {
        Self { curve, buckets, chunk, counts, meter, batches: Vec::new(), last_kept: None }
    }

    /// Scatters a mesh whose vertices are `vertices`.
    pub(super) fn scatter(&mut self, mesh: Scattered<'_>, mut vertices: Vertices) -> Result<()> {
        let Scattered { source, folder, .. } = mesh;
        let (chunk, budget_bytes) = (self.chunk, mesh.join_bytes);
        let mut join = Join { source, chunk, skip: 0, folder, budget_bytes };
        let mut stream = mesh.source.faces()?;
        let (mut chunk, mut ahead) = (TriangleChunk::default(), TriangleChunk::default());
        let max = self.chunk;
        stream.next_faces(max, &mut chunk)?;
        while !chunk.is_empty() {
            let (read, worked) = rayon::join(
                || stream.next_faces(max, &mut ahead),
                || self.take_chunk(mesh, &chunk, &mut vertices),
            );
            worked?;
            read?;
            join.skip += 1;
            vertices.join_if_thrashing(&join)?;
            std::mem::swap(&mut chunk, &mut ahead);
        }
        Ok(())
    }

    fn take_chunk(
        &mut self,
        mesh: Scattered<'_>,
        chunk: &TriangleChunk,
        vertices: &mut Vertices,
    ) -> Result<()> {
        self.counts.short_faces += chunk.short_faces;
        let (mut triangles, mut faces) = (&chunk.triangles[..], &chunk.faces[..]);
        while !triangles.is_empty() {
            let count = vertices.hold(triangles)?;
            let held = &*vertices;
            let corner = |k: usize, c: usize| held.corner(triangles, k, c);
            if let Some((k, c)) = self.take_corners(&faces[..count], mesh.first_id, corner)? {
                return Err(unusable_vertex(mesh.source, triangles[k][c], faces[k]));
            }
            (triangles, faces) = (&triangles[count..], &faces[count..]);
        }
        if let Some(&face) = chunk.faces.last() {
            let done = u64::from(mesh.first_id) + u64::from(face) + 1;
            self.meter.tell(BuildStage::Faces, done, self.counts.faces);
        }
        Ok(())
    }

    /// Throws triangles into buckets: one for each entry of `faces`, corner `c` of triangle `k` as `corner` gives
    /// it. Gives triangle and corner of the first vertex that is not finite, if there is one.
    fn take_corners(
        &mut self,
        faces: &[u32],
        first_id: u32,
        corner: impl Fn(usize, usize) -> Option<LatticePoint> + Sync,
    ) -> Result<Option<(usize, usize)>> {
        let curve = &self.curve;
        let count = faces.len().div_ceil(BATCH);
        self.batches.resize_with(count, Batch::default);
        self.batches
            .par_iter_mut()
            .zip(faces.par_chunks(BATCH))
            .enumerate()
            .for_each(|(b, (batch, faces))| batch.fill(b * BATCH, faces, first_id, curve, &corner));
        for batch in &self.batches {
            if let Some(place) = batch.unusable {
                return Ok(Some(place));
            }
            self.counts.triangles_dropped += batch.dropped;
            for record in batch.records.chunks_exact(RECORD_BYTES) {
                self.buckets.push(self.buckets.bucket_of(key_of(record)), record);
                self.counts.triangles += 1;
                let id = id_of(record);
                if self.last_kept != Some(id) {
                    self.last_kept = Some(id);
                    self.counts.faces_kept += 1;
                }
            }
        }
        self.buckets.spill_beyond_limit()?;
        Ok(None)
    }
}

impl Batch {
    /// Makes records of the triangles from number `first` on.
    fn fill(
        &mut self,
        first: usize,
        faces: &[u32],
        first_id: u32,
        curve: &Curve,
        corner: impl Fn(usize, usize) -> Option<LatticePoint>,
    ) {
        self.records.clear();
        self.kept.clear();
        self.dropped = 0;
        self.unusable = None;
        for (k, &face) in (first..).zip(faces) {
            let corners = [corner(k, 0), corner(k, 1), corner(k, 2)];
            let [Some(a), Some(b), Some(c)] = corners else {
                let bad = corners.iter().position(Option::is_none);
                self.unusable = bad.map(|c| (k, c));
                return;
            };
            let corners = [a, b, c];
            if has_area(&corners) {
                self.kept.push(Triangle { key: 0, id: first_id + face, corners });
                if self.kept.len() == KEYS_AT_ONCE {
                    self.encode_kept(curve);
                }
            } else {
                self.dropped += 1;
            }
        }
        self.encode_kept(curve);
    }

    fn encode_kept(&mut self, curve: &Curve) {
        curve.set_keys(&mut self.kept);
        for triangle in self.kept.drain(..) {
            self.records.extend_from_slice(&encode(&triangle));
        }
    }
}

/// The error for a face that uses a vertex which is not finite.
#[cold]
fn unusable_vertex(source: &dyn MeshSource, vertex: u32, face: u32) -> Error {
    let place = format!("vertex {vertex}, used by face {face}");
    let expected = format!("finite coordinates within {GROUND_LIMIT:e} m");
    Error::corrupt(source.path(), place, expected, "others")
}

/// Whether a triangle has any area; exact.
#[inline]
fn has_area([a, b, c]: &[LatticePoint; 3]) -> bool {
    let side = |p: &LatticePoint| -> LatticePoint { std::array::from_fn(|k| p[k] - a[k]) };
    let (u, v) = (side(b), side(c));
    let axes = [(1, 2), (2, 0), (0, 1)];
    // Sides of 41 bits are exact in f64; each product is off by 2⁻⁵³ of itself, and so is the difference.
    let surely = axes.iter().any(|&(i, j)| {
        let (left, right) = (u[i] as f64 * v[j] as f64, u[j] as f64 * v[i] as f64);
        (left - right).abs() > (left.abs() + right.abs()) * f64::EPSILON * 4.0
    });
    surely
        || axes.iter().any(|&(i, j)| {
            i128::from(u[i]) * i128::from(v[j]) != i128::from(u[j]) * i128::from(v[i])
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn area_is_judged_exactly() {
        let far = 1 << 38;
        assert!(has_area(&[[0, 0, 0], [far, far, far], [far, far, far - 1]]));
        assert!(has_area(&[[0, 0, 0], [far, far - 1, 0], [far - 1, far - 2, 0]]));
        assert!(!has_area(&[[-far, 1, 5], [far, 1, 5], [7, 1, 5]]));
        assert!(!has_area(&[[-far, -far, -far], [far - 1, far - 1, far - 1], [3, 3, 3]]));
        assert!(!has_area(&[[1, 2, 3], [1, 2, 3], [9, 9, 9]]));
        assert!(!has_area(&[[1, 2, 3], [9, 9, 9], [9, 9, 9]]));
        assert!(!has_area(&[[1, 2, 3]; 3]));
    }
}
