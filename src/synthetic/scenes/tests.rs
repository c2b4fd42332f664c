//! The scenes are what they claim to be, and the oracle agrees with the ray caster and with the photographs.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::*;
use crate::camera::{LensModel, Photo};
use crate::image::Image;
use crate::synthetic::{Oracle, Outcome, Part, Sampling, Sight, TestScene, photograph};

/// Every `step`-th pixel of both directions with its surface.
fn sights(scene: &TestScene, oracle: &Oracle, step: usize) -> Vec<([u32; 2], Option<Sight>)> {
    let size = scene.plane.size();
    let rows = (0..size.height).step_by(step);
    let pixels: Vec<[u32; 2]> =
        rows.flat_map(|y| (0..size.width).step_by(step).map(move |x| [x, y])).collect();
    pixels.into_par_iter().map(|pixel| (pixel, oracle.surface(pixel))).collect()
}

/// How often each outcome occurs, by the photo's name.
fn tally(scene: &TestScene, step: usize) -> BTreeMap<(String, &'static str), u32> {
    let oracle = scene.oracle(1e-7);
    let photos = scene.photos().unwrap().photos;
    let mut counts = BTreeMap::new();
    for (pixel, sight) in sights(scene, &oracle, step) {
        let Some(sight) = sight else { continue };
        for photo in &photos {
            let word =
                match oracle.sees(photo, pixel, &sight, 0.02 * scene.plane.pixel_size).outcome {
                    Outcome::Seen(_) => "seen",
                    Outcome::Behind => "behind",
                    Outcome::BeyondRadius => "beyond",
                    Outcome::OutOfFrame => "outside",
                    Outcome::WrongSide => "side",
                    Outcome::Occluded(_) => "occluded",
                };
            *counts.entry((photo.name.clone(), word)).or_insert(0) += 1;
        }
    }
    counts
}

fn count(counts: &BTreeMap<(String, &'static str), u32>, name: &str, word: &str) -> u32 {
    counts.iter().filter(|((n, w), _)| n.contains(name) && *w == word).map(|(_, c)| c).sum()
}

#[test]
fn every_scene_makes_photos_a_mosaic_and_has_its_own_name() {
    let scenes = all();
    let mut names: Vec<_> = scenes.iter().map(|s| s.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), scenes.len());
    for scene in &scenes {
        assert!(scene.photos().unwrap().photos.len() >= 3, "{}", scene.name);
        let mosaic = scene.mosaic().unwrap();
        assert_eq!(mosaic.size, scene.plane.size());
        assert!((1_000..20_000).contains(&mosaic.size.area()), "{} {:?}", scene.name, mosaic.size);
        assert!(
            (30..20_000).contains(&scene.triangles.len()),
            "{} {}",
            scene.name,
            scene.triangles.len()
        );
        assert_eq!(scene.parts.len(), scene.triangles.len());
    }
}

#[test]
fn the_oracle_s_surface_is_what_a_ray_from_the_viewer_meets_first() {
    for scene in all() {
        let oracle = scene.oracle(1e-7);
        let caster = scene.caster();
        let [low, high] = scene.plane.slab();
        let mut shown = 0;
        let step = if scene.plane.size().area() < 2_000 { 3 } else { 6 };
        for (pixel, sight) in sights(&scene, &oracle, step) {
            let from = oracle.ground(pixel, high.min(100.0));
            let hit = caster.cast(from, -scene.plane.n(), None);
            let elevation = hit.map(|h| (h.ground - scene.plane.origin).dot(scene.plane.n()));
            let elevation = elevation.filter(|e| *e >= low);
            let claim = elevation.zip(sight.map(|s| s.face));
            match sight {
                Some(s) => {
                    let e = elevation.unwrap_or(f64::NAN);
                    assert!((e - s.elevation).abs() < 1e-7, "{} {pixel:?} {s:?} {e}", scene.name);
                    shown += 1;
                }
                None => assert_eq!(elevation, None, "{} {pixel:?}", scene.name),
            }
            assert!(oracle.accepts(pixel, claim, 1e-7), "{} {pixel:?}", scene.name);
        }
        assert!(shown > 30, "{} {shown}", scene.name);
    }
}

/// The colour of a photo at a position, bilinear, 0 to 1; `None` within a pixel of the border.
fn look_up(image: &Image<u8>, at: DVec2) -> Option<DVec3> {
    let corner = (at - 0.5).floor();
    let size = DVec2::new(f64::from(image.size().width), f64::from(image.size().height));
    if corner.min_element() < 0.0 || (size - corner).min_element() < 2.0 {
        return None;
    }
    let t = at - 0.5 - corner;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside")]
    let (x, y) = (corner.x as usize, corner.y as usize);
    let tap = |i: usize, j: usize| {
        let rgb = image.pixel(x + i, y + j);
        DVec3::new(f64::from(rgb[0]), f64::from(rgb[1]), f64::from(rgb[2])) / 255.0
    };
    let row = |j: usize| tap(0, j) * (1.0 - t.x) + tap(1, j) * t.x;
    Some(row(0) * (1.0 - t.y) + row(1) * t.y)
}

/// Median distance between a photo and the texture where the oracle says `seen`, and where it says occluded.
fn agreement(scene: &TestScene, photo: &Photo, oracle: &Oracle) -> [Vec<f64>; 2] {
    let image: Image<u8> = photograph(&scene.caster(), photo, Sampling::Box(1), 3);
    let mut found = [Vec::new(), Vec::new()];
    for (pixel, sight) in sights(scene, oracle, 5) {
        let Some(sight) = sight else { continue };
        let verdict = oracle.sees(photo, pixel, &sight, 0.02 * scene.plane.pixel_size);
        let ground = oracle.ground(pixel, sight.elevation);
        let camera = photo.pose.camera_from_ground(ground);
        let (list, at) = match verdict.outcome {
            Outcome::Seen(at) => (0, Some(at)),
            Outcome::Occluded(_) => (1, photo.lens.photo_from_ray(camera.truncate() / camera.z)),
            _ => continue,
        };
        let truth = DVec3::from(scene.colour(oracle, pixel, &sight));
        if let Some(rgb) = at.and_then(|at| look_up(&image, at)) {
            found[list].push(rgb.distance(truth));
        }
    }
    for list in &mut found {
        list.sort_by(f64::total_cmp);
    }
    found
}

#[test]
fn where_the_oracle_says_seen_the_photograph_shows_the_texture_and_where_occluded_it_does_not() {
    for scene in all() {
        // Faces below a photo pixel hide and show within it, and points on edges lie between two parts: there, no
        // look-up can tell.
        if ["sub_pixel", "huge_and_tiny", "grid_aligned"].contains(&scene.name) {
            continue;
        }
        let oracle = scene.oracle(1e-7);
        for photo in scene.photos().unwrap().photos {
            let [seen, occluded] = agreement(&scene, &photo, &oracle);
            let at = |list: &[f64], share: f64| {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a share"
                )]
                let k = (list.len() as f64 * share) as usize;
                list[k.min(list.len() - 1)]
            };
            let place = format!("{} {}", scene.name, photo.name);
            if seen.len() > 30 {
                // Beside silhouettes a look-up mixes two surfaces.
                assert!(at(&seen, 0.8) < 0.06, "{place}: {} of {}", at(&seen, 0.8), seen.len());
            }
            if occluded.len() > 40 {
                assert!(at(&occluded, 0.5) > 0.06, "{place}: {}", at(&occluded, 0.5));
            }
        }
    }
}

#[test]
fn columns_hide_the_wall_from_each_photo_and_one_photo_is_behind_it() {
    for make in [columns, oblique, radial] {
        let counts = tally(&make(), 4);
        for name in ["a.png", "b.png", "c.png", "d.png"] {
            assert!(count(&counts, name, "occluded") > 10, "{counts:?}");
            assert!(count(&counts, name, "seen") > 200, "{counts:?}");
        }
        assert_eq!(count(&counts, "e.png", "seen"), 0, "{counts:?}");
        assert!(count(&counts, "e.png", "side") > 300, "{counts:?}");
    }
}

#[test]
fn beyond_the_valid_radius_the_formula_still_gives_positions_in_the_frame() {
    let scene = wide_angle();
    let counts = tally(&scene, 4);
    assert!(count(&counts, "near", "beyond") > 50, "{counts:?}");
    // What a program without the valid radius would take for seen.
    let oracle = scene.oracle(1e-7);
    let mut trap = 0;
    for (pixel, sight) in sights(&scene, &oracle, 4) {
        let Some(sight) = sight else { continue };
        for photo in scene.photos().unwrap().photos {
            let c = photo.pose.camera_from_ground(oracle.ground(pixel, sight.elevation));
            let ray = c.truncate() / c.z;
            if c.z > 0.0 && photo.lens.photo_from_ray(ray).is_none() {
                assert_eq!(photo.lens.model(), LensModel::SimpleRadial);
                let folded =
                    ray * (1.0 - 0.42 * ray.length_squared()) * 170.0 + DVec2::new(160.0, 120.0);
                trap += u32::from(photo.lens.contains(folded));
            }
        }
    }
    assert!(trap > 50, "{trap}");
}

#[test]
fn in_the_section_what_hides_the_wall_is_itself_not_shown() {
    let scene = hidden_section();
    let oracle = scene.oracle(1e-7);
    let mut hidden_by_shaft = 0;
    for (pixel, sight) in sights(&scene, &oracle, 4) {
        let Some(sight) = sight else { continue };
        assert_ne!(scene.parts[sight.triangle], Part::Shaft);
        for photo in scene.photos().unwrap().photos {
            let verdict = oracle.sees(&photo, pixel, &sight, 4e-4);
            if let Outcome::Occluded(by) = verdict.outcome {
                hidden_by_shaft += u32::from(scene.parts[by.0 as usize] == Part::Shaft);
            }
        }
    }
    assert!(hidden_by_shaft > 100, "{hidden_by_shaft}");
}

#[test]
fn from_inside_the_room_the_far_wall_is_seen_and_from_outside_it_is_not() {
    let counts = tally(&photo_inside(), 4);
    assert!(count(&counts, "in_", "seen") > 400, "{counts:?}");
    assert!(count(&counts, "in_", "occluded") > 20, "{counts:?}");
    assert_eq!(count(&counts, "out", "seen"), 0, "{counts:?}");
    assert!(count(&counts, "out", "occluded") > 300, "{counts:?}");
}

#[test]
fn faces_run_through_photo_planes_and_points_lie_behind_photos() {
    let scene = through_photo_plane();
    let counts = tally(&scene, 4);
    assert!(count(&counts, "", "behind") > 20, "{counts:?}");
    assert!(count(&counts, "", "occluded") > 50, "{counts:?}");
    assert!(count(&counts, "", "seen") > 1000, "{counts:?}");
    for photo in scene.photos().unwrap().photos {
        let depths = |t: &[DVec3; 3]| t.map(|p| photo.pose.camera_from_ground(p).z);
        let crossing = scene
            .triangles
            .iter()
            .map(depths)
            .filter(|d| d.iter().any(|&z| z > 0.0) && d.iter().any(|&z| z < 0.0));
        assert!(crossing.count() >= 4, "{}", photo.name);
    }
}

#[test]
fn on_the_grid_pixel_centres_lie_on_edges_and_sight_lines_touch_steps() {
    let scene = grid_aligned();
    let oracle = scene.oracle(1e-7);
    let (mut on_edge, mut touching, mut pixels) = (0, 0, 0);
    for (pixel, sight) in sights(&scene, &oracle, 2) {
        let Some(sight) = sight else { continue };
        pixels += 1;
        // Moved by a ten-thousandth of a pixel, another face may be shown.
        let [a, b, c] = scene.triangles[sight.triangle].map(|p| p / scene.plane.pixel_size);
        let at = oracle.ground(pixel, sight.elevation) / scene.plane.pixel_size;
        let area = |p: DVec3, q: DVec3| (q - p).truncate().perp_dot((at - p).truncate());
        on_edge += u32::from([area(a, b), area(b, c), area(c, a)].contains(&0.0));
        for photo in scene.photos().unwrap().photos {
            touching += u32::from(!oracle.sees(&photo, pixel, &sight, 3e-4).clear);
        }
    }
    assert!(on_edge * 4 > pixels, "{on_edge} of {pixels}");
    assert!(touching > 50, "{touching}");
}

#[test]
fn sub_pixel_faces_are_below_a_pixel_of_mosaic_and_photo() {
    let scene = sub_pixel();
    let photos = scene.photos().unwrap().photos;
    for t in &scene.triangles {
        let widest = (t[1] - t[0]).truncate().length().max((t[2] - t[0]).truncate().length());
        assert!(widest < 0.5 * scene.plane.pixel_size);
        let focal = photos[0].lens.focal_px().x;
        let depth = photos[0].pose.camera_from_ground(t[0]).z;
        assert!((t[1] - t[0]).length() * focal / depth < 3.0);
    }
}

#[test]
fn the_untidy_mesh_holds_duplicates_of_lower_id_and_both_windings() {
    let scene = untidy();
    let n = scene.plane.n();
    let up = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).dot(n) > 0.0;
    let ups = scene.triangles.iter().filter(|t| up(t)).count();
    assert!(ups > 30 && scene.triangles.len() - ups > 30);
    let oracle = scene.oracle(1e-7);
    let mut twins = 0;
    for (pixel, sight) in sights(&scene, &oracle, 2) {
        let Some(sight) = sight else { continue };
        let own = scene.triangles[sight.triangle];
        let twin = (0..scene.triangles.len())
            .rfind(|&k| scene.triangles[k].iter().all(|p| own.contains(p)))
            .unwrap();
        if twin > sight.triangle && own[0] != own[1] {
            twins += 1;
            let later = scene.ids()[twin];
            assert!(!oracle.accepts(pixel, Some((sight.elevation, later)), 1e-7));
        }
    }
    assert!(twins > 100, "{twins}");
}
