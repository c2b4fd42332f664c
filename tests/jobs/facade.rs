//! A façade of some hundred tiles, and the commands on it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use groundel::geom::Size;
use groundel::synthetic::{FacadeSet, StreetSet};

/// The files of a mosaic.
pub(super) const FILES: [&str; 4] =
    ["mosaic.tif", "mosaic.elevation.tif", "mosaic.best.tif", "mosaic.frame.toml"];

/// A folder with a project, `project.toml`, whose mosaic is rendered in about a second.
pub(super) struct Facade {
    pub(super) folder: tempfile::TempDir,
}

impl Facade {
    pub(super) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let set = FacadeSet {
            faces: 20_000,
            photo: Size::new(640, 480),
            pixel_size: 0.01,
            finest_m: 0.06,
            layers: vec!["elevation", "best"],
            ..FacadeSet::demo()
        };
        let project = folder.path().join("project");
        fs::create_dir(&project).unwrap();
        set.write(&project).unwrap();
        Self { folder }
    }

    /// A street of three façades, of which a photo sees one and a little of the next.
    pub(super) fn street() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let set = FacadeSet {
            faces: 60_000,
            photo: Size::new(320, 240),
            pixel_size: 0.02,
            finest_m: 0.12,
            layers: vec!["elevation", "best"],
            ..FacadeSet::demo()
        };
        let street = StreetSet { houses: 3, photos: 30, set };
        let project = folder.path().join("project");
        fs::create_dir(&project).unwrap();
        street.write(&project).unwrap();
        Self { folder }
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn project(&self) -> PathBuf {
        self.path("project/project.toml")
    }

    /// The files of `groundel ortho`, made in the folder `name`, with some flags.
    pub(super) fn ortho(&self, name: &str, flags: &[&str]) -> Vec<Vec<u8>> {
        let out = self.path(name);
        fs::create_dir(&out).unwrap();
        let mut command = groundel();
        command.arg("ortho").arg(self.project()).args(["--tile-size", "64", "--quiet"]);
        done(command.args(flags).arg("--out").arg(out.join("mosaic.tif")));
        files(&out)
    }

    /// `groundel plan`, into the folder `job`.
    pub(super) fn plan(&self, job: &Path, flags: &[&str]) -> Command {
        let mut command = groundel();
        command.arg("plan").arg(self.project()).args(["--tile-size", "64"]);
        command.args(flags).arg("--job").arg(job);
        command
    }
}

pub(super) fn groundel() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
    command.stdin(Stdio::null());
    command
}

/// `groundel render JOB`.
pub(super) fn render(job: &Path, flags: &[&str]) -> Command {
    let mut command = groundel();
    command.arg("render").arg(job).args(["--quiet"]).args(flags);
    command
}

/// The numbers of the batches that are not there.
pub(super) fn missing(job: &Path) -> Vec<u32> {
    let mut command = groundel();
    let (answer, _) = done(command.arg("render").arg(job).arg("--missing"));
    answer.lines().map(|line| line.parse().unwrap()).collect()
}

/// `groundel assemble JOB`, into the folder `out`, made anew.
pub(super) fn assemble(job: &Path, out: &Path, flags: &[&str]) -> Command {
    fs::create_dir_all(out).unwrap();
    let mut command = groundel();
    command.arg("assemble").arg(job).args(flags).arg("--out").arg(out.join("mosaic.tif"));
    command
}

/// What a command says on standard output and standard error; it must end well.
pub(super) fn done(command: &mut Command) -> (String, String) {
    let (code, out, said) = ended(&command.output().unwrap());
    assert_eq!(code, Some(0), "{command:?}: {said}");
    (out, said)
}

/// What a command that must end with `code` says on standard error.
pub(super) fn refused(command: &mut Command, code: i32) -> String {
    let (found, _, said) = ended(&command.output().unwrap());
    assert_eq!(found, Some(code), "{command:?}: {said}");
    said
}

pub(super) fn ended(output: &Output) -> (Option<i32>, String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

pub(super) fn files(out: &Path) -> Vec<Vec<u8>> {
    FILES.iter().map(|name| fs::read(out.join(name)).unwrap()).collect()
}

/// The names in a folder, sorted.
pub(super) fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
