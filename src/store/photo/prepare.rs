//! [`prepare_photos`]: the store files of all photos of a job, built in parallel within a budget of memory.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};

use xxhash_rust::xxh3::xxh3_128;

use super::build::{PhotoFingerprint, PhotoTiles, working_bytes};
use crate::geom::Size;
use crate::input::photo::{PhotoHeader, read_photo_header};
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
/// expected is left out, with the reason. `progress` is called from several threads, once a photo.
///
/// Steps: 1. in parallel, each header is read and each store file that matches is opened; 2. if one of the others
/// needs more than the budget, nothing is begun; 3. in parallel, these are built.
///
/// # Errors
/// [`Error::OverBudget`] if a photo cannot be decoded within the budget; [`Error::Io`] for the folder, a full disk,
/// or a photo that is there but cannot be read.
pub fn prepare_photos(
    sources: &[PhotoSource],
    preparation: &Preparation<'_>,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<Outcome>> {
    let folder = preparation.folder;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    let done = AtomicUsize::new(0);
    let report = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(Progress { done, total: sources.len() });
    };
    let surveyed = in_parallel(sources.len(), preparation.threads, &Budget::unlimited(), |i| {
        let survey = survey(&sources[i], folder)?;
        if matches!(survey, Survey::Known(_)) {
            report();
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
        let built = PhotoTiles::build(path, &work.header, work.fingerprint, &work.store);
        let outcome = left_out_or_fatal(built, path)?;
        report();
        Ok(outcome)
    })?;
    for ((number, _), outcome) in works.iter().zip(built) {
        outcomes[*number] = Some(outcome);
    }
    // None is left empty: a photo is known or was built.
    Ok(outcomes.into_iter().flatten().collect())
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

fn survey(source: &PhotoSource, folder: &Path) -> Result<Survey> {
    let header = match left_out_or_fatal(read_photo_header(&source.path), &source.path)? {
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
        hint: Some("allow more memory, or save the photo as a PNG that is not interlaced".into()),
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
