//! What the benches of several stages share: the demo's façade with photos of half the size, and its mesh.

use std::path::{Path, PathBuf};

use groundel::geom::Size;
use groundel::input::open_mesh;
use groundel::store::mesh::{MeshBuild, MeshStore};
use groundel::synthetic::{FacadeSet, PlyOptions, Refinement, write_ply};

/// About 300,000 faces, photos of 648 × 486 pixels, a mosaic of 8 mm pixels.
pub(crate) fn facade() -> FacadeSet {
    FacadeSet {
        photo: Size::new(648, 486),
        pixel_size: 0.008,
        finest_m: 0.052,
        ..FacadeSet::demo()
    }
}

/// Writes the façade's mesh into `folder`; its file and its faces.
pub(crate) fn write_mesh(folder: &Path) -> (PathBuf, u64) {
    let (set, file) = (facade(), folder.join("mesh.ply"));
    let polyhedron = set.scene();
    let mesh = Refinement::by_face_count(&polyhedron, set.faces).expect("few faces");
    write_ply(&file, &mesh, &PlyOptions::default()).expect("room for a mesh");
    (file, mesh.face_count())
}

/// The store of a mesh file in `work`: built, if there is none.
pub(crate) fn mesh_store(file: &Path, work: &Path) -> MeshStore {
    let work = work.to_path_buf();
    let build = MeshBuild { work, budget_bytes: 200 << 20, resident_limit_bytes: 1 << 30 };
    let mesh = open_mesh(file).expect("a mesh");
    build.open_or_build(&[mesh.as_ref()], &mut |_, _, _| Ok(())).expect("a good mesh")
}
