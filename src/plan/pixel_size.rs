//! The pixel size that the photos can fill.

use glam::DVec3;

use super::partitions::SlabFrame;
use super::{Partitions, Slab};
use crate::camera::{LocalPose, Photo};
use crate::geom::{Bounds2, FaceBlock};
use crate::{Error, Result};

/// Partitions that are looked at: of a larger mesh, every so many along its space-filling curve.
const MOST_PARTITIONS: usize = 4096;
/// Points on the surface, over all partitions, if the photos are few …
const MOST_POINTS: usize = 1 << 16;
/// … pairs of a point and a photo, if they are many: 32 MiB, and well under a second …
const MOST_PAIRS: usize = 1 << 21;
/// … but points at least.
const LEAST_POINTS: usize = 256;
/// Footprints less than this share below two digits are rounded up to them: 10 m / 1000 px is 0.01 m, not 0.0099 m.
const ROUNDING: f64 = 1e-9;

/// Pixel size, metres: the median footprint of a photo pixel on the surface, rounded down to two significant digits.
///
/// The footprint of a photo pixel is √(area on the face / its area in the photo, with distortion). The median is taken
/// over the photo pixels that show the surface in the slab (and over `extent`, if one is given, as
/// [`default_extent`](super::default_extent) gives it), so it is weighted by the area in the photos: half of all those
/// pixels are finer.
///
/// 1. Points are spread over the faces in the slab, in proportion to their area, at places fixed by the mesh alone
///    (M. Roberts 2018, "The unreasonable effectiveness of quasirandom sequences": the R2 sequence in each face).
/// 2. A point counts for a photo that has it in front, inside its frame and its valid radius, with the perspective
///    centre on the same side of the face as the mosaic's viewer.
/// 3. Photo pixels a square metre there: |det J| · |n · X| / Z³, with J the lens's derivative, X the point in camera
///    axes and n the face's unit normal. That is the weight, and the footprint is its −½ power.
///
/// Departures from a sum over all faces: points stand for faces, so that faces larger than a photo count with the part
/// that it shows; of a mesh of more than 4096 partitions every so many are taken; and occlusion is not tested, so that
/// a surface hidden in a photo counts as if it were shown.
///
/// # Errors
/// [`Error::Usage`] if no photo shows such a point; errors of reading the mesh.
pub fn default_pixel_size(
    mesh: &impl Partitions,
    slab: Slab<'_>,
    extent: Option<[f64; 4]>,
    photos: &[Photo],
) -> Result<f64> {
    let frame = SlabFrame::new(slab, mesh.origin());
    let area = Area { frame, extent: bounds(extent) };
    let views: Vec<_> = photos.iter().map(|p| (p, p.pose.relative_to(mesh.origin()))).collect();
    // Which partitions, and how many points on each.
    let wanted: Vec<_> = (0..mesh.count()).filter(|&k| area.may_hold(mesh, k)).collect();
    let points = (MOST_PAIRS / photos.len().max(1)).clamp(LEAST_POINTS, MOST_POINTS);
    let step = wanted.len().div_ceil(MOST_PARTITIONS.min(points)).max(1);
    let taken: Vec<_> = wanted.into_iter().step_by(step).collect();
    let points = points.div_ceil(taken.len().max(1));
    // Density of photo pixels at each point in each photo, and the ground area that it stands for.
    let mut found = Vec::new();
    for k in taken {
        mesh.visit(k, &mut |block| {
            area.spread(block, points, |point, normal, share| {
                let densities = views.iter().filter_map(|v| density(v, &frame, point, normal));
                found.extend(densities.map(|d| (d, d * share)));
            });
        })?;
    }
    let density = weighted_median(&mut found).ok_or_else(|| {
        Error::usage(
            "no photo shows the mesh from the frame's side, so that the pixel size cannot be derived: check frame and \
             cameras, or give --pixel-size",
        )
    })?;
    Ok(two_digits_down((1.0 + ROUNDING) / density.sqrt()))
}

/// Where points may lie.
struct Area {
    frame: SlabFrame,
    extent: Bounds2,
}

/// An extent as bounds; all if there is none.
fn bounds(extent: Option<[f64; 4]>) -> Bounds2 {
    let all = [f64::NEG_INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY];
    let [u0, v0, u1, v1] = extent.unwrap_or(all);
    Bounds2 { min: (u0, v0).into(), max: (u1, v1).into() }
}

impl Area {
    fn may_hold(&self, mesh: &impl Partitions, partition: usize) -> bool {
        self.frame.box_bounds(&mesh.bounds(partition)).intersects(&self.extent)
    }

    /// Calls `f(point, unit normal, m² that it stands for)` for `count` points spread evenly over the faces of a block
    /// that reach into the area, but not for those that fall outside.
    fn spread(&self, block: &FaceBlock<'_>, count: usize, mut f: impl FnMut(DVec3, DVec3, f64)) {
        // Twice the area of a face that may hold points, with its normal; 0 for others.
        let normal = |t: usize| {
            let corners = block.corners(t);
            let [a, b, c] = corners;
            let meets = self.frame.face_bounds(corners).intersects(&self.extent);
            if meets { (b - a).cross(c - a) } else { DVec3::ZERO }
        };
        let total: f64 = (0..block.triangles.len()).map(|t| normal(t).length()).sum();
        let share = total / count as f64;
        // Systematic sampling: a point whenever the area so far passes a half, one and a half, … shares.
        let (mut passed, mut made) = (0.0, 0_u32);
        for t in 0..block.triangles.len() {
            let n = normal(t);
            passed += n.length();
            while (f64::from(made) + 0.5) * share < passed && (made as usize) < count {
                let point = in_triangle(block.corners(t), made);
                made += 1;
                let uv = self.frame.project(point);
                let here = Bounds2::of([uv.truncate()]).intersects(&self.extent);
                if here && self.frame.holds(uv.z) {
                    f(point, n / n.length(), 0.5 * share);
                }
            }
        }
    }
}

/// Point `k` of the R2 sequence, in a triangle: the unit square, folded along its diagonal.
fn in_triangle([a, b, c]: [DVec3; 3], k: u32) -> DVec3 {
    // 1/g and 1/g², g the root of x³ = x + 1.
    const STEPS: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    let [mut s, mut t] = STEPS.map(|step| (0.5 + f64::from(k) * step).fract());
    if s + t > 1.0 {
        (s, t) = (1.0 - s, 1.0 - t);
    }
    a + s * (b - a) + t * (c - a)
}

/// Photo pixels a square metre of the surface at a point; `None` if the photo does not show it from the viewer's side.
fn density(
    (photo, pose): &(&Photo, LocalPose),
    frame: &SlabFrame,
    point: DVec3,
    normal: DVec3,
) -> Option<f64> {
    let faces_viewer = normal.dot(frame.towards_viewer(point));
    let faces_photo = normal.dot(pose.centre - point);
    if faces_viewer * faces_photo <= 0.0 {
        return None;
    }
    let at = pose.camera_from_local(point);
    if at.z <= 0.0 {
        return None;
    }
    let (position, slope) = photo.lens.photo_from_ray_jacobian(at.truncate() / at.z)?;
    if !photo.lens.contains(position) {
        return None;
    }
    let density = slope.determinant().abs() * faces_photo.abs() / (at.z * at.z * at.z);
    (density > 0.0 && density.is_finite()).then_some(density)
}

/// The least value that at least half of the weight does not exceed; `None` without weight. Pairs of value and weight.
pub(super) fn weighted_median(pairs: &mut [(f64, f64)]) -> Option<f64> {
    pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let half = 0.5 * pairs.iter().map(|p| p.1).sum::<f64>();
    let mut sum = 0.0;
    pairs
        .iter()
        .find(|p| {
            sum += p.1;
            sum >= half
        })
        .map(|p| p.0)
}

/// A positive number rounded down to two significant decimal digits.
fn two_digits_down(v: f64) -> f64 {
    // All digits of the number, so that nothing is rounded up on the way.
    let text = format!("{v:.30e}");
    let (mantissa, exponent) = text.split_once('e').expect("the format has an exponent");
    let short = format!("{}e{exponent}", &mantissa[..3]);
    short.parse().expect("a number, shortened")
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "decimal numbers, exactly")]
mod tests {
    use super::super::Base;
    use super::super::partitions::soup::Soup;
    use super::*;
    use crate::camera::{Lens, LensModel, PhotoId, Pose};
    use crate::frame::Plane;
    use crate::geom::Size;

    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
    const ORIGIN: DVec3 = DVec3::new(5e5, 4e6, 100.0);

    /// Looks straight down on the local point (x, y, 0) from `height`, f = 1000 px, 400 × 300 px.
    fn nadir(x: f64, y: f64, height: f64, k1: f64) -> Photo {
        let params = [1000.0, 200.0, 150.0, k1];
        let lens = Lens::new(LensModel::SimpleRadial, Size::new(400, 300), &params).unwrap();
        // Half a turn about x: camera z is ground −z.
        let mut pose = Pose::from_colmap([0.0, 1.0, 0.0, 0.0], DVec3::ZERO).unwrap();
        pose.centre_ground = ORIGIN + DVec3::new(x, y, height);
        Photo { id: PhotoId(0), name: "a.jpg".into(), lens, pose }
    }

    /// A level square of `half` metres to each side of a middle, in `n` × `n` × 2 triangles.
    fn level(middle: DVec3, half: f64, n: i32) -> Vec<[DVec3; 3]> {
        let p = |i: i32, j: i32| {
            let c = |k: i32| half * (2.0 * f64::from(k) / f64::from(n) - 1.0);
            middle + DVec3::new(c(i), c(j), 0.0)
        };
        let cells = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        cells
            .flat_map(|(i, j)| {
                [[p(i, j), p(i + 1, j), p(i + 1, j + 1)], [p(i, j), p(i + 1, j + 1), p(i, j + 1)]]
            })
            .collect()
    }

    fn size(faces: &[[DVec3; 3]], part: usize, photos: &[Photo]) -> Result<f64> {
        let slab = Slab { base: Base::Plane(&Plane::top()), elevation: ALL };
        default_pixel_size(&Soup::new(ORIGIN, faces, part), slab, None, photos)
    }

    #[test]
    fn a_level_surface_below_a_photo_has_height_over_focal_length() {
        // 7.777 m / 1000 px, whatever the size of the faces against the photo.
        for (half, n) in [(1.0, 40), (50.0, 1), (0.01, 1)] {
            let faces = level(DVec3::ZERO, half, n);
            let p = size(&faces, 100, &[nadir(0.0, 0.0, 7.777, 0.0)]).unwrap();
            assert_eq!(p, 0.0077, "{half} {n}");
        }
    }

    #[test]
    fn the_median_is_over_photo_pixels_not_over_faces() {
        // Two photos of their own ground; the nearer one has the same number of pixels on less ground.
        let mut faces = level(DVec3::new(-50.0, 0.0, 0.0), 10.0, 30);
        faces.extend(level(DVec3::new(50.0, 0.0, 0.0), 10.0, 30));
        let (near, far) = (nadir(-50.0, 0.0, 5.1, 0.0), nadir(50.0, 0.0, 20.1, 0.0));
        // Cut the near photo to a third of the pixels: then most pixels are far.
        let third =
            Lens::new(LensModel::Pinhole, Size::new(200, 200), &[1000.0, 1000.0, 100.0, 100.0]);
        let cut = Photo { lens: third.unwrap(), ..near.clone() };
        assert_eq!(size(&faces, 64, &[cut, far.clone()]).unwrap(), 0.020);
        // Near twice over: most pixels are near.
        assert_eq!(size(&faces, 64, &[near.clone(), near, far]).unwrap(), 0.0051);
    }

    #[test]
    fn a_tilted_face_and_distortion_are_in_the_footprint() {
        // On the axis at 10 m, tilted by 60°: √(0.01 · 0.01 / cos 60°) = 0.01414.
        let (s, c) = (0.75_f64.sqrt(), 0.5);
        let (a, b) = (DVec3::new(0.01, 0.0, 0.0), DVec3::new(0.0, 0.01 * c, 0.01 * s));
        let tilted = [[-a - b, a - b, b]];
        assert_eq!(size(&tilted, 1, &[nadir(0.0, 0.0, 10.0, 0.0)]).unwrap(), 0.014);
        // At r = 0.1, k1 = 2: d(r + 2 r³)/dr · (1 + 2 r²) = 1.06 · 1.02 → 0.01 / √1.0812 = 0.00962.
        let off = level(DVec3::new(1.0, 0.0, 0.0), 0.01, 1);
        assert_eq!(size(&off, 1, &[nadir(0.0, 0.0, 10.0, 2.0)]).unwrap(), 0.0096);
    }

    #[test]
    fn a_photo_on_the_other_side_or_looking_away_shows_nothing() {
        let faces = level(DVec3::ZERO, 1.0, 4);
        let below = {
            let mut photo = nadir(0.0, 0.0, -10.0, 0.0);
            photo.pose = Pose::from_colmap([1.0, 0.0, 0.0, 0.0], DVec3::ZERO).unwrap();
            photo.pose.centre_ground = ORIGIN - DVec3::new(0.0, 0.0, 10.0);
            photo
        };
        let away = nadir(0.0, 0.0, -10.0, 0.0);
        for photo in [below.clone(), away] {
            let e = size(&faces, 8, &[photo]).unwrap_err();
            assert!(e.exit_code() == 2 && e.to_string().contains("--pixel-size"), "{e}");
        }
        assert!(size(&faces, 8, &[]).is_err());
        // The winding says nothing: turned faces are as good.
        let turned: Vec<_> = faces.iter().map(|&[a, b, c]| [a, c, b]).collect();
        assert_eq!(size(&turned, 8, &[nadir(0.0, 0.0, 3.1, 0.0)]).unwrap(), 0.0031);
        assert!(size(&turned, 8, &[below]).is_err());
    }

    #[test]
    fn slab_and_extent_choose_the_surface() {
        let mut faces = level(DVec3::ZERO, 1.0, 10);
        faces.extend(level(DVec3::new(0.0, 0.0, 5.0), 1.0, 10));
        let photo = [nadir(0.0, 0.0, 10.0, 0.0)];
        let mesh = Soup::new(ORIGIN, &faces, 7);
        let of = |elevation, extent| {
            default_pixel_size(
                &mesh,
                Slab { base: Base::Plane(&Plane::top()), elevation },
                extent,
                &photo,
            )
        };
        assert_eq!(of([99.0, 101.0], None).unwrap(), 0.01);
        assert_eq!(of([104.0, 106.0], None).unwrap(), 0.005);
        assert!(of([101.0, 104.0], None).is_err());
        let beside = [5e5 + 2.0, 4e6, 5e5 + 3.0, 4e6 + 1.0];
        assert!(of(ALL, Some(beside)).is_err());
        let corner = [5e5, 4e6, 5e5 + 3.0, 4e6 + 1.0];
        assert_eq!(of([99.0, 101.0], Some(corner)).unwrap(), 0.01);
    }

    #[test]
    fn a_mesh_of_very_many_partitions_is_sampled() {
        // 20,000 partitions, of which every fifth is looked at.
        let faces = level(DVec3::ZERO, 1.0, 100);
        assert_eq!(size(&faces, 1, &[nadir(0.0, 0.0, 6.66, 0.0)]).unwrap(), 0.0066);
    }

    #[test]
    fn rounding_is_down_to_two_digits_of_the_exact_number() {
        for (v, want) in [(0.002_999_9, 0.0029), (0.003_000_1, 0.003), (1.0, 1.0), (99.9, 99.0)] {
            assert_eq!(two_digits_down(v), want);
        }
        assert_eq!(two_digits_down(1_f64.next_down()), 0.99);
        assert_eq!(two_digits_down(1234.0), 1200.0);
        assert_eq!(two_digits_down(0.29 * (1.0 + ROUNDING)), 0.29);
    }

    #[test]
    fn a_median_is_weighted() {
        assert_eq!(weighted_median(&mut []), None);
        assert_eq!(weighted_median(&mut [(3.0, 1.0), (1.0, 1.0), (2.0, 1.0)]), Some(2.0));
        assert_eq!(weighted_median(&mut [(3.0, 9.0), (1.0, 1.0), (2.0, 1.0)]), Some(3.0));
    }
}
