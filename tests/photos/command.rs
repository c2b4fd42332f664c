//! `groundel ortho` on a synthetic project, and what it wrote.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use groundel::geom::Size;
use groundel::input::photo::{Rows, decode_photo, read_photo_header};
use groundel::synthetic::{Sampling, TestScene};
use serde_json::Value;
use tiff::decoder::{Decoder, DecodingResult};

/// Layers written by every run.
pub(crate) const LAYERS: &str = "elevation,count,used,best";

/// Writes `test` as a project into a new folder.
pub(crate) fn project(test: &TestScene) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    test.write(folder.path(), Sampling::Box(4), &[]).unwrap();
    folder
}

/// Runs `groundel ortho` on the project in `folder`, into a folder `name`, with a report.
pub(crate) fn ortho(folder: &Path, name: &str, flags: &[&str]) -> (Output, PathBuf) {
    let out = folder.join(name).join("mosaic.tif");
    fs::create_dir_all(folder.join(name)).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .current_dir(folder)
        .args(["ortho", "--mesh", "mesh.ply", "--cameras", "sparse", "--photos", "photos"])
        .args(["--frame", "frame.toml", "--quiet", "--layers", LAYERS])
        .arg("--out")
        .arg(&out)
        .arg("--report")
        .arg(folder.join(name).join("report.json"))
        .args(flags)
        .output()
        .unwrap();
    (output, out)
}

/// As [`ortho`], of a run that uses everything.
pub(crate) fn done(folder: &Path, name: &str, flags: &[&str]) -> PathBuf {
    let (run, out) = ortho(folder, name, flags);
    assert_eq!(run.status.code(), Some(0), "{}", said(&run));
    out
}

/// As [`ortho`], of a run that is refused as bad input: what it said.
pub(crate) fn refused(folder: &Path, flags: &[&str]) -> String {
    let (run, out) = ortho(folder, "refused", flags);
    assert_eq!(run.status.code(), Some(2), "{}", said(&run));
    assert!(!out.exists());
    said(&run)
}

pub(crate) fn said(run: &Output) -> String {
    String::from_utf8_lossy(&run.stderr).into_owned()
}

pub(crate) fn report(mosaic: &Path) -> Value {
    let text = fs::read_to_string(mosaic.with_file_name("report.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// The file of a layer beside the mosaic.
pub(crate) fn layer(mosaic: &Path, layer: &str) -> PathBuf {
    mosaic.with_extension(format!("{layer}.tif"))
}

/// Whether mosaic and layers are the same bytes.
pub(crate) fn assert_same_files(a: &Path, b: &Path) {
    let layers = LAYERS.split(',').map(|name| (layer(a, name), layer(b, name)));
    for (a, b) in layers.chain([(a.to_path_buf(), b.to_path_buf())]) {
        assert!(fs::read(&a).unwrap() == fs::read(&b).unwrap(), "{} {}", a.display(), b.display());
    }
}

/// All samples of a file that groundel wrote, widened, as the `tiff` crate reads them, and bits a sample.
pub(crate) fn samples(path: &Path) -> (Vec<u16>, u32) {
    let mut decoder = Decoder::new(BufReader::new(File::open(path).unwrap())).unwrap();
    match decoder.read_image().unwrap() {
        DecodingResult::U8(v) => (v.into_iter().map(u16::from).collect(), 8),
        DecodingResult::U16(v) => (v, 16),
        other => panic!("{other:?}"),
    }
}

/// The elevation layer.
pub(crate) fn elevations(path: &Path) -> Vec<f32> {
    let mut decoder = Decoder::new(BufReader::new(File::open(path).unwrap())).unwrap();
    let DecodingResult::F32(elevations) = decoder.read_image().unwrap() else {
        panic!("{}: no elevations", path.display())
    };
    elevations
}

/// A photo as groundel decodes it: size, channels, bits and samples.
pub(crate) fn photo(path: &Path) -> (Size, usize, u32, Vec<u16>) {
    let header = read_photo_header(path).unwrap();
    let mut all = Vec::new();
    decode_photo(path, &header, &mut |rows| {
        match rows {
            Rows::U8(rows) => all.extend(rows.iter().map(|&s| u16::from(s))),
            Rows::U16(rows) => all.extend_from_slice(rows),
        }
        Ok(())
    })
    .unwrap();
    (header.size, header.channels, header.bits, all)
}
