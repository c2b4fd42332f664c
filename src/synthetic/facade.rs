//! The façade: columns, arches and niches before a recessed wall.
//!
//! Scene axes: x along the façade, 0 to 7.4 m; y up, 0 to 5.5 m; z towards the viewer, from the backs of the niches
//! at −1.4 m to the edge of the cornice at 0.3 m.

use glam::DVec3;

use super::{Figure, Opening, Part, Placement, Scene, SceneBuilder, Texture};

/// Width and height of the façade, metres.
pub const FACADE_SIZE: [f64; 2] = [7.4, 5.5];

/// From one façade of a row to the next, metres: their cornices do not touch.
pub const HOUSE_STEP_M: f64 = 7.7;

/// Top of the plinth, on which the columns stand.
const FLOOR: f64 = 0.5;
/// Front of the recessed wall.
const WALL_Z: f64 = -1.0;
/// Where the arches of the arcade spring.
const ARCADE_SPRING: f64 = 3.2;
/// Front and back of the arcade.
const ARCADE_Z: [f64; 2] = [0.0, -0.42];
/// Top of the walls, within the cornice.
const WALL_TOP: f64 = 4.95;
/// Left and right edge of the arches.
const BAYS: [[f64; 2]; 4] = [[0.42, 1.79], [2.10, 3.47], [3.78, 5.15], [5.46, 6.98]];

/// The façade, a polyhedron of about 1,700 patches, placed in the ground frame.
///
/// Solids stand in one another by a centimetre or so, as a scan's surface does not: each of them is closed or
/// ends within another, so that no ray passes between them.
pub fn facade(placement: Placement, texture: Texture) -> Scene {
    row_of_facades(1, placement, texture)
}

/// `houses` façades side by side along x, [`HOUSE_STEP_M`] from one to the next; the first is [`facade()`].
pub fn row_of_facades(houses: u32, placement: Placement, texture: Texture) -> Scene {
    let mut b = SceneBuilder::new();
    for house in 0..houses.max(1) {
        b.moved_by(DVec3::X * (HOUSE_STEP_M * f64::from(house)));
        add_facade(&mut b);
    }
    b.build(placement, texture)
}

/// Adds one façade, where the builder stands.
fn add_facade(b: &mut SceneBuilder) {
    plinth(b);
    recessed_wall(b);
    arcade(b);
    for pair in BAYS.windows(2) {
        column(b, 0.5 * (pair[0][1] + pair[1][0]));
    }
    cornice(b);
}

/// The plinth, a step before it in the two bays on the right, and the hall's floor.
fn plinth(b: &mut SceneBuilder) {
    b.cuboid(DVec3::new(0.0, 0.0, -1.5), DVec3::new(7.4, FLOOR, 0.16), Part::Plinth);
    b.cuboid(DVec3::new(3.9, -0.01, 0.1), DVec3::new(7.1, 0.24, 0.29), Part::Plinth);
}

/// The wall behind the columns: a door, two windows with bars, and a niche with a sphere; the ceiling.
fn recessed_wall(b: &mut SceneBuilder) {
    let opening = |x, sill, segments| Opening { x, sill, segments };
    let openings = [
        opening([0.72, 1.52], 1.25, 12),
        opening([2.38, 3.26], FLOOR, 16),
        opening([4.12, 4.86], 1.25, 12),
        opening([5.78, 6.66], 1.02, 14),
    ];
    // A little below the floor and beyond the end piers' inner faces.
    let (wall, holes) = Figure::arched_wall([0.2, 7.2], [FLOOR - 0.02, WALL_TOP], 2.45, &openings);
    b.sheet(&wall, WALL_Z, Part::Wall);
    for (hole, depth) in holes.iter().zip([0.28, 0.40, 0.28, 0.36]) {
        let back = WALL_Z - depth;
        b.walls(hole, WALL_Z, back, Part::Reveal);
        b.sheet(hole, back, Part::Niche);
    }
    for [left, right] in [openings[0].x, openings[2].x] {
        window_bars(b, left, right, 1.25);
    }
    // The third opening is a niche with an egg on a pedestal.
    let x = 0.5 * (openings[3].x[0] + openings[3].x[1]);
    let base = [(0.0, 1.0), (0.16, 1.0), (0.12, 1.22), (0.17, 1.27), (0.0, 1.27)];
    b.lathe([x, WALL_Z - 0.17], &base, 24, Part::Capital);
    let egg: Vec<(f64, f64)> = (0..=10)
        .map(|k| {
            let angle = std::f64::consts::PI * f64::from(k) / 10.0;
            let radius = if k % 10 == 0 { 0.0 } else { 0.19 * libm::sin(angle) };
            (radius, 1.53 - 0.29 * libm::cos(angle))
        })
        .collect();
    b.lathe([x, WALL_Z - 0.17], &egg, 28, Part::Shaft);
    // The hall's ceiling, seen from below, and its ends.
    b.cuboid(DVec3::new(0.2, 4.55, -1.1), DVec3::new(7.2, 4.6, -0.3), Part::Reveal);
    b.cuboid(DVec3::new(0.02, FLOOR - 0.02, -1.2), DVec3::new(0.38, WALL_TOP, -0.40), Part::Wall);
    b.cuboid(DVec3::new(7.02, FLOOR - 0.02, -1.2), DVec3::new(7.38, WALL_TOP, -0.40), Part::Wall);
}

/// An upright and two transoms, 4 cm wide, in a window.
fn window_bars(b: &mut SceneBuilder, left: f64, right: f64, sill: f64) {
    let (x, top) = (0.5 * (left + right), 2.45 + 0.5 * (right - left));
    let z = [WALL_Z - 0.21, WALL_Z - 0.165];
    b.cuboid(
        DVec3::new(x - 0.02, sill - 0.01, z[0]),
        DVec3::new(x + 0.02, top - 0.002, z[1]),
        Part::Capital,
    );
    for y in [1.86, 2.45] {
        b.cuboid(
            DVec3::new(left - 0.01, y - 0.018, z[0] + 0.005),
            DVec3::new(right + 0.01, y + 0.018, z[1] - 0.005),
            Part::Capital,
        );
    }
}

/// The arcade: end piers from the floor, arches over the bays.
fn arcade(b: &mut SceneBuilder) {
    let openings = BAYS.map(|x| Opening { x, sill: FLOOR - 0.02, segments: 18 });
    let (mut wall, _) =
        Figure::arched_wall([0.0, 7.4], [FLOOR - 0.02, WALL_TOP], ARCADE_SPRING, &openings);
    // Between the bays the columns stand in the wall's place.
    wall.cells.retain(|cell| {
        let (x, y) = (0.5 * (cell[0].x + cell[1].x), cell[0].y);
        y >= ARCADE_SPRING || x < BAYS[0][0] || x > BAYS[3][1]
    });
    b.prism(&wall, ARCADE_Z[1], ARCADE_Z[0], Part::Arcade);
    // Imposts on the end piers, at the height of the capitals.
    for [left, right] in [[-0.03, 0.46], [6.94, 7.43]] {
        b.cuboid(
            DVec3::new(left, ARCADE_SPRING - 0.11, ARCADE_Z[1] - 0.03),
            DVec3::new(right, ARCADE_SPRING + 0.01, 0.04),
            Part::Capital,
        );
    }
}

/// A column at `x`: square base, torus, shaft with entasis, capital and abacus.
fn column(b: &mut SceneBuilder, x: f64) {
    let z = 0.5 * (ARCADE_Z[0] + ARCADE_Z[1]);
    let square = |half: f64, y0: f64, y1: f64| {
        [DVec3::new(x - half, y0, z - half), DVec3::new(x + half, y1, z + half)]
    };
    let [min, max] = square(0.215, FLOOR - 0.01, FLOOR + 0.12);
    b.cuboid(min, max, Part::Capital);
    let [min, max] = square(0.22, ARCADE_SPRING - 0.12, ARCADE_SPRING + 0.008);
    b.cuboid(min, max, Part::Capital);
    let base = [(0.18, 0.61), (0.21, 0.65), (0.21, 0.69), (0.175, 0.74), (0.150, 0.76)];
    b.lathe([x, z], &base, 32, Part::Capital);
    let shaft =
        [(0.152, 0.75), (0.155, 1.2), (0.153, 1.8), (0.146, 2.4), (0.135, 2.86), (0.135, 2.92)];
    b.lathe([x, z], &shaft, 32, Part::Shaft);
    let capital = [(0.128, 2.86), (0.150, 2.87), (0.150, 2.91), (0.14, 2.93), (0.215, 3.09)];
    b.lathe([x, z], &capital, 32, Part::Capital);
}

/// Three steps of cornice with dentils under the second.
fn cornice(b: &mut SceneBuilder) {
    let steps = [(0.02, 4.82, 5.02, 0.08), (0.05, 5.0, 5.26, 0.20), (0.10, 5.24, 5.5, 0.30)];
    for (beyond, low, high, front) in steps {
        b.cuboid(
            DVec3::new(-beyond, low, ARCADE_Z[1] - beyond),
            DVec3::new(7.4 + beyond, high, front),
            Part::Cornice,
        );
    }
    for k in 0..34 {
        let x = 0.04 + 0.217 * f64::from(k);
        b.cuboid(DVec3::new(x, 4.90, 0.07), DVec3::new(x + 0.11, 5.01, 0.16), Part::Capital);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Bounds3;
    use crate::synthetic::Caster;

    #[test]
    fn the_facade_has_its_size_and_no_hole_from_the_front() {
        let scene = facade(Placement::IDENTITY, Texture::new(0.02));
        let Bounds3 { min, max } = scene.bounds();
        assert!(min.x > -0.2 && max.x < 7.6 && min.y > -0.1 && max.y < 5.51 && max.z < 0.31);
        let caster = Caster::of_scene(&scene);
        let mut depths = std::collections::BTreeSet::new();
        for j in 1..110 {
            for i in 1..148 {
                let from = DVec3::new(f64::from(i) * 0.05, f64::from(j) * 0.05 - 0.013, 9.0);
                let hit = caster.cast(from, DVec3::NEG_Z, None);
                let hit = hit.unwrap_or_else(|| panic!("a hole at {from}"));
                assert!(hit.ground.z > -1.45 && hit.normal.z > 0.0, "{hit:?}");
                depths.insert(hit.part);
            }
        }
        // From the front, jambs and sills are edge-on.
        assert!(Part::ALL.iter().all(|p| *p == Part::Reveal || depths.contains(p)), "{depths:?}");
    }

    #[test]
    fn every_patch_is_planar_and_convex() {
        let scene = facade(Placement::IDENTITY, Texture::new(0.02));
        assert!(scene.patches().len() > 1_000 && scene.patches().len() < 3_000);
        for patch in scene.patches() {
            let corners = scene.corners(patch);
            let cross = |k: usize| {
                let [p, q, r] = [k, k + 1, k + 2].map(|i| corners[i % 4]);
                (q - p).cross(r - q)
            };
            let normal = (cross(0) + cross(1) + cross(2) + cross(3)).normalize();
            for k in 0..4 {
                assert!(cross(k).dot(normal) >= 0.0, "{corners:?}");
                assert!(normal.dot(corners[k] - corners[0]).abs() < 1e-12, "{corners:?}");
            }
        }
    }
}
