//! Killed, doubled, damaged, without room, without permission.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use groundel::synthetic::Random;

use super::facade::{
    Facade, assemble, done, ended, files, groundel, missing, names, refused, render,
};

fn is_unfinished(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|end| end == "unfinished")
}

fn begin(command: &mut Command) -> Child {
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn workers_killed_at_any_moment_lose_no_finished_tile_and_do_no_harm() {
    let facade = Facade::new();
    let begun = Instant::now();
    let whole = facade.ortho("whole", &[]);
    let took = begun.elapsed();
    let job = facade.path("job");
    done(&mut facade.plan(&job, &["--batches", "5"]));
    let mut random = Random::new(7);
    let mut killed = 0;
    while !missing(&job).is_empty() && killed < 25 {
        let mut children: Vec<_> = (0..2).map(|_| begin(&mut render(&job, &[]))).collect();
        std::thread::sleep(took.mul_f64(random.between(0.05, 0.6)));
        for child in &mut children {
            child.kill().unwrap();
        }
        for child in children {
            let output = child.wait_with_output().unwrap();
            let (code, _, said) = ended(&output);
            // Killed, or done before it was.
            assert!(code.is_none() || code == Some(0), "{said}");
            killed += usize::from(code.is_none());
        }
        // A part under a final name is whole.
        for name in names(&job.join("parts")).iter().filter(|name| !is_unfinished(name)) {
            let bytes = fs::read(job.join("parts").join(name)).unwrap();
            assert!(bytes.ends_with(b"GRNDPEND"), "{name}");
        }
    }
    assert!(killed > 3, "{killed}");
    done(&mut render(&job, &[]));
    let out = facade.path("out");
    done(&mut assemble(&job, &out, &[]));
    assert!(files(&out) == whole);
    assert!(!names(&job.join("parts")).iter().any(|name| is_unfinished(name)));
    done(&mut assemble(&job, &out, &["--remove"]));
    assert_eq!(names(&job), ["manifest.json", "stores"]);
}

#[test]
fn two_workers_on_one_batch_both_end_well() {
    let facade = Facade::new();
    let job = facade.path("job");
    done(&mut facade.plan(&job, &["--batches", "1"]));
    let children: Vec<_> = (0..3).map(|_| begin(&mut render(&job, &["--batch", "0"]))).collect();
    for child in children {
        let (code, _, said) = ended(&child.wait_with_output().unwrap());
        assert!(code == Some(0), "{code:?} {said}");
    }
    let out = facade.path("out");
    done(&mut assemble(&job, &out, &[]));
    assert!(files(&out) == facade.ortho("whole", &[]));
    assert_eq!(names(&job.join("parts")), ["batch-00000.part"]);
}

#[cfg(unix)]
#[test]
fn a_worker_ends_soon_after_the_process_that_started_it() {
    let facade = Facade::new();
    let job = facade.path("job");
    done(&mut facade.plan(&job, &["--batches", "1", "--pixel-size", "0.002"]));
    let pid = facade.path("pid");
    // A shell that starts a worker, tells its number, and is killed.
    let script = "\"$0\" render \"$1\" --quiet --threads 1 --parent $$ & echo $! > \"$2\"; wait";
    let mut shell = Command::new("sh");
    shell.args(["-c", script, env!("CARGO_BIN_EXE_groundel")]).arg(&job).arg(&pid);
    let mut shell = shell.stderr(Stdio::null()).spawn().unwrap();
    let wait_for = |what: &dyn Fn() -> bool| {
        let begun = Instant::now();
        while !what() && begun.elapsed() < Duration::from_mins(1) {
            std::thread::sleep(Duration::from_millis(20));
        }
        what()
    };
    let number = || fs::read_to_string(&pid).unwrap_or_default().trim().to_owned();
    let is_begun = || {
        let parts = job.join("parts");
        let unfinished = names(&parts).into_iter().find(|name| name.ends_with(".unfinished"));
        unfinished.is_some_and(|name| fs::metadata(parts.join(name)).is_ok_and(|m| m.len() > 100))
    };
    assert!(wait_for(&|| !number().is_empty() && is_begun()));
    shell.kill().unwrap();
    shell.wait().unwrap();
    let proc = format!("/proc/{}/exe", number());
    assert!(wait_for(&|| fs::read_link(&proc).is_err()), "the worker lives on");
    assert_eq!(missing(&job), [0], "it was not done yet");
}

#[test]
fn damage_in_a_part_is_found_when_it_is_assembled() {
    let facade = Facade::new();
    let job = facade.path("job");
    done(&mut facade.plan(&job, &["--batches", "3"]));
    done(&mut render(&job, &[]));
    let part = job.join("parts/batch-00001.part");
    let whole = fs::read(&part).unwrap();
    let mut damaged = whole.clone();
    damaged[whole.len() / 3] ^= 8;
    fs::write(&part, damaged).unwrap();
    let out = facade.path("out");
    let said = refused(&mut assemble(&job, &out, &[]), 2);
    assert!(said.contains("batch-00001.part: byte "), "{said}");
    // Cut short, it is not finished.
    fs::write(&part, &whole[..whole.len() - 9]).unwrap();
    assert_eq!(missing(&job), [1]);
    refused(&mut assemble(&job, &out, &[]), 2);
    fs::remove_file(&part).unwrap();
    done(&mut render(&job, &[]));
    done(&mut assemble(&job, &out, &[]));
    assert!(files(&out) == facade.ortho("whole", &[]));
}

/// As root every folder takes files; in a namespace without that right it does not.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_takes_no_files_and_a_disk_that_fills_are_clear_errors_and_can_be_mended() {
    let facade = Facade::new();
    let whole = facade.ortho("whole", &[]);
    let (job, out) = (facade.path("job"), facade.path("out"));
    fs::create_dir(&job).unwrap();
    // The job lies in a small file system, which goes when the script ends: it is read-only, then full, then has room.
    let script = r#"
        set -u
        mount -t tmpfs -o size=64m tmpfs "$JOB" || exit 99
        "$GROUNDEL" plan "$PROJECT" --tile-size 64 --quiet --batches 3 --job "$JOB" || exit 98
        "$GROUNDEL" render "$JOB" --quiet --batch 1 || exit 97
        mount -o remount,ro "$JOB" || exit 99
        "$GROUNDEL" render "$JOB" --quiet --batch 0; echo "read-only $?" >> "$CODES"
        mount -o remount,rw "$JOB" || exit 99
        cat /dev/zero > "$JOB/filler" 2> /dev/null
        "$GROUNDEL" render "$JOB" --quiet; echo "full $?" >> "$CODES"
        rm "$JOB/filler"
        "$GROUNDEL" render "$JOB" --quiet; echo "room $?" >> "$CODES"
        "$GROUNDEL" assemble "$JOB" --quiet --out "$OUT/mosaic.tif"; echo "assembled $?" >> "$CODES"
    "#;
    fs::create_dir(&out).unwrap();
    let codes = facade.path("codes");
    let run = Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "sh", "-c", script])
        .env("GROUNDEL", env!("CARGO_BIN_EXE_groundel"))
        .env("PROJECT", facade.path("project/project.toml"))
        .env("JOB", &job)
        .env("OUT", &out)
        .env("CODES", &codes)
        .output()
        .unwrap();
    let (code, _, said) = ended(&run);
    let codes = fs::read_to_string(codes).unwrap_or_default();
    assert_eq!(code, Some(0), "{codes}{said}");
    assert_eq!(codes, "read-only 4\nfull 4\nroom 0\nassembled 0\n", "{said}");
    assert!(said.contains("Read-only file system") && said.contains("No space left"), "{said}");
    assert!(files(&out) == whole);
}

#[test]
fn a_damaged_manifest_is_an_error_or_a_job_and_never_a_panic() {
    let facade = Facade::new();
    let job = facade.path("job");
    done(&mut facade.plan(&job, &["--batches", "2"]));
    let manifest = job.join("manifest.json");
    let whole = fs::read(&manifest).unwrap();
    let mut refused = 0;
    let mut run = |bytes: &[u8], is_render: bool| {
        fs::write(&manifest, bytes).unwrap();
        let mut command = groundel();
        if is_render {
            command.arg("render").arg(&job).args(["--quiet", "--batch", "0"]);
        } else {
            command.arg("info").arg(&job);
        }
        let (code, _, said) = ended(&command.output().unwrap());
        assert!(matches!(code, Some(0 | 2..=4)), "{code:?} {said}");
        refused += usize::from(code != Some(0));
    };
    // One digit, letter or bracket for another; cut short.
    for k in 0..150 {
        let mut bytes = whole.clone();
        let place = (k * 7919 + 31) % whole.len();
        match k % 3 {
            0 => bytes[place] = b"0123456789"[k / 3 % 10],
            1 => bytes[place] = b"-.,[]{}\"eaZ"[k / 3 % 11],
            _ => bytes.truncate(place),
        }
        run(&bytes, k % 10 == 0);
    }
    // Ids beyond the set, out of order; batches of no tile.
    let text = String::from_utf8(whole.clone()).unwrap();
    for (from, to) in [
        ("\"id\": 0,", "\"id\": 4000000000,"),
        ("\"id\": 0,", "\"id\": 5,"),
        ("\"batches\": [\n    0,", "\"batches\": [\n    1,"),
        ("\"tile_size\": 64", "\"tile_size\": 4294967280"),
        ("\"width\": ", "\"width\": 4"),
    ] {
        assert!(text.contains(from), "{from}");
        run(text.replace(from, to).as_bytes(), true);
    }
    assert!(refused > 80, "{refused}");
    fs::write(&manifest, whole).unwrap();
    done(&mut render(&job, &[]));
}
