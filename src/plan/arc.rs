//! What the development of a cylinder covers.

use std::f64::consts::PI;

use super::Partitions;
use crate::frame::{AroundAxis, Cylinder, LocalCylinder};
use crate::{Error, Result};

/// Parts of a turn that are told apart when the widest gap is looked for.
const PARTS: usize = 1 << 16;

/// Surface that reaches less than this into a pixel, in pixels, does not make the extent grow.
const SNAP_PX: f64 = 1e-3;

/// The extent `[u_min, v_min, u_max, v_max]`, metres, of the smallest arc that holds all faces in the slab: a turn less
/// the widest gap. v, and the arc's ends, are snapped outward to whole multiples of `pixel_size`; where there is no gap,
/// the arc is the turn from −π to π.
///
/// A face counts whole if any of its corners lies in the slab, or they lie on both sides of it.
///
/// # Errors
/// [`Error::Usage`] if no face lies in the slab; errors of reading the mesh.
pub fn default_arc(
    mesh: &impl Partitions,
    cylinder: &Cylinder,
    elevation: [f64; 2],
    pixel_size: f64,
) -> Result<[f64; 4]> {
    let local = cylinder.local(mesh.origin(), 0.0);
    let mut taken = vec![false; PARTS];
    let mut v_range = [f64::INFINITY, f64::NEG_INFINITY];
    visit(mesh, &local, elevation, &mut |[from, to], v| {
        v_range = [v_range[0].min(v[0]), v_range[1].max(v[1])];
        mark(&mut taken, from, to);
    })?;
    if v_range[0] > v_range[1] {
        return Err(Error::usage(
            "mesh and frame do not meet: no face lies in the cylinder's range of elevation; check the frame and --elevation",
        ));
    }
    let turn = 2.0 * PI * cylinder.radius;
    let [u_min, u_max] = match widest_gap(&taken) {
        None => [-0.5 * turn, 0.5 * turn],
        Some(middle) => {
            // Angles from the middle of the gap on.
            let mut arc = [f64::INFINITY, f64::NEG_INFINITY];
            visit(mesh, &local, elevation, &mut |[from, to], _| {
                let start = (from - middle).rem_euclid(2.0 * PI);
                arc = [arc[0].min(start), arc[1].max(start + (to - from))];
            })?;
            let ends = arc.map(|angle| middle + angle);
            // The turn in which the arc's middle lies within ± π.
            let turns = (0.5 * (ends[0] + ends[1]) / (2.0 * PI)).round() * 2.0 * PI;
            let [a, b] = ends.map(|angle| local.along(angle - turns));
            let [low, high] = snapped([a.min(b), a.max(b)], pixel_size);
            // Snapping must not take in more than a turn.
            if high - low > turn { [a.min(b), a.min(b) + turn] } else { [low, high] }
        }
    };
    let [v_min, v_max] = snapped(v_range, pixel_size);
    Ok([u_min, v_min, u_max, v_max])
}

/// Calls `f` with the range of angles and of v of each face in the slab.
fn visit(
    mesh: &impl Partitions,
    local: &LocalCylinder,
    [low, high]: [f64; 2],
    f: &mut dyn FnMut([f64; 2], [f64; 2]),
) -> Result<()> {
    for k in 0..mesh.count() {
        mesh.visit(k, &mut |block| {
            let around: Vec<AroundAxis> =
                block.positions.iter().map(|&p| local.around_axis(p)).collect();
            for corners in block.triangles {
                let corners = corners.map(|i| around[usize::from(i)]);
                let elevations = corners.map(|c| local.elevation(c.distance));
                let below = elevations.iter().all(|&e| e < low);
                let above = elevations.iter().all(|&e| e > high);
                if below || above {
                    continue;
                }
                let vs = corners.map(|c| c.v);
                let v = [vs[0].min(vs[1]).min(vs[2]), vs[0].max(vs[1]).max(vs[2])];
                f(AroundAxis::angles_of(corners).unwrap_or([-PI, PI]), v);
            }
        })?;
    }
    Ok(())
}

/// Marks the parts of a turn that a range of angles touches.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of a turn, counted from 0"
)]
fn mark(taken: &mut [bool], from: f64, to: f64) {
    let parts = PARTS as f64;
    let first = (from.rem_euclid(2.0 * PI) / (2.0 * PI) * parts).floor() as usize;
    let count = ((to - from) / (2.0 * PI) * parts).ceil() as usize + 1;
    for k in first..first + count.min(PARTS) {
        taken[k % PARTS] = true;
    }
}

/// The angle in the middle of the longest run of parts that are not taken; `None` if all are.
fn widest_gap(taken: &[bool]) -> Option<f64> {
    let first = taken.iter().position(|&t| t)?;
    let (mut best, mut run) = ((0_usize, 0), 0);
    for k in first..=first + taken.len() {
        if taken[k % taken.len()] {
            if run > best.0 {
                best = (run, k);
            }
            run = 0;
        } else {
            run += 1;
        }
    }
    let (length, end) = best;
    let middle = end as f64 - 0.5 * length as f64;
    (length > 0).then(|| middle / taken.len() as f64 * 2.0 * PI)
}

/// Outward to whole pixels from 0, at least one.
fn snapped([min, max]: [f64; 2], pixel_size: f64) -> [f64; 2] {
    let low = (min / pixel_size + SNAP_PX).floor();
    let high = (max / pixel_size - SNAP_PX).ceil().max(low + 1.0);
    [low * pixel_size, high * pixel_size]
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::partitions::soup::Soup;
    use super::*;
    use crate::frame::Facing;

    fn cylinder(facing: Facing) -> Cylinder {
        Cylinder {
            origin: DVec3::ZERO,
            axis: DVec3::Z,
            zero: DVec3::X,
            radius: 2.0,
            facing,
            pixel_size: None,
            extent: None,
            elevation: None,
        }
    }

    /// A wall of quadrangles from one angle to another, 2 m from the axis, 0 to 3 m high.
    fn wall(from_degrees: i32, to_degrees: i32) -> Soup {
        let at = |degrees: i32, z: f64| {
            let angle = f64::from(degrees).to_radians();
            DVec3::new(2.0 * angle.cos(), 2.0 * angle.sin(), z)
        };
        let faces: Vec<_> = (from_degrees..to_degrees)
            .flat_map(|d| {
                let [a, b, c, e] = [at(d, 0.0), at(d + 1, 0.0), at(d + 1, 3.0), at(d, 3.0)];
                [[a, b, c], [a, c, e]]
            })
            .collect();
        Soup::new(DVec3::ZERO, &faces, 10)
    }

    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    #[test]
    fn an_arc_across_the_seam_is_one_arc() {
        let e = default_arc(&wall(100, 250), &cylinder(Facing::Outside), ALL, 0.01).unwrap();
        let expected = [100.0_f64.to_radians() * 2.0, 0.0, 250.0_f64.to_radians() * 2.0, 3.0];
        assert!(e.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.011), "{e:?} {expected:?}");
        let inside = default_arc(&wall(-30, 60), &cylinder(Facing::Inside), ALL, 0.01).unwrap();
        let expected = [-60.0_f64.to_radians() * 2.0, 0.0, 30.0_f64.to_radians() * 2.0, 3.0];
        assert!(inside.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.011), "{inside:?}");
    }

    #[test]
    fn a_full_turn_begins_at_the_seam() {
        let e = default_arc(&wall(0, 360), &cylinder(Facing::Outside), ALL, 0.01).unwrap();
        assert!((e[0] + 2.0 * PI).abs() < 1e-12 && (e[2] - 2.0 * PI).abs() < 1e-12, "{e:?}");
    }

    #[test]
    fn a_wall_outside_the_slab_is_a_usage_error() {
        let found = default_arc(&wall(0, 90), &cylinder(Facing::Outside), [1.0, 2.0], 0.01);
        assert!(matches!(found, Err(Error::Usage(_))));
    }
}
