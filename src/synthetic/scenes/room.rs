//! Photos within the mesh, and faces that run through a photo's plane.

use glam::DVec3;

use crate::camera::LensModel;
use crate::geom::Size;
use crate::synthetic::{
    CameraSpec, Part, Placement, PlaneSpec, SceneBuilder, Shot, TestScene, Texture,
};

/// A closed room with a pillar: two photos inside, one outside. The section shows the far wall, which only those
/// inside see; the near wall hides it from the one outside.
pub fn photo_inside() -> TestScene {
    let mut b = SceneBuilder::new();
    // Wound as seen from outside: the room's inner faces are seen from their backs.
    b.cuboid(DVec3::ZERO, DVec3::new(2.0, 1.5, 2.5), Part::Wall);
    b.lathe([1.1, 0.9], &[(0.1, 0.0), (0.1, 1.5)], 24, Part::Shaft);
    let placement = Placement::upright(DVec3::new(100.0, 200.0, 5.0), -0.4);
    let scene = b.build(placement, Texture::new(0.06));
    let views = [
        ("in_a.png", DVec3::new(0.5, 0.8, 2.1), DVec3::new(1.0, 0.7, 0.0)),
        ("in_b.png", DVec3::new(1.6, 0.6, 2.2), DVec3::new(0.9, 0.8, 0.0)),
        ("out.png", DVec3::new(0.9, 0.7, 4.5), DVec3::new(1.0, 0.7, 0.0)),
    ];
    let mut plane = PlaneSpec::of_scene(&placement, 0.015, [-0.05, -0.05, 2.05, 1.55]);
    plane.elevation = Some([-0.5, 2.0]);
    TestScene::of_scene("photo_inside", &scene, 0.12, shots(&placement, &views), plane)
}

/// A floor and a wall that pass beside and behind the cameras, in large faces: their corners have no image.
pub fn through_photo_plane() -> TestScene {
    let mut b = SceneBuilder::new();
    b.cuboid(DVec3::new(0.0, 0.0, -0.2), DVec3::new(2.0, 1.5, 0.0), Part::Wall);
    // A floor and a side wall, six metres deep; the cameras stand one to two metres from the wall.
    b.cuboid(DVec3::new(-0.5, -0.1, -0.3), DVec3::new(2.5, 0.05, 6.0), Part::Plinth);
    b.cuboid(DVec3::new(1.9, 0.0, -0.25), DVec3::new(2.1, 1.6, 6.0), Part::Arcade);
    // A beam from the wall through the middle camera's plane, past its left side.
    b.cuboid(DVec3::new(0.55, 0.95, -0.05), DVec3::new(0.65, 1.05, 4.0), Part::Cornice);
    let placement = Placement::IDENTITY;
    let scene = b.build(placement, Texture::new(0.06));
    let views = [
        ("a.png", DVec3::new(0.3, 0.7, 1.3), DVec3::new(0.9, 0.7, 0.0)),
        ("b.png", DVec3::new(0.9, 0.9, 1.8), DVec3::new(1.0, 0.8, 0.0)),
        ("c.png", DVec3::new(1.6, 0.5, 1.5), DVec3::new(0.9, 0.8, 0.0)),
        ("d.png", DVec3::new(1.0, 1.3, 1.1), DVec3::new(0.8, 0.6, 0.0)),
    ];
    let plane = PlaneSpec::of_scene(&placement, 0.015, [-0.05, -0.05, 2.05, 1.55]);
    TestScene::of_scene("through_photo_plane", &scene, 9.0, shots(&placement, &views), plane)
}

fn shots(placement: &Placement, views: &[(&str, DVec3, DVec3)]) -> Vec<Shot> {
    let params = vec![185.0, 184.0, 121.0, 89.0, -0.08, 0.01, 0.001, 0.0005];
    let camera = CameraSpec { model: LensModel::OpenCv, size: Size::new(240, 180), params };
    views
        .iter()
        .map(|&(name, centre, target)| {
            Shot::towards(name, &camera, placement, [centre, target], 0.02)
        })
        .collect()
}
