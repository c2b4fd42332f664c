//! Columns before a wall, in several attitudes and through several lenses.

use glam::DVec3;

use crate::camera::LensModel;
use crate::geom::Size;
use crate::synthetic::{
    CameraSpec, Part, Placement, PlaneSpec, Scene, SceneBuilder, Shot, TestScene, Texture,
};

/// Shortest wavelength of the texture, metres: about five photo pixels.
const FINEST: f64 = 0.08;
/// Mosaic pixel, metres.
const PIXEL: f64 = 0.02;
/// Extent of the mosaic: the wall and a margin without surface.
const EXTENT: [f64; 4] = [-0.05, -0.06, 2.47, 1.88];

/// Two columns and a lintel before a wall.
pub fn columns() -> TestScene {
    of("columns", Placement::IDENTITY, &opencv(), None)
}

/// The same far from the origin, in an oblique frame.
pub fn oblique() -> TestScene {
    let origin = DVec3::new(500_000.3, 4_200_000.7, 100.2);
    let placement =
        Placement::oblique(origin, DVec3::new(0.6, 0.7, 0.13), DVec3::new(-0.2, 0.1, 1.0));
    of("oblique", placement, &opencv(), None)
}

/// The same through a lens of model RADIAL whose principal point lies far off the middle.
pub fn radial() -> TestScene {
    let camera = CameraSpec {
        model: LensModel::Radial,
        size: Size::new(320, 240),
        params: vec![290.0, 205.5, 88.25, -0.21, 0.06],
    };
    of("radial", Placement::upright(DVec3::new(3.0, -7.0, 1.0), 0.7), &camera, None)
}

/// The same through a wide lens whose model folds back within the scene: beyond the valid radius a photo shows
/// nothing, though the formula gives a position in the frame.
pub fn wide_angle() -> TestScene {
    let camera = CameraSpec {
        model: LensModel::SimpleRadial,
        size: Size::new(320, 240),
        params: vec![170.0, 160.0, 120.0, -0.42],
    };
    let mut scene = of("wide_angle", Placement::IDENTITY, &camera, None);
    for (k, (x, y)) in [(0.5, 0.5), (1.9, 1.2), (1.2, 0.9)].into_iter().enumerate() {
        // Half a metre to a metre before the columns: the wall's far parts are beyond the valid radius.
        let ends = [DVec3::new(x, y, 0.7), DVec3::new(1.2, 0.9, -0.8)];
        let name = format!("near_{k}.png");
        scene.shots.push(Shot::towards(&name, &camera, &scene.placement, ends, 0.0));
    }
    scene
}

/// A section of the wall: the columns lie beyond the slab and are not shown, but the photos saw them.
pub fn hidden_section() -> TestScene {
    of("hidden_section", Placement::IDENTITY, &opencv(), Some([-2.0, -0.45]))
}

/// The scene proper; the columns stand free of wall and floor.
fn colonnade(placement: Placement) -> Scene {
    let mut b = SceneBuilder::new();
    b.cuboid(DVec3::new(0.0, 0.0, -1.0), DVec3::new(2.4, 1.8, -0.8), Part::Wall);
    b.cuboid(DVec3::new(0.31, 0.0, -0.85), DVec3::new(0.83, 0.4, -0.5), Part::Plinth);
    for (x, z) in [(0.62, 0.0), (1.71, -0.1)] {
        let profile = [(0.0, 0.05), (0.16, 0.05), (0.13, 0.7), (0.11, 1.45), (0.0, 1.45)];
        b.lathe([x, z], &profile, 24, Part::Shaft);
    }
    b.cuboid(DVec3::new(0.3, 1.45, -0.2), DVec3::new(2.05, 1.62, 0.15), Part::Cornice);
    b.build(placement, Texture::new(FINEST))
}

fn opencv() -> CameraSpec {
    let params = vec![300.0, 301.5, 163.0, 117.5, -0.12, 0.04, 0.0015, -0.001];
    CameraSpec { model: LensModel::OpenCv, size: Size::new(320, 240), params }
}

fn of(
    name: &'static str,
    placement: Placement,
    camera: &CameraSpec,
    slab: Option<[f64; 2]>,
) -> TestScene {
    // From the left, the middle and the right; from above; and from behind the wall, which sees no front.
    let views = [
        ("a.png", DVec3::new(-0.6, 0.8, 2.2), DVec3::new(0.9, 0.9, -0.7), 0.04),
        ("b.png", DVec3::new(1.1, 0.6, 2.6), DVec3::new(1.2, 0.9, -0.7), -0.03),
        ("c.png", DVec3::new(3.1, 1.0, 2.1), DVec3::new(1.5, 0.9, -0.7), 1.6),
        ("sub folder/d.png", DVec3::new(1.4, 3.1, 2.0), DVec3::new(1.1, 0.9, -0.6), 0.0),
        ("sub folder/e.png", DVec3::new(1.3, 0.9, -3.0), DVec3::new(1.2, 0.9, -0.8), 0.1),
    ];
    let shots = views
        .map(|(name, centre, target, roll)| {
            Shot::towards(name, camera, &placement, [centre, target], roll)
        })
        .into();
    let mut plane = PlaneSpec::of_scene(&placement, PIXEL, EXTENT);
    plane.elevation = slab;
    TestScene::of_scene(name, &colonnade(placement), 0.11, shots, plane)
}
