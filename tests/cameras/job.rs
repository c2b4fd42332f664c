//! Whole jobs with cameras of other tools than COLMAP.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use glam::DVec2;
use groundel::synthetic::{Sampling, photos, scenes};

use crate::rig::{Bend, Camera, Rig};
use crate::suites;
use crate::table::{HEADER, angles};
use crate::writers;

fn groundel(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
    command.current_dir(folder).args(arguments).output().unwrap()
}

#[test]
fn the_mosaic_of_a_table_is_that_of_the_colmap_model() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scenes::all().into_iter().find(|scene| scene.name == "radial").unwrap();
    scene.write(folder.path(), Sampling::Box(2), &[]).unwrap();
    let mut table = HEADER.to_owned();
    for (photo, shot) in photos(&scene.shots).unwrap().photos.iter().zip(&scene.shots) {
        let [f, cx, cy, k1, k2] = shot.camera.params[..] else { panic!("a radial lens") };
        let camera = Camera {
            name: photo.name.clone(),
            focal: f,
            principal: DVec2::new(cx, cy),
            bend: Bend::Brown([k1, k2, 0.0], [0.0; 2]),
            rotation: photo.pose.rotation,
            centre: photo.pose.centre_ground,
        };
        let size = shot.camera.size;
        let inner = [f, cx - 0.5 * f64::from(size.width), 0.5 * f64::from(size.height) - cy];
        let gon = angles(&camera).map(|a| a * 200.0 / std::f64::consts::PI);
        let pose = [&camera.centre.to_array()[..], &gon, &inner, &[k1, k2, 0.0, 0.0, 0.0]].concat();
        let numbers: Vec<_> = pose.iter().map(f64::to_string).collect();
        writeln!(table, "{},{}", camera.name, numbers.join(",")).unwrap();
    }
    fs::write(folder.path().join("cameras.csv"), table).unwrap();
    let ortho = |out: &str, cameras: &[&str]| {
        let input = ["ortho", "--mesh", "mesh.ply", "--photos", "photos", "--frame", "frame.toml"];
        let output = ["--quiet", "--out", out];
        let done = groundel(folder.path(), &[&input[..], &output, cameras].concat());
        assert!(done.status.success(), "{done:?}");
    };
    ortho("colmap.tif", &["--cameras", "sparse"]);
    ortho("table.tif", &["--cameras", "cameras.csv", "--angle-unit", "gon"]);
    let told = groundel(folder.path(), &["compare", "colmap.tif", "table.tif"]);
    let told = String::from_utf8(told.stdout).unwrap();
    let psnr = told.lines().find_map(|l| l.strip_prefix("PSNR: ")?.strip_suffix(" dB")).unwrap();
    assert!(psnr.parse::<f64>().unwrap() > 60.0, "{told}");
}

#[test]
fn a_camera_that_metashape_did_not_align_is_left_out_by_name_and_the_job_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::brown();
    rig.write_photos(&folder.path().join("photos"));
    let path = suites::metashape(&rig, folder.path());
    let text = fs::read_to_string(&path).unwrap();
    let (before, rest) = text.split_once("label=\"IMG 2\"><transform>").unwrap();
    let (_, after) = rest.split_once("</transform>").unwrap();
    fs::write(&path, format!("{before}label=\"IMG 2\">{after}")).unwrap();
    let vertices = rig.points.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let mesh = vertices.collect::<String>() + "f 1 2 3\nf 4 5 6\n";
    fs::write(folder.path().join("m.obj"), mesh).unwrap();
    let input = ["ortho", "--mesh", "m.obj", "--photos", "photos", "--view", "top"];
    let cameras = ["--cameras", "metashape.xml", "--pixel-size", "0.05", "--out", "o.tif"];
    let done = groundel(folder.path(), &[&input[..], &cameras].concat());
    let said = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(1), "{said}");
    assert!(said.contains("IMG 2.png") && said.contains("not aligned"), "{said}");
}

#[test]
fn a_job_warns_of_half_a_pixel_and_refuses_transposed_rotations() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::brown();
    rig.write_photos(&folder.path().join("photos"));
    let corner = |k: usize| {
        let p = rig.points[k] + glam::DVec3::new(0.0, 0.0, 1.0);
        format!("v {} {} {}\n", p.x, p.y, p.z)
    };
    let mesh = (0..3).map(corner).collect::<String>() + "f 1 2 3\n";
    fs::write(folder.path().join("m.obj"), mesh).unwrap();
    let ortho = |rig: &Rig| {
        writers::opensfm(rig, folder.path());
        let input = ["ortho", "--mesh", "m.obj", "--photos", "photos", "--view", "top"];
        let cameras = ["--cameras", "reconstruction.json", "--pixel-size", "0.05"];
        let done = groundel(folder.path(), &[&input[..], &cameras, &["--out", "o.tif"]].concat());
        (done.status.code(), String::from_utf8(done.stderr).unwrap())
    };
    let mut shifted = rig.clone();
    shifted.seen.iter_mut().flatten().for_each(|at| *at += 0.5);
    let (code, said) = ortho(&shifted);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("warning: the cameras see their tie points within 0.71 px"), "{said}");

    let mut transposed = rig.clone();
    transposed.cameras.iter_mut().for_each(|c| c.rotation = c.rotation.transpose());
    let (code, said) = ortho(&transposed);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("300 tie points: expected") && said.contains("--force"), "{said}");
}
