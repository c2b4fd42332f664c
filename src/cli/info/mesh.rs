//! What is in a mesh file, and in a mesh store.

use std::path::Path;

use glam::DVec3;

use crate::Result;
use crate::geom::{Bounds3, MeshSource};
use crate::input::{mesh_format, open_mesh};
use crate::store::mesh::MeshStore;

/// Vertices read at once.
const CHUNK: usize = 1 << 16;
/// Pages of a store that may stay mapped while its header is looked at, bytes.
const RESIDENT_BYTES: u64 = 16 << 20;

/// Format, vertices, faces and bounds of a mesh file; reads all vertices.
///
/// # Errors
/// What reading the file gives.
pub(super) fn describe(path: &Path) -> Result<String> {
    let mesh = open_mesh(path)?;
    let format = mesh_format(path)?.map(|format| format.to_string()).unwrap_or_default();
    let (bounds, not_finite) = vertex_bounds(&*mesh)?;
    let spacing_m = bounds.map_or(0.0, |(min, max)| mesh.spacing_m(&Bounds3 { min, max }));
    let mut lines = vec![
        format!("{}: mesh, {format}", path.display()),
        format!("vertices: {}", mesh.vertex_count()),
        format!("faces: {}", mesh.face_count()),
    ];
    lines.extend(bounds.map(|(min, max)| bounds_line(min, max)));
    if spacing_m > 0.0 {
        let spacing = spacing_m * 1000.0;
        lines.push(format!("coordinates: 32-bit floats, {spacing:.3} mm apart at the greatest"));
    }
    if not_finite > 0 {
        lines.push(format!("vertices not finite: {not_finite}"));
    }
    Ok(lines.join("\n") + "\n")
}

/// Bounds of the finite vertices, ground, and how many are not finite; reads all of them.
///
/// # Errors
/// What reading the file gives.
pub(super) fn vertex_bounds(mesh: &dyn MeshSource) -> Result<(Option<(DVec3, DVec3)>, u64)> {
    let mut stream = mesh.vertices()?;
    let mut chunk = Vec::new();
    let (mut bounds, mut not_finite) = (None, 0_u64);
    loop {
        stream.next_vertices(CHUNK, &mut chunk)?;
        if chunk.is_empty() {
            break;
        }
        for vertex in &chunk {
            if vertex.is_finite() {
                let (min, max): (DVec3, DVec3) = bounds.unwrap_or((*vertex, *vertex));
                bounds = Some((min.min(*vertex), max.max(*vertex)));
            } else {
                not_finite += 1;
            }
        }
    }
    Ok((bounds, not_finite))
}

/// Counts, bounds and resolution of a mesh store.
///
/// # Errors
/// What opening the store gives.
pub(super) fn describe_store(path: &Path) -> Result<String> {
    let store = MeshStore::open(path, RESIDENT_BYTES)?;
    let counts = store.counts();
    let Bounds3 { min, max } = store.bounds();
    let lines = [
        format!("{}: mesh store, {} bytes", path.display(), store.file_bytes()),
        format!("vertices of the files: {}", counts.vertices),
        format!("vertices not finite, used by no face: {}", counts.vertices_unusable),
        format!("faces of the files: {}", counts.faces),
        format!("faces dropped: {}", counts.faces_dropped()),
        format!("triangles: {}", counts.triangles),
        format!("partitions: {}", store.partition_count()),
        format!("lattice: origin {:?}, step {} m", store.origin().to_array(), store.step()),
        bounds_line(min, max),
    ];
    Ok(lines.join("\n") + "\n")
}

fn bounds_line(min: DVec3, max: DVec3) -> String {
    format!("bounds: x {} to {}, y {} to {}, z {} to {}", min.x, max.x, min.y, max.y, min.z, max.z)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn counts_and_bounds_of_finite_vertices_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.ply");
        let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n\
                    property double z\nelement face 1\nproperty list uchar int vertex_index\nend_header\n\
                    500000.05 1 2\n500001 -3 2\n500000.5 1 7.5\nnan 0 0\n3 0 1 2\n";
        fs::write(&path, text).unwrap();
        let told = describe(&path).unwrap();
        let (first, told) = told.split_once('\n').unwrap();
        assert!(first.ends_with("m.ply: mesh, PLY"), "{first}");
        assert_eq!(
            told,
            "vertices: 4\nfaces: 1\nbounds: x 500000.05 to 500001, y -3 to 1, z 2 to 7.5\n\
             vertices not finite: 1\n"
        );
    }
    #[test]
    fn floats_are_told_with_the_detail_that_they_lose() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.stl");
        let mut stl = vec![0; 134];
        stl[80] = 1;
        stl[96..100].copy_from_slice(&4_200_000_f32.to_le_bytes());
        fs::write(&path, &stl).unwrap();
        let told = describe(&path).unwrap();
        assert!(told.contains("m.stl: mesh, STL (binary)\nvertices: 3\nfaces: 1\n"), "{told}");
        assert!(told.ends_with("\ncoordinates: 32-bit floats, 500.000 mm apart at the greatest\n"));
    }
}
