//! How a mesh streams from a foreign file into the mesh store, whatever the format.
//!
//! In: nothing but a promise of counts. Out: vertices as chunks of ground positions in file order, faces as
//! chunks of triangles in file order. Both may be streamed as often as the receiver likes, each time from the
//! start and with the same result. Memory: one chunk, whatever the size of the mesh or of a polygon.

use std::fmt::Debug;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::Bounds3;
use crate::Result;

/// A mesh that can be streamed: a checked file whose counts are known.
pub trait MeshSource: Sync + Debug {
    /// The file, for messages.
    fn path(&self) -> &Path;

    /// The files besides [`Self::path`] that the mesh is read from.
    fn further_files(&self) -> &[PathBuf] {
        &[]
    }

    /// What is added to the file's coordinates, metres.
    fn shift(&self) -> DVec3 {
        DVec3::ZERO
    }

    /// How far apart neighbouring numbers of the file's number type are at the coordinates of a mesh with these
    /// bounds, metres: finer detail is lost. 0 for doubles and for text.
    fn spacing_m(&self, _bounds: &Bounds3) -> f64 {
        0.0
    }

    /// Number of vertices in the file.
    fn vertex_count(&self) -> u64;

    /// Number of faces in the file, polygons counted once, degenerate ones counted too; at most `u32::MAX`.
    fn face_count(&self) -> u64;

    /// Streams the vertices from the first.
    ///
    /// # Errors
    /// If the file cannot be opened or read, or is malformed before its vertices.
    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>>;

    /// Streams the faces from the first.
    ///
    /// # Errors
    /// If the file cannot be opened or read, or is malformed before its faces.
    fn faces(&self) -> Result<Box<dyn FaceStream + '_>>;
}

/// How far apart neighbouring 32-bit floats are at the greatest coordinate of these bounds; 0 if they are empty.
pub fn f32_spacing(bounds: &Bounds3) -> f64 {
    if bounds.is_empty() {
        return 0.0;
    }
    let greatest = bounds.min.abs().max(bounds.max.abs()).max_element();
    #[expect(clippy::cast_possible_truncation, reason = "the rounding is what is asked for")]
    let single = greatest as f32;
    f64::from(single.next_up()) - f64::from(single)
}

/// The vertices of a [`MeshSource`], in file order.
pub trait VertexStream: Send {
    /// Replaces `out` by the next 1 to `max` vertices, ground frame, metres; by none at the end.
    ///
    /// Positions may be NaN or infinite: whether a face uses such a vertex is for the receiver to find out.
    ///
    /// # Errors
    /// If the file cannot be read, is cut, or is malformed; the message names the vertex.
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()>;
}

/// The faces of a [`MeshSource`], in file order.
pub trait FaceStream: Send {
    /// Replaces `out` by the next triangles, about `max` of them; by none at the end.
    ///
    /// Every index is below the source's vertex count.
    ///
    /// # Errors
    /// If the file cannot be read, is cut, or is malformed, or names a vertex that there is not; the message
    /// names the face.
    fn next_faces(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()>;
}

/// Some triangles of a mesh, in file order: polygons fanned from their first vertex.
#[derive(Debug, Clone, Default)]
pub struct TriangleChunk {
    /// Indices of the three vertices, in the file's winding.
    pub triangles: Vec<[u32; 3]>,
    /// The 0-based ordinal of the face in its file, one a triangle, never descending.
    pub faces: Vec<u32>,
    /// Faces with fewer than three vertices, which gave no triangle.
    pub short_faces: u64,
}

impl TriangleChunk {
    /// Whether the chunk bears nothing: the end of the stream.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty() && self.short_faces == 0
    }

    /// Forgets everything, keeping the memory.
    pub fn clear(&mut self) {
        self.triangles.clear();
        self.faces.clear();
        self.short_faces = 0;
    }

    /// Appends one triangle of face `face`.
    #[inline]
    pub fn push(&mut self, face: u32, triangle: [u32; 3]) {
        self.triangles.push(triangle);
        self.faces.push(face);
    }
}

/// A polygon on its way into a [`TriangleChunk`], vertex by vertex; the chunk may change between vertices, so
/// a polygon of any size needs no memory of its own.
#[derive(Debug, Clone, Copy)]
pub struct PolygonFan {
    face: u32,
    first: u32,
    last: u32,
    seen: u8,
}

impl PolygonFan {
    /// An empty polygon with the ordinal `face`.
    pub fn new(face: u32) -> Self {
        Self { face, first: 0, last: 0, seen: 0 }
    }

    /// Adds the next vertex; from the third on, each gives a triangle.
    #[inline]
    pub fn push(&mut self, vertex: u32, out: &mut TriangleChunk) {
        match self.seen {
            0 => (self.first, self.seen) = (vertex, 1),
            1 => self.seen = 2,
            _ => {
                self.seen = 3;
                out.push(self.face, [self.first, self.last, vertex]);
            }
        }
        self.last = vertex;
    }

    /// Ends the polygon; one with fewer than three vertices is counted as short.
    pub fn finish(self, out: &mut TriangleChunk) {
        if self.seen < 3 {
            out.short_faces += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_at_utm_size_stand_half_a_metre_apart() {
        let at = |p: DVec3| f32_spacing(&Bounds3::of([p, DVec3::ZERO])).to_bits();
        assert_eq!(at(DVec3::new(500_000.0, 4_200_000.0, 100.0)), 0.5_f64.to_bits());
        assert_eq!(at(DVec3::new(-500_000.0, 0.0, 100.0)), (1.0_f64 / 32.0).to_bits());
        assert_eq!(at(DVec3::new(1.0, 1023.9, 3.0)), (1.0_f64 / 16384.0).to_bits());
        assert_eq!(f32_spacing(&Bounds3::EMPTY).to_bits(), 0);
    }

    #[test]
    fn a_polygon_is_fanned_from_its_first_vertex_and_a_short_one_is_counted() {
        let mut chunk = TriangleChunk::default();
        for (face, polygon) in [(4, vec![9, 8, 7, 6]), (5, vec![1, 2]), (6, vec![])] {
            let mut fan = PolygonFan::new(face);
            for vertex in polygon {
                fan.push(vertex, &mut chunk);
            }
            fan.finish(&mut chunk);
        }
        assert_eq!(chunk.triangles, [[9, 8, 7], [9, 7, 6]]);
        assert_eq!((chunk.faces, chunk.short_faces), (vec![4, 4], 2));
    }
}
