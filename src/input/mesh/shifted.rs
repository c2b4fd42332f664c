//! A mesh whose coordinates stand for others: reduced ones, moved to where they belong.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::Result;
use crate::geom::{Bounds3, FaceStream, MeshSource, VertexStream};

/// A mesh to each vertex of which a shift is added, in doubles.
#[derive(Debug)]
struct ShiftedMesh {
    mesh: Box<dyn MeshSource>,
    shift: DVec3,
}

/// `mesh` with `shift` (finite, metres) added to each vertex: one rounding a coordinate, none where the sum is exact.
pub fn shifted(mesh: Box<dyn MeshSource>, shift: DVec3) -> Box<dyn MeshSource> {
    // `+ 0.0` turns −0 into 0.
    let shift = shift + 0.0;
    if shift == DVec3::ZERO { mesh } else { Box::new(ShiftedMesh { mesh, shift }) }
}

impl MeshSource for ShiftedMesh {
    fn path(&self) -> &Path {
        self.mesh.path()
    }

    fn further_files(&self) -> &[PathBuf] {
        self.mesh.further_files()
    }

    fn shift(&self) -> DVec3 {
        self.mesh.shift() + self.shift
    }

    /// At the file's own coordinates.
    fn spacing_m(&self, bounds: &Bounds3) -> f64 {
        let own = Bounds3 { min: bounds.min - self.shift, max: bounds.max - self.shift };
        self.mesh.spacing_m(&own)
    }

    fn vertex_count(&self) -> u64 {
        self.mesh.vertex_count()
    }

    fn face_count(&self) -> u64 {
        self.mesh.face_count()
    }

    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        Ok(Box::new(ShiftedVertices { vertices: self.mesh.vertices()?, shift: self.shift }))
    }

    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        self.mesh.faces()
    }
}

/// The vertices of a shifted mesh.
struct ShiftedVertices<'a> {
    vertices: Box<dyn VertexStream + 'a>,
    shift: DVec3,
}

impl VertexStream for ShiftedVertices<'_> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        self.vertices.next_vertices(max, out)?;
        for vertex in out {
            *vertex += self.shift;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::open_mesh;
    use crate::input::reading::{read, with_file};

    #[test]
    fn a_shift_is_added_to_every_vertex_and_to_nothing_else() {
        with_file("a.obj", b"v 0.5 0 -1\nv 1 2 3\nv 0 1 1e9\nf 1 2 3 1", |path| {
            let shift = DVec3::new(500_000.25, 4_200_000.0, -0.0);
            let plain = read(open_mesh(path).unwrap().as_ref()).unwrap();
            let moved = shifted(open_mesh(path).unwrap(), shift);
            assert_eq!(moved.shift(), shift);
            let found = read(moved.as_ref()).unwrap();
            let expected: Vec<_> = plain.vertices.iter().map(|&v| v + shift).collect();
            assert_eq!(found.vertices, expected);
            assert_eq!(found.faces.triangles, plain.faces.triangles);
            assert_eq!(shifted(moved, -shift).shift(), DVec3::ZERO);
        });
    }

    #[test]
    fn floats_in_reduced_coordinates_lose_nothing() {
        let mut stl = vec![0; 134];
        stl[80] = 1;
        with_file("a.stl", &stl, |path| {
            let shift = DVec3::new(5e5, 4.2e6, 0.0);
            let bounds = Bounds3::of([DVec3::ZERO, DVec3::splat(100.0)]);
            let moved = Bounds3 { min: bounds.min + shift, max: bounds.max + shift };
            let spacing = open_mesh(path).unwrap().spacing_m(&bounds);
            let mesh = shifted(open_mesh(path).unwrap(), shift);
            assert_eq!(mesh.spacing_m(&moved).to_bits(), spacing.to_bits());
            assert!(spacing < 1e-5 && open_mesh(path).unwrap().spacing_m(&moved) > 0.4);
        });
    }
}
