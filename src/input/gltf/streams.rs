//! Vertices and faces of a scene, streamed from its buffers.

use glam::DVec3;

use super::layout::{Elements, Mode, Part};
use super::source::GltfMesh;
use crate::geom::{FaceStream, TriangleChunk, VertexStream};
use crate::input::byte_reader::ByteReader;
use crate::{Error, Result};

/// The elements of an accessor, read forwards.
#[derive(Debug)]
struct ElementReader<'a> {
    reader: ByteReader<'a>,
    elements: Elements,
    left: u32,
}

impl<'a> ElementReader<'a> {
    fn open(mesh: &'a GltfMesh, elements: Elements) -> Result<Self> {
        let buffer = &mesh.buffers[elements.buffer];
        let reader = buffer.open(&mesh.path, elements.offset)?;
        Ok(Self { reader, elements, left: elements.count })
    }

    /// Gives the bytes of the next elements to `take`, up to `max` of them; tells of how many, 0 behind the last.
    fn read(&mut self, max: usize, mut take: impl FnMut(&[u8])) -> Result<usize> {
        let Elements { size, stride, .. } = self.elements;
        let wanted = max.min(usize::try_from(self.left).unwrap_or(usize::MAX));
        if wanted == 0 {
            return Ok(0);
        }
        // The last element of all has no gap behind it.
        let bytes = self.reader.fill(stride)?;
        let ready = (bytes.len() + stride - size) / stride;
        if ready == 0 {
            return Err(self.reader.cut("element", u64::from(self.elements.count - self.left)));
        }
        let count = ready.min(wanted);
        for k in 0..count {
            take(&bytes[k * stride..k * stride + size]);
        }
        let passed = (count * stride).min(bytes.len());
        self.reader.consume(passed);
        self.left -= u32::try_from(count).expect("no more than were left");
        Ok(count)
    }
}

/// The vertices of all blocks.
#[derive(Debug)]
pub(super) struct GltfVertices<'a> {
    mesh: &'a GltfMesh,
    /// The next block, and the one being read.
    next: usize,
    reader: Option<ElementReader<'a>>,
}

impl<'a> GltfVertices<'a> {
    /// The vertices from the first.
    pub(super) fn new(mesh: &'a GltfMesh) -> Self {
        Self { mesh, next: 0, reader: None }
    }
}

impl VertexStream for GltfVertices<'_> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        while out.len() < max {
            let Some(reader) = &mut self.reader else {
                let Some(block) = self.mesh.layout.blocks.get(self.next) else { break };
                self.next += 1;
                self.reader = Some(ElementReader::open(self.mesh, block.positions)?);
                continue;
            };
            let to_scene = self.mesh.layout.blocks[self.next - 1].scene_from_mesh;
            let count = reader.read(max - out.len(), |bytes| {
                let corner = [0, 4, 8].map(|at| {
                    let number = [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
                    f64::from(f32::from_le_bytes(number))
                });
                out.push(to_scene.transform_point3(DVec3::from_array(corner)));
            })?;
            if count == 0 {
                self.reader = None;
            }
        }
        Ok(())
    }
}

/// The triangles of all parts.
#[derive(Debug)]
pub(super) struct GltfFaces<'a> {
    mesh: &'a GltfMesh,
    /// The next part, and what is being read of the one before it.
    next: usize,
    corners: Option<Corners<'a>>,
    /// Number of the next face.
    face: u32,
}

/// The corners of a part.
#[derive(Debug)]
struct Corners<'a> {
    part: Part,
    /// The indices; none if the vertices come in their order.
    indices: Option<ElementReader<'a>>,
    /// Corners read, and the last two of a strip, or the first and the last of a fan, or of a triangle the two before.
    count: u32,
    a: u32,
    b: u32,
}

impl<'a> GltfFaces<'a> {
    /// The faces from the first.
    pub(super) fn new(mesh: &'a GltfMesh) -> Self {
        Self { mesh, next: 0, corners: None, face: 0 }
    }
}

impl FaceStream for GltfFaces<'_> {
    fn next_faces(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        out.clear();
        while out.triangles.len() < max {
            let Some(corners) = &mut self.corners else {
                let Some(&part) = self.mesh.layout.parts.get(self.next) else { break };
                self.next += 1;
                let indices =
                    part.indices.map(|e| ElementReader::open(self.mesh, e)).transpose()?;
                self.corners = Some(Corners { part, indices, count: 0, a: 0, b: 0 });
                continue;
            };
            // A corner gives one triangle at most.
            let wanted = max - out.triangles.len();
            let face = &mut self.face;
            let count = corners.read(self.mesh, wanted, |triangle| {
                out.push(*face, triangle);
                *face += 1;
            })?;
            if count == 0 {
                self.corners = None;
            }
        }
        Ok(())
    }
}

impl Corners<'_> {
    /// Reads up to `max` corners, and tells of how many; 0 behind the last.
    fn read(
        &mut self,
        mesh: &GltfMesh,
        max: usize,
        mut take: impl FnMut([u32; 3]),
    ) -> Result<usize> {
        let Some(mut indices) = self.indices.take() else {
            let left = self.part.vertices - self.count;
            let count = left.min(u32::try_from(max).unwrap_or(u32::MAX));
            for vertex in self.count..self.count + count {
                self.push(vertex, &mut take);
            }
            return Ok(count as usize);
        };
        let mut bad = None;
        let count = indices.read(max, |bytes| {
            let index = bytes.iter().rev().fold(0, |sum, &byte| sum << 8 | u32::from(byte));
            if bad.is_none() && index < self.part.vertices {
                self.push(index, &mut take);
            } else if bad.is_none() {
                bad = Some(index);
            }
        })?;
        self.indices = Some(indices);
        match bad {
            Some(index) => Err(self.out_of_range(mesh, index)),
            None => Ok(count),
        }
    }

    /// Adds a corner: the vertex of that number in its block.
    #[inline]
    fn push(&mut self, index: u32, take: &mut impl FnMut([u32; 3])) {
        let vertex = self.part.first_vertex + index;
        let count = self.count;
        self.count += 1;
        match self.part.mode {
            Mode::Triangles => match count % 3 {
                0 => self.a = vertex,
                1 => self.b = vertex,
                _ => take([self.a, self.b, vertex]),
            },
            // Every second triangle of a strip is turned, so that all wind alike.
            Mode::Strip => {
                if count >= 2 {
                    let k = count - 2;
                    take(if k.is_multiple_of(2) {
                        [self.a, self.b, vertex]
                    } else {
                        [self.a, vertex, self.b]
                    });
                }
                (self.a, self.b) = (self.b, vertex);
            }
            Mode::Fan => {
                match count {
                    0 => self.a = vertex,
                    1 => {}
                    _ => take([self.b, vertex, self.a]),
                }
                self.b = vertex;
            }
        }
    }

    #[cold]
    fn out_of_range(&self, mesh: &GltfMesh, index: u32) -> Error {
        let place = format!("node {}, primitive {}", self.part.node, self.part.primitive);
        let place = format!("{place}, index {}", self.count);
        let expected = format!("a vertex below {}", self.part.vertices);
        Error::corrupt(&mesh.path, place, expected, index.to_string())
    }
}
