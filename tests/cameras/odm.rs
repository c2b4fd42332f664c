//! ODM's reduced coordinates: its meshes and its cameras less the offset of `coords.txt`.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use glam::DVec3;

use crate::rig::Rig;
use crate::writers;

fn ortho(folder: &Path, out: &str, flags: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
    command.current_dir(folder).args([
        "ortho",
        "--view",
        "top",
        "--photos",
        "photos",
        "--pixel-size",
        "0.125",
    ]);
    command.args(["--crs", "EPSG:32634", "--out", out]).args(flags).output().unwrap()
}

fn mesh(rig: &Rig) -> String {
    let vertex = |p: &DVec3| format!("v {} {} {}\n", p.x, p.y, p.z);
    rig.points.iter().map(vertex).collect::<String>() + "f 1 2 3\nf 4 5 6\nf 7 8 9\n"
}

#[test]
fn coords_txt_moves_odms_mesh_and_cameras_to_the_ground() {
    let (whole, reduced) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let offset = DVec3::new(512_000.0, -2_304.0, 0.0);
    let rig = Rig::brown();
    let mut less = rig.clone();
    less.points.iter_mut().for_each(|p| *p -= offset);
    less.cameras.iter_mut().for_each(|c| c.centre -= offset);
    for (rig, folder) in [(&rig, whole.path()), (&less, reduced.path())] {
        rig.write_photos(&folder.join("photos"));
        writers::opensfm(rig, folder);
        fs::write(folder.join("m.obj"), mesh(rig)).unwrap();
    }
    fs::write(reduced.path().join("coords.txt"), "WGS84 UTM 34N\n512000.0 -2304.0\n").unwrap();
    let input = ["--mesh", "m.obj", "--cameras", "reconstruction.json"];
    let done = ortho(whole.path(), "o.tif", &input);
    assert!(done.status.success(), "{done:?}");
    let done = ortho(reduced.path(), "o.tif", &[&input[..], &["--shift", "coords.txt"]].concat());
    assert!(done.status.success(), "{done:?}");
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(!said.contains("warning"), "{said}");
    let read = |folder: &Path, name: &str| fs::read(folder.join(name)).unwrap();
    assert!(read(whole.path(), "o.frame.toml") == read(reduced.path(), "o.frame.toml"));
    // A project file says the same.
    let project = "mesh = [\"m.obj\"]\ncameras = \"reconstruction.json\"\nshift = \"coords.txt\"\n";
    fs::write(reduced.path().join("p.toml"), project).unwrap();
    let done = ortho(reduced.path(), "p.tif", &["p.toml"]);
    assert!(done.status.success(), "{done:?}");
    assert!(read(reduced.path(), "o.tif") == read(reduced.path(), "p.tif"));
    // The shift of the mesh alone leaves the cameras behind.
    let done =
        ortho(reduced.path(), "q.tif", &[&input[..], &["--shift", "512000,-2304,0"]].concat());
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(said.contains("in the picture of 0 of 6 photos"), "{said}");
    // The same pixels, whichever way they came.
    let (a, b) = (whole.path().join("o.tif"), reduced.path().join("o.tif"));
    let told = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .arg("compare")
        .args([&a, &b])
        .output()
        .unwrap();
    let told = String::from_utf8(told.stdout).unwrap();
    let compared = told.lines().next().unwrap().split(' ').nth(2).unwrap();
    assert!(compared.parse::<u32>().unwrap() > 50 && told.contains("PSNR: inf"), "{told}");
}
