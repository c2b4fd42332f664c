//! Surfaces as meshes have them: faces below a pixel, faces of very different size, and untidy ones.

use glam::DVec3;

use crate::camera::LensModel;
use crate::geom::Size;
use crate::synthetic::{CameraSpec, Part, Placement, PlaneSpec, Random, Shot, TestScene, Texture};

/// A rough relief whose faces are a third of a pixel wide.
pub fn sub_pixel() -> TestScene {
    let mut scene = base("sub_pixel", [0.0, 0.0, 0.8, 0.6], 0.02, 1.3);
    let mut random = Random::new(11);
    relief(&mut scene, [0.0513, 0.0487, 0.0], 0.0065, [106, 76], |_, _| random.between(0.0, 0.006));
    scene
}

/// T-junctions, faces that occur twice, and faces wound either way.
pub fn untidy() -> TestScene {
    let mut scene = base("untidy", [0.0, 0.0, 1.2, 0.9], 0.01, 2.0);
    // A relief of coarse cells; beside each third one, its neighbour is cut in three: T-junctions on a ridge. A
    // T-vertex lies beside its edge by rounding, a true crack: no pixel's centre lies on an edge, where chance
    // would decide (`grid_aligned` has centres on edges without cracks).
    let mut random = Random::new(5);
    relief(&mut scene, [0.1003, 0.1007, 0.0], 0.1, [10, 7], |_, _| random.between(0.0, 0.12));
    let coarse = std::mem::take(&mut scene.triangles);
    let parts = std::mem::take(&mut scene.parts);
    for (k, (t, part)) in coarse.into_iter().zip(parts).enumerate() {
        let [a, b, c] = t;
        if k % 3 == 1 {
            let (p, q) = (a + (b - a) / 3.0, a + (b - a) * (2.0 / 3.0));
            scene.push([a, p, c], part);
            scene.push([q, p, c], part);
            scene.push([q, b, c], part);
        } else if k % 4 == 2 {
            scene.push([c, b, a], part);
        } else {
            scene.push(t, part);
        }
    }
    // Every fifth face once more: the same, turned about, or wound the other way.
    for k in (0..scene.triangles.len()).step_by(5) {
        let ([a, b, c], part) = (scene.triangles[k], scene.parts[k]);
        scene.push([[a, b, c], [b, c, a], [c, b, a]][k % 3], part);
    }
    // Faces without area, and slivers.
    let [a, b, c] = scene.triangles[0];
    scene.push([a, a, b], Part::Wall);
    scene.push([a, 0.5 * (a + b), b], Part::Wall);
    scene.push([a, b, a + (c - a) * 1e-9], Part::Wall);
    scene
}

/// A plain of two faces two kilometres wide, and on it a relief of faces of a few millimetres.
pub fn huge_and_tiny() -> TestScene {
    let mut scene = base("huge_and_tiny", [-0.2, -0.1, 1.0, 0.8], 0.01, 1.6);
    let p = |x: f64, y: f64| DVec3::new(x, y, -0.1 + 1e-4 * x - 2e-4 * y);
    let corners = [p(-1000.0, -1000.0), p(1000.0, -1000.0), p(1000.0, 1000.0), p(-1000.0, 1000.0)];
    scene.push([corners[0], corners[1], corners[2]], Part::Plinth);
    scene.push([corners[0], corners[2], corners[3]], Part::Plinth);
    let mut random = Random::new(3);
    relief(&mut scene, [0.3, 0.2, 0.0], 0.004, [50, 40], |i, j| {
        let bump = libm::sin(f64::from(i) * 0.3) * libm::cos(f64::from(j) * 0.25);
        0.05 * bump + random.between(0.0, 0.001)
    });
    // And a tall needle of a face.
    let tip = DVec3::new(0.75, 0.6, 0.6);
    scene.push([tip, DVec3::new(0.74, 0.3, -0.1), DVec3::new(0.76, 0.3, -0.1)], Part::Shaft);
    scene
}

/// An empty scene that four photos look at from `distance` metres.
fn base(name: &'static str, extent: [f64; 4], pixel: f64, distance: f64) -> TestScene {
    let placement = Placement::IDENTITY;
    let camera = CameraSpec {
        model: LensModel::FullOpenCv,
        size: Size::new(240, 180),
        params: vec![
            260.0, 259.0, 118.5, 91.25, -0.1, 0.03, 0.0008, -0.0012, 0.004, 0.05, 0.01, 0.002,
        ],
    };
    let middle = DVec3::new(0.5 * (extent[0] + extent[2]), 0.5 * (extent[1] + extent[3]), 0.0);
    let shots = [(-0.6, 0.1, 0.0), (0.05, -0.5, 0.2), (0.7, 0.3, -1.5), (0.02, 0.03, 3.0)]
        .into_iter()
        .zip(["a.png", "b.png", "c.png", "d.png"])
        .map(|((x, y, roll), name)| {
            let centre = middle + DVec3::new(x, y, 1.0) * distance;
            Shot::towards(name, &camera, &placement, [centre, middle], roll)
        })
        .collect();
    TestScene {
        name,
        triangles: Vec::new(),
        parts: Vec::new(),
        placement,
        texture: Texture::new(6.0 * pixel),
        shots,
        plane: PlaneSpec::of_scene(&placement, pixel, extent),
    }
}

/// Adds a relief over a grid of `cells` squares from a corner; `height` gives the height of each grid point.
fn relief(
    scene: &mut TestScene,
    corner: [f64; 3],
    step: f64,
    cells: [i32; 2],
    mut height: impl FnMut(i32, i32) -> f64,
) {
    let [columns, rows] = cells;
    let points: Vec<DVec3> = (0..=rows)
        .flat_map(|j| (0..=columns).map(move |i| (i, j)))
        .map(|(i, j)| {
            DVec3::from(corner) + DVec3::new(f64::from(i) * step, f64::from(j) * step, height(i, j))
        })
        .collect();
    let at = |i: i32, j: i32| points[usize::try_from(j * (columns + 1) + i).expect("in the grid")];
    for j in 0..rows {
        for i in 0..columns {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            let part = if (i / 8 + j / 8) % 2 == 0 { Part::Arcade } else { Part::Capital };
            scene.push([a, b, c], part);
            scene.push([a, c, d], part);
        }
    }
}
