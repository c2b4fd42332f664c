//! The mesh in a file.

use std::path::Path;

use super::super::content::Compression;
use super::super::gltf::GltfMesh;
use super::super::obj::ObjMesh;
use super::super::ply::PlyMesh;
use super::super::stl::{StlMesh, StlText};
use super::super::xyz::XyzMesh;
use super::{MeshKind, mesh_format};
use crate::geom::MeshSource;
use crate::{Error, Result};

/// Opens a mesh file, whatever its name: PLY, OBJ, STL or XYZ triplets, each perhaps compressed by gzip or Zstandard;
/// GLB or glTF. Its header is checked; text without one is read once for its counts.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Unsupported`] if it is of no known format; otherwise those of the
/// format.
pub fn open_mesh(path: &Path) -> Result<Box<dyn MeshSource>> {
    let Some(format) = mesh_format(path)? else {
        let what = "a mesh file that is neither PLY, OBJ, STL, glTF nor XYZ triplets".to_owned();
        let hint = Some("export the mesh as PLY".to_owned());
        return Err(Error::Unsupported { path: path.to_path_buf(), what, hint });
    };
    Ok(match format.kind {
        MeshKind::Ply => Box::new(PlyMesh::open(path)?),
        MeshKind::Obj => Box::new(ObjMesh::open(path)?),
        MeshKind::StlText => Box::new(StlText::open(path)?),
        MeshKind::StlBinary => Box::new(StlMesh::open(path)?),
        MeshKind::Xyz => Box::new(XyzMesh::open(path)?),
        MeshKind::Glb | MeshKind::Gltf if format.compression == Compression::None => {
            Box::new(GltfMesh::open(path)?)
        }
        MeshKind::Glb | MeshKind::Gltf => {
            let what = format!("a compressed mesh file of this format: {format}");
            let hint = Some("decompress it".to_owned());
            return Err(Error::Unsupported { path: path.to_path_buf(), what, hint });
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::reading::{gzip, read, with_file};

    const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n\
        0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    #[test]
    fn the_same_triangle_comes_from_every_format_whatever_the_name() {
        let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        let stl = "solid\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n\
                   endfacet\nendsolid";
        let binary = {
            let mut bytes = vec![0; 134];
            bytes[80] = 1;
            bytes[108..112].copy_from_slice(&1_f32.to_le_bytes());
            bytes[124..128].copy_from_slice(&1_f32.to_le_bytes());
            bytes
        };
        let xyz = "0 0 0 1 0 0 0 1 0";
        let big_ply = {
            let (head, _) = PLY.split_at(PLY.find("0 0 0\n").unwrap());
            let mut bytes = head.replace("ascii", "binary_big_endian").into_bytes();
            for k in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0] {
                bytes.extend(k.to_be_bytes());
            }
            bytes.push(3);
            bytes.extend([0_i32, 1, 2].into_iter().flat_map(i32::to_be_bytes));
            bytes
        };
        let texts =
            [PLY.as_bytes(), &big_ply, obj.as_bytes(), stl.as_bytes(), &binary, xyz.as_bytes()];
        let corners = read(open(&gzip(obj.as_bytes())).unwrap().as_ref());
        assert!(corners.is_err(), "the file is gone");
        for bytes in texts {
            for bytes in [bytes.to_vec(), gzip(bytes), zstd::encode_all(bytes, 3).unwrap()] {
                with_file("mesh.obj", &bytes, |path| {
                    let found = read(open_mesh(path).unwrap().as_ref()).unwrap().corners();
                    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
                    assert_eq!(found, [(corners.map(glam::DVec3::from_array), 0)]);
                });
            }
        }
    }

    fn open(bytes: &[u8]) -> Result<Box<dyn MeshSource>> {
        with_file("mesh", bytes, open_mesh)
    }

    #[test]
    fn what_is_no_mesh_is_refused() {
        assert!(matches!(open(b"hello\n"), Err(Error::Unsupported { .. })));
        assert!(matches!(open(b""), Err(Error::Unsupported { .. })));
        assert!(matches!(open(&gzip(b"glTF")), Err(Error::Unsupported { hint: Some(_), .. })));
        assert!(matches!(open_mesh(Path::new("/no/such/mesh")), Err(Error::Io { .. })));
    }
}
