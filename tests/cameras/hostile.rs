//! Files that are cut, damaged or malicious are refused by name, or read; never a panic.

use std::fs;
use std::path::Path;

use groundel::input::{AngleUnit, CameraFormat, CameraOptions, read_cameras};
use groundel::synthetic::Random;

use crate::rig::Rig;
use crate::table::HEADER;
use crate::writers::{self, Writer};

/// The single files of formats, and what they are read with.
fn forms(folder: &Path) -> Vec<(CameraFormat, Vec<u8>)> {
    let rig = Rig::radial();
    rig.write_photos(&folder.join("photos"));
    let writers: [(CameraFormat, Writer); 4] = [
        (CameraFormat::Bundler, writers::bundler),
        (CameraFormat::OpenSfm, writers::opensfm),
        (CameraFormat::OpenMvg, writers::openmvg),
        (CameraFormat::AliceVision, writers::alicevision),
    ];
    let mut forms: Vec<_> = writers
        .iter()
        .map(|(format, write)| (*format, fs::read(write(&rig, folder)).unwrap()))
        .collect();
    let line = |k: usize| format!("IMG {k}.png,1,2,3,0.1,0.2,0.3,500,0,0,-0.1,0,0,0,0\n");
    let table: String = [HEADER.to_owned()].into_iter().chain((0..6).map(line)).collect();
    forms.push((CameraFormat::Table, table.into_bytes()));
    forms
}

fn message(format: CameraFormat, bytes: &[u8], folder: &Path) -> Option<String> {
    let path = folder.join("cams");
    fs::write(&path, bytes).unwrap();
    let options = CameraOptions {
        format: Some(format),
        angle_unit: Some(AngleUnit::Degrees),
        force: true,
        ..writers::options(folder)
    };
    let error = read_cameras(&path, &options).err()?;
    assert_eq!(error.exit_code(), 2, "{error}");
    Some(error.to_string())
}

#[test]
fn a_file_cut_anywhere_is_refused_or_shorter() {
    let folder = tempfile::tempdir().unwrap();
    for (format, bytes) in forms(folder.path()) {
        assert_eq!(message(format, &bytes, folder.path()), None, "{format:?}");
        for cut in (0..bytes.len() - 2).step_by(1 + bytes.len() / 150) {
            let said = message(format, &bytes[..cut], folder.path());
            let may_end = matches!(format, CameraFormat::Table | CameraFormat::Bundler);
            assert!(said.is_some() || may_end, "{format:?} cut at {cut}");
            if let Some(said) = said {
                assert!(said.contains("cams") || said.contains("list.txt"), "{said}");
            }
        }
    }
}

#[test]
fn damage_is_refused_or_read_but_never_crashes() {
    let folder = tempfile::tempdir().unwrap();
    let mut r = Random::new(3);
    let mut refused = 0;
    for (format, bytes) in forms(folder.path()) {
        for _ in 0..150 {
            let mut damaged = bytes.clone();
            for _ in 0..=r.below(3) {
                let at = usize::try_from(r.below(damaged.len() as u64)).unwrap();
                match r.below(3) {
                    0 => damaged[at] = b"\0\"[]{},9-.e\xff"[usize::try_from(r.below(12)).unwrap()],
                    1 => damaged[at] ^= 1 << r.below(8),
                    _ => drop(damaged.remove(at)),
                }
            }
            refused += u32::from(message(format, &damaged, folder.path()).is_some());
        }
    }
    assert!(refused > 200, "{refused}");
}

#[test]
fn what_makes_no_sense_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for (format, from, to, expected) in [
        (CameraFormat::OpenSfm, "\"shots\":{", "\"shots\":3,\"x\":{", "expected an object"),
        (CameraFormat::OpenSfm, "\"rotation\":[", "\"rotation\":[1e999,", "line 1, column"),
        (
            CameraFormat::OpenSfm,
            "v2 unknown camera 0\",\"capt",
            "none\",\"capt",
            "name of a camera",
        ),
        (CameraFormat::OpenSfm, "IMG 1.png\":{", "IMG 0.png\":{", "once more"),
        (CameraFormat::OpenSfm, "IMG 1.png\":{", "../IMG 1.png\":{", "below the photo folder"),
        (CameraFormat::OpenMvg, "IMG 1.png", "IMG 0.png", "once more"),
        (CameraFormat::OpenMvg, "\"focal_length\": ", "\"focal_length\": -", "positive focal"),
        (CameraFormat::AliceVision, "\"sensorWidth\":\"23.5", "\"sensorWidth\":\"nan", "finite"),
        (CameraFormat::AliceVision, "\"poseId\":\"441\"}", "\"poseId\":\"440\"}", "once more"),
        (
            CameraFormat::AliceVision,
            "brown\",\"width\":\"640",
            "brown\",\"width\":\"6.5",
            "whole pixels",
        ),
        (CameraFormat::Table, "IMG 1.png", "IMG 0.png", "once more"),
        (CameraFormat::Table, "0.3,500", "0.3,nan", "line 2, column c"),
        (CameraFormat::Table, "0.3,500", "0.3,-500", "line 2: expected a positive focal"),
        (CameraFormat::Table, ",kappa,", ",k,", "line 1: expected the columns"),
        (CameraFormat::Table, "IMG 1.png,1,", "IMG 1.png,", "line 3: expected 15 columns"),
        (CameraFormat::Table, "IMG 1.png", "/etc/x", "below the photo folder"),
        (CameraFormat::Bundler, "7 50\n", "9 50\n", "list.txt"),
        (CameraFormat::Bundler, "7 50\n", "7 50\nnan ", "line 3: expected"),
    ] {
        let bytes = forms(folder.path()).into_iter().find(|f| f.0 == format).unwrap().1;
        let text = String::from_utf8(bytes).unwrap();
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text, "{from} does not occur");
        let said = message(format, broken.as_bytes(), folder.path()).expect(to);
        assert!(said.contains(expected), "{to}: {said}");
    }
}

#[test]
fn nesting_without_end_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let deep = "[".repeat(1 << 20);
    for format in [CameraFormat::OpenSfm, CameraFormat::OpenMvg, CameraFormat::AliceVision] {
        let said = message(format, deep.as_bytes(), folder.path()).unwrap();
        assert!(said.contains("cams: line 1"), "{said}");
    }
    let hidden = format!("[{{\"cameras\": {{}}, \"shots\": {{}}, \"biases\": {deep}");
    let said = message(CameraFormat::OpenSfm, hidden.as_bytes(), folder.path()).unwrap();
    assert!(said.contains("line 1"), "{said}");
}
