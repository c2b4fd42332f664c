//! Frames that are found, sections, views of a camera and the way between pixels and ground, from outside.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use super::job;
use glam::DVec3;
use groundel::synthetic::{TestScene, scenes};

pub(super) struct Project {
    pub(super) test: TestScene,
    folder: tempfile::TempDir,
}

impl Project {
    pub(super) fn new(test: TestScene) -> Self {
        let folder = tempfile::tempdir().unwrap();
        job::write_files(&test, folder.path());
        Self { test, folder }
    }

    pub(super) fn path(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }

    /// Renders `name`.tif and gives what is said.
    pub(super) fn ortho(&self, name: &str, flags: &[&str]) -> String {
        let output = self.groundel(
            "ortho",
            &[
                &[
                    "--mesh",
                    "mesh.ply",
                    "--cameras",
                    "sparse",
                    "--photos",
                    "photos",
                    "--quiet",
                    "--out",
                ],
                &[&format!("{name}.tif")],
                flags,
            ],
        );
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        said
    }

    pub(super) fn groundel(&self, command: &str, args: &[&[&str]]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_groundel"))
            .current_dir(self.folder.path())
            .arg(command)
            .args(args.concat())
            .output()
            .unwrap()
    }

    /// What a command answers.
    pub(super) fn answer(&self, command: &str, args: &[&str]) -> String {
        let output = self.groundel(command, &[args]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }
}

/// The numbers of one line of `groundel locate`.
pub(super) fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace().map(|word| word.parse().unwrap()).collect()
}

pub(super) fn triple(values: &[f64]) -> String {
    let words: Vec<_> = values.iter().map(|v| format!("{v:?}")).collect();
    words.join(",")
}

pub(super) fn key(file: &Path, key: &str) -> Vec<f64> {
    let text = fs::read_to_string(file).unwrap();
    let table: toml::Table = text.parse().unwrap();
    table[key].as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect()
}

#[test]
fn a_photo_left_out_is_found_again_by_the_others() {
    let project = Project::new(scenes::columns());
    let frame = "kind = \"perspective\"\nphoto = \"b.png\"\ndistorted = true\n";
    fs::write(project.path("view.toml"), frame).unwrap();
    let flags = ["--frame", "view.toml", "--exclude", "b.png", "--layers", "elevation,count"];
    project.ortho("view", &flags);
    let compared =
        project.answer("compare", &["view.tif", "photos/b.png", "--out", "difference.png"]);
    let of = |what: &str| -> Vec<f64> {
        let line = compared.lines().find(|line| line.starts_with(what)).unwrap();
        line.split([' ', ',']).filter_map(|word| word.parse().ok()).collect()
    };
    assert!(of("PSNR")[0] > 30.0 && of("SSIM")[0] > 0.95, "{compared}");
    let shift = of("shift");
    assert!(shift[0].hypot(shift[1]) < 0.05, "{compared}");
    assert!(fs::read(project.path("difference.png")).unwrap().starts_with(b"\x89PNG"));
    // The frame beside it reads back to the same bytes; there is nothing of the ground in the file.
    assert_eq!(fs::read_to_string(project.path("view.frame.toml")).unwrap(), frame);
    // Depth along the axis, and back to the pixel.
    let line =
        project.answer("locate", &["view.tif", "--pixel", "150.5,120.5", "--cameras", "sparse"]);
    let found = numbers(&line);
    let ground = triple(&found[2..5]);
    let back = numbers(
        &project.answer("locate", &["view.tif", "--ground", &ground, "--cameras", "sparse"]),
    );
    assert!((back[0] - 150.5).hypot(back[1] - 120.5) < 1e-6, "{back:?}");
    assert!(found[5] > 0.5 && (found[5] - back[5]).abs() < 1e-9, "{found:?} {back:?}");
}

#[test]
fn pixels_and_ground_points_are_told_by_the_frames_own_definition() {
    let project = Project::new(scenes::oblique());
    project.ortho("mosaic", &["--frame", "frame.toml", "--layers", "elevation"]);
    let frame = project.path("mosaic.frame.toml");
    let [origin, u, v] = ["origin", "u_axis", "v_axis"].map(|k| DVec3::from_slice(&key(&frame, k)));
    let extent = key(&frame, "extent");
    let pixel = project.test.plane.pixel_size;
    for (column, row) in [(60.5, 50.5), (61.25, 40.75), (20.125, 70.0)] {
        let at = format!("{column},{row}");
        let found = numbers(&project.answer("locate", &["mosaic.tif", "--pixel", &at]));
        let (a, b) = (extent[0] + column * pixel, extent[3] - row * pixel);
        let due = origin + u * a + v * b + u.cross(v) * found[5];
        let ground = DVec3::from_slice(&found[2..5]);
        assert!((due - ground).length() < 1e-8, "{due} {ground}");
        let args = ["mosaic.tif", "--ground", &triple(&found[2..5])];
        let back = numbers(&project.answer("locate", &args));
        assert!((back[0] - column).hypot(back[1] - row) < 1e-6, "{back:?}");
    }
    // Where there is no surface, and outside, the error says so.
    for (at, said) in [("0.5,0.5", "shows no surface"), ("-1,3", "within the mosaic")] {
        let output = project.groundel("locate", &[&["mosaic.tif", "--pixel", at]]);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && error.contains(said), "{error}");
    }
}

#[test]
fn the_facade_is_found_by_what_the_photos_look_at() {
    let project = Project::new(scenes::columns());
    let said = project.ortho("fit", &["--view", "fit", "--up", "0,1,0", "--pixel-size", "0.02"]);
    assert!(said.contains("--view fit chose the plane with origin = ["), "{said}");
    assert!(!said.contains("upside down"), "{said}");
    let said = project.ortho("down", &["--view", "fit", "--up", "0,-1,0", "--pixel-size", "0.02"]);
    assert!(
        said.contains("photos stand upside down in this view: is [0.0, 1.0, 0.0] up"),
        "{said}"
    );
    let frame = project.path("fit.frame.toml");
    let [u, v] = ["u_axis", "v_axis"].map(|k| DVec3::from_slice(&key(&frame, k)));
    assert!(u.x > 0.9999 && v == DVec3::Y, "{u} {v}");
}

#[test]
fn three_points_are_the_plane_they_span() {
    let project = Project::new(scenes::columns());
    let mut frame = String::from("kind = \"plane\"\n");
    write!(frame, "origin = [0.5, 0.25, 0]\nu_axis = [1, 0, 0]\nv_axis = [0, 1, 0]\n").unwrap();
    fs::write(project.path("plane.toml"), frame).unwrap();
    let grid = ["--pixel-size", "0.02", "--extent", "0,0,1,1"];
    project.ortho("stated", &[&["--frame", "plane.toml"], &grid[..]].concat());
    let points = "0.5,0.25,0;2.5,0.25,0;0.75,7,0";
    project.ortho("points", &[&["--plane-points", points], &grid[..]].concat());
    for name in ["tif", "frame.toml"] {
        let read = |stem: &str| fs::read(project.path(&format!("{stem}.{name}"))).unwrap();
        assert!(read("stated") == read("points"), "{name}");
    }
    let flags = ["--plane-points", "0,0,0;1,1,1;2,2,2", "--out", "x.tif"];
    let output = project.groundel("ortho", &[&flags]);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && error.contains("not on one line"), "{error}");
}

#[test]
fn a_development_has_its_own_coordinates_and_the_other_frames_keys_are_refused() {
    let project = Project::new(scenes::columns());
    // The wall from an axis a long way before it: nearly flat.
    let cylinder = "kind = \"cylinder\"\norigin = [1.2, 0.9, 20.0]\naxis = [0, 1, 0]\nzero = [0, 0, -1]\n\
                    radius = 20.7\nfacing = \"inside\"\n";
    fs::write(project.path("inside.toml"), cylinder).unwrap();
    let flags = ["--frame", "inside.toml", "--pixel-size", "0.02", "--layers", "elevation"];
    project.ortho("inside", &flags);
    let extent = key(&project.path("inside.frame.toml"), "extent");
    // The wall is about 2.4 m wide and 1.8 m high.
    assert!((2.2..2.8).contains(&(extent[2] - extent[0])), "{extent:?}");
    assert!((1.7..2.1).contains(&(extent[3] - extent[1])), "{extent:?}");
    // With u = 0 behind the axis the wall lies across the seam at ± half a turn: the arc is the same.
    fs::write(project.path("seam.toml"), cylinder.replace("[0, 0, -1]", "[0, 0, 1]")).unwrap();
    project.ortho("seam", &["--frame", "seam.toml", "--pixel-size", "0.02"]);
    let seam = key(&project.path("seam.frame.toml"), "extent");
    let half_turn = std::f64::consts::PI * 20.7;
    assert!(
        seam[0] < half_turn && half_turn < seam[2] || seam[0] < -half_turn && -half_turn < seam[2],
        "{seam:?}"
    );
    assert!((seam[2] - seam[0] - (extent[2] - extent[0])).abs() < 0.021, "{seam:?} {extent:?}");
    let at = ["inside.tif", "--pixel", "60.5,50.5"];
    let found = numbers(&project.answer("locate", &at));
    let ground = DVec3::from_slice(&found[2..5]);
    let axis = DVec3::new(1.2, ground.y, 20.0);
    assert!((20.7 - (ground - axis).length() - found[5]).abs() < 1e-6, "{found:?}");
    let args = ["inside.tif", "--ground", &triple(&found[2..5])];
    let back = numbers(&project.answer("locate", &args));
    assert!((back[0] - 60.5).hypot(back[1] - 50.5) < 1e-6, "{back:?}");
    for (frame, flag) in
        [("inside.toml", ["--crs", "EPSG:32634"]), ("view.toml", ["--pixel-size", "1"])]
    {
        fs::write(project.path("view.toml"), "kind = \"perspective\"\nphoto = \"b.png\"\n")
            .unwrap();
        let flags = ["--mesh", "mesh.ply", "--cameras", "sparse", "--photos", "photos"];
        let output =
            project.groundel("ortho", &[&flags, &["--out", "x.tif", "--frame", frame], &flag]);
        assert_eq!(output.status.code(), Some(2));
    }
}
