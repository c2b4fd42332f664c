//! [`prepare_photos`]: the store files of all photos of a job, built in parallel within a budget of memory.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};

use xxhash_rust::xxh3::xxh3_128;

use super::build::{Content, PhotoFingerprint, PhotoTiles, UNFINISHED_PREFIX, working_bytes};
use crate::geom::Size;
use crate::input::photo::{PhotoHeader, read_mask_header, read_photo_header};
use crate::{Error, Result};

/// A photo to prepare.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PhotoSource {
    /// Its name in the job, unique.
    pub name: String,
    /// The file.
    pub path: PathBuf,
    /// The size that its camera expects, if it is known.
    pub expected: Option<Size>,
}

/// How photos are prepared.
#[derive(Debug, Clone, Copy)]
pub struct Preparation<'a> {
    /// The folder of the store files; made if it is not there.
    pub folder: &'a Path,
    /// Memory for decoding, in bytes; photos are decoded at once as far as their [`working_bytes`] fit.
    pub budget_bytes: u64,
    /// Threads to use, at least 1.
    pub threads: usize,
}

/// How far the preparation has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Photos that are ready or left out.
    pub done: usize,
    /// All photos.
    pub total: usize,
}

/// A photo that has to be left out of the job.
#[derive(Debug)]
pub struct LeftOut {
    /// Why: the message names the file.
    pub reason: Error,
    /// Expected and found size, if only the size is wrong: when all differ by one factor, the photos were resized.
    pub sizes: Option<(Size, Size)>,
}

/// What became of a photo.
type Outcome = std::result::Result<PhotoTiles, LeftOut>;

/// Makes the store file of every photo, or opens it where it is there and matches the photo.
///
/// The outcomes are in the order of `sources`. A photo that is missing, broken, unsupported or of another size than
/// expected is left out, with the reason. `progress` is called from several threads, once a photo. A lock on the
/// folder keeps other processes waiting meanwhile.
///
/// Steps: 1. in parallel, each header is read and each store file that matches is opened; 2. if one of the others
/// needs more than the budget, nothing is begun; 3. in parallel, these are built.
///
/// # Errors
/// [`Error::OverBudget`] if a photo cannot be decoded within the budget; [`Error::Io`] for the folder, a full disk,
/// or a photo that is there but cannot be read; what `progress` returns: then no further photo is begun.
pub fn prepare_photos(
    sources: &[PhotoSource],
    preparation: &Preparation<'_>,
    progress: &(dyn Fn(Progress) -> Result<()> + Sync),
) -> Result<Vec<Outcome>> {
    prepare(Content::Photo, sources, preparation, progress)
}

/// Like [`prepare_photos`], for masks: stores of one channel, 0 where a photo is not to be used, else 255. They need a
/// folder of their own. None can be left out.
///
/// # Errors
/// As [`prepare_photos`], and what is wrong with the first mask that is missing, broken, no PNG or of another size.
pub fn prepare_masks(
    sources: &[PhotoSource],
    preparation: &Preparation<'_>,
    progress: &(dyn Fn(Progress) -> Result<()> + Sync),
) -> Result<Vec<PhotoTiles>> {
    let outcomes = prepare(Content::Mask, sources, preparation, progress)?;
    outcomes.into_iter().map(|outcome| outcome.map_err(|left_out| left_out.reason)).collect()
}

fn prepare(
    content: Content,
    sources: &[PhotoSource],
    preparation: &Preparation<'_>,
    progress: &(dyn Fn(Progress) -> Result<()> + Sync),
) -> Result<Vec<Outcome>> {
    let folder = preparation.folder;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let _lock = lock(folder)?;
    remove_leftovers(folder)?;
    let done = AtomicUsize::new(0);
    let report = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(Progress { done, total: sources.len() })
    };
    let surveyed = in_parallel(sources.len(), preparation.threads, &Budget::unlimited(), |i| {
        let survey = survey(content, &sources[i], folder)?;
        if matches!(survey, Survey::Known(_)) {
            report()?;
        }
        Ok(survey)
    })?;
    let mut outcomes = Vec::with_capacity(sources.len());
    let mut works = Vec::new();
    for (number, survey) in surveyed.into_iter().enumerate() {
        match survey {
            Survey::Known(outcome) => outcomes.push(Some(outcome)),
            Survey::ToBuild(work) => {
                check_budget(&sources[number], &work.header, preparation.budget_bytes)?;
                outcomes.push(None);
                works.push((number, work));
            }
        }
    }
    let needs = works.iter().map(|(_, work)| working_bytes(&work.header)).collect();
    let budget = Budget { bytes: preparation.budget_bytes, needs };
    let built = in_parallel(works.len(), preparation.threads, &budget, |i| {
        let (number, work) = &works[i];
        let path = &sources[*number].path;
        let built =
            PhotoTiles::build_of(content, path, &work.header, work.fingerprint, &work.store);
        let outcome = left_out_or_fatal(built, path)?;
        report()?;
        Ok(outcome)
    })?;
    for ((number, _), outcome) in works.iter().zip(built) {
        outcomes[*number] = Some(outcome);
    }
    // None is left empty: a photo is known or was built.
    Ok(outcomes.into_iter().flatten().collect())
}

/// Waits until no other process prepares photos in this folder, and keeps others waiting until it is dropped.
fn lock(folder: &Path) -> Result<File> {
    let path = folder.join("photos.lock");
    let io = |e| Error::io(&path, e);
    let file = File::options().create(true).append(true).open(&path).map_err(io)?;
    file.lock().map_err(io)?;
    Ok(file)
}

/// Deletes unfinished store files of runs that were killed; the folder is locked.
fn remove_leftovers(folder: &Path) -> Result<()> {
    let io = |e| Error::io(folder, e);
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        if entry.file_name().as_encoded_bytes().starts_with(UNFINISHED_PREFIX.as_bytes()) {
            std::fs::remove_file(entry.path()).map_err(|e| Error::io(entry.path(), e))?;
        }
    }
    Ok(())
}

/// What is known of a photo before any is decoded.
enum Survey {
    Known(Outcome),
    ToBuild(Work),
}

struct Work {
    header: PhotoHeader,
    fingerprint: PhotoFingerprint,
    store: PathBuf,
}

fn survey(content: Content, source: &PhotoSource, folder: &Path) -> Result<Survey> {
    let header = match content {
        Content::Photo => read_photo_header(&source.path),
        Content::Mask => read_mask_header(&source.path),
    };
    let header = match left_out_or_fatal(header, &source.path)? {
        Ok(header) => header,
        Err(left_out) => return Ok(Survey::Known(Err(left_out))),
    };
    if let Some(expected) = source.expected.filter(|&size| size != header.size) {
        let pixels = |size: Size| format!("{} × {} pixels", size.width, size.height);
        let expected_text = format!("{}, as its camera says", pixels(expected));
        let reason = Error::corrupt(&source.path, "size", expected_text, pixels(header.size));
        let sizes = Some((expected, header.size));
        return Ok(Survey::Known(Err(LeftOut { reason, sizes })));
    }
    let fingerprint =
        match left_out_or_fatal(PhotoFingerprint::of(&source.name, &source.path), &source.path)? {
            Ok(fingerprint) => fingerprint,
            Err(left_out) => return Ok(Survey::Known(Err(left_out))),
        };
    let store = folder.join(store_name(&source.name));
    Ok(match PhotoTiles::open_checked(&store) {
        Ok(tiles) if tiles.fingerprint() == fingerprint => Survey::Known(Ok(tiles)),
        // Not there, stale, cut or foreign: a new one takes its place.
        _ => Survey::ToBuild(Work { header, fingerprint, store }),
    })
}

/// The file name of a photo's store: names may hold folders and any character.
fn store_name(name: &str) -> String {
    format!("{:032x}.tiles", xxh3_128(name.as_bytes()))
}

fn check_budget(source: &PhotoSource, header: &PhotoHeader, budget_bytes: u64) -> Result<()> {
    let needed_bytes = working_bytes(header);
    if needed_bytes <= budget_bytes {
        return Ok(());
    }
    Err(Error::OverBudget {
        what: format!("decoding {}", source.path.display()),
        needed_bytes,
        allowed_bytes: budget_bytes,
        hint: Some("allow more memory, or save the photo as a TIFF in strips or a PNG that is not interlaced".into()),
    })
}

/// Tells a photo that is to be left out from a failure that ends the preparation: of a disk, or of the store.
fn left_out_or_fatal<T>(
    result: Result<T>,
    photo: &Path,
) -> Result<std::result::Result<T, LeftOut>> {
    use std::io::ErrorKind::{IsADirectory, NotADirectory, NotFound, PermissionDenied};
    match result {
        Ok(value) => Ok(Ok(value)),
        Err(Error::Io { path, source })
            if path != photo
                || !matches!(
                    source.kind(),
                    IsADirectory | NotADirectory | NotFound | PermissionDenied
                ) =>
        {
            Err(Error::Io { path, source })
        }
        Err(reason) => Ok(Err(LeftOut { reason, sizes: None })),
    }
}

/// What pieces of work need of a budget, by index.
struct Budget {
    bytes: u64,
    needs: Vec<u64>,
}

impl Budget {
    fn unlimited() -> Self {
        Self { bytes: u64::MAX, needs: Vec::new() }
    }

    fn need(&self, index: usize) -> u64 {
        self.needs.get(index).copied().unwrap_or(0)
    }
}

/// The next piece of work, and the bytes of those in progress.
struct Queue {
    next: usize,
    used_bytes: u64,
    failure: Option<Error>,
}

/// Does `work` for 0 to `count − 1`, started in that order, on several threads, each piece when its need fits beside
/// those in progress (one alone always may). The results are in order; after an error no further piece is begun.
///
/// Threads of its own, not rayon's: a rayon worker that waits for the budget could not go on with the piece below it
/// on its stack.
fn in_parallel<T: Send>(
    count: usize,
    threads: usize,
    budget: &Budget,
    work: impl Fn(usize) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let queue = Mutex::new(Queue { next: 0, used_bytes: 0, failure: None });
    let changed = Condvar::new();
    let take = || {
        let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if queue.next == count || queue.failure.is_some() {
                return None;
            }
            let need = budget.need(queue.next);
            if queue.used_bytes == 0 || queue.used_bytes.saturating_add(need) <= budget.bytes {
                queue.used_bytes += need;
                queue.next += 1;
                return Some(queue.next - 1);
            }
            queue = changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
    };
    let give_back = |index: usize, failure: Option<Error>| {
        let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
        queue.used_bytes -= budget.need(index);
        queue.failure = queue.failure.take().or(failure);
        changed.notify_all();
    };
    let run = || {
        let mut results = Vec::new();
        while let Some(index) = take() {
            match work(index) {
                Ok(result) => {
                    results.push((index, result));
                    give_back(index, None);
                }
                Err(failure) => give_back(index, Some(failure)),
            }
        }
        results
    };
    let mut results = std::thread::scope(|scope| {
        let threads = threads.clamp(1, count.max(1));
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(run)).collect();
        let join = |handle: std::thread::ScopedJoinHandle<'_, Vec<(usize, T)>>| {
            handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        handles.into_iter().flat_map(join).collect::<Vec<_>>()
    });
    if let Some(failure) = queue.into_inner().unwrap_or_else(PoisonError::into_inner).failure {
        return Err(failure);
    }
    results.sort_unstable_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

#[cfg(test)]
mod tests {
    use image::ExtendedColorType;

    use super::super::PhotoStore;
    use super::super::tests::write_photo;
    use super::*;

    fn source(folder: &Path, name: &str, expected: Option<Size>) -> PhotoSource {
        PhotoSource { name: name.to_string(), path: folder.join(name), expected }
    }

    fn prepare(sources: &[PhotoSource], folder: &Path) -> Result<Vec<Outcome>> {
        let folder = folder.join("store");
        let preparation = Preparation { folder: &folder, budget_bytes: 1 << 30, threads: 3 };
        prepare_photos(sources, &preparation, &|_| Ok(()))
    }

    #[test]
    fn each_photo_is_ready_or_left_out_with_its_reason_in_the_order_given() {
        let folder = tempfile::tempdir().unwrap();
        let size = Size::new(120, 90);
        for name in ["a.jpg", "sub folder/a.jpg", "b.png", "broken.png", "small.jpg"] {
            std::fs::create_dir_all(folder.path().join(name).parent().unwrap()).unwrap();
            write_photo(&folder.path().join(name), size, ExtendedColorType::Rgb8);
        }
        let broken = folder.path().join("broken.png");
        let bytes = std::fs::read(&broken).unwrap();
        std::fs::write(&broken, &bytes[..bytes.len() / 2]).unwrap();
        std::fs::write(folder.path().join("c.psd"), b"8BPS..............").unwrap();
        let sources = [
            source(folder.path(), "a.jpg", Some(size)),
            source(folder.path(), "missing.jpg", None),
            source(folder.path(), "sub folder/a.jpg", None),
            source(folder.path(), "broken.png", Some(size)),
            source(folder.path(), "c.psd", None),
            source(folder.path(), "small.jpg", Some(Size::new(240, 180))),
            source(folder.path(), "b.png", Some(size)),
        ];
        let outcomes = prepare(&sources, folder.path()).unwrap();
        let messages: Vec<_> = outcomes
            .iter()
            .map(|outcome| outcome.as_ref().err().map(|left_out| left_out.reason.to_string()))
            .collect();
        let is_ready: Vec<_> = messages.iter().map(Option::is_none).collect();
        assert_eq!(is_ready, [true, false, true, false, false, false, true], "{messages:?}");
        let mentions = |number: usize, text: &str| {
            let message = messages[number].clone().unwrap_or_default();
            assert!(message.contains(text), "{message}");
            assert!(message.contains(&sources[number].name), "{message}");
        };
        mentions(1, "No such file");
        mentions(3, "a whole picture");
        mentions(4, "not supported");
        mentions(5, "expected 240 × 180 pixels, as its camera says, found 120 × 90 pixels");
        let sizes = outcomes[5].as_ref().unwrap_err().sizes;
        assert_eq!(sizes, Some((Size::new(240, 180), size)));
        // Three stores and the lock, nothing else.
        let files = std::fs::read_dir(folder.path().join("store")).unwrap().count();
        assert_eq!(files, 4);
    }

    #[test]
    fn a_store_is_used_again_while_it_matches_and_made_again_when_not() {
        let folder = tempfile::tempdir().unwrap();
        let photo = folder.path().join("a.png");
        write_photo(&photo, Size::new(300, 40), ExtendedColorType::L8);
        let sources = [source(folder.path(), "a.png", None)];
        let first = prepare(&sources, folder.path()).unwrap().remove(0).unwrap();
        let written = std::fs::read(first.path()).unwrap();

        // Marked where only a reader of tiles looks: if it is still there, the file was not made again.
        let mut marked = written.clone();
        *marked.last_mut().unwrap() ^= 1;
        std::fs::write(first.path(), &marked).unwrap();
        assert_eq!(prepare(&sources, folder.path()).unwrap().remove(0).unwrap(), first);
        assert_eq!(std::fs::read(first.path()).unwrap(), marked);

        // Damaged in header or index, cut, or foreign: made again, to the same bytes.
        let mut damaged = Vec::new();
        for at in [0, 9, 20, 40, 70, 120] {
            let mut bytes = written.clone();
            bytes[at] ^= 4;
            damaged.push(bytes);
        }
        damaged.extend([written[..written.len() - 1].to_vec(), Vec::new(), b"else".to_vec()]);
        for bytes in damaged {
            std::fs::write(first.path(), bytes).unwrap();
            assert_eq!(prepare(&sources, folder.path()).unwrap().remove(0).unwrap(), first);
            assert_eq!(std::fs::read(first.path()).unwrap(), written);
        }

        // Another photo under the same name: made again, with its pixels.
        write_photo(&photo, Size::new(30, 40), ExtendedColorType::L8);
        let second = prepare(&sources, folder.path()).unwrap().remove(0).unwrap();
        assert_eq!((second.path(), second.size()), (first.path(), Size::new(30, 40)));
        assert!(second.fingerprint() != first.fingerprint());
        PhotoStore::open([(0, second.path().to_path_buf())], 0).unwrap();
    }

    #[test]
    fn what_a_killed_run_left_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("store");
        std::fs::create_dir(&store).unwrap();
        std::fs::write(store.join(".unfinished-Ab3"), "half").unwrap();
        write_photo(&folder.path().join("a.png"), Size::new(30, 40), ExtendedColorType::L8);
        prepare(&[source(folder.path(), "a.png", None)], folder.path()).unwrap();
        assert!(!store.join(".unfinished-Ab3").exists());
    }

    #[test]
    fn a_photo_beyond_the_budget_is_refused_before_anything_is_built() {
        let folder = tempfile::tempdir().unwrap();
        for (name, width) in [("a.jpg", 100), ("b.jpg", 3000)] {
            let path = folder.path().join(name);
            write_photo(&path, Size::new(width, 1000), ExtendedColorType::Rgb8);
        }
        let sources = ["a.jpg", "b.jpg"].map(|name| source(folder.path(), name, None));
        let header = read_photo_header(&sources[1].path).unwrap();
        let store = folder.path().join("store");
        let with = |budget_bytes| {
            let preparation = Preparation { folder: &store, budget_bytes, threads: 2 };
            prepare_photos(&sources, &preparation, &|_| Ok(()))
        };
        let e = with(working_bytes(&header) - 1).unwrap_err();
        assert_eq!(e.exit_code(), 3);
        assert!(e.to_string().contains("b.jpg"), "{e}");
        assert_eq!(std::fs::read_dir(&store).unwrap().count(), 1, "the lock alone");
        assert!(with(working_bytes(&header)).unwrap().iter().all(std::result::Result::is_ok));
        // Once built, a photo needs no memory to be decoded.
        assert!(with(1).is_ok());
    }

    #[test]
    fn a_progressive_jpeg_is_refused_for_its_coefficients_where_a_sequential_one_fits() {
        let folder = tempfile::tempdir().unwrap();
        // 48 Mpx that are not there: the header tells the need.
        for (name, marker) in [("progressive.jpg", 0xC2), ("sequential.jpg", 0xC0)] {
            let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/photo").join(name);
            let mut bytes = std::fs::read(data).unwrap();
            let frame = bytes.windows(2).position(|w| w == [0xFF, marker]).unwrap();
            bytes[frame + 5..frame + 9].copy_from_slice(&[0x17, 0x70, 0x1F, 0x40]);
            bytes.resize(1 << 20, 0);
            std::fs::write(folder.path().join(name), bytes).unwrap();
        }
        let store = folder.path().join("store");
        let of = |name| {
            let preparation = Preparation { folder: &store, budget_bytes: 200 << 20, threads: 1 };
            prepare_photos(&[source(folder.path(), name, None)], &preparation, &|_| Ok(()))
        };
        let e = of("progressive.jpg").unwrap_err();
        assert_eq!(e.exit_code(), 3);
        // 8000 × 6000 × 3 samples and, in whole blocks, 1.5 coefficients of 2 bytes a pixel.
        let least = (8000 * 6000 * 3 + 8000 * 6016 * 3) >> 20;
        let said = e.to_string();
        let words = said.split("progressive.jpg needs ").nth(1).unwrap();
        let needed: u64 = words.split(' ').next().unwrap().parse().unwrap();
        assert!((least..least + 32).contains(&needed), "{said}");
        assert!(said.contains("MiB, but only 200 MiB are allowed (allow more memory"), "{said}");
        // The sequential one fits; its data are found to be missing later.
        assert!(of("sequential.jpg").unwrap().remove(0).is_err());
    }

    #[test]
    fn progress_counts_every_photo_once() {
        let folder = tempfile::tempdir().unwrap();
        write_photo(&folder.path().join("a.png"), Size::new(30, 40), ExtendedColorType::L8);
        let sources = ["a.png", "none.png", "a.png"].map(|name| source(folder.path(), name, None));
        let seen = Mutex::new(Vec::new());
        let preparation =
            Preparation { folder: &folder.path().join("s"), budget_bytes: 1 << 30, threads: 2 };
        let note = |p: Progress| {
            seen.lock().unwrap().push((p.done, p.total));
            Ok(())
        };
        prepare_photos(&sources, &preparation, &note).unwrap();
        let mut seen = seen.into_inner().unwrap();
        seen.sort_unstable();
        assert_eq!(seen, [(1, 3), (2, 3), (3, 3)]);
    }

    #[test]
    fn work_in_progress_stays_in_the_budget_and_results_in_order() {
        let needs: Vec<u64> = (0..60).map(|i| 1 + i * 7 % 10).collect();
        let budget = Budget { bytes: 12, needs: needs.clone() };
        let used = Mutex::new((0, 0));
        let results = in_parallel(60, 4, &budget, |i| {
            let mut now = used.lock().unwrap();
            now.0 += needs[i];
            now.1 = now.1.max(now.0);
            drop(now);
            std::thread::sleep(std::time::Duration::from_micros(300));
            used.lock().unwrap().0 -= needs[i];
            Ok(i)
        });
        assert_eq!(results.unwrap(), (0..60).collect::<Vec<_>>());
        let peak = used.into_inner().unwrap().1;
        assert!((10..=12).contains(&peak), "{peak}");
    }

    #[test]
    fn after_a_failure_nothing_further_is_begun() {
        let begun = AtomicUsize::new(0);
        let failed = in_parallel(1000, 2, &Budget::unlimited(), |i| {
            begun.fetch_add(1, Ordering::Relaxed);
            if i == 3 { Err(Error::usage("stop")) } else { Ok(()) }
        });
        assert!(matches!(failed, Err(Error::Usage(_))));
        assert!(begun.into_inner() < 1000);
    }
}
