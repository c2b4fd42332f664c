//! `--masks`: where a photo is not to be used, it does not count.

use std::path::Path;

use glam::DVec2;
use groundel::camera::Photo;
use groundel::geom::Size;
use groundel::image::{Image, Samples};
use groundel::synthetic::{TestScene, scenes, write_picture};

use super::command::{
    assert_same_files, done, elevations, layer, project, refused, report, samples,
};

/// Writes the mask `name`.png of `size`, 1 where `is_used`.
fn write_mask(folder: &Path, name: &str, size: Size, is_used: impl Fn(u32, u32) -> bool) {
    let pixels = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y)));
    let data = pixels.map(|(x, y)| u8::from(is_used(x, y))).collect();
    let path = folder.join("masks").join(format!("{name}.png"));
    write_picture(&path, &Samples::U8(Image::from_data(size, 1, data))).unwrap();
}

/// Stripes and a disc, with borders in all directions.
fn pattern(x: u32, y: u32) -> bool {
    let (dx, dy) = (f64::from(x) - 150.0, f64::from(y) - 110.0);
    (x + 2 * y) % 23 > 6 && dx.hypot(dy) > 40.0
}

/// The distorted position in `photo` of what each mosaic pixel shows; from the exact surface, where it is the one that
/// was drawn: a pixel's centre may lie on a silhouette.
fn positions(test: &TestScene, photo: &Photo, drawn: &[f32]) -> Vec<Option<DVec2>> {
    let oracle = test.oracle(1e-7);
    let size = test.plane.size();
    let pixels = (0..size.height).flat_map(|y| (0..size.width).map(move |x| [x, y]));
    pixels
        .zip(drawn)
        .map(|(pixel, drawn)| {
            let sight = oracle.surface(pixel)?;
            if (sight.elevation - f64::from(*drawn)).abs() > 1e-5 {
                return None;
            }
            let q = photo.pose.camera_from_ground(oracle.ground(pixel, sight.elevation));
            if q.z > 0.0 { photo.lens.photo_from_ray(DVec2::new(q.x, q.y) / q.z) } else { None }
        })
        .collect()
}

const NO_SURFACE: u16 = 255;

#[test]
fn a_masked_point_is_not_counted_and_no_other_changes() {
    let test = scenes::columns();
    let folder = project(&test);
    let photos = test.photos().unwrap().photos;
    let photo = photos.iter().find(|p| p.name == "b.png").unwrap();
    write_mask(folder.path(), "b", photo.lens.size(), pattern);
    let whole = samples(&layer(&done(folder.path(), "whole", &[]), "count")).0;
    let alone = samples(&layer(&done(folder.path(), "alone", &["--include", "b.png"]), "count")).0;
    let masked_run = done(folder.path(), "masked", &["--masks", "masks"]);
    let masked = samples(&layer(&masked_run, "count")).0;
    let drawn = elevations(&layer(&masked_run, "elevation"));
    let (mut dropped, mut kept, mut unclear) = (0, 0, 0);
    for (k, position) in positions(&test, photo, &drawn).into_iter().enumerate() {
        if whole[k] == NO_SURFACE || alone[k] != 1 {
            assert_eq!(masked[k], whole[k], "pixel {k}: not seen by the photo");
            continue;
        }
        // Within rounding of the edge of a face or of a mask's pixel either answer is right.
        let is_clear = |p: &DVec2| (*p - p.round()).abs().min_element() > 1e-6;
        let Some(position) = position.filter(is_clear) else {
            unclear += 1;
            continue;
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in the frame")]
        let is_used = pattern(position.x.floor() as u32, position.y.floor() as u32);
        assert_eq!(masked[k], whole[k] - u16::from(!is_used), "pixel {k} at {position}");
        if is_used { kept += 1 } else { dropped += 1 }
    }
    assert!(dropped > 1000 && kept > 1000 && unclear < 100, "{dropped}, {kept}, {unclear}");
    // The report's statistics are those of the layer.
    let seen = |run: &Path| {
        let photos = report(run)["photos"].clone();
        let own = photos.as_array().unwrap().iter().find(|p| p["name"] == "b.png").cloned();
        own.unwrap()["pixels_seen"].as_u64().unwrap()
    };
    let (before, after) = (seen(&folder.path().join("whole/mosaic.tif")), seen(&masked_run));
    assert!((before - after).abs_diff(dropped) <= unclear, "{before} − {after} is not {dropped}");
}

#[test]
fn tile_size_threads_and_memory_do_not_change_a_masked_pixel() {
    let test = scenes::columns();
    let folder = project(&test);
    for photo in test.photos().unwrap().photos {
        write_mask(folder.path(), &photo.name, photo.lens.size(), pattern);
    }
    let masks = ["--masks", "masks"];
    let first = done(folder.path(), "first", &masks);
    for (name, flags) in [
        ("one", ["--threads", "1", "--memory", "256MiB"]),
        ("many", ["--threads", "3", "--memory", "2GiB"]),
    ] {
        assert_same_files(
            &first,
            &done(
                folder.path(),
                name,
                &[masks, [flags[0], flags[1]], [flags[2], flags[3]]].concat(),
            ),
        );
    }
    let tiles = done(folder.path(), "tiles", &[&masks[..], &["--tile-size", "32"]].concat());
    assert!(samples(&first) == samples(&tiles));
    assert!(samples(&first) != samples(&done(folder.path(), "unmasked", &[])));
}

#[test]
fn an_empty_mask_excludes_its_photo_and_a_full_one_changes_no_byte() {
    let test = scenes::columns();
    let folder = project(&test);
    let size = test.shots[0].camera.size;
    // By whole name and by stem, with a sub-folder.
    write_mask(folder.path(), "b.png", size, |_, _| true);
    write_mask(folder.path(), "sub folder/d", size, |_, _| true);
    let full = done(folder.path(), "full", &["--masks", "masks"]);
    assert_same_files(&full, &done(folder.path(), "none", &[]));
    write_mask(folder.path(), "sub folder/d", size, |_, _| false);
    let empty = done(folder.path(), "empty", &["--masks", "masks"]);
    let excluded = done(folder.path(), "excluded", &["--exclude", "sub folder/d.png"]);
    assert_same_files(&empty, &excluded);
    assert!(samples(&empty) != samples(&full));
}

#[test]
fn masks_may_be_named_in_the_project_file() {
    let test = scenes::columns();
    let folder = project(&test);
    write_mask(folder.path(), "a", test.shots[0].camera.size, pattern);
    let flag = done(folder.path(), "flag", &["--masks", "masks"]);
    std::fs::write(folder.path().join("masks.toml"), "masks = \"masks\"\n").unwrap();
    assert_same_files(&flag, &done(folder.path(), "file", &["masks.toml"]));
}

#[test]
fn what_is_wrong_with_masks_is_said_before_the_start() {
    let test = scenes::columns();
    let folder = project(&test);
    let root = folder.path();
    let masks = ["--masks", "masks"];
    assert!(refused(root, &masks).contains("groundel: error: masks: No such file"));
    std::fs::create_dir(root.join("masks")).unwrap();
    let none = refused(root, &masks);
    assert!(
        none.contains("--masks: masks holds no mask for any photo, such as a.png.png"),
        "{none}"
    );
    write_mask(root, "a", Size::new(320, 241), |_, _| true);
    let size = refused(root, &masks);
    let words =
        "masks/a.png: size: expected 320 × 240 pixels, as its photo, found 320 × 241 pixels";
    assert!(size.contains(words), "{size}");
    let mask = root.join("masks/a.png");
    write_mask(root, "a", Size::new(320, 240), |_, _| true);
    let bytes = std::fs::read(&mask).unwrap();
    std::fs::write(&mask, &bytes[..bytes.len() - 30]).unwrap();
    let cut = refused(root, &masks);
    assert!(cut.contains("masks/a.png: picture data: expected a whole picture"), "{cut}");
    std::fs::write(&mask, "no picture").unwrap();
    let other = refused(root, &masks);
    assert!(other.contains("masks/a.png: byte 0: expected a JPEG, PNG or TIFF photo"), "{other}");
    std::fs::remove_file(&mask).unwrap();
    let own = refused(root, &["--masks", "photos"]);
    assert!(
        own.contains("--masks: expected a mask, found the photo itself: photos/a.png"),
        "{own}"
    );
    let file = refused(root, &["--masks", "mesh.ply"]);
    assert!(file.contains("mesh.ply: --masks: expected a folder of masks, found a file"), "{file}");
}
