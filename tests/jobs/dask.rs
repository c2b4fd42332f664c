//! The real Dask: a scheduler and three workers as processes of their own on the loopback interface, driven by
//! `scripts/cluster/dask_render.py`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::facade::{Facade, done, ended, files, missing, names};

/// A process that ends with the test, however that ends.
struct Guarded(Child);

impl Drop for Guarded {
    fn drop(&mut self) {
        self.0.kill().ok();
        self.0.wait().ok();
    }
}

/// Scheduler and workers, each a Python process without a nanny, so that its number is its own.
struct Dask {
    address: String,
    workers: Vec<Guarded>,
    _scheduler: Guarded,
}

fn python() -> PathBuf {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/venv.sh");
    let output = Command::new(&script).stderr(Stdio::inherit()).output().unwrap();
    assert!(output.status.success(), "{}", script.display());
    PathBuf::from(String::from_utf8(output.stdout).unwrap().trim())
}

fn wait_for(what: &str, is_there: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_there() {
        assert!(begun.elapsed() < Duration::from_mins(3), "{what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

impl Dask {
    fn start(python: &Path, folder: &Path) -> Self {
        let file = folder.join("scheduler.json");
        let log = |name: &str| fs::File::create(folder.join(format!("{name}.log"))).unwrap();
        let start = |name: &str, module: &str, arguments: &[&str]| {
            let mut command = Command::new(python);
            command.args(["-m", module, "--scheduler-file"]).arg(&file).args(arguments);
            command.current_dir(folder).stdin(Stdio::null());
            Guarded(command.stdout(log(name)).stderr(log(name)).spawn().unwrap())
        };
        let host = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show"];
        let scheduler = start("scheduler", "distributed.cli.dask_scheduler", &host);
        let address = || {
            let text = fs::read_to_string(&file).ok()?;
            let found: serde_json::Value = serde_json::from_str(&text).ok()?;
            Some(found["address"].as_str()?.to_owned())
        };
        wait_for("the scheduler's address", || address().is_some());
        let worker = |k: usize| {
            let name = format!("worker {k}");
            let limits = ["--no-nanny", "--nthreads", "1", "--memory-limit", "600MiB"];
            let place = ["--host", "127.0.0.1", "--no-dashboard", "--name", &name];
            start(&name, "distributed.cli.dask_worker", &[&limits[..], &place].concat())
        };
        let workers = (0..3).map(worker).collect();
        Self { address: address().unwrap(), workers, _scheduler: scheduler }
    }
}

/// The processes whose command line names `path`.
fn processes(path: &Path) -> Vec<String> {
    let command = |entry: fs::DirEntry| fs::read_to_string(entry.path().join("cmdline")).ok();
    let all = fs::read_dir("/proc").unwrap().filter_map(|e| command(e.ok()?));
    all.filter(|line| line.contains(path.to_str().unwrap()) && line.contains("render\0")).collect()
}

fn driver(python: &Path, dask: &Dask, job: &Path) -> Command {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/cluster/dask_render.py");
    let mut command = Command::new(python);
    command.arg(script).arg(job).args(["--scheduler", &dask.address]);
    command.args(["--groundel", env!("CARGO_BIN_EXE_groundel")]).stdin(Stdio::null());
    command
}

#[cfg(target_os = "linux")]
#[test]
fn a_job_whose_worker_is_killed_ends_in_the_bytes_of_one_run_and_leaves_nothing() {
    let facade = Facade::new();
    let whole = facade.ortho("whole", &[]);
    let (job, out) = (facade.path("job"), facade.path("out"));
    done(&mut facade.plan(&job, &["--batches", "36"]));
    let python = python();
    let mut dask = Dask::start(&python, facade.folder.path());
    fs::create_dir(&out).unwrap();
    let mut command = driver(&python, &dask, &job);
    command.arg("--remove").arg("--out").arg(out.join("mosaic.tif"));
    let running = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let finished = || {
        let names = fs::read_dir(job.join("parts")).into_iter().flatten().flatten();
        names.filter(|e| e.file_name().to_string_lossy().ends_with(".part")).count()
    };
    wait_for("some finished batches", || finished() >= 6);
    // In the middle of the job, while it renders.
    let victim = &mut dask.workers[1].0;
    victim.kill().unwrap();
    victim.wait().unwrap();
    let at = finished();
    assert!(at < 30, "{at} of 36 batches were finished when the worker was killed");
    let (code, told, said) = ended(&running.wait_with_output().unwrap());
    assert_eq!(code, Some(0), "{told}{said}");
    assert!(told.contains("36 of 36 batches"), "{told}{said}");
    assert!(files(&out) == whole);
    assert_eq!(names(&job), ["manifest.json", "stores"]);
    wait_for("the killed worker's command", || processes(&job).is_empty());
}

#[test]
fn a_batch_that_cannot_be_rendered_is_named_and_nothing_hangs() {
    let facade = Facade::new();
    let job = facade.path("job");
    done(&mut facade.plan(&job, &["--batches", "30"]));
    let python = python();
    let dask = Dask::start(&python, facade.folder.path());
    // Bad input is not tried again.
    let photo = facade.path("project/photos/IMG_0004.jpg");
    let hidden = photo.with_extension("hidden");
    fs::rename(&photo, &hidden).unwrap();
    let (code, told, said) = ended(&driver(&python, &dask, &job).output().unwrap());
    assert_eq!(code, Some(2), "{told}{said}");
    let last = said.lines().find(|line| line.starts_with("batch ")).unwrap();
    assert!(last.contains("cannot be rendered (bad input)"), "{said}");
    assert!(last.contains("IMG_0004.jpg") && !told.contains("; try 2"), "{told}{last}");
    fs::rename(&hidden, &photo).unwrap();
    // What may be tried again is, so many times: a command that fails on one batch.
    let failing = facade.path("failing.sh");
    let script = "#!/bin/sh\ncase \"$*\" in *'--batch 7 '*) echo 'no room' >&2; exit 4;; esac\nexec \"$GROUNDEL\" \"$@\"\n";
    fs::write(&failing, script.replace("$GROUNDEL", env!("CARGO_BIN_EXE_groundel"))).unwrap();
    done(Command::new("chmod").arg("+x").arg(&failing));
    let mut command = driver(&python, &dask, &job);
    command.arg("--groundel").arg(&failing).args(["--tries", "2"]);
    let (code, told, said) = ended(&command.output().unwrap());
    assert_eq!(code, Some(4), "{told}{said}");
    assert!(told.contains("batch 7: no room; try 2 of 2"), "{told}{said}");
    assert!(said.contains("batch 7 cannot be rendered (tried 2 times): no room"), "{told}{said}");
    let (code, told, said) = ended(&driver(&python, &dask, &job).output().unwrap());
    assert_eq!(code, Some(0), "{told}{said}");
    assert_eq!(missing(&job), Vec::<u32>::new());
}
