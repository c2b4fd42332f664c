//! However photos are read — whole into memory, by an index, from store files — the mosaic is the same.

use std::fs;
use std::path::Path;

use groundel::synthetic::{Sampling, TestScene, scenes};

use super::command::{done, report, samples};

/// Columns before a wall, seen by JPEGs four times as large a side as usual: of several tiles.
fn large() -> TestScene {
    let mut test = scenes::columns();
    test.shots.truncate(3);
    for (k, shot) in test.shots.iter_mut().enumerate() {
        shot.name = format!("{k}.jpg");
        let camera = &mut shot.camera;
        (camera.size.width, camera.size.height) = (4 * camera.size.width, 4 * camera.size.height);
        camera.params.iter_mut().take(4).for_each(|p| *p *= 4.0);
    }
    test
}

fn project(test: &TestScene) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    test.write(folder.path(), Sampling::Box(1), &[]).unwrap();
    folder
}

/// Files of the photo store that end like this.
fn files(mosaic: &Path, ending: &str) -> usize {
    let folder = mosaic.with_file_name(".groundel").join("photos");
    let files = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    files.filter(|p| p.extension().is_some_and(|e| e == ending)).count()
}

fn pixels(mosaic: &Path) -> (u64, u64) {
    let pixels = report(mosaic)["run"]["photo_pixels"].clone();
    (pixels["needed"].as_u64().unwrap(), pixels["decoded"].as_u64().unwrap())
}

#[test]
fn a_part_of_the_mosaic_reads_a_part_of_the_photos_and_is_the_same() {
    let test = large();
    let folder = project(&test);
    let p = test.plane.pixel_size / 4.0;
    let size = p.to_string();
    let full = done(folder.path(), "full", &["--pixel-size", &size]);
    assert_eq!((files(&full, "tiles"), files(&full, "index")), (0, 0), "all fit in memory");
    let all: u64 = test.shots.iter().map(|shot| shot.camera.size.area()).sum();
    let (needed, decoded) = pixels(&full);
    assert_eq!(decoded, all);
    assert!(all / 2 < needed && needed <= all, "{needed} of {all}");
    // Columns 60 to 140 of rows 40 to 100.
    let [u, _, _, v] = test.plane.extent;
    let extent = [u + 60.0 * p, v - 100.0 * p, u + 140.0 * p, v - 40.0 * p];
    let extent = extent.map(|e| e.to_string()).join(",");
    let part = done(folder.path(), "part", &["--pixel-size", &size, "--extent", &extent]);
    assert!(files(&part, "index") > 0, "no photo was read by its index");
    let (needed, decoded) = pixels(&part);
    assert!(decoded <= 2 * needed && decoded < all / 2, "{decoded} decoded, {needed} needed");
    let width = report(&full)["frame"]["width"].as_u64().unwrap();
    let row = 4 * usize::try_from(width).unwrap();
    let (whole, part) = (samples(&full).0, samples(&part).0);
    assert_eq!(part.len(), 4 * 80 * 60);
    for (row, part) in whole.chunks(row).skip(40).zip(part.chunks(4 * 80)) {
        // The extent's corner is rounded, and so are the pixels' centres.
        let near = row[4 * 60..].iter().zip(part).all(|(a, b)| a.abs_diff(*b) <= 1);
        assert!(near, "{row:?}\n{part:?}");
    }
}

#[test]
fn a_photo_cut_short_is_left_out_in_whichever_way_it_is_read() {
    let test = large();
    let folder = project(&test);
    let cut = folder.path().join("photos/0.jpg");
    let bytes = fs::read(&cut).unwrap();
    fs::write(&cut, &bytes[..bytes.len() - 100]).unwrap();
    let [u, _, _, v] = test.plane.extent;
    let p = test.plane.pixel_size / 4.0;
    let extent = [u, v - 120.0 * p, u + 160.0 * p, v].map(|e| e.to_string()).join(",");
    let size = p.to_string();
    let size = ["--pixel-size", &size];
    for (name, flags) in [("full", &[][..]), ("part", &["--extent", &extent])] {
        let flags = &[&size, flags].concat();
        let (run, mosaic) = super::command::ortho(folder.path(), name, flags);
        assert_eq!(run.status.code(), Some(1), "{name}: {}", super::command::said(&run));
        let left_out = report(&mosaic)["inputs"]["cameras"]["left_out"].clone();
        assert_eq!(left_out[0]["photo"], "0.jpg", "{name}");
    }
}
