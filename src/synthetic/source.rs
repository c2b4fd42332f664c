//! Scenes as mesh sources: what a mesh file would give, without the file.

use std::path::Path;

use glam::DVec3;

use super::{Refinement, TestScene};
use crate::Result;
use crate::geom::{FaceStream, MeshSource, TriangleChunk, VertexStream};

/// Vertices one by one, handed out in blocks.
struct Vertices<I>(I);

/// Faces one by one, numbered, handed out in blocks.
struct Faces<I>(I);

impl<I: Iterator<Item = DVec3> + Send> VertexStream for Vertices<I> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        out.extend(self.0.by_ref().take(max.max(1)));
        Ok(())
    }
}

impl<I: Iterator<Item = (u32, [u32; 3])> + Send> FaceStream for Faces<I> {
    fn next_faces(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        out.clear();
        for (face, triangle) in self.0.by_ref().take(max.max(1)) {
            out.push(face, triangle);
        }
        Ok(())
    }
}

/// The mesh of a test scene; no two faces share a vertex.
impl MeshSource for TestScene {
    fn path(&self) -> &Path {
        Path::new(self.name)
    }

    fn vertex_count(&self) -> u64 {
        3 * self.triangles.len() as u64
    }

    fn face_count(&self) -> u64 {
        self.triangles.len() as u64
    }

    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        Ok(Box::new(Vertices(self.triangles.as_flattened().iter().copied())))
    }

    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        let faces = (0..).zip(&self.triangles).map(|(k, _)| (k, [3 * k, 3 * k + 1, 3 * k + 2]));
        Ok(Box::new(Faces(faces)))
    }
}

/// The refined mesh, as [`super::write_ply`] would write it without noise.
impl MeshSource for Refinement<'_> {
    fn path(&self) -> &Path {
        Path::new("synthetic scene")
    }

    fn vertex_count(&self) -> u64 {
        Refinement::vertex_count(self)
    }

    fn face_count(&self) -> u64 {
        Refinement::face_count(self)
    }

    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        Ok(Box::new(Vertices(Refinement::vertices(self))))
    }

    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        Ok(Box::new(Faces((0..).zip(Refinement::faces(self).map(|(triangle, _)| triangle)))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::open_mesh;
    use crate::synthetic::{
        Part, Placement, PlyOptions, SceneBuilder, Texture, scenes, write_ply, write_triangles,
    };

    /// All triangles of a source, corner by corner, with their faces.
    fn read(source: &dyn MeshSource) -> Vec<([DVec3; 3], u32)> {
        let (mut vertices, mut block) = (Vec::new(), Vec::new());
        let mut stream = source.vertices().unwrap();
        loop {
            stream.next_vertices(1000, &mut block).unwrap();
            if block.is_empty() {
                break;
            }
            vertices.append(&mut block);
        }
        assert_eq!(vertices.len() as u64, source.vertex_count());
        let (mut faces, mut chunk) = (Vec::new(), TriangleChunk::default());
        let mut stream = source.faces().unwrap();
        loop {
            stream.next_faces(999, &mut chunk).unwrap();
            if chunk.is_empty() {
                break;
            }
            let corners = chunk.triangles.iter().map(|t| t.map(|k| vertices[k as usize]));
            faces.extend(corners.zip(chunk.faces.iter().copied()));
        }
        assert_eq!(faces.len() as u64, source.face_count());
        faces
    }

    #[test]
    fn a_test_scene_s_mesh_is_the_same_from_memory_and_from_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/mesh.ply");
        for scene in [scenes::untidy(), scenes::oblique()] {
            write_triangles(&path, &scene.triangles).unwrap();
            let expected: Vec<_> = scene.triangles.iter().copied().zip(0..).collect();
            assert_eq!(read(&scene), expected);
            assert_eq!(read(open_mesh(&path).unwrap().as_ref()), expected);
        }
    }

    #[test]
    fn a_refined_scene_s_mesh_is_the_same_from_memory_and_from_its_file() {
        let mut b = SceneBuilder::new();
        b.lathe([0.0, 0.0], &[(0.0, 0.0), (1.0, 0.3), (0.4, 1.0), (0.0, 1.2)], 9, Part::Shaft);
        let scene = b.build(Placement::upright(DVec3::splat(1e6), 0.3), Texture::new(0.02));
        let mesh = Refinement::by_edge_length(&scene, 0.07).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        write_ply(&path, &mesh, &PlyOptions::default()).unwrap();
        let expected: Vec<_> = mesh.triangles().iter().map(|t| t.0).zip(0..).collect();
        assert_eq!(read(&mesh), expected);
        assert_eq!(read(open_mesh(&path).unwrap().as_ref()), expected);
    }
}
