//! An OBJ file as a mesh.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::statements::{Statement, Statements};
use crate::geom::{FaceStream, MeshSource, PolygonFan, TriangleChunk, VertexStream};
use crate::{Error, Result};

/// An OBJ file whose vertices and faces have been counted.
#[derive(Debug)]
pub(in crate::input) struct ObjMesh {
    path: PathBuf,
    vertices: u32,
    faces: u32,
}

impl ObjMesh {
    /// Opens an OBJ file and counts its vertices and faces, for which it is read once.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read; [`Error::Corrupt`] if a line is no statement of an OBJ file, or if there is
    /// no face; [`Error::Unsupported`] for free-form surfaces and calls of other files; [`Error::Limit`] for more
    /// vertices or faces than 32 bits can number.
    pub(in crate::input) fn open(path: &Path) -> Result<Self> {
        let mut statements = Statements::open(path)?;
        let (mut vertices, mut faces) = (0_u64, 0_u64);
        loop {
            match statements.next()? {
                Statement::Vertex => vertices += 1,
                Statement::Face => faces += 1,
                Statement::End => break,
            }
            statements.words.skip_line()?;
        }
        if faces == 0 {
            let found = if vertices == 0 { "none" } else { "none: a point cloud" };
            return Err(Error::corrupt(path, "the whole", "faces", found));
        }
        let limited = |what: &str, found: u64| {
            let what = format!("number of {what} in {}", path.display());
            u32::try_from(found).or(Err(Error::Limit { what, limit: u32::MAX.into(), found }))
        };
        let (vertices, faces) = (limited("vertices", vertices)?, limited("faces", faces)?);
        Ok(Self { path: path.to_path_buf(), vertices, faces })
    }
}

impl MeshSource for ObjMesh {
    fn path(&self) -> &Path {
        &self.path
    }

    fn vertex_count(&self) -> u64 {
        self.vertices.into()
    }

    fn face_count(&self) -> u64 {
        self.faces.into()
    }

    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        let statements = Statements::open(&self.path)?;
        Ok(Box::new(ObjVertices { statements, left: self.vertices }))
    }

    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        let statements = Statements::open(&self.path)?;
        Ok(Box::new(ObjFaces { statements, mesh: self, vertices: 0, next: 0, pending: None }))
    }
}

/// The vertices of a file.
#[derive(Debug)]
struct ObjVertices<'a> {
    statements: Statements<'a>,
    left: u32,
}

impl VertexStream for ObjVertices<'_> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        while out.len() < max && self.left > 0 {
            match self.statements.next()? {
                Statement::Vertex => {
                    out.push(self.statements.position()?);
                    self.left -= 1;
                }
                Statement::Face => self.statements.words.skip_line()?,
                Statement::End => {
                    let expected = format!("{} more vertices", self.left);
                    return Err(self.statements.words.malformed(expected, "the end of the file"));
                }
            }
        }
        Ok(())
    }
}

/// The faces of a file.
#[derive(Debug)]
struct ObjFaces<'a> {
    statements: Statements<'a>,
    mesh: &'a ObjMesh,
    /// Vertices above the current line.
    vertices: u32,
    /// Number of the current face.
    next: u32,
    /// A face of which corners are still to be read.
    pending: Option<PolygonFan>,
}

impl FaceStream for ObjFaces<'_> {
    fn next_faces(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        out.clear();
        while out.triangles.len() < max && self.next < self.mesh.faces {
            let Some(fan) = self.pending.take() else {
                self.start_face()?;
                continue;
            };
            self.read_face(fan, max, out)?;
        }
        Ok(())
    }
}

impl ObjFaces<'_> {
    /// Goes to the corners of the next face.
    fn start_face(&mut self) -> Result<()> {
        match self.statements.next()? {
            Statement::Face => self.pending = Some(PolygonFan::new(self.next)),
            Statement::Vertex => {
                self.vertices = self.vertices.saturating_add(1);
                self.statements.words.skip_line()?;
            }
            Statement::End => {
                let expected = format!("{} more faces", self.mesh.faces - self.next);
                return Err(self.statements.words.malformed(expected, "the end of the file"));
            }
        }
        Ok(())
    }

    /// Reads the corners of a face, or as many as `out` takes.
    fn read_face(
        &mut self,
        mut fan: PolygonFan,
        max: usize,
        out: &mut TriangleChunk,
    ) -> Result<()> {
        while let Some(index) = self.statements.corner()? {
            fan.push(self.vertex(index)?, out);
            if out.triangles.len() >= max {
                self.pending = Some(fan);
                return Ok(());
            }
        }
        fan.finish(out);
        self.next += 1;
        self.statements.words.skip_line()
    }

    /// The vertex that a face means by `index`.
    #[inline]
    fn vertex(&self, index: i64) -> Result<u32> {
        let place = if index < 0 { i64::from(self.vertices) + index } else { index - 1 };
        let vertex = u32::try_from(place).ok().filter(|&v| v < self.mesh.vertices);
        vertex.ok_or_else(|| self.out_of_range(index))
    }

    #[cold]
    fn out_of_range(&self, index: i64) -> Error {
        let expected = match (index < 0, self.vertices, self.mesh.vertices) {
            (true, 0, _) | (false, _, 0) => "a vertex above it".to_owned(),
            (true, above, _) => format!("a vertex from -{above} to -1"),
            (false, _, all) => format!("a vertex from 1 to {all}"),
        };
        let place = format!("line {}, face {}", self.statements.words.line(), self.next);
        Error::corrupt(&self.mesh.path, place, expected, index.to_string())
    }
}
