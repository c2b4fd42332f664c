//! Sections made in one run: byte for byte the mosaics of separate runs, from outside.

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use super::command::read;
use super::frames::tower_from_outside;
use super::job;
use glam::DVec3;
use groundel::synthetic::{TestScene, scenes};

const LAYERS: [&str; 6] = ["elevation", "face", "count", "used", "coverage", "best"];

/// A scene's files, and the frame to draw it on.
struct Project {
    folder: tempfile::TempDir,
}

impl Project {
    fn new(test: &TestScene, frame: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        job::write_files(test, folder.path());
        fs::write(folder.path().join("frame.toml"), frame).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn groundel(&self, args: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
        command.current_dir(self.folder.path()).args(args).output().unwrap()
    }

    /// Runs a command with what is to be drawn; what it said.
    fn run(&self, command: &[&str], flags: &[&str]) -> String {
        let layers = LAYERS.join(",");
        let inputs = ["--mesh", "mesh.ply", "--cameras", "sparse", "--photos", "photos"];
        let frame = ["--frame", "frame.toml", "--layers", &layers];
        let output = self.groundel(&[command, &inputs, &frame, flags].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{flags:?}: {said}");
        said
    }

    /// Makes `name`.tif, or its sections, and the report `name`.json.
    fn ortho(&self, name: &str, flags: &[&str]) -> String {
        let (out, report) = (format!("{name}.tif"), format!("{name}.json"));
        let files = ["--out", &out, "--report", &report, "--work", name];
        self.run(&["ortho"], &[&files, flags].concat())
    }

    fn report(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&fs::read_to_string(self.path(name)).unwrap()).unwrap()
    }
}

/// All files of the mosaic `stem`.tif in a folder.
fn files(folder: &Path, stem: &str) -> Vec<PathBuf> {
    let layers = LAYERS.iter().map(|layer| format!("{layer}.tif"));
    let endings = layers.chain(["tif".into(), "frame.toml".into()]);
    endings.map(|ending| folder.join(format!("{stem}.{ending}"))).collect()
}

fn assert_same(project: &Project, one: &str, two: &str) {
    let both = files(project.folder.path(), one).into_iter().zip(files(project.folder.path(), two));
    for (a, b) in both {
        let (a, b) = (a.display(), b.display());
        let read = |path: String| fs::read(path).unwrap();
        assert!(read(a.to_string()) == read(b.to_string()), "{a} differs from {b}");
    }
}

/// The flags of a run over one section of those that the run `name` made.
fn alone(project: &Project, stem: &str) -> Vec<String> {
    let frame: toml::Table =
        fs::read_to_string(project.path(&format!("{stem}.frame.toml"))).unwrap().parse().unwrap();
    let numbers = |key: &str| {
        let list = frame[key].as_array().unwrap();
        let words = list.iter().map(|v| format!("{:?}", v.as_float().unwrap()));
        words.collect::<Vec<_>>().join(",")
    };
    let pixel_size = format!("{:?}", frame["pixel_size"].as_float().unwrap());
    [["--elevation", &numbers("elevation")], ["--extent", &numbers("extent")]]
        .concat()
        .into_iter()
        .chain(["--pixel-size", &pixel_size])
        .map(String::from)
        .collect()
}

/// The pixels that show a surface, as the report of a section tells.
fn with_surface(section: &serde_json::Value) -> u64 {
    section["coverage"]["with_surface"].as_u64().unwrap()
}

/// Makes `sections` in one run and each alone, and compares every byte of every file, and what is reported. The last is
/// to show what the one before it shows, the first nothing.
fn compare_with_separate_runs(project: &Project, sections: &str, names: &[&str]) {
    let said = project.ortho("all", &["--sections", sections, "--tile-size", "64"]);
    let report = project.report("all.json");
    let told = report["sections"].as_array().unwrap();
    assert_eq!(told.len(), names.len());
    assert_eq!(with_surface(&told[0]), 0);
    assert!(said.contains(&format!("all_{}m.tif: no surface, all undefined", names[0])), "{said}");
    for (name, section) in names.iter().zip(told).skip(1) {
        let (one, two) = (format!("all_{name}m"), format!("one {name}"));
        assert_eq!(section["file"], format!("{one}.tif"));
        let flags = alone(project, &one);
        let flags: Vec<_> = flags.iter().map(String::as_str).collect();
        project.ortho(&two, &[&flags[..], &["--tile-size", "64"]].concat());
        assert_same(project, &one, &two);
        let own = project.report(&format!("{two}.json"));
        assert_eq!(section["coverage"], own["coverage"], "{name}");
        assert_eq!(section["photos"], own["photos"], "{name}");
    }
    let shown: Vec<_> = told.iter().map(with_surface).collect();
    assert!(shown.is_sorted() && shown[1] > 0, "{shown:?}");
    // The two highest show the same, the lowest nothing at all.
    let read_layer =
        |name: &str, layer: &str| read(&project.path(&format!("all_{name}m.{layer}tif")));
    let [.., a, b] = names else { panic!("at least two") };
    for layer in ["", "elevation.", "face.", "count.", "used.", "best."] {
        assert!(read_layer(a, layer) == read_layer(b, layer), "{a} and {b}: {layer}");
    }
    assert!(read_layer(names[0], "face.").iter().all(|&id| id == u32::MAX));
    assert!(read_layer(names[0], "").iter().all(|&sample| sample == 0));
    assert_eq!(report["coverage"], told[names.len() - 1]["coverage"]);
    // Neither an ordinary mosaic nor anything of the job is left.
    assert!(!project.path("all.tif").exists());
}

const COLUMNS: &str = "-1.05,0.55,0.2";

fn columns() -> Project {
    let test = scenes::columns();
    let folder = tempfile::tempdir().unwrap();
    job::write_files(&test, folder.path());
    let frame = fs::read_to_string(folder.path().join("frame.toml")).unwrap();
    // The default extent and pixel size are to be those of the whole.
    let is_stated = |line: &&str| ["extent", "elevation"].iter().any(|key| line.starts_with(key));
    let frame: Vec<_> = frame.lines().filter(|line| !is_stated(line)).collect();
    Project::new(&test, &frame.join("\n"))
}

#[test]
fn sections_of_a_plane_are_byte_for_byte_those_of_separate_runs() {
    let names = ["-1.05", "-0.85", "-0.65", "-0.45", "-0.25", "-0.05", "0.15", "0.35", "0.55"];
    compare_with_separate_runs(&columns(), COLUMNS, &names);
}

#[test]
fn sections_of_a_cylinder_are_byte_for_byte_those_of_separate_runs() {
    let test = tower_from_outside();
    let place = test.placement;
    let triple = |v: DVec3| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z);
    let axis = place.direction(DVec3::Y).normalize();
    let zero = place.direction(DVec3::Z).normalize();
    let half = PI * 1.03;
    let frame = format!(
        "kind = \"cylinder\"\norigin = {}\naxis = {}\nzero = {}\nradius = 1.03\nfacing = \"outside\"\n\
         pixel_size = 0.02\nextent = [{:?}, -0.66, {half:?}, 0.66]\n",
        triple(place.ground_from_scene(DVec3::ZERO)),
        triple(axis),
        triple(zero),
        -half,
    );
    let project = Project::new(&test, &frame);
    compare_with_separate_runs(
        &project,
        "-0.06,0.09,0.03",
        &["-0.06", "-0.03", "0", "0.03", "0.06", "0.09"],
    );
}

#[test]
fn threads_memory_groups_and_batches_do_not_change_a_byte_of_a_section() {
    let project = columns();
    let all = project.ortho("all", &["--sections", "-0.2,0.4,0.2", "--memory", "4GiB"]);
    assert!(!all.contains("part 1 of"), "{all}");
    // Two threads with all layers in 256 MiB hold one section at a time.
    let flags = ["--sections", "-0.2,0.4,0.2", "--threads", "2", "--memory", "256MiB"];
    let few = project.ortho("few", &flags);
    assert!(few.contains("1 sections, part 4 of 4"), "{few}");
    let job = ["plan", "--job", "job", "--batches", "3"];
    project.run(&job, &["--sections", "-0.2,0.4,0.2", "--memory", "4GiB", "--tile-size", "512"]);
    for command in
        [&["render", "job", "--memory", "4GiB"][..], &["assemble", "job", "--out", "job.tif"]]
    {
        let output = project.groundel(command);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    for name in ["-0.2", "0", "0.2", "0.4"] {
        assert_same(&project, &format!("all_{name}m"), &format!("few_{name}m"));
        assert_same(&project, &format!("all_{name}m"), &format!("job_{name}m"));
    }
    let [all, few] = ["all.json", "few.json"].map(|name| project.report(name));
    for (a, b) in
        all["sections"].as_array().unwrap().iter().zip(few["sections"].as_array().unwrap())
    {
        assert_eq!((&a["elevation"], &a["coverage"]), (&b["elevation"], &b["coverage"]));
        assert_eq!(a["photos"], b["photos"]);
    }
    assert_eq!(all["outputs"].as_array().unwrap().len(), 4 * 8);
    assert_eq!(few["outputs"].as_array().unwrap().len(), 4 * 8);
}
