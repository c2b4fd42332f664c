//! Golden pictures: what the scenes looked like when someone looked at them, compared sample by sample.
//!
//! `tests/golden/<scene>.<layer>.png` are renewed by `scripts/bless.sh` alone. A picture that differs is written to
//! `target/golden/`, to be looked at beside the old one.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use image::{DynamicImage, ImageFormat};
use tiff::decoder::{Decoder, DecodingResult};

use super::{command, job};
use groundel::synthetic::{TestScene, scenes};

#[test]
fn golden_columns_before_a_wall() {
    compare(&scenes::columns());
}

#[test]
fn golden_section_whose_hidden_part_occludes() {
    compare(&scenes::hidden_section());
}

#[test]
fn golden_untidy_mesh() {
    compare(&scenes::untidy());
}

/// Renders `scene` through the command, by the paper's rule, and compares mosaic and counts with the golden pictures.
fn compare(scene: &TestScene) {
    let folder = tempfile::tempdir().unwrap();
    job::write_files(scene, folder.path());
    let (run, mosaic) = command::ortho(folder.path(), "golden", &["--quiet", "--colour", "paper"]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    for (layer, file) in [("mosaic", mosaic.clone()), ("used", mosaic.with_extension("used.tif"))] {
        check(&format!("{}.{layer}.png", scene.name), &read(&file));
    }
}

fn check(name: &str, found: &DynamicImage) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let golden = root.join("tests/golden").join(name);
    if is_blessing() {
        fs::create_dir_all(golden.parent().unwrap()).unwrap();
        found.save_with_format(&golden, ImageFormat::Png).unwrap();
        return;
    }
    let known = image::open(&golden).unwrap_or_else(|e| panic!("{}: {e}", golden.display()));
    if *found != known {
        let failed = root.join("target/golden").join(name);
        fs::create_dir_all(failed.parent().unwrap()).unwrap();
        found.save_with_format(&failed, ImageFormat::Png).unwrap();
        panic!("{} differs from {}", failed.display(), golden.display());
    }
}

#[expect(clippy::disallowed_methods, reason = "only scripts/bless.sh sets it")]
fn is_blessing() -> bool {
    std::env::var_os("GROUNDEL_BLESS").is_some()
}

fn read(path: &Path) -> DynamicImage {
    let mut decoder = Decoder::new(BufReader::new(File::open(path).unwrap())).unwrap();
    let (width, height) = decoder.dimensions().unwrap();
    let channels = decoder.colortype().unwrap().num_samples();
    let DecodingResult::U8(samples) = decoder.read_image().unwrap() else {
        panic!("{}: not 8 bit", path.display())
    };
    if channels == 1 {
        image::GrayImage::from_raw(width, height, samples).unwrap().into()
    } else {
        image::RgbaImage::from_raw(width, height, samples).unwrap().into()
    }
}
