//! Every format is read to the truth.

use std::path::Path;
use std::process::Command;

use groundel::input::{CameraFormat, Proof, read_cameras};

use crate::rig::{Bend, Rig};
use crate::suites;
use crate::writers::{self, Writer};

/// What a format may differ from the truth by, pixels: a hundredth.
const CLOSE_PX: f64 = 0.01;

fn check(rig: &Rig, write: Writer, format: CameraFormat) {
    let proof = read(rig, write, format).expect("it comes with tie points");
    assert_eq!(proof.ties, rig.cameras.len() * rig.points.len());
    assert!(proof.error_px < CLOSE_PX && proof.better.is_none(), "{format:?}: {proof:?}");
}

/// Reads the rig in one format, to the truth.
fn read(rig: &Rig, write: Writer, format: CameraFormat) -> Option<Proof> {
    let folder = tempfile::tempdir().unwrap();
    rig.write_photos(&folder.path().join("photos"));
    let path = write(rig, folder.path());
    let cameras = read_cameras(&path, &writers::options(folder.path())).unwrap();
    assert_eq!(cameras.format, format);
    let error = rig.greatest_error(&cameras.set);
    assert!(error < CLOSE_PX, "{format:?}: {error} px");
    cameras.proof
}

#[test]
fn each_format_is_read_to_a_hundredth_of_a_pixel() {
    check(&Rig::brown(), writers::colmap_text, CameraFormat::Colmap);
    check(&Rig::brown(), writers::colmap_binary, CameraFormat::Colmap);
    check(&Rig::brown(), writers::opensfm, CameraFormat::OpenSfm);
    check(&Rig::brown(), writers::openmvg, CameraFormat::OpenMvg);
    check(&Rig::brown(), writers::alicevision, CameraFormat::AliceVision);
    check(&Rig::brown(), writers::old_alicevision, CameraFormat::AliceVision);
    check(&Rig::radial(), writers::bundler, CameraFormat::Bundler);
    check(&Rig::brown(), suites::metashape, CameraFormat::Metashape);
    check(&Rig::brown(), suites::micmac, CameraFormat::MicMac);
}

#[test]
fn formats_without_tie_points_are_read_to_a_hundredth_of_a_pixel() {
    let forms: [(Writer, CameraFormat); 3] = [
        (suites::pix4d, CameraFormat::Pix4d),
        (suites::reality_xmp, CameraFormat::RealityCapture),
        (suites::reality_table, CameraFormat::RealityCapture),
    ];
    for (write, format) in forms {
        assert_eq!(read(&Rig::brown(), write, format), None, "{format:?}");
    }
}

#[test]
fn fisheyes_are_read_to_a_hundredth_of_a_pixel() {
    check(&Rig::fisheye(), writers::opensfm, CameraFormat::OpenSfm);
    check(&Rig::fisheye(), writers::openmvg, CameraFormat::OpenMvg);
    check(&Rig::fisheye(), writers::alicevision, CameraFormat::AliceVision);
    check(&Rig::fisheye(), suites::metashape, CameraFormat::Metashape);
}

#[test]
fn every_fisheye_of_colmap_is_read_to_a_hundredth_of_a_pixel_beyond_sixty_degrees() {
    for bend in [
        Bend::Fisheye([0.02, -0.004, 0.001, -0.0005]),
        Bend::Fisheye([0.03, 0.0, 0.0, 0.0]),
        Bend::Fisheye([-0.02, 0.004, 0.0, 0.0]),
        Bend::Fov(0.9),
        Bend::ThinPrism([0.02, -0.004, 0.001, -0.0005], [2e-3, -1e-3], [1e-3, 2e-3]),
    ] {
        check(&Rig::wide(bend), writers::colmap_text, CameraFormat::Colmap);
        check(&Rig::wide(bend), writers::colmap_binary, CameraFormat::Colmap);
    }
}

#[test]
fn photos_that_cannot_be_used_are_left_out_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::radial();
    rig.write_photos(&folder.path().join("photos"));
    let options = writers::options(folder.path());
    let left_out = |path: &Path| {
        let set = read_cameras(path, &options).unwrap().set;
        assert_eq!(set.names.len(), set.photos.len() + set.left_out.len());
        set.left_out.into_iter().map(|l| (l.name, l.reason)).collect::<Vec<_>>()
    };
    let told = left_out(&writers::bundler(&rig, folder.path()));
    assert_eq!(told, [("blurred.png".into(), "it is not oriented".into())]);

    let path = writers::opensfm(&rig, folder.path());
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replacen("\"brown\"", "\"spherical\"", 1)).unwrap();
    let told = left_out(&path);
    assert!(told.len() == 1 && told[0].1.contains("spherical"), "{told:?}");

    let path = writers::alicevision(&rig, folder.path());
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replacen("\"poseId\":\"442\"", "\"poseId\":\"9\"", 1)).unwrap();
    let told = left_out(&path);
    assert!(told.len() == 1 && told[0].1.contains("not oriented"), "{told:?}");
}

#[test]
fn info_tells_format_tie_points_and_whether_the_mesh_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::brown();
    let path = writers::opensfm(&rig, folder.path());
    let corners = rig.points.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let mesh = corners.collect::<String>() + "f 1 2 3\nf 4 5 6\n";
    std::fs::write(folder.path().join("m.obj"), mesh).unwrap();
    let command = |mesh: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
        command.arg("info").arg(&path).arg("--mesh").arg(folder.path().join(mesh));
        let output = command.output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let told = command("m.obj");
    assert!(told.contains("OpenSfM reconstruction, 6 photos"), "{told}");
    assert!(told.contains("tie points: 300 tried, residual 0.00 px"), "{told}");
    assert!(told.contains("in front of 6 and in the picture of 6 of 6 photos"), "{told}");
    assert!(!told.contains("warning"), "{told}");

    std::fs::write(folder.path().join("far.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n").unwrap();
    let told = command("far.obj");
    assert!(told.contains("warning: the mesh lies in front of"), "{told}");
}
