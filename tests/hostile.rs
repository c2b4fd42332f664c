//! Seeded mutations of good files of every format: whatever the bytes, a parser answers soon, with a result or an error
//! that names the file, within its memory. Of our own files no damage goes unseen.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "hostile/corpus.rs"]
mod corpus;
#[path = "hostile/parsers.rs"]
mod parsers;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use groundel::Result;
use groundel::report::peak_resident_bytes;
use groundel::synthetic::{Random, Sampling, scenes};

/// Mutations of each good file.
const MUTATIONS: u64 = 250;
/// The longest that a parser may take over a small file.
const LONGEST: Duration = Duration::from_secs(5);
/// The most memory of this whole process: what the parsers may ask for, and the test itself.
const MOST_BYTES: u64 = 300 << 20;

type Parser = fn(&Path) -> Result<u64>;

/// Numbers that programs stumble over.
const NUMBERS: [&str; 10] = [
    "-1",
    "0",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "1e308",
    "-1e400",
    "nan",
    "inf",
    "0x7f",
];

/// Stores and a job's part, as a run leaves them.
fn own(folder: &Path) -> Vec<(PathBuf, Parser)> {
    let mut scene = scenes::columns();
    scene.shots.truncate(2);
    scene.write(folder, Sampling::Box(1), &[]).unwrap();
    let out = folder.join("out");
    fs::create_dir(&out).unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .args(["ortho", "--quiet", "--tile-size", "32", "--work"])
        .arg(folder.join("work"))
        .arg("--out")
        .arg(out.join("mosaic.tif"))
        .arg(folder.join("project.toml"))
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let find = |folder: PathBuf, ending: &str| {
        let mut found: Vec<PathBuf> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
        found.retain(|p| p.extension().is_some_and(|e| e == ending));
        found.sort();
        found.remove(0)
    };
    let work = folder.join("work");
    let photo = folder.join("photos").join(&scene.shots[0].name);
    vec![
        (find(work, "store"), parsers::mesh_store as Parser),
        (corpus::photo_store(&photo, &folder.join("tiles")), parsers::photo_store as Parser),
        (corpus::part(&folder.join("job")), parsers::part as Parser),
    ]
}

/// One of the ways in which files go wrong.
fn mutate(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut below = |n: usize| usize::try_from(random.bits() % n.max(1) as u64).unwrap();
    let at = below(bytes.len());
    let length = 1 + below(40);
    let end = (at + length).min(bytes.len());
    match below(8) {
        0 => bytes.truncate(at),
        1 => bytes[at] ^= 1 << below(8),
        2 => {
            for _ in 0..=below(8) {
                let at = below(bytes.len());
                bytes[at] = u8::try_from(below(256)).unwrap();
            }
        }
        3 => drop(bytes.drain(at..end)),
        4 => {
            let copy = bytes[at..end].to_vec();
            let to = below(bytes.len());
            bytes.splice(to..to, copy);
        }
        // A length, a count or an offset becomes absurd.
        5 => bytes[at..end].iter_mut().take(4).for_each(|b| *b = 0xff),
        6 => bytes[at..end].iter_mut().take(8).for_each(|b| *b = 0),
        _ => {
            // A number in a text, or what stands for one.
            let digits: Vec<usize> =
                (0..bytes.len()).filter(|&k| bytes[k].is_ascii_digit()).collect();
            let at = digits.get(below(digits.len())).copied().unwrap_or(at);
            let end =
                (at..bytes.len()).find(|&k| !bytes[k].is_ascii_digit()).unwrap_or(bytes.len());
            bytes.splice(at..end, NUMBERS[below(NUMBERS.len())].bytes());
        }
    }
    bytes
}

/// Runs `parser` over mutations of the file `name` in `folder`; the outcomes, good ones as numbers. `subject` is what
/// the parser is given: the file, or its folder.
fn torment(folder: &Path, name: &str, subject: &Path, parser: Parser) -> Vec<Option<u64>> {
    let file = folder.join(name);
    let good = fs::read(&file).unwrap();
    let seed = name.bytes().fold(7_u64, |seed, b| seed.wrapping_mul(31).wrapping_add(b.into()));
    let mut random = Random::new(seed);
    let mut outcomes = Vec::new();
    for k in 0..MUTATIONS {
        let bad = mutate(&good, &mut random);
        fs::write(&file, &bad).unwrap();
        let begun = Instant::now();
        let outcome = parser(subject);
        let took = begun.elapsed();
        assert!(took < LONGEST, "{name}, mutation {k}: {took:?}");
        if let Err(e) = &outcome {
            let said = e.to_string();
            let named = subject.file_name().unwrap().to_str().unwrap();
            assert!(said.contains(named) && said.len() < 2000, "{name}, mutation {k}: {said}");
        }
        outcomes.push(outcome.ok().filter(|_| bad != good));
    }
    fs::write(&file, &good).unwrap();
    outcomes
}

fn within_memory() {
    if let Some(peak) = peak_resident_bytes() {
        assert!(peak < MOST_BYTES, "{} MiB", peak >> 20);
    }
}

#[test]
fn foreign_files_are_read_or_refused_whatever_their_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, parser) in corpus::foreign(folder) {
        let path = folder.join(&name);
        parser(&path).unwrap_or_else(|e| panic!("the good {name}: {e}"));
        let outcomes = torment(folder, &name, &path, parser);
        assert!(outcomes.iter().any(Option::is_none), "{name}: no mutation was refused");
    }
    within_memory();
}

#[test]
fn a_jpeg_is_the_same_by_its_index_whatever_its_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, _) in corpus::foreign(folder)
        .into_iter()
        .filter(|(n, _)| Path::new(n).extension().is_some_and(|e| e == "jpg"))
    {
        let path = folder.join(&name);
        assert_eq!(parsers::photo_index(&path).unwrap(), 2, "{name} has no index");
        let outcomes = torment(folder, &name, &path, parsers::photo_index);
        let taken = outcomes.iter().flatten().filter(|&&found| found == 2).count();
        assert!(taken > 0 && outcomes.iter().any(Option::is_none), "{name}: {taken}");
    }
    within_memory();
}

#[test]
fn camera_folders_are_read_or_refused_whatever_their_bytes() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["text", "binary"] {
        let set = folder.path().join(kind);
        let names = corpus::cameras(&set, kind);
        parsers::cameras(&set).unwrap();
        for name in names {
            let outcomes = torment(&set, &name, &set, parsers::cameras);
            assert!(outcomes.iter().any(Option::is_none), "{name}: no mutation was refused");
        }
    }
    within_memory();
}

#[test]
fn damage_in_our_own_files_is_never_read_as_something_else() {
    let folder = tempfile::tempdir().unwrap();
    for (path, parser) in own(folder.path()) {
        let whole = parser(&path).unwrap_or_else(|e| panic!("the good {}: {e}", path.display()));
        let name = path.file_name().unwrap().to_str().unwrap();
        let outcomes = torment(path.parent().unwrap(), name, &path, parser);
        let other = outcomes.iter().flatten().filter(|&&found| found != whole).count();
        // A part that was cut is a part with fewer tiles, as a killed run leaves it.
        assert!(other == 0 || name.starts_with("part"), "{name}: {other} read as something else");
        assert!(outcomes.iter().any(Option::is_none), "{name}: no damage was seen");
    }
    within_memory();
}
