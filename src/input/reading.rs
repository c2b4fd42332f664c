//! Meshes read whole, for the tests of the formats.

use std::io::Write;
use std::path::Path;

use glam::DVec3;

use crate::Result;
use crate::geom::{MeshSource, TriangleChunk};

/// All that a mesh streams.
#[derive(Debug, Clone)]
pub(super) struct Read {
    pub(super) vertices: Vec<DVec3>,
    pub(super) faces: TriangleChunk,
}

impl Read {
    /// The corners of every triangle, with its face.
    pub(super) fn corners(&self) -> Vec<([DVec3; 3], u32)> {
        let corners = |t: &[u32; 3]| t.map(|v| self.vertices[v as usize]);
        self.faces.triangles.iter().map(corners).zip(self.faces.faces.iter().copied()).collect()
    }
}

/// Reads a mesh, and again in small chunks, which must give the same.
pub(super) fn read(mesh: &dyn MeshSource) -> Result<Read> {
    let all = read_in(mesh, 1 << 16)?;
    let again = read_in(mesh, 3)?;
    let bits = |vertices: &[DVec3]| -> Vec<[u64; 3]> {
        vertices.iter().map(|v| v.to_array().map(f64::to_bits)).collect()
    };
    assert_eq!(bits(&all.vertices), bits(&again.vertices));
    assert_eq!(all.faces.triangles, again.faces.triangles);
    assert_eq!(all.faces.faces, again.faces.faces);
    assert_eq!(all.vertices.len() as u64, mesh.vertex_count());
    Ok(all)
}

/// Reads a mesh in chunks of `max`.
pub(super) fn read_in(mesh: &dyn MeshSource, max: usize) -> Result<Read> {
    let (mut vertices, mut block) = (Vec::new(), Vec::new());
    let mut stream = mesh.vertices()?;
    loop {
        stream.next_vertices(max, &mut block)?;
        if block.is_empty() {
            break;
        }
        assert!(block.len() <= max);
        vertices.append(&mut block);
    }
    let (mut faces, mut chunk) = (TriangleChunk::default(), TriangleChunk::default());
    let mut stream = mesh.faces()?;
    loop {
        stream.next_faces(max, &mut chunk)?;
        if chunk.is_empty() {
            break;
        }
        faces.triangles.append(&mut chunk.triangles);
        faces.faces.append(&mut chunk.faces);
        faces.short_faces += chunk.short_faces;
    }
    Ok(Read { vertices, faces })
}

/// What `work` makes of a file of these bytes.
pub(super) fn with_file<T>(name: &str, bytes: &[u8], work: impl FnOnce(&Path) -> T) -> T {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    work(&path)
}

/// `bytes` in a gzip member.
pub(super) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}
