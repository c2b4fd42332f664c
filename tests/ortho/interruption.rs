//! Killed, terminated, out of disk: what is left, and that the next run ends in the same bytes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use groundel::geom::Size;
use groundel::synthetic::{FacadeSet, Random};

/// A façade of some hundred tiles, rendered in about a second.
fn facade(folder: &Path) {
    let set = FacadeSet {
        faces: 20_000,
        photo: Size::new(640, 480),
        pixel_size: 0.01,
        finest_m: 0.06,
        layers: vec!["elevation", "count"],
        ..FacadeSet::demo()
    };
    set.write(folder).unwrap();
}

fn ortho(project: &Path, out: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
    command.arg("ortho").arg(project.join("project.toml"));
    command.args(["--tile-size", "64", "--threads", "2", "--out"]).arg(out.join("mosaic.tif"));
    command.arg("--report").arg(out.join("report.json"));
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn begin(project: &Path, out: &Path) -> Child {
    ortho(project, out).spawn().unwrap()
}

/// The exit code and what was said.
fn end(child: Child) -> (Option<i32>, String) {
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

const FILES: [&str; 3] = ["mosaic.tif", "mosaic.elevation.tif", "mosaic.count.tif"];

fn files(out: &Path) -> Vec<Vec<u8>> {
    FILES.iter().map(|name| fs::read(out.join(name)).unwrap()).collect()
}

/// What the report says of the pixels: the same however often a run was interrupted.
fn found(out: &Path) -> String {
    let report = fs::read_to_string(out.join("report.json")).unwrap();
    let of = |key: &str| report.find(&format!("\"{key}\"")).unwrap();
    report[of("coverage")..of("outputs")].to_owned()
}

/// An undisturbed run: its files, what it found, and how long it took.
fn reference(project: &Path, out: &Path) -> (Vec<Vec<u8>>, String, Duration) {
    fs::create_dir(out).unwrap();
    let begun = Instant::now();
    let (code, said) = end(begin(project, out));
    assert_eq!(code, Some(0), "{said}");
    (files(out), found(out), begun.elapsed())
}

fn finals(out: &Path) -> Vec<PathBuf> {
    FILES.iter().map(|name| out.join(name)).filter(|path| path.exists()).collect()
}

#[test]
fn killed_at_twenty_moments_and_resumed_it_ends_in_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    facade(folder.path());
    let (bytes, report, took) = reference(folder.path(), &folder.path().join("whole"));
    let mut random = Random::new(20);
    let (mut killed, mut resumed) = (0, 0);
    let out = folder.path().join("killed");
    fs::create_dir(&out).unwrap();
    while killed < 20 {
        let mut child = begin(folder.path(), &out);
        std::thread::sleep(took.mul_f64(random.between(0.02, 0.7)));
        child.kill().unwrap();
        let (code, said) = end(child);
        resumed += usize::from(said.contains("going on after "));
        if code.is_some() {
            // It was faster than the signal.
            assert_eq!(code, Some(0), "{said}");
            assert!(files(&out) == bytes && found(&out) == report);
            fs::remove_dir_all(&out).unwrap();
            fs::create_dir(&out).unwrap();
            continue;
        }
        killed += 1;
        // Under a final name stands the whole file or none.
        for path in finals(&out) {
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            let k = FILES.iter().position(|f| **f == name).unwrap();
            assert!(fs::read(&path).unwrap() == bytes[k], "{name}");
        }
    }
    let (code, said) = end(begin(folder.path(), &out));
    assert_eq!(code, Some(0), "{said}");
    assert!(files(&out) == bytes && found(&out) == report);
    assert!(resumed > 0, "some run went on from finished tiles");
    assert_eq!(leftovers(&out), Vec::<String>::new());
}

/// Files beside the outputs, the report, the frame and the stores.
fn leftovers(out: &Path) -> Vec<String> {
    let names = fs::read_dir(out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let known = [&FILES[..], &["report.json", "mosaic.frame.toml", ".groundel"]].concat();
    let mut left: Vec<_> = names.filter(|name| !known.contains(&name.as_str())).collect();
    let work = fs::read_dir(out.join(".groundel")).unwrap();
    let temporary = |name: &String| name.starts_with("job-") || name.contains(".tmp");
    left.extend(work.map(|e| e.unwrap().file_name().into_string().unwrap()).filter(temporary));
    left
}

/// A run that hears of signals, also where what starts the tests is told to ignore them, as `nohup` and `&` do.
#[cfg(unix)]
fn begin_listening(project: &Path, out: &Path) -> Child {
    let plain = ortho(project, out);
    if !cfg!(target_os = "linux") {
        return begin(project, out);
    }
    let mut command = Command::new("env");
    command.arg("--default-signal=INT,TERM").arg(plain.get_program()).args(plain.get_args());
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Bytes of the parts of an unfinished job in the work folder.
#[cfg(unix)]
fn written(out: &Path) -> u64 {
    let entries = |folder: &Path| -> Vec<PathBuf> {
        fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect()
    };
    let parts =
        entries(&out.join(".groundel")).into_iter().flat_map(|job| entries(&job.join("parts")));
    parts.filter_map(|part| fs::metadata(part).ok()).map(|meta| meta.len()).sum()
}

#[test]
fn two_runs_on_one_work_folder_end_in_the_same_bytes_or_one_is_told_of_the_other() {
    let folder = tempfile::tempdir().unwrap();
    facade(folder.path());
    let (bytes, _, _) = reference(folder.path(), &folder.path().join("whole"));
    let work = folder.path().join("work");
    let outs = ["one", "two"].map(|name| folder.path().join(name));
    let begin = |out: &PathBuf| {
        fs::create_dir(out).unwrap();
        ortho(folder.path(), out).arg("--work").arg(&work).spawn().unwrap()
    };
    let children = outs.each_ref().map(begin);
    let ends = children.map(end);
    let mut done = 0;
    for (out, (code, said)) in outs.iter().zip(&ends) {
        match code {
            Some(0) => {
                done += 1;
                assert!(files(out) == bytes);
            }
            // The job's part has one writer at a time.
            Some(4) => assert!(said.contains("another process is writing this file"), "{said}"),
            other => panic!("{other:?}: {said}"),
        }
    }
    assert!(done > 0, "{ends:?}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_and_sigterm_leave_no_file_and_the_next_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    facade(folder.path());
    let (bytes, report, took) = reference(folder.path(), &folder.path().join("whole"));
    for signal in ["INT", "TERM"] {
        let out = folder.path().join(signal);
        fs::create_dir(&out).unwrap();
        let mut interrupted = 0;
        for k in 1..=8 {
            let before = written(&out);
            let mut child = begin_listening(folder.path(), &out);
            if k == 1 {
                std::thread::sleep(took.mul_f64(0.05));
            } else {
                // Some more of it is there, but not yet all.
                while written(&out) <= before && child.try_wait().unwrap().is_none() {
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
            let id = child.id().to_string();
            Command::new("kill").args([&format!("-{signal}"), &id]).status().unwrap();
            let (code, said) = end(child);
            match code {
                Some(4) => {
                    interrupted += 1;
                    let last = said.lines().last().unwrap();
                    assert_eq!(
                        last,
                        "groundel: error: interrupted; the same command goes on from here"
                    );
                    assert_eq!(finals(&out), Vec::<PathBuf>::new());
                    let unfinished =
                        |e: fs::DirEntry| e.file_name().to_string_lossy().contains("unfinished");
                    assert!(!fs::read_dir(&out).unwrap().any(|e| unfinished(e.unwrap())));
                }
                // Before it could watch for signals, or after it had finished.
                None | Some(0) => {}
                other => panic!("{signal}: {other:?}: {said}"),
            }
            if code == Some(0) {
                break;
            }
        }
        assert!(interrupted > 0, "{signal}");
        let (code, said) = end(begin(folder.path(), &out));
        assert_eq!(code, Some(0), "{said}");
        assert!(files(&out) == bytes && found(&out) == report, "{signal}");
        assert_eq!(leftovers(&out), Vec::<String>::new());
    }
}

/// A small file system refuses the run while it is surely too small; fills at several moments of the run; then there
/// is room.
#[cfg(target_os = "linux")]
#[test]
fn a_disk_too_small_is_refused_with_code_3_a_full_one_ends_with_4_and_after_room_is_made_in_the_same_bytes()
 {
    let folder = tempfile::tempdir().unwrap();
    facade(folder.path());
    let (bytes, report, _) = reference(folder.path(), &folder.path().join("whole"));
    let (small, kept) = (folder.path().join("small"), folder.path().join("kept"));
    fs::create_dir(&small).unwrap();
    fs::create_dir(&kept).unwrap();
    // A mount of this test's own, in a namespace of its own: it goes when the script ends. The run is given room, which
    // something else takes while tiles are written, twice.
    let script = r#"
        set -u
        mount -t tmpfs -o size=100k tmpfs "$1" || exit 99
        shift_out="$2"; shift 2
        "$@"
        echo "small $?" >> "$shift_out/codes"
        ls -A "$SMALL" > "$shift_out/names.small"
        mount -o remount,size=16m "$SMALL" || exit 99
        written() { cat "$SMALL"/.groundel/job-*/parts/*.unfinished 2> /dev/null | wc -c; }
        for time in first second; do
          before=$(written)
          "$@" &
          run=$!
          until [ "$(written)" -gt "$before" ] || ! kill -0 $run 2> /dev/null; do :; done
          cat /dev/zero > "$SMALL/filler" 2> /dev/null
          wait $run
          echo "$time $?" >> "$shift_out/codes"
          ls "$SMALL" >> "$shift_out/names.full"
          rm "$SMALL/filler"
        done
        "$@"
        echo "room $?" >> "$shift_out/codes"
        cp "$SMALL"/mosaic* "$SMALL"/report.json "$shift_out"
    "#;
    let mut command = Command::new("unshare");
    command.args(["--user", "--map-root-user", "--mount", "sh", "-c", script, "sh"]);
    let own = ortho(folder.path(), &small);
    let run = command
        .arg(&small)
        .arg(&kept)
        .arg(own.get_program())
        .args(own.get_args())
        .env("SMALL", &small)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    let codes = fs::read_to_string(kept.join("codes")).unwrap_or_default();
    assert!(run.status.success(), "{codes}{said}");
    assert!(codes.starts_with("small 3\n") && codes.ends_with("room 0\n"), "{codes}{said}");
    assert!(said.contains("MiB of disk are needed, but only 0 MiB are free"), "{said}");
    assert_eq!(fs::read_to_string(kept.join("names.small")).unwrap(), "", "nothing was begun");
    assert_eq!(codes.lines().filter(|line| line.ends_with(" 4")).count(), 2, "{codes}{said}");
    assert!(said.contains("No space left on device"), "{said}");
    let names = fs::read_to_string(kept.join("names.full")).unwrap();
    assert!(!names.contains("mosaic.tif"), "{names}");
    assert!(files(&kept) == bytes && found(&kept) == report);
}
