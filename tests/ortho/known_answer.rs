//! Every test scene against the brute-force oracle: elevation, face, visibility, colour. And the tests of these
//! tests: each injected fault must be seen.

use super::job;
use groundel::camera::{CameraSet, Lens, Photo};
use groundel::frame::MosaicFrame;
use groundel::geom::FaceId;
use groundel::image::{Image, Samples};
use groundel::render::{Canvas, OrthoTile, Renderer, Scene, Tolerance};
use groundel::store::photo::Reading;
use groundel::synthetic::scenes;
use groundel::synthetic::{Likeness, Oracle, Sight, TestScene, likeness};

/// How far rounding may move a point, metres.
const SLACK_M: f64 = 1e-7;
/// Of a large scene, every so many pixels in each direction are asked of the oracle, which tries every face.
const STEP: usize = 3;
/// Memory for one renderer: small, so that blocks are cut.
const BLOCK_BYTES: u64 = 8 << 20;

struct Rendered {
    folder: tempfile::TempDir,
    cameras: CameraSet,
}

impl Rendered {
    fn files(test: &TestScene) -> Self {
        let folder = tempfile::tempdir().unwrap();
        job::write_files(test, folder.path());
        Self { cameras: test.photos().unwrap(), folder }
    }

    fn tile(&self, test: &TestScene, change: impl FnOnce(&mut Scene, &mut Canvas)) -> OrthoTile {
        let mut scene = job::open(self.folder.path(), &self.cameras);
        let mut canvas = job::canvas(test, &scene);
        change(&mut scene, &mut canvas);
        Renderer::new(&scene, &canvas, BLOCK_BYTES).tile(test.plane.size().rect()).unwrap()
    }
}

/// Pixels asked, surfaces that are wrong, decisions asked and decisions that are wrong.
#[derive(Debug, Default)]
struct Found {
    pixels: u64,
    wrong_surfaces: u64,
    decisions: u64,
    wrong_decisions: u64,
}

fn judge(test: &TestScene, oracle: &Oracle, cameras: &CameraSet, tile: &OrthoTile) -> Found {
    let size = test.plane.size();
    let tolerance_m = job::tolerance_m(test);
    let mut found = Found::default();
    let step = if size.area() < 5000 { 1 } else { STEP };
    for y in (0..size.height).step_by(step) {
        for x in (0..size.width).step_by(step) {
            let at = (y * size.width + x) as usize;
            let (elevation, face) =
                (f64::from(tile.elevation.data()[at]), FaceId(tile.face.data()[at]));
            let claim = (face != FaceId::NONE).then_some((elevation, face));
            // A thousandth of a pixel, and the rounding of the layer to f32.
            let room = 1e-3 * test.plane.pixel_size + elevation.abs() * f64::from(f32::EPSILON);
            found.pixels += 1;
            if !oracle.accepts([x, y], claim, room) {
                found.wrong_surfaces += 1;
                continue;
            }
            let Some((_, face)) = claim else { continue };
            // The exact elevation of the face that was chosen.
            let sight = oracle.surface([x, y]).filter(|s| s.face == face);
            let Some(sight) = sight else { continue };
            let (least, most) = seen(oracle, &cameras.photos, [x, y], &sight, tolerance_m);
            let count = u64::from(tile.count.data()[at]);
            found.decisions += cameras.photos.len() as u64;
            found.wrong_decisions += least.saturating_sub(count) + count.saturating_sub(most);
        }
    }
    found
}

/// The least and the greatest number of photos that may see a point: they differ where a decision is not clear.
fn seen(
    oracle: &Oracle,
    photos: &[Photo],
    pixel: [u32; 2],
    sight: &Sight,
    tolerance_m: f64,
) -> (u64, u64) {
    photos.iter().fold((0, 0), |(least, most), photo| {
        let verdict = oracle.sees(photo, pixel, sight, tolerance_m);
        let sees = verdict.outcome.is_seen();
        (least + u64::from(sees && verdict.clear), most + u64::from(sees || !verdict.clear))
    })
}

/// The mosaic against the texture, where some photo sees it.
fn colours(test: &TestScene, oracle: &Oracle, tile: &OrthoTile) -> Likeness {
    let (expected, _) = test.expected(oracle);
    let Samples::U8(rgba) = &tile.colour else { unreachable!("8-bit photos") };
    let size = rgba.size();
    let rgb: Vec<u8> = rgba.data().chunks_exact(4).flat_map(|p| p[..3].to_vec()).collect();
    let alpha: Vec<u8> = rgba.data().chunks_exact(4).map(|p| p[3]).collect();
    let (rgb, alpha) = (Image::from_data(size, 3, rgb), Image::from_data(size, 1, alpha));
    likeness(rgb.view(), expected.view(), alpha.view())
}

#[test]
fn surfaces_and_visibility_agree_with_brute_force_in_every_scene() {
    for test in scenes::all() {
        let (oracle, files) = (test.oracle(SLACK_M), Rendered::files(&test));
        let tile = files.tile(&test, |_, _| {});
        let found = judge(&test, &oracle, &files.cameras, &tile);
        assert!(found.pixels > 500, "{}: {found:?}", test.name);
        assert_eq!(found.wrong_surfaces, 0, "{}: {found:?}", test.name);
        // 99.99 % of all decisions.
        assert!(found.wrong_decisions * 10_000 <= found.decisions, "{}: {found:?}", test.name);
    }
}

#[test]
fn colours_are_those_of_the_texture_and_lie_where_they_should() {
    for test in [scenes::columns(), scenes::oblique(), scenes::radial()] {
        let (oracle, files) = (test.oracle(SLACK_M), Rendered::files(&test));
        let found = colours(&test, &oracle, &files.tile(&test, |_, _| {}));
        assert!(found.psnr_db > 25.0 && found.ssim > 0.85, "{}: {found:?}", test.name);
        let shift = found.shift.unwrap();
        assert!(shift.x.hypot(shift.y) < 0.05, "{}: {found:?}", test.name);
    }
}

#[test]
fn a_view_without_occlusion_is_found_out() {
    let test = scenes::columns();
    let (oracle, files) = (test.oracle(SLACK_M), Rendered::files(&test));
    let tile = files.tile(&test, |_, canvas| canvas.tolerance = Tolerance::Fixed(1e9));
    let found = judge(&test, &oracle, &files.cameras, &tile);
    assert!(found.wrong_decisions * 100 > found.decisions, "{found:?}");
}

#[test]
fn a_mosaic_upside_down_is_found_out() {
    let test = scenes::columns();
    let (oracle, files) = (test.oracle(SLACK_M), Rendered::files(&test));
    let tile = files.tile(&test, |scene, canvas| {
        let mut mosaic = test.mosaic().unwrap();
        // The rows run along +v, the grid stays where it is.
        let [_, low, _, high] = mosaic.extent;
        let MosaicFrame::Plane(plane) = &mut mosaic.frame else { unreachable!("a plane") };
        (plane.v, plane.u) = (-plane.v, -plane.u);
        plane.origin -= plane.v * (low + high);
        canvas.mosaic = mosaic.local(scene.mesh.origin());
    });
    let found = judge(&test, &oracle, &files.cameras, &tile);
    assert!(found.wrong_surfaces * 10 > found.pixels, "{found:?}");
}

/// The shift of the mosaic when every photo's lens is `lens(photo)`.
fn shift_with(lens: impl Fn(&Photo) -> Lens) -> (f64, f64) {
    let test = scenes::radial();
    let (oracle, mut files) = (test.oracle(SLACK_M), Rendered::files(&test));
    for photo in &mut files.cameras.photos {
        photo.lens = lens(photo);
    }
    let found = colours(&test, &oracle, &files.tile(&test, |_, _| {}));
    (found.shift.map_or(9.0, |s| s.x.hypot(s.y)), found.psnr_db)
}

#[test]
fn half_a_pixel_and_a_forgotten_distortion_are_found_out() {
    let shots = scenes::radial().shots;
    let half_a_pixel = |photo: &Photo| {
        let camera = &shots.iter().find(|s| s.name == photo.name).unwrap().camera;
        let mut params = camera.params.clone();
        let first = params.len() - 4;
        params[first] += 0.5;
        params[first + 1] += 0.5;
        Lens::new(camera.model, camera.size, &params).unwrap()
    };
    let (_, right) = shift_with(|photo| photo.lens);
    let (moved, _) = shift_with(half_a_pixel);
    assert!(moved > 0.1, "half a pixel moves the mosaic by {moved}");
    let (_, undistorted) = shift_with(|photo| photo.lens.without_distortion());
    assert!(undistorted < right - 3.0, "{undistorted} dB without distortion, {right} dB with it");
}

#[test]
fn a_tile_is_the_same_however_photos_are_read() {
    let mut test = scenes::columns();
    for (k, shot) in test.shots.iter_mut().enumerate() {
        shot.name = format!("{k}.jpg");
    }
    let rendered = Rendered::files(&test);
    let tile = |reading| {
        let scene = job::open_reading(rendered.folder.path(), &rendered.cameras, reading);
        let canvas = job::canvas(&test, &scene);
        Renderer::new(&scene, &canvas, BLOCK_BYTES).tile(test.plane.size().rect()).unwrap()
    };
    let [memory, index, tiles] = [Reading::Memory, Reading::Index, Reading::Tiles].map(tile);
    assert!(format!("{memory:?}") == format!("{index:?}"), "by an index");
    assert!(format!("{memory:?}") == format!("{tiles:?}"), "from store files");
}
