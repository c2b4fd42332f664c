//! The command line of the built binary: its contract of flags, exit codes and messages.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Flags of `groundel ortho` that users rely on.
const ORTHO_FLAGS: &[&str] = &[
    "--mesh",
    "--cameras",
    "--photos",
    "--frame",
    "--view",
    "--up",
    "--pixel-size",
    "--extent",
    "--force",
    "--elevation",
    "--include",
    "--exclude",
    "--masks",
    "--colour",
    "--levelling",
    "--tone-from",
    "--edges",
    "--interpolation",
    "--outliers",
    "--beta",
    "--weights",
    "--blend",
    "--occlusion-tolerance",
    "--undefined",
    "--layers",
    "--out",
    "--compress",
    "--tile-size",
    "--crs",
    "--memory",
    "--threads",
    "--work",
    "--quiet",
    "--report",
];

fn groundel(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
    command.args(arguments).output().expect("the binary was built for this test")
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

/// Runs `ortho` with these flags, expects a refusal as bad usage, and returns its message.
fn refused(flags: &[&str]) -> String {
    let output = groundel(&[&["ortho"], flags].concat());
    assert_eq!(output.status.code(), Some(2), "{flags:?}");
    assert!(output.stdout.is_empty(), "{flags:?}: an error is no answer");
    let message = stderr(&output);
    assert!(message.starts_with("groundel: error: "), "{flags:?}: {message}");
    assert_eq!(message.matches("error:").count(), 1, "{flags:?}: reported once: {message}");
    message
}

#[test]
fn help_and_version_are_answers() {
    let version = groundel(&["--version"]);
    assert_eq!(version.status.code(), Some(0));
    assert_eq!(stdout(&version), format!("groundel {}\n", env!("CARGO_PKG_VERSION")));
    let help = groundel(&["--help"]);
    assert_eq!(help.status.code(), Some(0));
    for command in ["demo", "ortho", "plan", "render", "assemble", "info"] {
        assert!(stdout(&help).contains(&format!("\n  {command} ")), "{command}");
    }
    assert!(help.stderr.is_empty());
}

#[test]
fn the_help_of_ortho_shows_every_flag_of_the_contract() {
    let help = stdout(&groundel(&["ortho", "--help"]));
    for flag in ORTHO_FLAGS {
        assert!(help.contains(&format!("      {flag}")), "{flag} is not in\n{help}");
    }
    for words in [
        "nearest, bilinear, bicubic",
        "even, paper",
        "none, gain, full",
        "none, guard",
        "none, sigma, robust",
        "area, equal, sharp",
        "mean, best",
        "top, fit",
        "elevation, face, count, used, coverage, best",
        "deflate, zstd, lzw or none",
    ] {
        assert!(help.contains(words), "{words} is not in\n{help}");
    }
}

#[test]
fn a_wrong_value_is_refused_with_the_flag_and_what_is_expected() {
    for (flags, flag, expected) in [
        (&["--extent", "0,0,1"][..], "--extent", "4 numbers"),
        (&["--extent", "0,0,-1,1"], "--extent", "U0 less than U1"),
        (&["--elevation", "2,1"], "--elevation", "MIN less than MAX"),
        (&["--pixel-size", "-0.1"], "--pixel-size", "greater than 0"),
        (&["--undefined", "1,2"], "--undefined", "R,G,B"),
        (&["--layers", "face,depth"], "--layers", "elevation, face, count, used, coverage, best"),
        (&["--memory", "100MiB"], "--memory", "at least 256 MiB"),
        (&["--memory", "lots"], "--memory", "512MiB"),
        (&["--threads", "0"], "--threads", "1 to"),
        (&["--tile-size", "100"], "--tile-size", "multiple of 16"),
        (&["--crs", "32634"], "--crs", "EPSG:"),
        (&["--compress", "jpeg"], "--compress", "deflate, zstd, lzw, none"),
        (&["--interpolation", "lanczos"], "--interpolation", "nearest, bilinear, bicubic"),
        (&["--outliers", "median"], "--outliers", "none, sigma, robust"),
        (&["--colour", "even-ish"], "--colour", "even, paper"),
        (&["--levelling", "yes"], "--levelling", "none, gain, full"),
        (&["--edges", "soft"], "--edges", "none, guard"),
        (&["--beta", "-1"], "--beta", "at least 0"),
        (&["--occlusion-tolerance", "-1"], "--occlusion-tolerance", "at least 0"),
        (&["--view", "side"], "--view", "top, fit"),
        (&["--mesh", "--cameras"], "--mesh", "found the flag --cameras"),
        (&["--out"], "--out", "value is required"),
        (&["--view", "top", "--frame", "f.toml"], "--view", "--frame"),
        (&["--bogus"], "--bogus", "unexpected"),
    ] {
        let message = refused(flags);
        assert!(message.contains(flag) && message.contains(expected), "{flags:?}: {message}");
    }
}

#[test]
fn what_is_missing_is_named_as_flag_and_as_key() {
    let all =
        ["--mesh", "m.ply", "--cameras", "c", "--photos", "p", "--out", "o.tif", "--view", "top"];
    for pair in all.chunks(2) {
        let rest: Vec<_> =
            all.chunks(2).filter(|other| *other != pair).flatten().copied().collect();
        let message = refused(&rest);
        let key = pair[0].trim_start_matches('-');
        assert!(message.contains(pair[0]) && message.contains(&format!("`{key}`")), "{message}");
    }
}

#[test]
fn input_that_does_not_exist_is_bad_input_and_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("o.tif");
    let out = out.to_str().expect("UTF-8");
    let frame = refused(&[
        "--mesh",
        "m.ply",
        "--cameras",
        "c",
        "--photos",
        "p",
        "--out",
        out,
        "--frame",
        "no such.toml",
    ]);
    assert!(frame.contains("no such.toml"), "{frame}");
    let project = refused(&["no such project.toml"]);
    assert!(project.contains("no such project.toml"), "{project}");
    let info = groundel(&["info", "no such file"]);
    assert_eq!(info.status.code(), Some(2));
    assert!(stderr(&info).starts_with("groundel: error: no such file: "), "{}", stderr(&info));
    assert_eq!(fs::read_dir(folder.path()).expect("it exists").count(), 0);
}

#[test]
fn a_project_file_speaks_for_flags_and_its_faults_are_placed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let project = folder.path().join("façade 1.toml");
    let refused_with = |text: &str| {
        fs::write(&project, text).expect("a writable folder");
        refused(&[project.to_str().expect("UTF-8")])
    };
    let key = refused_with("mesh = [\"m.ply\"]\npixelsize = 1\n");
    assert!(key.contains("façade 1.toml: line 2:") && key.contains("pixelsize"), "{key}");
    let value = refused_with("interpolation = \"lanczos\"\n");
    assert!(value.contains("key `interpolation`") && value.contains("bicubic"), "{value}");
    let incomplete = refused_with("mesh = [\"m.ply\"]\nout = \"o.tif\"\n");
    assert!(incomplete.contains("--cameras is missing"), "{incomplete}");
    let cylinder = refused_with(
        "mesh = [\"m.ply\"]\nout = \"o.tif\"\ncameras = \"c\"\nphotos = \"p\"\n[frame]\nkind = \"cylinder\"\n\
         origin = [0, 0, 0]\naxis = [0, 0, 1]\nzero = [1, 0, 0]\nradius = -5.0\nfacing = \"outside\"\n",
    );
    assert!(cylinder.contains("key `frame.radius`"), "{cylinder}");
    assert_eq!(fs::read_dir(folder.path()).expect("it exists").count(), 1, "nothing was written");
}

#[test]
fn a_job_that_is_not_there_or_not_whole_is_refused_and_nothing_is_made() {
    for (arguments, said) in [
        (&["plan", "--job", "j", "--mesh", "m.ply", "--batches", "4"][..], "--cameras is missing"),
        (&["plan", "--mesh", "m.ply"], "--job"),
        (&["plan", "--job", "j", "--batches", "0"], "--batches"),
        (&["plan", "--job", "j", "--batches", "3", "--batch-mpx", "5"], "cannot be used with"),
        (&["render", "j", "--batch", "3"], "j: expected the folder of a job"),
        (&["render", "j", "--missing"], "j: expected the folder of a job"),
        (&["assemble", "j", "--out", "o.tif"], "j: expected the folder of a job"),
        (&["assemble", "j"], "--out"),
    ] {
        let output = groundel(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).contains(said), "{arguments:?}: {}", stderr(&output));
    }
    assert!(!Path::new("j").exists());
}

#[test]
fn no_command_is_bad_usage() {
    assert_eq!(groundel(&[]).status.code(), Some(2));
    assert_eq!(groundel(&["mosaic"]).status.code(), Some(2));
}
