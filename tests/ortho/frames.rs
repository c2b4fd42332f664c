//! Cylinders and perspective views against a brute force over every face, on a tower with a skew axis.

use std::f64::consts::PI;

use super::job;
use glam::{DMat3, DVec2, DVec3};
use groundel::camera::{CameraSet, LensModel, Photo, PhotoId};
use groundel::frame::{CentralView, Cylinder, Facing, Mosaic, Orientation};
use groundel::geom::Size;
use groundel::image::Samples;
use groundel::render::{Canvas, OrthoTile, Renderer, Tolerance};
use groundel::synthetic::scenes;
use groundel::synthetic::{CameraSpec, Placement, Sampling, Shot, TestScene};

const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
/// Memory for one renderer: small, so that blocks are cut.
const BLOCK_BYTES: u64 = 8 << 20;
/// Radius of the cylinders, metres.
const RADIUS: f64 = 1.03;
/// Side of a cylinder's pixel, metres: a whole number of them make a turn.
const PIXEL: f64 = 2.0 * PI * RADIUS / 324.0;
/// Rounding of the two ways of computing an elevation, metres.
const ROOM: f64 = 1e-9;

/// A tower about the scene's y axis: segments in turn 1.00 and 1.08 m from it.
fn tower(placement: Placement) -> Vec<[DVec3; 3]> {
    const SEGMENTS: i32 = 40;
    let at = |k: i32, radius: f64, y: f64| {
        let angle = 2.0 * PI * f64::from(k) / f64::from(SEGMENTS);
        placement.ground_from_scene(DVec3::new(radius * angle.sin(), y, radius * angle.cos()))
    };
    let radius = |k: i32| if k.rem_euclid(SEGMENTS) / 5 % 2 == 0 { 1.0 } else { 1.08 };
    let mut faces = Vec::new();
    for ring in 0..6 {
        let (y0, y1) = (f64::from(ring) * 0.2 - 0.6, f64::from(ring) * 0.2 - 0.4);
        let mut quad = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| {
            faces.extend([[a, b, c], [a, c, d]]);
        };
        for k in 0..SEGMENTS {
            let (r, before) = (radius(k), radius(k - 1));
            quad(at(k, r, y0), at(k + 1, r, y0), at(k + 1, r, y1), at(k, r, y1));
            if (r - before).abs() > 0.0 {
                quad(at(k, before, y0), at(k, r, y0), at(k, r, y1), at(k, before, y1));
            }
        }
    }
    faces
}

/// The tower, far from the origin and leaning, with `shots` given in scene coordinates.
fn test_scene(shots: impl Fn(&Placement) -> Vec<Shot>) -> TestScene {
    let origin = DVec3::new(500_000.3, 4_200_000.7, 100.2);
    let placement =
        Placement::oblique(origin, DVec3::new(0.6, 0.7, 0.13), DVec3::new(-0.2, 0.1, 1.0));
    let mut test = scenes::columns();
    test.triangles = tower(placement);
    test.parts = vec![test.parts[0]; test.triangles.len()];
    test.placement = placement;
    test.shots = shots(&placement);
    test
}

fn lens(focal: f64, size: [u32; 2]) -> CameraSpec {
    let [w, h] = size.map(f64::from);
    CameraSpec {
        model: LensModel::OpenCv,
        size: Size::new(size[0], size[1]),
        params: vec![focal, focal * 1.01, 0.5 * w + 3.0, 0.5 * h - 5.0, -0.08, 0.02, 1e-3, -5e-4],
    }
}

fn around(count: i32) -> impl Iterator<Item = (String, f64, f64)> {
    (0..count).map(move |k| {
        let angle = 2.0 * PI * f64::from(k) / f64::from(count);
        (format!("{k}.png"), angle, if k % 2 == 0 { 0.25 } else { -0.25 })
    })
}

fn from_outside(placement: &Placement) -> Vec<Shot> {
    let shot = |(name, angle, y): (String, f64, f64)| {
        let ends = [DVec3::new(2.9 * angle.sin(), y, 2.9 * angle.cos()), DVec3::ZERO];
        Shot::towards(&name, &lens(300.0, [280, 224]), placement, ends, 0.02)
    };
    around(10).map(shot).collect()
}

fn from_inside(placement: &Placement) -> Vec<Shot> {
    let shot = |(name, angle, y): (String, f64, f64)| {
        let towards = DVec3::new(angle.sin(), 0.0, angle.cos());
        let ends = [towards * -0.3 + DVec3::Y * y, towards + DVec3::Y * (0.2 * y)];
        Shot::towards(&name, &lens(200.0, [276, 276]), placement, ends, -0.05)
    };
    around(12).map(shot).collect()
}

/// The tower, seen from outside.
pub(super) fn tower_from_outside() -> TestScene {
    test_scene(from_outside)
}

/// A pixel's line: from a point along a direction.
type Line = (DVec3, DVec3);

/// What lines should meet: T. Möller, B. Trumbore (1997), "Fast, minimum storage ray/triangle intersection", over all
/// faces; parameter along the line, which of the faces.
fn meets(faces: &[[DVec3; 3]], (origin, direction): Line) -> Vec<(f64, usize)> {
    let meet = |(k, [a, b, c]): (usize, &[DVec3; 3])| {
        let (ab, ac) = (*b - *a, *c - *a);
        let p = direction.cross(ac);
        let det = ab.dot(p);
        let s = origin - *a;
        let u = s.dot(p) / det;
        let q = s.cross(ab);
        let v = direction.dot(q) / det;
        let inside = u >= -1e-12 && v >= -1e-12 && u + v <= 1.0 + 1e-12;
        let t = ac.dot(q) / det;
        (det.abs() > 1e-14 && inside && t > 0.0).then_some((t, k))
    };
    faces.iter().enumerate().filter_map(meet).collect()
}

fn render(test: &TestScene, mosaic: &Mosaic, tolerance: Tolerance) -> OrthoTile {
    let folder = tempfile::tempdir().unwrap();
    test.write(folder.path(), Sampling::Box(2), &[]).unwrap();
    let cameras: CameraSet = test.photos().unwrap();
    let scene = job::open(folder.path(), &cameras);
    let mosaic_local = mosaic.local(scene.mesh.origin());
    let canvas = Canvas { mosaic: mosaic_local, below: Vec::new(), tolerance };
    Renderer::new(&scene, &canvas, BLOCK_BYTES).tile(mosaic.size.rect()).unwrap()
}

/// How a tile differs from the truth.
#[derive(Debug, Default)]
struct Judgement {
    pixels: u32,
    /// Another face, a face too many or too few, or an elevation off by more than a thousandth of a pixel.
    wrong: u32,
    /// Pixels that some photo sees.
    seen: u32,
    /// Mean squared difference of colours, 0 to 255, of those.
    error: f64,
    /// The same, if the picture were shifted by half a pixel along the columns.
    shifted: f64,
}

impl Judgement {
    fn psnr_db(error: f64) -> f64 {
        10.0 * (255.0 * 255.0 / error).log10()
    }
}

/// Compares `tile` with the truth: `line` of a place in the mosaic; `elevation` of a parameter; the line's last meeting
/// counts if `farthest`, else its first. `room` of an elevation, metres.
fn judge(
    test: &TestScene,
    tile: &OrthoTile,
    line: impl Fn(DVec2) -> Line,
    elevation: impl Fn(f64) -> f64,
    farthest: bool,
    room: impl Fn(f64) -> f64,
) -> Judgement {
    let (width, height) = (tile.rect.width(), tile.rect.height());
    let Samples::U8(colours) = &tile.colour else { panic!("8 bits") };
    let shown = |at: DVec2| {
        let line = line(at);
        let mut hits = meets(&test.triangles, line);
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let shown = if farthest { hits.last() } else { hits.first() };
        shown.map(|&(t, face)| (t, face, line.0 + line.1 * t))
    };
    let colour = |at: DVec2| {
        let (_, face, point) = shown(at)?;
        let point = test.placement.scene_from_ground(point);
        Some(test.texture.colour(point, test.parts[face]).map(|c| c * 255.0))
    };
    let mut found = Judgement::default();
    for k in 0..width * height {
        let at = DVec2::new((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
        let face = tile.face.data()[k];
        found.pixels += 1;
        let Some((t, expected, _)) = shown(at) else {
            found.wrong += u32::from(face != u32::MAX);
            continue;
        };
        let (claimed, due) = (f64::from(tile.elevation.data()[k]), elevation(t));
        // The layer holds f32; on a shared edge either face may stand.
        let is_near = (claimed - due).abs() <= room(due) + due.abs() * f64::from(f32::EPSILON);
        let is_face = face as usize == expected
            || meets(&test.triangles, line(at))
                .iter()
                .any(|&(other, k)| k == face as usize && (other - t).abs() < ROOM);
        found.wrong += u32::from(!(is_near && is_face));
        if tile.count.data()[k] == 0 {
            continue;
        }
        let (Some(due), Some(beside)) = (colour(at), colour(at + DVec2::new(0.5, 0.0))) else {
            continue;
        };
        found.seen += 1;
        let pixel = colours.pixel(k % width, k / width);
        for c in 0..3 {
            found.error += (f64::from(pixel[c]) - due[c]).powi(2) / 3.0;
            found.shifted += (f64::from(pixel[c]) - beside[c]).powi(2) / 3.0;
        }
    }
    found.error /= f64::from(found.seen);
    found.shifted /= f64::from(found.seen);
    found
}

/// Whether a photo sees a point, by brute force; `slack` makes every test that much easier (or harder, if negative).
fn sees(
    faces: &[[DVec3; 3]],
    photo: &Photo,
    (point, face): (DVec3, usize),
    eps: f64,
    slack: f64,
) -> bool {
    let q = photo.pose.camera_from_ground(point);
    let at = (q.z > 0.0).then(|| photo.lens.photo_from_ray(q.truncate() / q.z)).flatten();
    let size = photo.lens.size();
    let far = DVec2::new(f64::from(size.width), f64::from(size.height));
    let inside =
        |at: DVec2| (at + slack).min_element() >= 0.0 && (far - at + slack).min_element() > 0.0;
    if !at.is_some_and(inside) {
        return false;
    }
    let (centre, way) = (photo.pose.centre_ground, point - photo.pose.centre_ground);
    let limit = way.length() - eps - slack;
    // A face is an obstacle if the line passes it farther inside than the slack.
    let cuts = |(k, [a, b, c]): (usize, &[DVec3; 3])| {
        let (ab, ac) = (*b - *a, *c - *a);
        let p = way.cross(ac);
        let (det, s) = (ab.dot(p), centre - *a);
        let q = s.cross(ab);
        let (u, v, t) = (s.dot(p) / det, way.dot(q) / det, ac.dot(q) / det);
        let inside = u >= slack && v >= slack && u + v <= 1.0 - slack;
        k != face && det.abs() > 1e-14 && inside && t > 0.0 && t * way.length() < limit
    };
    !faces.iter().enumerate().any(cuts)
}

/// Decisions of visibility asked, and those that are wrong. Every third pixel of every third row is asked.
fn visibility(
    test: &TestScene,
    tile: &OrthoTile,
    line: impl Fn(DVec2) -> Line,
    farthest: bool,
    eps: impl Fn(f64) -> f64,
) -> [u64; 2] {
    let (width, height) = (tile.rect.width(), tile.rect.height());
    let cameras = test.photos().unwrap();
    let [mut decisions, mut wrong] = [0, 0];
    for (x, y) in (0..height).step_by(3).flat_map(|y| (0..width).step_by(3).map(move |x| (x, y))) {
        let (origin, direction) = line(DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
        let face = tile.face.data()[y * width + x] as usize;
        let hits = meets(&test.triangles, (origin, direction));
        let Some(&(t, _)) = hits.iter().find(|hit| hit.1 == face) else { continue };
        let point = origin + direction * t;
        let [a, b, c] = test.triangles[face];
        let normal = (b - a).cross(c - a);
        let viewer = if farthest { direction } else { -direction };
        let [mut least, mut most] = [0, 0];
        for photo in &cameras.photos {
            let side = normal.dot(photo.pose.centre_ground - a) * normal.dot(viewer);
            let sees =
                |slack| side > 0.0 && sees(&test.triangles, photo, (point, face), eps(t), slack);
            least += u64::from(sees(-1e-7));
            most += u64::from(sees(1e-7));
        }
        let count = u64::from(tile.count.data()[y * width + x]);
        decisions += cameras.photos.len() as u64;
        wrong += least.saturating_sub(count) + count.saturating_sub(most);
    }
    [decisions, wrong]
}

/// At most one decision in ten thousand is wrong.
fn assert_sights([decisions, wrong]: [u64; 2]) {
    assert!(decisions > 10_000 && wrong * 10_000 <= decisions, "{wrong} of {decisions}");
}

fn assert_right(found: &Judgement) {
    assert_eq!(found.wrong, 0, "{found:?}");
    let (psnr, shifted) = (Judgement::psnr_db(found.error), Judgement::psnr_db(found.shifted));
    assert!(psnr > 33.0 && psnr > shifted + 3.0, "{psnr} dB, {shifted} dB shifted: {found:?}");
}

/// A full turn about the tower's axis from the angle `start` on: the cylinder, the extent, and what is drawn.
fn turn(
    test: &TestScene,
    facing: Facing,
    zero_turn: f64,
    start: f64,
) -> (Cylinder, [f64; 4], OrthoTile) {
    let p = test.placement;
    let (z, x) = (p.direction(DVec3::Z).normalize(), p.direction(DVec3::X).normalize());
    let cylinder = Cylinder {
        origin: p.ground_from_scene(DVec3::ZERO),
        axis: p.direction(DVec3::Y).normalize(),
        zero: z * zero_turn.cos() + x * zero_turn.sin(),
        radius: RADIUS,
        facing,
        pixel_size: None,
        extent: None,
        elevation: None,
    };
    let extent = [start * RADIUS, -0.66, (start + 2.0 * PI) * RADIUS, 0.66];
    let mosaic = Mosaic::new(cylinder.clone(), PIXEL, extent, ALL).unwrap();
    (cylinder, extent, render(test, &mosaic, Tolerance::Fixed(0.02 * PIXEL)))
}

/// The development of the tower, all around; its visibility is right.
fn development(test: &TestScene, facing: Facing, zero_turn: f64) -> Judgement {
    let (Cylinder { origin, axis, zero, .. }, extent, tile) = turn(test, facing, zero_turn, -PI);
    let across = axis.cross(zero);
    let outside = facing == Facing::Outside;
    let sense = if outside { 1.0 } else { -1.0 };
    let line = |at: DVec2| {
        let angle = sense * (extent[0] + at.x * PIXEL) / RADIUS;
        let v = extent[3] - at.y * PIXEL;
        (origin + axis * v, zero * angle.cos() + across * angle.sin())
    };
    let elevation = |t: f64| sense * (t - RADIUS);
    assert_sights(visibility(test, &tile, line, outside, |_| 0.02 * PIXEL));
    judge(test, &tile, line, elevation, outside, |_| 1e-3 * PIXEL)
}

#[test]
fn a_tower_is_developed_from_outside() {
    let found = development(&test_scene(from_outside), Facing::Outside, 0.3);
    assert_right(&found);
    assert!(f64::from(found.seen) > 0.85 * f64::from(found.pixels), "{found:?}");
}

#[test]
fn a_drum_is_developed_from_inside_and_is_not_mirrored() {
    let found = development(&test_scene(from_inside), Facing::Inside, 2.9);
    assert_right(&found);
    assert!(f64::from(found.seen) > 0.85 * f64::from(found.pixels), "{found:?}");
}

#[test]
fn a_perspective_view_through_a_distorting_lens_is_what_the_lens_would_see() {
    let test = test_scene(from_outside);
    // A camera of its own, between two of the photos.
    let ends = [DVec3::new(0.9, 0.1, 2.4), DVec3::new(0.1, 0.05, 0.0)];
    let shot = Shot::towards("own.png", &lens(210.0, [200, 150]), &test.placement, ends, 0.1);
    let photo = shot.photo(PhotoId(99)).unwrap();
    let (lens, pose) = (photo.lens, photo.pose);
    let stated = Orientation::OfPhoto { name: "own.png".into(), distorted: true };
    let mosaic = Mosaic::perspective(CentralView { stated, lens, pose }, ALL).unwrap();
    let part = 0.02 / 210.0;
    let tile = render(&test, &mosaic, Tolerance::OfDepth(part));
    let back: DMat3 = pose.rotation.transpose();
    let line = |at: DVec2| {
        let ray = lens.ray_from_photo(at).unwrap();
        (pose.centre_ground, back * ray.extend(1.0))
    };
    assert_sights(visibility(&test, &tile, line, false, |depth| part * depth));
    let found = judge(&test, &tile, line, |t| t, false, |depth| 1e-3 * depth / 210.0);
    assert_right(&found);
    assert!(f64::from(found.seen) > 0.4 * f64::from(found.pixels), "{found:?}");
}

#[test]
fn a_full_turn_closes_and_its_seam_leaves_no_mark() {
    for (facing, shots) in [
        (Facing::Outside, from_outside as fn(&Placement) -> Vec<Shot>),
        (Facing::Inside, from_inside),
    ] {
        let test = test_scene(shots);
        // The seam at ± half a turn, and a quarter of a turn beside it.
        let (_, _, tile) = turn(&test, facing, 0.3, -PI);
        let (_, _, turned) = turn(&test, facing, 0.3, -0.5 * PI);
        let (width, height) = (tile.rect.width(), tile.rect.height());
        assert_eq!((width, turned.rect.width()), (324, 324));
        let mut other_faces = 0;
        for k in 0..width * height {
            let (x, y) = (k % width, k / width);
            let same = y * width + (x + width - 81) % width;
            if tile.face.data()[k] == turned.face.data()[same] {
                let off = tile.elevation.data()[k] - turned.elevation.data()[same];
                assert!(off.abs() < 1e-6 || off.is_nan(), "{x}, {y}: {off} m");
            } else {
                other_faces += 1;
            }
        }
        // Lines through edges, which rounding decides.
        assert!(other_faces * 1000 < width * height, "{other_faces}");
    }
}

/// A fisheye of 200 × 200 pixels that shows 78° at its sides, 85° in its corners.
fn fisheye() -> CameraSpec {
    let params = vec![75.0, 74.0, 101.0, 98.5, -0.01, 0.002, 0.0, 0.0];
    CameraSpec { model: LensModel::OpenCvFisheye, size: Size::new(200, 200), params }
}

fn fisheyes_inside(placement: &Placement) -> Vec<Shot> {
    let shot = |(name, angle, y): (String, f64, f64)| {
        let towards = DVec3::new(angle.sin(), 0.0, angle.cos());
        // Beside the axis, and askew: much of the drum lies more than 60° from the lens's axis.
        let ends = [towards * -0.2 + DVec3::Y * y, towards + DVec3::new(0.2, 0.7 * y, 0.1)];
        Shot::towards(&name, &fisheye(), placement, ends, 0.4)
    };
    around(6).map(shot).collect()
}

#[test]
fn fisheyes_agree_with_brute_force_far_from_their_axes() {
    let test = test_scene(fisheyes_inside);
    let angle = |photo: &Photo, p: DVec3| photo.pose.camera_from_ground(p).angle_between(DVec3::Z);
    let cameras = test.photos().unwrap();
    let corners = || test.triangles.iter().flatten();
    let far = cameras.photos.iter().flat_map(|p| corners().map(move |&c| angle(p, c)));
    assert!(far.filter(|a| (1.1..1.45).contains(a)).count() > 500);
    let found = development(&test, Facing::Inside, 0.3);
    assert_eq!(found.wrong, 0, "{found:?}");
    assert!(f64::from(found.seen) > 0.85 * f64::from(found.pixels), "{found:?}");
    assert!(Judgement::psnr_db(found.error) > 24.0, "{found:?}");
}

#[test]
fn a_perspective_view_through_a_fisheye_is_what_it_would_see() {
    let test = test_scene(from_inside);
    let ends = [DVec3::new(0.1, 0.1, -0.2), DVec3::new(0.2, 0.0, 1.0)];
    let shot = Shot::towards("own.png", &fisheye(), &test.placement, ends, 0.1);
    let photo = shot.photo(PhotoId(99)).unwrap();
    let (lens, pose) = (photo.lens, photo.pose);
    let stated = Orientation::OfPhoto { name: "own.png".into(), distorted: true };
    let mosaic = Mosaic::perspective(CentralView { stated, lens, pose }, ALL).unwrap();
    let part = 0.02 / 75.0;
    let tile = render(&test, &mosaic, Tolerance::OfDepth(part));
    let back: DMat3 = pose.rotation.transpose();
    let line = |at: DVec2| {
        // Beyond the lens's end there is no line: one that meets nothing.
        let away = DVec3::splat(1e9);
        let ray = lens.ray_from_photo(at);
        ray.map_or((away, away), |ray| (pose.centre_ground, back * ray.extend(1.0)))
    };
    assert_sights(visibility(&test, &tile, line, false, |depth| part * depth));
    let found = judge(&test, &tile, line, |t| t, false, |depth| 1e-3 * depth / 75.0);
    assert_eq!(found.wrong, 0, "{found:?}");
    assert!(f64::from(found.seen) > 0.4 * f64::from(found.pixels), "{found:?}");
}
