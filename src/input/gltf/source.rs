//! A glTF file as a mesh.

use std::path::{Path, PathBuf};

use super::buffers::{BufferBytes, Container, Place};
use super::layout::Layout;
use super::streams::{GltfFaces, GltfVertices};
use crate::Result;
use crate::geom::{Bounds3, FaceStream, MeshSource, VertexStream};

/// A glTF file whose document has been read and compared with its buffers.
#[derive(Debug)]
pub(in crate::input) struct GltfMesh {
    pub(super) path: PathBuf,
    pub(super) buffers: Vec<BufferBytes>,
    pub(super) layout: Layout,
    files: Vec<PathBuf>,
}

impl GltfMesh {
    /// Opens a GLB or glTF file and checks its document.
    ///
    /// # Errors
    /// [`crate::Error::Io`] if it or a buffer cannot be read; [`crate::Error::Corrupt`] if it is malformed, or states more
    /// than it holds; [`crate::Error::Unsupported`] for what is named in the module's page; [`crate::Error::Limit`] for
    /// more JSON than 32 MiB, and more vertices or faces than 32 bits can number.
    pub(in crate::input) fn open(path: &Path) -> Result<Self> {
        let container = Container::open(path)?;
        let layout = Layout::of(path, &container)?;
        let outside = |buffer: &BufferBytes| match &buffer.place {
            Place::File(file, _) if file != path => Some(file.clone()),
            _ => None,
        };
        let buffers = container.buffers;
        let files = buffers.iter().filter_map(outside).collect();
        Ok(Self { path: path.to_path_buf(), buffers, layout, files })
    }
}

impl MeshSource for GltfMesh {
    fn path(&self) -> &Path {
        &self.path
    }

    fn further_files(&self) -> &[PathBuf] {
        &self.files
    }

    fn vertex_count(&self) -> u64 {
        self.layout.vertices.into()
    }

    fn face_count(&self) -> u64 {
        self.layout.faces.into()
    }

    /// That of the coordinates before the nodes' transforms, which are doubles.
    fn spacing_m(&self, _bounds: &Bounds3) -> f64 {
        self.layout.spacing_m
    }

    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        Ok(Box::new(GltfVertices::new(self)))
    }

    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        Ok(Box::new(GltfFaces::new(self)))
    }
}
