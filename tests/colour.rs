//! The colour rules from outside: the built binary on a façade of known answer, its photos changed as cameras and
//! passers-by change them.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::Path;
use std::process::Command;

use groundel::geom::Size;
use groundel::synthetic::{FacadeSet, Random};
use serde_json::Value;
use tiff::decoder::{Decoder, DecodingResult};

fn set() -> FacadeSet {
    FacadeSet {
        faces: 20_000,
        photo: Size::new(648, 486),
        pixel_size: 0.008,
        finest_m: 0.06,
        layers: vec!["count", "used", "best"],
        ..FacadeSet::demo()
    }
}

/// The façade as a project whose photos (numbered from 1) were changed pixel by pixel: place in the frame, −1 to 1, and
/// colour.
fn project(change: impl Fn(u64, [f64; 2], [f64; 3]) -> [f64; 3]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    set().write(folder.path()).unwrap();
    for k in 1..=7 {
        let path = folder.path().join(format!("photos/IMG_{k:04}.jpg"));
        let mut photo = image::open(&path).unwrap().into_rgb8();
        let (width, height) = (f64::from(photo.width()), f64::from(photo.height()));
        for (x, y, pixel) in photo.enumerate_pixels_mut() {
            let at = [
                2.0 * (f64::from(x) + 0.5) / width - 1.0,
                2.0 * (f64::from(y) + 0.5) / height - 1.0,
            ];
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let rounded = |v: f64| (v + 0.5).clamp(0.0, 255.0) as u8;
            pixel.0 = change(k, at, pixel.0.map(f64::from)).map(rounded);
        }
        let mut to = BufWriter::new(File::create(&path).unwrap());
        let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut to, 97);
        photo.write_with_encoder(encoder).unwrap();
    }
    folder
}

fn as_it_is(_: u64, _: [f64; 2], colour: [f64; 3]) -> [f64; 3] {
    colour
}

/// Gains of ± 20 % and some white balance, and a lens that darkens its corners by a quarter.
fn exposed(k: u64, [x, y]: [f64; 2], colour: [f64; 3]) -> [f64; 3] {
    let mut random = Random::new(40 + k);
    let (gain, square) = (random.between(0.8, 1.15), (x * x * 16.0 + y * y * 9.0) / 25.0);
    let balance = [1.0; 3].map(|v| v + random.between(-0.04, 0.04));
    std::array::from_fn(|c| {
        colour[c] * gain * balance[c] * (1.0 - 0.3 * square + 0.05 * square * square)
    })
}

/// Something flat before the wall in photos 2, 4 and 6, elsewhere in each.
fn obstructed(k: u64, [x, y]: [f64; 2], colour: [f64; 3]) -> [f64; 3] {
    let (left, top) = (-0.7 + 0.1 * k as f64, 0.5 - 0.15 * k as f64);
    let is_hidden =
        k.is_multiple_of(2) && (0.0..0.35).contains(&(x - left)) && (0.0..0.6).contains(&(y - top));
    if is_hidden { [70.0, 75.0 + 8.0 * x, 90.0] } else { colour }
}

/// A mosaic: RGB and alpha.
struct Picture {
    rgba: Vec<u8>,
    count: Vec<u8>,
}

fn bytes(path: &Path) -> Vec<u8> {
    match Decoder::new(File::open(path).unwrap()).unwrap().read_image().unwrap() {
        DecodingResult::U8(data) => data,
        other => panic!("8 bit expected, found {other:?}"),
    }
}

fn ortho(folder: &Path, name: &str, flags: &[&str]) -> Picture {
    let run = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .current_dir(folder)
        .args(["ortho", "project.toml", "--quiet", "--out", &format!("{name}.tif")])
        .args(["--report", &format!("{name}.json")])
        .args(flags)
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(0), "{}", String::from_utf8_lossy(&run.stderr));
    let file = |ending: &str| bytes(&folder.join(format!("{name}.{ending}")));
    Picture { rgba: file("tif"), count: file("count.tif") }
}

fn report(folder: &Path, name: &str) -> Value {
    serde_json::from_slice(&fs::read(folder.join(format!("{name}.json"))).unwrap()).unwrap()
}

/// PSNR against the known answer, dB, after the one gain for each channel that fits best, over the pixels for whose
/// count of photos `is_asked` holds.
fn psnr(picture: &Picture, is_asked: impl Fn(u8) -> bool) -> f64 {
    let (colours, mask) = set().expected();
    let pixels = || {
        let both = picture.rgba.chunks_exact(4).zip(colours.data().chunks_exact(3));
        let known = both.zip(mask.data()).zip(&picture.count);
        let asked = known
            .filter(|(((found, _), mask), count)| **mask > 0 && found[3] > 0 && is_asked(**count));
        asked.map(|(((found, wanted), _), _)| (found, wanted))
    };
    let (mut sum, mut n) = (0.0, 0.0);
    for c in 0..3 {
        let (mut cross, mut own) = (0.0, 0.0);
        for (found, wanted) in pixels() {
            let (f, w) = (f64::from(found[c]), f64::from(wanted[c]));
            (cross, own) = (cross + f * w, own + f * f);
        }
        for (found, wanted) in pixels() {
            let d = f64::from(found[c]) * cross / own - f64::from(wanted[c]);
            (sum, n) = (sum + d * d, n + 1.0);
        }
    }
    assert!(n > 3000.0, "pixels to compare");
    10.0 * (255.0 * 255.0 * n / sum).log10()
}

const ALL: fn(u8) -> bool = |_| true;

#[test]
fn photos_of_one_exposure_are_as_good_as_by_the_papers_rule_or_better() {
    let folder = project(as_it_is);
    let paper = psnr(&ortho(folder.path(), "paper", &["--colour", "paper"]), ALL);
    let even = psnr(&ortho(folder.path(), "even", &[]), ALL);
    assert!(even >= paper + 0.2, "even {even:.2} dB, paper {paper:.2} dB");
}

#[test]
fn differences_of_exposure_are_levelled_within_a_decibel_of_photos_without() {
    let clean = project(as_it_is);
    let known = psnr(&ortho(clean.path(), "even", &[]), ALL);
    let folder = project(exposed);
    let even = psnr(&ortho(folder.path(), "even", &[]), ALL);
    assert!(even >= known - 1.0, "levelled {even:.2} dB, without differences {known:.2} dB");
    // Less is found out: no levelling at all, and gains without vignetting.
    let gain = psnr(&ortho(folder.path(), "gain", &["--levelling", "gain"]), ALL);
    let none = psnr(&ortho(folder.path(), "none", &["--levelling", "none"]), ALL);
    assert!(
        none < gain - 1.0 && gain < even - 1.0,
        "none {none:.2}, gain {gain:.2}, full {even:.2}"
    );
    for photo in report(folder.path(), "even")["photos"].as_array().unwrap() {
        let levelling = &photo["levelling"];
        assert!(levelling["points"].as_u64() > Some(100), "{photo}");
        let of = |key: &str| levelling[key].as_f64().unwrap();
        assert!(of("residual_after") < 0.5 * of("residual_before"), "{photo}");
        assert!(levelling["vignetting"][0].as_f64() < Some(-0.1), "{photo}");
    }
    assert!(report(folder.path(), "none")["photos"][0]["levelling"].is_null());
}

#[test]
fn the_tone_is_that_of_the_photos_that_are_named() {
    let folder = project(exposed);
    ortho(folder.path(), "named", &["--tone-from", "*_0003.jpg", "--levelling", "gain"]);
    let gain = |name: &str, k: usize| {
        report(folder.path(), name)["photos"][k]["levelling"]["gain"][1].as_f64().unwrap()
    };
    assert!((gain("named", 2) - 1.0).abs() < 1e-9);
    ortho(folder.path(), "mean", &["--levelling", "gain"]);
    let mean: f64 = (0..7).map(|k| gain("mean", k).ln()).sum();
    assert!(mean.abs() < 1e-9 && (gain("mean", 2) - 1.0).abs() > 0.02);
    let run = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .current_dir(folder.path())
        .args(["ortho", "project.toml", "--tone-from", "card*"])
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&run.stderr).contains("--tone-from card*"));
}

#[test]
fn what_stands_before_the_wall_goes_where_three_see_and_two_are_no_worse_than_by_the_paper() {
    let folder = project(obstructed);
    let (even, paper) =
        (ortho(folder.path(), "even", &[]), ortho(folder.path(), "paper", &["--colour", "paper"]));
    let none = ortho(folder.path(), "none", &["--outliers", "none"]);
    let of = |picture: &Picture| (psnr(picture, |n| n == 2), psnr(picture, |n| n > 2));
    let ((two, more), (paper_two, paper_more), (_, all)) = (of(&even), of(&paper), of(&none));
    assert!(two >= paper_two - 0.1, "two photos: even {two:.2} dB, paper {paper_two:.2} dB");
    assert!(more >= paper_more - 0.5, "more: even {more:.2} dB, paper {paper_more:.2} dB");
    assert!(more > all + 3.0, "outliers kept: {all:.2} dB, robust {more:.2} dB");
}

#[test]
fn threads_memory_and_batches_change_no_byte_and_tile_sizes_no_pixel() {
    let folder = project(exposed);
    let at = |name: &str| folder.path().join(name);
    let first = ortho(folder.path(), "one", &["--threads", "1", "--work", "a"]);
    ortho(folder.path(), "two", &["--threads", "3", "--memory", "256MiB", "--work", "b"]);
    let small = ortho(folder.path(), "small", &["--tile-size", "64", "--work", "c"]);
    assert!(first.rgba == small.rgba && first.count == small.count, "tile sizes");
    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
        let run = command.current_dir(folder.path()).args(args).output().unwrap();
        assert_eq!(run.status.code(), Some(0), "{}", String::from_utf8_lossy(&run.stderr));
    };
    run(&["plan", "project.toml", "--job", "job", "--batches", "3", "--quiet"]);
    for batch in ["2", "0", "1"] {
        run(&["render", "job", "--batch", batch, "--quiet"]);
    }
    run(&["assemble", "job", "--out", "job.tif"]);
    for ending in ["tif", "used.tif", "best.tif"] {
        let one = fs::read(at(&format!("one.{ending}"))).unwrap();
        for name in ["two", "job"] {
            assert!(one == fs::read(at(&format!("{name}.{ending}"))).unwrap(), "{name}.{ending}");
        }
    }
}

#[test]
fn the_papers_rule_is_the_single_settings_that_it_stands_for() {
    let folder = project(exposed);
    let paper = ortho(folder.path(), "paper", &["--colour", "paper"]);
    let single =
        ["--levelling", "none", "--edges", "none", "--outliers", "sigma", "--weights", "area"];
    let single = ortho(folder.path(), "single", &single);
    assert!(paper.rgba == single.rgba);
    let settings = &report(folder.path(), "single")["settings"];
    assert_eq!(settings["levelling"], "none");
    assert_eq!((&settings["edges"], &settings["weights"]), (&"none".into(), &"area".into()));
    let even = report(folder.path(), "paper")["settings"] == *settings;
    assert!(even, "a preset is told as what it sets");
}

#[test]
fn a_damaged_tone_in_a_manifest_is_refused() {
    let folder = project(exposed);
    let run = |args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
        command.current_dir(folder.path()).args(args).output().unwrap()
    };
    assert_eq!(run(&["plan", "project.toml", "--job", "job", "--quiet"]).status.code(), Some(0));
    let path = folder.path().join("job/manifest.json");
    let text = fs::read_to_string(&path).unwrap();
    let (before, after) = text.split_once("\"gain\": [").unwrap();
    let (_, after) = after.split_once(',').unwrap();
    fs::write(&path, format!("{before}\"gain\": [1e300,{after}")).unwrap();
    let refused = run(&["render", "job", "--quiet"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("levelled"));
}
