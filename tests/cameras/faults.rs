//! Faults written into a file are detected by its tie points, in every format that has some.

use glam::DVec2;
use groundel::geom::Bounds3;
use groundel::input::{CameraOptions, MeshProof, Reading, read_cameras};

use crate::rig::{Bend, Rig};
use crate::suites;
use crate::writers::{self, Writer};

const WRITERS: [(&str, Writer); 7] = [
    ("colmap text", writers::colmap_text),
    ("colmap binary", writers::colmap_binary),
    ("opensfm", writers::opensfm),
    ("openmvg", writers::openmvg),
    ("alicevision", writers::alicevision),
    ("metashape", suites::metashape),
    ("micmac", suites::micmac),
];

/// What reading the rig says, each format in turn: residual, better reading and the refusal if there is one.
fn read(rig: &Rig, check: impl Fn(&str, f64, Option<Reading>, Option<String>)) {
    let is_radial = rig.cameras.iter().all(|c| c.brown().1.map(f64::to_bits) == [0; 2]);
    let bundler: [(&str, Writer); 1] = [("bundler", writers::bundler)];
    let more = if is_radial { &bundler[..] } else { &[] };
    for (name, write) in WRITERS.iter().chain(more) {
        let folder = tempfile::tempdir().unwrap();
        rig.write_photos(&folder.path().join("photos"));
        let path = write(rig, folder.path());
        let options = writers::options(folder.path());
        let refusal = read_cameras(&path, &options).err();
        if let Some(error) = &refusal {
            assert_eq!(error.exit_code(), 2);
        }
        let forced = CameraOptions { force: true, ..options };
        let proof = read_cameras(&path, &forced).unwrap().proof.unwrap();
        let better = proof.better.map(|(reading, error)| {
            assert!(error < 0.01, "{name}: {error} px with {reading}");
            assert!(proof.warning().unwrap().contains(&reading.to_string()));
            reading
        });
        check(name, proof.error_px, better, refusal.map(|e| e.to_string()));
    }
}

#[test]
fn half_a_pixel_is_detected() {
    for rig in [Rig::brown(), Rig::radial()] {
        for (shift, expected) in [(0.5, Reading::HalfPixelMore), (-0.5, Reading::HalfPixelLess)] {
            let mut rig = rig.clone();
            rig.seen.iter_mut().flatten().for_each(|at| *at += shift);
            read(&rig, |name, error, better, refusal| {
                assert!((error - 0.5_f64.sqrt()).abs() < 0.01, "{name}: {error}");
                assert_eq!((better, refusal), (Some(expected), None), "{name}");
            });
        }
    }
}

#[test]
fn half_a_pixel_is_detected_among_noise_and_mismatches() {
    let mut rig = Rig::brown();
    let mut r = groundel::synthetic::Random::new(5);
    for (k, at) in rig.seen.iter_mut().flatten().enumerate() {
        *at += 0.5 + DVec2::new(r.between(-1.0, 1.0), r.between(-1.0, 1.0));
        if k % 20 == 0 {
            *at += 200.0;
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = writers::colmap_text(&rig, folder.path());
    let proof = read_cameras(&path, &CameraOptions::default()).unwrap().proof.unwrap();
    assert_eq!(proof.better.map(|b| b.0), Some(Reading::HalfPixelMore), "{proof:?}");
}

#[test]
fn exchanged_tangential_coefficients_are_detected() {
    let mut rig = Rig::brown();
    for camera in &mut rig.cameras {
        let (k, [p1, p2]) = camera.brown();
        camera.bend = Bend::Brown(k, [p2, p1]);
    }
    read(&rig, |name, error, better, _| {
        assert!(error > 0.3, "{name}: {error}");
        assert_eq!(better, Some(Reading::TangentialExchanged), "{name}");
    });
}

#[test]
fn photos_turned_upside_down_are_refused() {
    for mut rig in [Rig::brown(), Rig::radial()] {
        rig.seen.iter_mut().flatten().for_each(|at| at.y = 480.0 - at.y);
        read(&rig, |name, error, better, refusal| {
            assert!(error > 5.0, "{name}: {error}");
            assert_eq!(better, Some(Reading::YUpwards), "{name}");
            let refusal = refusal.unwrap();
            assert!(
                refusal.contains("within 5 pixels") && refusal.contains("y upwards"),
                "{refusal}"
            );
        });
    }
}

#[test]
fn transposed_rotations_are_refused() {
    for rig in [Rig::brown(), Rig::radial()] {
        let mut with_centres = rig.clone();
        let mut with_translations = rig;
        for camera in &mut with_centres.cameras {
            camera.rotation = camera.rotation.transpose();
        }
        for camera in &mut with_translations.cameras {
            let translation = camera.translation();
            camera.rotation = camera.rotation.transpose();
            camera.centre = -(camera.rotation.transpose() * translation);
        }
        for (rig, expected) in [
            (with_centres, Reading::Transposed),
            (with_translations, Reading::TransposedKeepingTranslation),
        ] {
            read(&rig, |name, _, better, refusal| {
                assert_eq!(better, Some(expected), "{name}");
                assert!(refusal.unwrap().contains("transposed"), "{name}");
            });
        }
    }
}

#[test]
fn without_tie_points_the_mesh_tells_of_wrong_rotations() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::brown();
    rig.write_photos(&folder.path().join("photos"));
    let (mut transposed, mut backward) = (rig.clone(), rig.clone());
    transposed.cameras.iter_mut().for_each(|c| c.rotation = c.rotation.transpose());
    let turn = glam::DMat3::from_diagonal(glam::DVec3::new(1.0, -1.0, -1.0));
    backward.cameras.iter_mut().for_each(|c| c.rotation = turn * c.rotation);
    let bounds = Bounds3::of(rig.points.iter().copied());
    let writers: [Writer; 3] = [suites::pix4d, suites::reality_xmp, suites::reality_table];
    for write in writers {
        for (rig, is_right) in [(&rig, true), (&transposed, false), (&backward, false)] {
            let path = write(rig, folder.path());
            let options = writers::options(folder.path());
            let cameras = read_cameras(&path, &options).unwrap();
            let read = (&*path, cameras.format, &options);
            let proof = MeshProof::of(read, &cameras.set.photos, &bounds).unwrap();
            assert_eq!(proof.warnings().is_empty(), is_right, "{proof:?}");
            assert_eq!((proof.in_front == 6, proof.inside == 6), (is_right, is_right), "{proof:?}");
        }
    }
}

#[test]
fn axes_of_another_convention_are_refused() {
    let turn = glam::DMat3::from_diagonal(glam::DVec3::new(1.0, -1.0, -1.0));
    let (mut up, mut inverse) = (Rig::brown(), Rig::brown());
    up.cameras.iter_mut().for_each(|c| c.rotation = turn * c.rotation);
    for camera in &mut inverse.cameras {
        let translation = camera.translation();
        camera.rotation = camera.rotation.transpose();
        camera.centre = translation;
    }
    for (rig, expected) in [(up, Reading::AxesUpBackwards), (inverse, Reading::Inverse)] {
        read(&rig, |name, _, better, refusal| {
            assert_eq!(better, Some(expected), "{name}");
            assert!(refusal.is_some(), "{name}");
        });
    }
}
