//! Vertices and edges exactly on pixel centres, and on photos' rays.

use glam::DVec3;

use crate::camera::LensModel;
use crate::geom::Size;
use crate::synthetic::{CameraSpec, Part, Placement, PlaneSpec, Shot, TestScene, Texture};

/// Mosaic pixel: a power of two, so that nothing rounds.
const PIXEL: f64 = 1.0 / 64.0;

/// Steps of height on a grid whose vertices are centres of mosaic pixels; photos that look straight down from over
/// such centres, with a focal length that puts the rays of their own pixel corners through them.
///
/// All coordinates are small multiples of powers of two: every edge function of a pixel centre on an edge is exactly
/// 0, every wall between steps is exactly edge-on, and every edge of a step lies exactly on segments of sight.
pub fn grid_aligned() -> TestScene {
    let camera = CameraSpec {
        model: LensModel::SimplePinhole,
        size: Size::new(256, 192),
        params: vec![256.0, 128.0, 96.0],
    };
    let placement = Placement::IDENTITY;
    // Over pixel centres: odd multiples of half a pixel.
    let at = |x: f64, y: f64| DVec3::new((x + 0.5) * PIXEL, (y + 0.5) * PIXEL, 4.0);
    let shots = [("a.png", at(64.0, 48.0)), ("b.png", at(20.0, 16.0)), ("c.png", at(116.0, 80.0))]
        .map(|(name, centre)| {
            let mut shot =
                Shot::towards(name, &camera, &placement, [centre, centre - DVec3::Z], 0.0);
            // Exactly half a turn about x: x right, y down, z forward is (x, −y, −z).
            shot.quaternion = [0.0, 1.0, 0.0, 0.0];
            shot.translation = DVec3::new(-centre.x, centre.y, centre.z);
            shot
        })
        .into();
    let mut scene = TestScene {
        name: "grid_aligned",
        triangles: Vec::new(),
        parts: Vec::new(),
        placement,
        texture: Texture::new(5.0 * PIXEL),
        shots,
        plane: PlaneSpec::of_scene(&placement, PIXEL, [0.0, 0.0, 128.0 * PIXEL, 96.0 * PIXEL]),
    };
    steps(&mut scene);
    scene
}

/// Cells of 4 × 4 pixels at heights of 0 to 3 quarters, and the upright walls between them.
fn steps(scene: &mut TestScene) {
    let (columns, rows) = (31, 23);
    let height = |i: i32, j: i32| {
        let inside = (0..columns).contains(&i) && (0..rows).contains(&j);
        inside.then(|| 0.25 * f64::from((i * i + 3 * j + i * j / 5) % 4))
    };
    let point = |i: i32, j: i32, z: f64| {
        DVec3::new(f64::from(4 * i) + 0.5, f64::from(4 * j) + 0.5, 0.0) * PIXEL + DVec3::Z * z
    };
    for j in 0..rows {
        for i in 0..columns {
            let Some(z) = height(i, j) else { continue };
            let [a, b, c, d] =
                [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| point(i, j, z));
            // Both diagonals occur; each goes through pixel centres.
            let (one, two) =
                if (i + j) % 2 == 0 { ([a, b, c], [a, c, d]) } else { ([a, b, d], [b, c, d]) };
            scene.push(one, Part::Wall);
            scene.push(two, Part::Wall);
            // Walls down to the right and upper neighbour, where that is lower or higher.
            let sides = [
                (height(i + 1, j), (i + 1, j), (i + 1, j + 1)),
                (height(i, j + 1), (i + 1, j + 1), (i, j + 1)),
            ];
            for (other, p, q) in sides {
                let Some(w) = other.filter(|w| w.total_cmp(&z).is_ne()) else { continue };
                let [p, q, r, s] =
                    [(p, z), (q, z), (q, w), (p, w)].map(|((i, j), z)| point(i, j, z));
                scene.push([p, q, r], Part::Reveal);
                scene.push([p, r, s], Part::Reveal);
            }
        }
    }
}
