//! [`prepare_photos`]: the store files of all photos of a job, built in parallel within a budget of memory.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::build::{Content, PhotoTiles, UNFINISHED_PREFIX};
use super::choice::{Reading, Way, choose};
use super::jpeg::IndexedJpeg;
use super::memory::MemoryTiles;
use super::parallel::{Budget, in_parallel};
use super::prepared::PreparedPhoto;
use super::survey::{LeftOut, Needed, PhotoSource, Survey, left_out_or_fatal, survey};
use crate::{Error, Result};

/// How photos are prepared.
#[derive(Debug, Clone, Copy)]
pub struct Preparation<'a> {
    /// The folder of the store files; made if it is not there.
    pub folder: &'a Path,
    /// Memory for decoding, in bytes; photos are decoded at once as far as working memory fits.
    pub budget_bytes: u64,
    /// Memory of others that is held meanwhile, in bytes: what is decoded at once leaves room for it, but one photo alone
    /// may always be.
    pub beside_bytes: u64,
    /// Threads to use, at least 1.
    pub threads: usize,
    /// Memory that decoded photos may keep, in bytes.
    pub memory_bytes: u64,
    /// How photos are read.
    pub reading: Reading,
}

impl Preparation<'_> {
    /// Memory for what is decoded at once.
    pub(super) fn free_bytes(&self) -> u64 {
        self.budget_bytes.saturating_sub(self.beside_bytes)
    }
}

/// How far the preparation has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Photos that are ready or left out.
    pub done: usize,
    /// All photos.
    pub total: usize,
}

/// What became of a photo.
type Outcome = std::result::Result<PreparedPhoto, LeftOut>;

/// Makes every photo that is needed ready to be read: in memory, by an index, or in a store file; files are used again
/// where they are there and match the photo. The samples are the same in any way.
///
/// The outcomes are in the order of `sources`. A photo that is missing, broken, unsupported or of another size than
/// expected is left out, with the reason; of one that is not needed only the header tells. `progress` is called from
/// several threads, once a photo. While files are made, a lock on the folder keeps other processes that would make some
/// waiting.
///
/// Steps: 1. in parallel, each header is read and each store file that matches is opened; 2. it is chosen how each
/// photo is read (see [`Reading::Auto`]), and if files are to be made, both again under the lock; 3. if a store file has
/// to be built that needs more than the budget, nothing is begun; 4. in parallel, photos are decoded and store files built.
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
) -> Result<Vec<PreparedPhoto>> {
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
    let done = AtomicUsize::new(0);
    let report = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(Progress { done, total: sources.len() })
    };
    let survey_all = || {
        let surveyed = in_parallel(sources.len(), preparation.threads, &Budget::unlimited(), |i| {
            survey(content, &sources[i], folder)
        });
        surveyed.map(|surveyed| Surveyed::new(content, surveyed, preparation))
    };
    // Processes that only read need not wait for one another, nor for one that decodes into its memory.
    let mut surveyed = survey_all()?;
    let _lock = if surveyed.writes(sources) {
        let lock = lock(folder)?;
        remove_leftovers(folder)?;
        surveyed = survey_all()?;
        Some(lock)
    } else {
        None
    };
    let Surveyed { mut outcomes, needed } = surveyed;
    outcomes.iter().flatten().try_for_each(|_| report())?;
    let works: Vec<_> = needed
        .iter()
        .map(|(number, photo, way)| Work { path: &sources[*number].path, photo, way: *way })
        .collect();
    let ready = make_all(content, &works, preparation, &report)?;
    for ((number, ..), outcome) in needed.iter().zip(ready) {
        outcomes[*number] = Some(outcome);
    }
    // None is left empty: a photo is known or was made ready.
    Ok(outcomes.into_iter().flatten().collect())
}

/// What is known of all photos: an outcome, or what is to be made ready, how, under its number.
struct Surveyed {
    outcomes: Vec<Option<Outcome>>,
    needed: Vec<(usize, Needed, Way)>,
}

impl Surveyed {
    fn new(content: Content, surveyed: Vec<Survey>, preparation: &Preparation<'_>) -> Self {
        let mut outcomes = Vec::with_capacity(surveyed.len());
        let (mut numbers, mut needed) = (Vec::new(), Vec::new());
        for (number, survey) in surveyed.into_iter().enumerate() {
            match survey {
                Survey::Known(outcome) => outcomes.push(Some(outcome)),
                Survey::Needed(photo) => {
                    outcomes.push(None);
                    numbers.push(number);
                    needed.push(photo);
                }
            }
        }
        let ways = choose(content, &needed, preparation);
        let needed = numbers.into_iter().zip(needed).zip(ways);
        let needed = needed.map(|((number, photo), way)| (number, photo, way)).collect();
        Self { outcomes, needed }
    }

    /// Whether a file has to be made.
    fn writes(&self, sources: &[PhotoSource]) -> bool {
        self.needed.iter().any(|(number, photo, way)| match way {
            Way::Memory => false,
            Way::Tiles => photo.existing.is_none(),
            Way::Index => known_index(photo, &sources[*number].path).is_none(),
        })
    }
}

/// The index that is there and matches the photo.
fn known_index(photo: &Needed, path: &Path) -> Option<IndexedJpeg> {
    let known = IndexedJpeg::open_checked(&photo.index, path).ok();
    known.filter(|known| known.fingerprint() == photo.fingerprint)
}

/// A photo to be made ready in the way that was chosen.
#[derive(Clone, Copy)]
struct Work<'a> {
    path: &'a Path,
    photo: &'a Needed,
    way: Way,
}

/// Makes photos ready. Those that turn out to have no index are built as store files in the end.
fn make_all(
    content: Content,
    works: &[Work<'_>],
    preparation: &Preparation<'_>,
    report: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Vec<Outcome>> {
    for work in works.iter().filter(|work| work.way == Way::Tiles) {
        check_budget(work, preparation.budget_bytes)?;
    }
    let held: u64 = works.iter().map(|work| work.way.held_bytes(work.photo)).sum();
    let bytes = preparation.free_bytes().saturating_sub(held);
    let in_turn = |works: &[Work<'_>]| {
        let needs = works.iter().map(|work| work.way.working_bytes(work.photo)).collect();
        in_parallel(works.len(), preparation.threads, &Budget { bytes, needs }, |i| {
            let made = left_out_or_fatal(make(content, works[i]), works[i].path)?;
            if !matches!(made, Ok(None)) {
                report()?;
            }
            Ok(made)
        })
    };
    let mut made = in_turn(works)?;
    let refused: Vec<_> = (0..works.len()).filter(|&k| matches!(made[k], Ok(None))).collect();
    let again: Vec<_> = refused.iter().map(|&k| Work { way: Way::Tiles, ..works[k] }).collect();
    for work in &again {
        check_budget(work, preparation.budget_bytes)?;
    }
    for (k, outcome) in refused.into_iter().zip(in_turn(&again)?) {
        made[k] = outcome;
    }
    // Store files are made or fail: none is left without an outcome.
    Ok(made.into_iter().filter_map(std::result::Result::transpose).collect())
}

/// Makes a photo ready; `None` if it has no index.
fn make(content: Content, work: Work<'_>) -> Result<Option<PreparedPhoto>> {
    let Work { path, photo, way } = work;
    let Needed { header, shape, fingerprint, store, index, existing, .. } = photo;
    Ok(Some(match (way, existing) {
        (Way::Memory, _) => {
            let tiles = Arc::new(MemoryTiles::decode(path, header, *shape)?);
            PreparedPhoto::memory(path, *shape, *fingerprint, tiles)
        }
        (Way::Tiles, Some(tiles)) => PreparedPhoto::tiles(tiles.clone()),
        (Way::Tiles, None) => PreparedPhoto::tiles_just_made(PhotoTiles::build_of(
            content,
            path,
            header,
            *fingerprint,
            store,
        )?),
        (Way::Index, _) => {
            // Not there, stale, cut or foreign: a new one takes its place.
            return Ok(match known_index(photo, path) {
                Some(known) => Some(PreparedPhoto::indexed(known)),
                None => IndexedJpeg::build(path, header, *fingerprint, index)?
                    .map(PreparedPhoto::indexed),
            });
        }
    }))
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

fn check_budget(work: &Work<'_>, budget_bytes: u64) -> Result<()> {
    let needed_bytes = work.way.working_bytes(work.photo);
    if needed_bytes <= budget_bytes {
        return Ok(());
    }
    Err(Error::OverBudget {
        what: format!("decoding {}", work.path.display()),
        needed_bytes,
        allowed_bytes: budget_bytes,
        hint: Some("allow more memory, or save the photo as a TIFF in strips or a PNG that is not interlaced".into()),
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use image::ExtendedColorType;

    use super::super::PhotoStore;
    use super::super::build::working_bytes;
    use super::super::prepared::Demand;
    use super::super::survey::check_headers;
    use super::super::tests::write_photo;
    use super::*;
    use crate::geom::{PixelRect, Size};
    use crate::input::photo::read_photo_header;

    /// Into store files, on two threads.
    fn preparation(folder: &Path, budget_bytes: u64) -> Preparation<'_> {
        Preparation {
            folder,
            budget_bytes,
            beside_bytes: 0,
            threads: 2,
            memory_bytes: 0,
            reading: Reading::Tiles,
        }
    }

    fn source(folder: &Path, name: &str, expected: Option<Size>) -> PhotoSource {
        PhotoSource {
            name: name.to_string(),
            path: folder.join(name),
            expected,
            demand: Some(Demand::ALL),
        }
    }

    fn prepare(sources: &[PhotoSource], folder: &Path) -> Result<Vec<Outcome>> {
        let folder = folder.join("store");
        let preparation = Preparation { threads: 3, ..preparation(&folder, 1 << 30) };
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
    fn a_process_that_makes_no_file_does_not_wait_for_one_that_does() {
        let folder = tempfile::tempdir().unwrap();
        write_photo(&folder.path().join("a.png"), Size::new(300, 40), ExtendedColorType::L8);
        let sources = [source(folder.path(), "a.png", None)];
        prepare(&sources, folder.path()).unwrap().remove(0).unwrap();
        let held = lock(&folder.path().join("store")).unwrap();
        let (sender, receiver) = std::sync::mpsc::channel();
        let at = folder.path().to_path_buf();
        let reader = std::thread::spawn(move || {
            sender.send(prepare(&sources, &at).unwrap().remove(0).is_ok()).unwrap();
        });
        assert_eq!(receiver.recv_timeout(std::time::Duration::from_mins(1)), Ok(true));
        reader.join().unwrap();
        drop(held);
    }

    #[test]
    fn a_store_is_used_again_while_it_matches_and_made_again_when_not() {
        let folder = tempfile::tempdir().unwrap();
        let photo = folder.path().join("a.png");
        write_photo(&photo, Size::new(300, 40), ExtendedColorType::L8);
        let sources = [source(folder.path(), "a.png", None)];
        let first = prepare(&sources, folder.path()).unwrap().remove(0).unwrap();
        let written = std::fs::read(first.store_path().unwrap()).unwrap();

        // Marked where only a reader of tiles looks: if it is still there, the file was not made again.
        let mut marked = written.clone();
        *marked.last_mut().unwrap() ^= 1;
        std::fs::write(first.store_path().unwrap(), &marked).unwrap();
        let again = prepare(&sources, folder.path()).unwrap().remove(0).unwrap();
        assert_eq!(again.source, first.source);
        assert_eq!((first.pixels_decoded, again.pixels_decoded), (12_000, 0));
        assert_eq!(std::fs::read(first.store_path().unwrap()).unwrap(), marked);

        // Damaged in header or index, cut, or foreign: made again, to the same bytes.
        let mut damaged = Vec::new();
        for at in [0, 9, 20, 40, 70, 120] {
            let mut bytes = written.clone();
            bytes[at] ^= 4;
            damaged.push(bytes);
        }
        damaged.extend([written[..written.len() - 1].to_vec(), Vec::new(), b"else".to_vec()]);
        for bytes in damaged {
            std::fs::write(first.store_path().unwrap(), bytes).unwrap();
            assert_eq!(prepare(&sources, folder.path()).unwrap().remove(0).unwrap(), first);
            assert_eq!(std::fs::read(first.store_path().unwrap()).unwrap(), written);
        }

        // Another photo under the same name: made again, with its pixels.
        write_photo(&photo, Size::new(30, 40), ExtendedColorType::L8);
        let second = prepare(&sources, folder.path()).unwrap().remove(0).unwrap();
        assert_eq!((second.store_path(), second.size()), (first.store_path(), Size::new(30, 40)));
        assert!(second.fingerprint() != first.fingerprint());
        PhotoStore::new([(0, second)], 0).unwrap();
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
    fn of_a_photo_that_is_not_needed_the_header_alone_is_checked() {
        let folder = tempfile::tempdir().unwrap();
        let size = Size::new(300, 200);
        for name in ["whole.jpg", "cut.jpg", "small.jpg"] {
            write_photo(&folder.path().join(name), size, ExtendedColorType::Rgb8);
        }
        let cut = folder.path().join("cut.jpg");
        let bytes = std::fs::read(&cut).unwrap();
        std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
        let unneeded = |name, expected| PhotoSource {
            demand: None,
            ..source(folder.path(), name, Some(expected))
        };
        let sources = [
            unneeded("whole.jpg", size),
            unneeded("cut.jpg", size),
            unneeded("small.jpg", Size::new(600, 400)),
            unneeded("missing.jpg", size),
        ];
        let outcomes = prepare(&sources, folder.path()).unwrap();
        let is_ready: Vec<_> = outcomes.iter().map(std::result::Result::is_ok).collect();
        assert_eq!(is_ready, [true, true, false, false]);
        let headers = check_headers(&sources, 2).unwrap();
        assert_eq!(headers.iter().map(std::result::Result::is_ok).collect::<Vec<_>>(), is_ready);
        // No store, and no lock: nothing is to be made.
        assert_eq!(std::fs::read_dir(folder.path().join("store")).unwrap().count(), 0);
        // Its shape is known; a window of it is an error, not a picture.
        let ready = outcomes.into_iter().next().unwrap().unwrap();
        let store = PhotoStore::new([(0, ready)], 1 << 20).unwrap();
        assert_eq!((store.channels(0), store.bits(0), store.level_size(0, 0)), (3, 8, size));
        let e = store.window(0, 0, PixelRect::new(0, 0, 1, 1)).unwrap_err();
        assert!(e.to_string().contains("whole.jpg"), "{e}");
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
            let preparation = preparation(&store, budget_bytes);
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
            let preparation = preparation(&store, 200 << 20);
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
        let store = folder.path().join("s");
        let preparation = preparation(&store, 1 << 30);
        let note = |p: Progress| {
            seen.lock().unwrap().push((p.done, p.total));
            Ok(())
        };
        prepare_photos(&sources, &preparation, &note).unwrap();
        let mut seen = seen.into_inner().unwrap();
        seen.sort_unstable();
        assert_eq!(seen, [(1, 3), (2, 3), (3, 3)]);
    }
}
