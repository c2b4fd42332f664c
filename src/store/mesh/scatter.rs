//! Third reading of the meshes: faces into buckets.
//!
//! In: streams of triangles, and the vertices. Out: triangles with area, with their corners, id and key, in
//! buckets; the rest counted. A face that uses a vertex which is not finite is an error that names both.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::buckets::{Buckets, RECORD_BYTES, bucket_of, encode, key_of};
use super::curve::Curve;
use super::join::Join;
use super::lattice::{GROUND_LIMIT, LatticePoint};
use super::layout::MeshCounts;
use super::partition::Triangle;
use super::progress::{BuildStage, Meter};
use super::vertices::Vertices;
use crate::geom::{FaceStream, MeshSource, TriangleChunk};
use crate::{Error, Result};

/// Triangles that a thread takes at a time.
const BATCH: usize = 1 << 11;
/// Triangles whose keys are made together; they stay in the fastest memory.
const KEYS_AT_ONCE: usize = 256;

/// A mesh to be scattered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scattered<'a> {
    pub(super) source: &'a dyn MeshSource,
    /// The id of its first face.
    pub(super) first_id: u32,
    /// Where temporary files go, and memory for a join of faces and vertices.
    pub(super) folder: &'a Path,
    pub(super) join_bytes: usize,
}

/// Scatters meshes, one after the other.
pub(super) struct Scatter<'a> {
    pub(super) curve: Curve,
    pub(super) buckets: Buckets,
    /// Triangles read at a time.
    pub(super) chunk: usize,
    pub(super) counts: MeshCounts,
    pub(super) meter: Meter<'a>,
}

impl Scatter<'_> {
    /// Scatters a mesh whose vertices are `vertices`: while the records of one chunk go into buckets, those of the
    /// next are made.
    pub(super) fn scatter(&mut self, mesh: Scattered<'_>, vertices: Vertices) -> Result<()> {
        let Scattered { source, folder, first_id, join_bytes } = mesh;
        let (chunk, budget_bytes) = (self.chunk, join_bytes);
        let mut reader = Reader {
            join: Join { source, chunk, skip: 0, folder, budget_bytes },
            first_id,
            stream: source.faces()?,
            chunk: TriangleChunk::default(),
            vertices,
            curve: self.curve,
            starts: self.buckets.starts(),
        };
        let (mut now, mut next) = (Records::default(), Records::default());
        let mut last_kept = None;
        reader.read(&mut now)?;
        while !now.is_end {
            let (read, taken) =
                rayon::join(|| reader.read(&mut next), || self.take(&now, &mut last_kept));
            taken?;
            read?;
            if let Some(last_face) = now.last_face {
                let done = u64::from(first_id) + u64::from(last_face) + 1;
                self.meter.tell(BuildStage::Faces, done, self.counts.faces)?;
            }
            std::mem::swap(&mut now, &mut next);
        }
        Ok(())
    }

    /// Throws records into their buckets. `last_kept` is the last face of which there was a record.
    fn take(&mut self, records: &Records, last_kept: &mut Option<u32>) -> Result<()> {
        self.counts.short_faces += records.short_faces;
        for batch in &records.batches[..records.used] {
            self.counts.triangles_dropped += batch.dropped;
            self.counts.triangles += (batch.records.len() / RECORD_BYTES) as u64;
            if let Some((first, last)) = batch.ids {
                // A polygon may stand in two batches.
                self.counts.faces_kept += batch.faces - u64::from(*last_kept == Some(first));
                *last_kept = Some(last);
            }
            let mut rest = &batch.records[..];
            for &(bucket, bytes) in &batch.runs {
                let (run, others) = rest.split_at(bytes);
                self.buckets.push(bucket, run);
                rest = others;
            }
        }
        self.buckets.spill_beyond_limit()
    }
}

/// Makes records of a mesh's triangles.
struct Reader<'a> {
    join: Join<'a>,
    first_id: u32,
    stream: Box<dyn FaceStream + 'a>,
    chunk: TriangleChunk,
    vertices: Vertices,
    curve: Curve,
    /// The first key of each bucket.
    starts: Vec<u64>,
}

/// The records of a chunk of triangles.
#[derive(Debug, Default)]
struct Records {
    batches: Vec<Batch>,
    /// How many of the batches are of this chunk; the others keep their memory.
    used: usize,
    short_faces: u64,
    /// The chunk's last face that gave a triangle.
    last_face: Option<u32>,
    /// Whether there was no chunk left.
    is_end: bool,
}

impl Reader<'_> {
    /// Reads the next chunk.
    fn read(&mut self, out: &mut Records) -> Result<()> {
        out.used = 0;
        self.vertices.join_if_thrashing(&self.join)?;
        self.stream.next_faces(self.join.chunk, &mut self.chunk)?;
        self.join.skip += 1;
        out.is_end = self.chunk.is_empty();
        out.short_faces = self.chunk.short_faces;
        out.last_face = self.chunk.faces.last().copied();
        let (mut triangles, mut faces) = (&self.chunk.triangles[..], &self.chunk.faces[..]);
        while !triangles.is_empty() {
            let count = self.vertices.hold(triangles)?;
            let batches = count.div_ceil(BATCH);
            if out.batches.len() < out.used + batches {
                out.batches.resize_with(out.used + batches, Batch::default);
            }
            let (vertices, curve, starts) = (&self.vertices, &self.curve, &self.starts);
            let fill = |(b, batch): (usize, &mut Batch)| {
                let part = b * BATCH..count.min((b + 1) * BATCH);
                let corner = |k: usize, c: usize| vertices.corner(triangles, k, c);
                batch.fill(part, &faces[..count], self.first_id, curve, corner);
                batch.group(starts);
            };
            let new = &mut out.batches[out.used..out.used + batches];
            new.par_iter_mut().enumerate().for_each(fill);
            if let Some((k, c)) = new.iter().find_map(|batch| batch.unusable) {
                return Err(unusable_vertex(self.join.source, triangles[k][c], faces[k]));
            }
            out.used += batches;
            (triangles, faces) = (&triangles[count..], &faces[count..]);
        }
        Ok(())
    }
}

/// What a thread makes of its triangles.
#[derive(Debug, Default)]
struct Batch {
    records: Vec<u8>,
    /// The records by bucket: each bucket and the length of its run, ascending.
    runs: Vec<(usize, usize)>,
    /// Faces of which there are records, the first and the last.
    faces: u64,
    ids: Option<(u32, u32)>,
    dropped: u64,
    /// Triangle and corner of the first vertex that is not finite.
    unusable: Option<(usize, usize)>,
    /// Triangles whose keys are still to be made.
    kept: Vec<Triangle>,
    /// Buckets and places of the records; records before they are grouped.
    places: Vec<(usize, usize)>,
    spare: Vec<u8>,
}

impl Batch {
    /// Makes records of some triangles.
    fn fill(
        &mut self,
        part: Range<usize>,
        faces: &[u32],
        first_id: u32,
        curve: &Curve,
        corner: impl Fn(usize, usize) -> Option<LatticePoint>,
    ) {
        self.records.clear();
        self.kept.clear();
        (self.faces, self.ids, self.dropped, self.unusable) = (0, None, 0, None);
        for k in part {
            let corners = [corner(k, 0), corner(k, 1), corner(k, 2)];
            let [Some(a), Some(b), Some(c)] = corners else {
                let bad = corners.iter().position(Option::is_none);
                self.unusable = bad.map(|c| (k, c));
                return;
            };
            let (corners, id) = ([a, b, c], first_id + faces[k]);
            if !has_area(&corners) {
                self.dropped += 1;
                continue;
            }
            let (first, last) = self.ids.map_or((id, None), |(first, last)| (first, Some(last)));
            self.faces += u64::from(last != Some(id));
            self.ids = Some((first, id));
            self.kept.push(Triangle { key: 0, id, corners });
            if self.kept.len() == KEYS_AT_ONCE {
                self.encode_kept(curve);
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

    /// Groups the records by bucket; within a bucket they keep their order.
    fn group(&mut self, starts: &[u64]) {
        let bucket = |record: &[u8]| bucket_of(starts, key_of(record));
        self.places.clear();
        self.places.extend(self.records.chunks_exact(RECORD_BYTES).map(bucket).zip(0..));
        if !self.places.is_sorted() {
            self.places.sort_unstable();
            self.spare.clear();
            for &(_, place) in &self.places {
                let record = &self.records[place * RECORD_BYTES..][..RECORD_BYTES];
                self.spare.extend_from_slice(record);
            }
            std::mem::swap(&mut self.records, &mut self.spare);
        }
        self.runs.clear();
        let runs = self.places.chunk_by(|a, b| a.0 == b.0);
        self.runs.extend(runs.map(|run| (run[0].0, run.len() * RECORD_BYTES)));
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
