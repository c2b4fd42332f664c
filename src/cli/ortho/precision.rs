//! Whether the coordinates of the meshes are fine enough.

use super::inputs::Inputs;
use crate::geom::{Bounds3, MeshSource};
use crate::store::mesh::MeshStore;

/// Neighbouring coordinates that stand this far apart or farther deserve a warning, metres: a twentieth of the finest
/// mosaic pixels, of 2 mm, that documentation asks for.
const COARSE_M: f64 = 1e-4;

/// A warning for each mesh whose number type loses detail at its coordinates. The bounds are those of all meshes, which
/// lie together.
pub(super) fn warnings(inputs: &Inputs, store: &MeshStore) -> Vec<String> {
    let Bounds3 { min, max } = store.bounds();
    let ground = Bounds3 { min: min + store.origin(), max: max + store.origin() };
    inputs.meshes.iter().filter_map(|mesh| warning(mesh.as_ref(), &ground)).collect()
}

fn warning(mesh: &dyn MeshSource, ground: &Bounds3) -> Option<String> {
    let spacing_m = mesh.spacing_m(ground);
    (spacing_m >= COARSE_M).then(|| {
        format!(
            "{}: its coordinates are 32-bit floats, which stand {:.1} mm apart there, and finer detail is lost; export \
             it with doubles, or in reduced coordinates and give --shift X,Y,Z",
            mesh.path().display(),
            spacing_m * 1000.0
        )
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::input::open_mesh;

    #[test]
    fn floats_are_warned_of_from_a_kilometre_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.stl");
        let mut stl = vec![0; 134];
        stl[80] = 1;
        std::fs::write(&path, stl).unwrap();
        let mesh = open_mesh(&path).unwrap();
        let at =
            |x: f64| warning(mesh.as_ref(), &Bounds3::of([DVec3::ZERO, DVec3::new(0.0, -x, 9.0)]));
        assert_eq!(at(1023.0), None);
        assert!(
            at(1025.0)
                .unwrap()
                .contains("a.stl: its coordinates are 32-bit floats, which stand 0.1 mm")
        );
        assert!(at(4_200_000.0).unwrap().contains(" 500.0 mm "));
    }
}
