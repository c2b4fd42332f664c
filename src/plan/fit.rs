//! The façade that the photos look at.

use std::f64::consts::PI;

use glam::DVec3;

use super::Partitions;
use super::pixel_size::weighted_median;
use crate::camera::{LocalPose, Photo};
use crate::frame::Plane;
use crate::geom::FaceBlock;
use crate::{Error, Result};

/// Faces that are looked at, about …
const MOST_FACES: usize = 1 << 16;
/// … and pairs of a face and a photo, at most.
const MOST_PAIRS: usize = 1 << 22;
/// A face is of a wall if its normal rises or falls by less than this: sine of 20°.
const UPRIGHT: f64 = 0.342;
/// Parts of half a turn in which the walls' directions are counted.
const PARTS: usize = 720;
/// Directions within so many parts of a part count for it: 3°.
const SPREAD: usize = 12;
/// Angle within which a face is of the wall, bumps and mouldings included: 20°.
const NEAR: f64 = 20.0;
/// Thickness of the layer in which the wall is sought, one after another: parts of its length.
const LAYERS: [f64; 5] = [0.1, 0.05, 0.02, 0.02, 0.02];
/// The origin is a whole multiple of this, metres.
const TIDY: f64 = 0.001;

/// A wall's face as the photos see it.
#[derive(Debug, Clone, Copy)]
struct Patch {
    middle: DVec3,
    /// Direction of its normal about the upward axis, 0 to π: a wall's two sides are one direction.
    angle: f64,
    /// Its area in all photos that may see it, pixels.
    weight: f64,
}

/// The vertical plane of most of what the photos show: u × v = n is horizontal and points to the middle of the cameras, v
/// = `up`.
///
/// 1. Of some faces, evenly spread over the mesh, those of walls are kept (normal within 20° of the horizon), each with
///    the area that it has in the photos that have it before them and in their frame; what hides what is not looked at.
/// 2. The direction in which most of this area faces is the fullest 3° of a histogram; only faces within 20° of it count
///    from here on.
/// 3. The wall is the fullest layer of these faces that is square to that direction; the line that fits it best, by least
///    squares, turns the direction. This is done five times, with layers from a tenth to a fiftieth of the wall's length,
///    so that clutter, side walls and what stands back do not count.
/// 4. The origin is the median of the faces of that layer: elevations are small on the wall.
///
/// # Errors
/// [`Error::Usage`] if the photos show no wall; errors of reading the mesh.
pub fn fit_plane(mesh: &impl Partitions, photos: &[Photo], up: DVec3) -> Result<Plane> {
    let nothing = || {
        Error::usage(
            "--view fit: the photos show no upright surface of the mesh; give a frame, or another --up",
        )
    };
    let up = up.try_normalize().ok_or_else(nothing)?;
    let (east, north) = horizontal(up);
    let patches = patches(mesh, photos, up, [east, north])?;
    let first = fullest(&patches).ok_or_else(nothing)?;
    let near = |p: &&Patch| half_turn(p.angle - first).abs() < NEAR.to_radians();
    let facing: Vec<&Patch> = patches.iter().filter(near).collect();
    let along = |angle: f64| east * libm::cos(angle) + north * libm::sin(angle);
    let (mut angle, mut wall) = (first, facing.clone());
    for part in LAYERS {
        let (u, n) = (along(angle - 0.5 * PI), along(angle));
        let layer = layer(&facing, u, n, part);
        angle += libm::atan(slope(&layer, u, n));
        wall = layer;
    }
    let (normal, facing) = (along(angle), wall);
    let median = |of: &dyn Fn(DVec3) -> f64| {
        let mut pairs: Vec<_> = facing.iter().map(|p| (of(p.middle), p.weight)).collect();
        weighted_median(&mut pairs)
    };
    let axes = [normal.cross(up), up, normal];
    let [Some(a), Some(b), Some(c)] = axes.map(|axis| median(&|p| p.dot(axis))) else {
        return Err(nothing());
    };
    let middle = axes[0] * a + axes[1] * b + axes[2] * c;
    let mut sides: Vec<_> = photos
        .iter()
        .map(|p| ((p.pose.centre_ground - mesh.origin() - middle).dot(normal), 1.0))
        .collect();
    let towards = weighted_median(&mut sides).unwrap_or(1.0);
    let n = if towards < 0.0 { -normal } else { normal };
    let origin = ((middle + mesh.origin()) / TIDY).round() * TIDY;
    // `+ 0.0` turns −0 into 0.
    let [origin, u, v] = [origin, up.cross(n), up].map(|axis| (axis + 0.0).to_array());
    let plane = Plane::new(origin, u, v);
    plane.map_err(|e| Error::usage(format!("--view fit: {e}")))
}

/// Two unit vectors square to `up` and to each other: east and north, if up is z.
fn horizontal(up: DVec3) -> (DVec3, DVec3) {
    let aside = if up.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let east = (aside - up * aside.dot(up)).normalize();
    (east, up.cross(east))
}

/// Step 1.
fn patches(
    mesh: &impl Partitions,
    photos: &[Photo],
    up: DVec3,
    [east, north]: [DVec3; 2],
) -> Result<Vec<Patch>> {
    let views: Vec<_> = photos.iter().map(|p| (p, p.pose.relative_to(mesh.origin()))).collect();
    let most = (MOST_PAIRS / photos.len().max(1)).clamp(1, MOST_FACES);
    let partitions = mesh.count().min(most).max(1);
    let step = mesh.count().div_ceil(partitions).max(1);
    let faces = most.div_ceil(partitions);
    let mut found = Vec::new();
    for k in (0..mesh.count()).step_by(step) {
        mesh.visit(k, &mut |block| {
            let stride = block.triangles.len().div_ceil(faces).max(1);
            for t in (0..block.triangles.len()).step_by(stride) {
                let patch = patch(block, t, &views, up, [east, north]);
                // Each stands for those passed over.
                found.extend(patch.map(|p| Patch { weight: p.weight * stride as f64, ..p }));
            }
        })?;
    }
    Ok(found)
}

fn patch(
    block: &FaceBlock<'_>,
    t: usize,
    views: &[(&Photo, LocalPose)],
    up: DVec3,
    [east, north]: [DVec3; 2],
) -> Option<Patch> {
    let [a, b, c] = block.corners(t);
    let (middle, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a));
    let unit = normal.try_normalize()?;
    if unit.dot(up).abs() > UPRIGHT {
        return None;
    }
    let area = |(photo, pose): &(&Photo, LocalPose)| {
        let q = pose.camera_from_local(middle);
        if q.z <= 0.0 {
            return 0.0;
        }
        let Some((at, slope)) = photo.lens.photo_from_ray_jacobian(q.truncate() / q.z) else {
            return 0.0;
        };
        if !photo.lens.contains(at) {
            return 0.0;
        }
        0.5 * slope.determinant().abs() * normal.dot(pose.centre - middle).abs() / (q.z * q.z * q.z)
    };
    let weight: f64 = views.iter().map(area).filter(|a| a.is_finite()).sum();
    let angle = libm::atan2(unit.dot(north), unit.dot(east)).rem_euclid(PI);
    (weight > 0.0).then_some(Patch { middle, angle, weight })
}

/// Step 2: the middle of the fullest part of half a turn; `None` if nothing is seen.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of half a turn"
)]
fn fullest(patches: &[Patch]) -> Option<f64> {
    let mut parts = vec![0.0; PARTS];
    for p in patches {
        parts[(p.angle / PI * PARTS as f64) as usize % PARTS] += p.weight;
    }
    let around = |k: usize| -> f64 { (0..=SPREAD).map(|d| parts[(k + d) % PARTS]).sum() };
    let best = (0..PARTS).max_by(|&a, &b| around(a).total_cmp(&around(b)).then(b.cmp(&a)))?;
    let middle = best as f64 + 0.5 * (SPREAD + 1) as f64;
    (around(best) > 0.0).then(|| (middle / PARTS as f64 * PI).rem_euclid(PI))
}

/// Step 3: the patches in the fullest layer square to `n`, as thick as a part of their length along `u`.
fn layer<'a>(patches: &[&'a Patch], u: DVec3, n: DVec3, part: f64) -> Vec<&'a Patch> {
    let total: f64 = patches.iter().map(|p| p.weight).sum();
    let mean = patches.iter().map(|p| p.middle.dot(u) * p.weight).sum::<f64>() / total;
    let variance =
        patches.iter().map(|p| (p.middle.dot(u) - mean).powi(2) * p.weight).sum::<f64>() / total;
    // √12 standard deviations are the length of a wall that is seen evenly.
    let thickness = part * (12.0 * variance).sqrt();
    let mut sorted: Vec<_> = patches.iter().map(|p| (p.middle.dot(n), *p)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut first, mut held, mut best) = (0, 0.0, (0.0, 0..0));
    for (last, (offset, patch)) in sorted.iter().enumerate() {
        held += patch.weight;
        while sorted[first].0 < offset - thickness {
            held -= sorted[first].1.weight;
            first += 1;
        }
        if held > best.0 {
            best = (held, first..last + 1);
        }
    }
    sorted[best.1].iter().map(|(_, patch)| *patch).collect()
}

/// How much the line of least squares through patches rises along `n` for a metre along −`u`.
fn slope(patches: &[&Patch], u: DVec3, n: DVec3) -> f64 {
    let total: f64 = patches.iter().map(|p| p.weight).sum();
    let mean = patches.iter().map(|p| p.middle * p.weight).sum::<DVec3>() / total;
    let (mut up, mut along) = (0.0, 0.0);
    for p in patches {
        let d = p.middle - mean;
        up += p.weight * d.dot(u) * d.dot(n);
        along += p.weight * d.dot(u) * d.dot(u);
    }
    if along > 0.0 { up / along } else { 0.0 }
}

/// An angle brought to ± π/2 by half turns.
fn half_turn(angle: f64) -> f64 {
    angle - PI * (angle / PI).round()
}

#[cfg(test)]
mod tests {
    use super::super::partitions::soup::Soup;
    use super::*;
    use crate::camera::{Lens, LensModel, PhotoId, Pose};
    use crate::geom::Size;

    /// A photo from `centre` towards `target`, its picture's top up.
    fn photo(centre: DVec3, target: DVec3) -> Photo {
        let forward = (target - centre).normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let rotation = glam::DMat3::from_cols(right, forward.cross(right), forward).transpose();
        let lens = Lens::new(LensModel::SimplePinhole, Size::new(800, 600), &[600.0, 400.0, 300.0]);
        let pose = Pose { rotation, centre_ground: centre };
        Photo { id: PhotoId(0), name: String::new(), lens: lens.unwrap(), pose }
    }

    #[test]
    fn a_bumpy_facade_is_found_among_side_walls_ground_and_trees() {
        let (bearing, origin) = (0.4_f64, DVec3::new(5000.0, 2000.0, 50.0));
        let u = DVec3::new(bearing.cos(), bearing.sin(), 0.0);
        let n = u.cross(DVec3::Z);
        let at = |a: f64, b: f64, c: f64| u * a + DVec3::Z * b + n * c;
        let mut faces = Vec::new();
        let mut quad =
            |a: DVec3, b: DVec3, c: DVec3, d: DVec3| faces.extend([[a, b, c], [a, c, d]]);
        let bump = |i: i32, j: i32| 0.03 * f64::from((i * 7 + j * 5) % 11 - 5) / 5.0;
        for i in 0..40 {
            for j in 0..20 {
                let p = |i: i32, j: i32| at(f64::from(i) * 0.25, f64::from(j) * 0.25, bump(i, j));
                quad(p(i, j), p(i + 1, j), p(i + 1, j + 1), p(i, j + 1));
            }
        }
        // The ground, a wing that stands out, and planes at odd angles before it.
        quad(at(-5.0, 0.0, 8.0), at(15.0, 0.0, 8.0), at(15.0, 0.0, 0.0), at(-5.0, 0.0, 0.0));
        quad(at(10.0, 0.0, 0.0), at(10.0, 0.0, 4.0), at(10.0, 5.0, 4.0), at(10.0, 5.0, 0.0));
        for k in 0..4 {
            let (x, y) = (1.0 + 2.0 * f64::from(k), 3.0);
            quad(
                at(x, 0.0, y),
                at(x + 0.7, 0.0, y + 0.6),
                at(x + 0.7, 2.0, y + 0.6),
                at(x, 2.0, y),
            );
        }
        let mesh = Soup::new(origin, &faces, 100);
        let centres = [at(1.0, 1.7, 9.0), at(5.0, 1.7, 10.0), at(9.0, 1.7, 9.0)];
        let photos = centres.map(|c| photo(origin + c, origin + at(5.0, 2.5, 0.0)));
        let plane = fit_plane(&mesh, &photos, DVec3::Z * 3.0).unwrap();
        assert!(plane.u.dot(u) > 1.0 - 1e-5, "{:?} {u:?}", plane.u);
        assert!(plane.n.dot(n) > 0.99 && plane.v == DVec3::Z);
        let distance = (plane.origin - origin).dot(n);
        assert!(distance.abs() < 0.05, "{distance}");
        // From the other side u runs the other way.
        let behind = centres.map(|c| c - 2.0 * n * c.dot(n));
        let photos = behind.map(|c| photo(origin + c, origin + at(5.0, 2.5, 0.0)));
        assert!(fit_plane(&mesh, &photos, DVec3::Z).unwrap().u.dot(u) < -0.999);
    }

    #[test]
    fn a_floor_alone_is_a_usage_error() {
        let faces = [[DVec3::ZERO, DVec3::X, DVec3::Y]];
        let photos = [photo(DVec3::new(0.3, -2.0, 2.0), DVec3::new(0.3, 0.3, 0.0))];
        let found = fit_plane(&Soup::new(DVec3::ZERO, &faces, 1), &photos, DVec3::Z);
        assert!(matches!(found, Err(Error::Usage(_))));
    }
}
