//! Mesh files by their content.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::ply::PlyMesh;
use crate::geom::MeshSource;
use crate::{Error, Result};

/// Opens a mesh file, whatever its name, and checks its header.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Unsupported`] if it is not a PLY file; otherwise those of the
/// format.
pub fn open_mesh(path: &Path) -> Result<Box<dyn MeshSource>> {
    let mut magic = Vec::new();
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    file.take(4).read_to_end(&mut magic).map_err(|e| Error::io(path, e))?;
    if let [b'p', b'l', b'y', b'\r' | b'\n'] = magic.as_slice() {
        return Ok(Box::new(PlyMesh::open(path)?));
    }
    let what = "a mesh file that does not begin with `ply`".to_owned();
    let hint = Some("export the mesh as PLY".to_owned());
    Err(Error::Unsupported { path: path.to_path_buf(), what, hint })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_known_by_its_content_not_by_its_name() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mesh.obj");
        let ply = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\n\
                   property float z\nelement face 0\nproperty list uchar int vertex_index\nend_header\n";
        std::fs::write(&path, ply).unwrap();
        assert_eq!(open_mesh(&path).unwrap().face_count(), 0);
        std::fs::write(&path, "v 0 0 0\n").unwrap();
        assert!(matches!(open_mesh(&path), Err(Error::Unsupported { .. })));
        assert!(matches!(open_mesh(&dir.path().join("none")), Err(Error::Io { .. })));
    }
}
