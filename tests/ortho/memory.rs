//! The memory cap as a fact: the peak that the system counted, and a control group of the cap's size.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use groundel::geom::Size;
use groundel::synthetic::FacadeSet;

/// A job whose mesh, photos and mosaic are each larger than their share of the least cap: 3 million faces (48 MB as a
/// store), seven photos of 2 megapixels (40 MB as pixels), all layers.
fn large(folder: &Path) {
    let set = FacadeSet {
        faces: 3_000_000,
        photo: Size::new(1600, 1200),
        finest_m: 0.025,
        ..FacadeSet::demo()
    };
    set.write(folder).unwrap();
}

fn arguments(folder: &Path, memory: &str) -> Vec<String> {
    let project = folder.join("project.toml").display().to_string();
    let work = folder.join(format!("work {memory}")).display().to_string();
    let out = folder.join(format!("{memory}.tif")).display().to_string();
    let report = folder.join(format!("{memory}.json")).display().to_string();
    let flags = ["ortho", &project, "--memory", memory, "--work", &work, "--out", &out];
    let rest = ["--report", &report, "--threads", "2", "--quiet"];
    flags.iter().chain(&rest).map(ToString::to_string).collect()
}

fn mebibytes(memory: &str) -> u64 {
    memory.strip_suffix("MiB").unwrap().parse().unwrap()
}

/// The value of the first `"key": number` in a report.
fn number(report: &str, key: &str) -> u64 {
    let rest = report.split(&format!("\"{key}\": ")).nth(1).unwrap();
    rest.split(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()
}

/// Whether this process may make control groups, so that a test must.
#[cfg(target_os = "linux")]
fn has_control_groups() -> bool {
    let root =
        fs::metadata("/proc/self").is_ok_and(|m| std::os::unix::fs::MetadataExt::uid(&m) == 0);
    let mounted = Path::new("/sys/fs/cgroup/memory").exists()
        || fs::read_to_string("/sys/fs/cgroup/cgroup.controllers")
            .is_ok_and(|list| list.split_whitespace().any(|c| c == "memory"));
    root && mounted
}

#[cfg(target_os = "linux")]
fn run(folder: &Path, memory: &str) -> Output {
    let binary = env!("CARGO_BIN_EXE_groundel");
    let mut command = if has_control_groups() {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/in_cgroup.sh");
        let mut command = Command::new(script);
        command.arg((mebibytes(memory) << 20).to_string()).arg(binary);
        command
    } else {
        Command::new(binary)
    };
    command.args(arguments(folder, memory)).output().unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn the_peak_stays_within_the_cap_and_within_a_control_group_of_its_size() {
    let folder = tempfile::tempdir().unwrap();
    large(folder.path());
    let mut pictures = Vec::new();
    for memory in ["256MiB", "512MiB", "1024MiB"] {
        let run = run(folder.path(), memory);
        assert!(run.status.success(), "{memory}: {}", String::from_utf8_lossy(&run.stderr));
        let report = fs::read_to_string(folder.path().join(format!("{memory}.json"))).unwrap();
        let peak = report.rsplit("\"peak_memory_bytes\": ").next().unwrap();
        let peak = number(&format!("\"peak\": {peak}"), "peak");
        assert!(peak > 64 << 20 && peak <= mebibytes(memory) << 20, "{memory}: {peak}");
        for part in report.split("\"consumer\"").skip(1) {
            let (share, held) = (number(part, "share_bytes"), number(part, "peak_bytes"));
            assert!(held > 0 && held <= share, "{memory}: {part}");
        }
        pictures.push(fs::read(folder.path().join(format!("{memory}.tif"))).unwrap());
    }
    assert!(pictures.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn what_cannot_fit_is_refused_before_the_start_with_the_figure_needed() {
    let folder = tempfile::tempdir().unwrap();
    let small =
        FacadeSet { faces: 2000, photo: Size::new(64, 48), finest_m: 0.5, ..FacadeSet::demo() };
    small.write(folder.path()).unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .args(arguments(folder.path(), "256MiB"))
        .args(["--tile-size", "4096"])
        .output()
        .unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(3), "{said}");
    assert!(said.contains("--tile-size 4096") && said.contains(" MiB, but only 256 MiB"), "{said}");
    assert!(!folder.path().join("work 256MiB").exists(), "nothing was begun");
}
