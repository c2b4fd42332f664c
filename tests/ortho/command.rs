//! `groundel ortho` from outside: the built binary on a synthetic project.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use super::job;
use groundel::synthetic::scenes;

const LAYERS: [&str; 6] = ["elevation", "face", "count", "used", "coverage", "best"];

/// Runs `groundel ortho` on the project in `folder`, into `name`.tif in a folder of its own.
pub(super) fn ortho(folder: &Path, name: &str, flags: &[&str]) -> (Output, PathBuf) {
    let out = folder.join(name).join("mosaic.tif");
    fs::create_dir_all(folder.join(name)).unwrap();
    let path = |p: &str| folder.join(p).into_os_string();
    let output = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .arg("ortho")
        .args(["--mesh".into(), path("mesh.ply"), "--cameras".into(), path("sparse")])
        .args(["--photos".into(), path("photos"), "--frame".into(), path("frame.toml")])
        .args(["--out".into(), out.clone().into_os_string()])
        .args(["--layers", &LAYERS.join(",")])
        .args(flags)
        .output()
        .unwrap();
    (output, out)
}

fn files(mosaic: &Path) -> Vec<PathBuf> {
    let layers = LAYERS.iter().map(|l| mosaic.with_extension(format!("{l}.tif")));
    layers.chain([mosaic.to_path_buf(), mosaic.with_extension("frame.toml")]).collect()
}

fn project() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    job::write_files(&scenes::columns(), folder.path());
    folder
}

#[test]
fn threads_and_memory_do_not_change_a_byte() {
    let project = project();
    let folder = project.path();
    let (first, reference) = ortho(folder, "reference", &["--threads", "1"]);
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    for (name, flags) in [
        ("two", ["--threads", "2", "--memory", "2GiB"]),
        ("four", ["--threads", "4", "--memory", "512MiB"]),
        ("small", ["--threads", "2", "--memory", "256MiB"]),
    ] {
        let (run, mosaic) = ortho(folder, name, &flags);
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        for (a, b) in files(&reference).iter().zip(files(&mosaic)) {
            assert!(fs::read(a).unwrap() == fs::read(&b).unwrap(), "{name}: {}", b.display());
        }
    }
}

#[test]
fn nothing_is_left_beside_the_files_but_the_stores() {
    let project = project();
    let (run, mosaic) = ortho(project.path(), "out", &[]);
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let folder = mosaic.parent().unwrap();
    let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    names.sort();
    let mut expected = files(&mosaic);
    expected.push(folder.join(".groundel"));
    expected.sort();
    assert_eq!(names, expected);
    let jobs = fs::read_dir(folder.join(".groundel")).unwrap();
    let left =
        jobs.filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().starts_with("job-"));
    assert_eq!(left.count(), 0);
}

#[test]
fn a_missing_and_a_broken_photo_are_named_and_left_out() {
    let project = project();
    let folder = project.path();
    let shots = scenes::columns().shots;
    let photo = |k: usize| folder.join("photos").join(&shots[k].name);
    fs::remove_file(photo(0)).unwrap();
    let bytes = fs::read(photo(1)).unwrap();
    fs::write(photo(1), &bytes[..bytes.len() / 2]).unwrap();
    let (run, mosaic) = ortho(folder, "out", &[]);
    assert_eq!(run.status.code(), Some(1));
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    for shot in &shots[..2] {
        assert!(said.contains(&format!("{} is left out", shot.name)), "{said}");
    }
    assert!(mosaic.exists());
}

#[test]
fn bad_input_is_named_and_leaves_no_mosaic() {
    let project = project();
    let folder = project.path();
    let mesh = folder.join("mesh.ply");
    let whole = fs::read(&mesh).unwrap();
    fs::write(&mesh, &whole[..whole.len() - 5]).unwrap();
    let (run, mosaic) = ortho(folder, "cut", &[]);
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert!(said.contains("mesh.ply"), "{said}");
    assert!(!mosaic.exists());
    fs::write(&mesh, whole).unwrap();
    for (flags, word) in [
        (["--extent", "9000,9000,9001,9001"], "meet"),
        (["--include", "nothing*"], "nothing*"),
        (["--pixel-size", "0.0001"], "--force"),
    ] {
        let (run, mosaic) = ortho(folder, "bad", &flags);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(2), "{flags:?}: {said}");
        assert!(said.contains(word), "{flags:?}: {said}");
        assert!(!mosaic.exists());
    }
}

#[test]
fn tile_sizes_do_not_change_a_pixel_as_the_tiff_crate_reads_them() {
    let project = project();
    let (small, a) = ortho(project.path(), "small", &["--tile-size", "128"]);
    let (large, b) = ortho(project.path(), "large", &["--tile-size", "512"]);
    assert!(small.status.success() && large.status.success());
    // The tiff crate reads no palettes.
    for (a, b) in files(&a).iter().zip(files(&b)).filter(|(a, _)| {
        let name = a.to_string_lossy();
        name.ends_with(".tif") && !name.ends_with("coverage.tif")
    }) {
        assert!(read(a) == read(&b), "{}", b.display());
    }
}

/// The bits of every sample.
pub(super) fn read(path: &Path) -> Vec<u32> {
    use tiff::decoder::DecodingResult::{F32, U8, U16, U32};
    let file = std::io::BufReader::new(fs::File::open(path).unwrap());
    match tiff::decoder::Decoder::new(file).unwrap().read_image().unwrap() {
        U8(v) => v.into_iter().map(u32::from).collect(),
        U16(v) => v.into_iter().map(u32::from).collect(),
        U32(v) => v,
        F32(v) => v.into_iter().map(f32::to_bits).collect(),
        other => unreachable!("{other:?}"),
    }
}
