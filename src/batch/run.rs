//! [`run`]: tiles rendered by all threads, encoded where they are rendered, written by one.
//!
//! Workers take the next tile from one counter, so that tiles under way at the same time are neighbours in the given
//! order and the caches behind the renderer stay warm. A finished tile is encoded by its worker, which also makes the
//! overview tiles that it completes. Encoded tiles go through a bounded channel to the one thread that writes the
//! part; when the disk is slow, the channel is full and the workers wait. The first error ends the run; what was
//! finished before is in the part, and the next run goes on from there to the same bytes.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use crossbeam::channel::{Receiver, Sender, bounded};

use super::gauge::Gauge;
use super::known::{Known, Work};
use super::notes::note_layer;
use super::{Manifest, PartReader, PartState, PartWriter, TileAddress};
use crate::output::{OverviewBuilder, Quarter, Raster, Scratch, TileKey, encode_tile};
use crate::{Error, Result};

/// Encoded tiles that may wait for the disk, for each thread.
const QUEUE_PER_THREAD: usize = 2;

/// Renders one tile; a pure function of its address, whatever the thread and the order.
pub trait TileRenderer: Sync {
    /// Working memory of one thread, made once for each.
    type Scratch;

    /// New working memory.
    fn scratch(&self) -> Self::Scratch;

    /// Renders a tile.
    ///
    /// # Errors
    /// Whatever keeps the tile from being rendered; it ends the run.
    fn render(&self, tile: TileAddress, scratch: &mut Self::Scratch) -> Result<Rendered>;
}

/// A rendered tile.
#[derive(Debug, Clone)]
pub struct Rendered {
    /// One raster for each layer of the manifest, in its order, each of the size of [`Manifest::tile_rect`].
    pub rasters: Vec<Raster>,
    /// What was found on the tile, in the renderer's own words: it is kept beside the tile, see [`super::notes`].
    pub note: Vec<u8>,
}

impl<F: Fn(TileAddress) -> Result<Vec<Raster>> + Sync> TileRenderer for F {
    type Scratch = ();

    fn scratch(&self) {}

    fn render(&self, tile: TileAddress, (): &mut ()) -> Result<Rendered> {
        Ok(Rendered { rasters: self(tile)?, note: Vec::new() })
    }
}

/// What a run is to make, and where.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// The job.
    pub manifest: &'a Manifest,
    /// The part that the run writes. If it is there and of this job, the run goes on from it; a part of another job
    /// is replaced.
    pub part: &'a Path,
    /// The part's file if this process has locked it already; else the run locks it.
    pub held: Option<&'a File>,
    /// Finished parts of the same job, whose tiles need not be made again.
    pub others: &'a [PathBuf],
    /// The tiles to make, in the order in which to make them; each once.
    pub tiles: &'a [TileAddress],
}

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Tiles that are done, those of earlier runs counted.
    pub done: usize,
    /// Tiles that the run is to make, those of earlier runs counted.
    pub total: usize,
    /// The tile that has just been rendered.
    pub tile: TileAddress,
}

/// What a run did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunSummary {
    /// Tiles rendered.
    pub rendered: usize,
    /// Tiles that were there before.
    pub reused: usize,
    /// Bytes of finished tiles held at most, as pixels, quarters of overviews, or encoded and waiting for the disk.
    pub peak_bytes: u64,
}

/// The tiles of a job that a part holds with all their layers: a run over it will not render them again. None if the
/// part is missing or of another job.
///
/// # Errors
/// If what stands under its name cannot be read or is no part.
pub fn completed(manifest: &Manifest, part: &Path) -> Result<Vec<TileAddress>> {
    let PartState::Own(part) = PartState::of(part, manifest)? else { return Ok(Vec::new()) };
    let known = Known::new(manifest, vec![part]);
    let tiles = manifest.pyramid().level_tiles(0);
    Ok(tiles.filter(|t| known.has(*t)).map(|t| TileAddress { x: t.x, y: t.y }).collect())
}

/// Makes the tiles of a run on all threads of the current rayon pool. `progress` is called once a rendered tile, by
/// the thread that rendered it.
///
/// # Errors
/// The first error of the renderer, the disk or `progress`; the part then holds what was finished before and can be
/// resumed.
///
/// # Panics
/// If a tile is outside the mosaic or comes twice, or a raster has not the size or the samples that it should.
pub fn run<R: TileRenderer>(
    run: &Run<'_>,
    renderer: &R,
    progress: &(dyn Fn(Progress) -> Result<()> + Sync),
) -> Result<RunSummary> {
    check_tiles(run);
    let mut parts = Vec::new();
    let own = match PartState::of(run.part, run.manifest)? {
        PartState::Own(part) => Some(part),
        PartState::Missing | PartState::Foreign => None,
    };
    let was_finished = own.as_ref().is_some_and(PartReader::is_finished);
    let resumed = own.is_some();
    parts.extend(own);
    for other in run.others {
        parts.push(PartReader::open(other, run.manifest)?);
    }
    let known = Known::new(run.manifest, parts);
    let work = known.work(run.tiles);
    let rendered = work.iter().filter(|w| matches!(w, Work::Render(_))).count();
    let reused = run.tiles.len() - rendered;
    let summary = RunSummary { rendered, reused, peak_bytes: 0 };
    if work.is_empty() && was_finished {
        return Ok(summary);
    }
    let writer = match known.parts().first() {
        Some(part) if resumed => PartWriter::resume(part, run.held)?,
        _ => PartWriter::create(run.part, run.held, run.manifest.fingerprint())?,
    };
    let crew = Crew {
        known: &known,
        manifest: run.manifest,
        work: &work,
        next: AtomicUsize::new(0),
        done: AtomicUsize::new(summary.reused),
        total: run.tiles.len(),
        builder: Mutex::new(OverviewBuilder::new(run.manifest.pyramid())),
        stop: AtomicBool::new(false),
        error: Mutex::new(None),
        held: Gauge::default(),
    };
    let peak_bytes = crew.make(renderer, progress, writer)?;
    Ok(RunSummary { peak_bytes, ..summary })
}

fn check_tiles(run: &Run<'_>) {
    let pyramid = run.manifest.pyramid();
    assert!(run.tiles.iter().all(|t| pyramid.contains((*t).into())), "tiles are of the mosaic");
    let mut sorted = run.tiles.to_vec();
    sorted.sort_unstable();
    assert!(sorted.is_sorted_by(|a, b| a < b), "a tile comes once");
}

/// An encoded tile on its way to the disk.
struct Record {
    layer: usize,
    tile: TileKey,
    bytes: Vec<u8>,
}

/// What the workers of a run share.
struct Crew<'a> {
    known: &'a Known<'a>,
    manifest: &'a Manifest,
    work: &'a [Work],
    next: AtomicUsize,
    done: AtomicUsize,
    total: usize,
    builder: Mutex<OverviewBuilder>,
    stop: AtomicBool,
    error: Mutex<Option<Error>>,
    /// Bytes of finished tiles.
    held: Gauge,
}

/// Stops the other workers if this one panics.
struct StopOnPanic<'a>(&'a AtomicBool);

impl Drop for StopOnPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.store(true, Ordering::Relaxed);
        }
    }
}

impl Crew<'_> {
    fn make<R: TileRenderer>(
        self,
        renderer: &R,
        progress: &(dyn Fn(Progress) -> Result<()> + Sync),
        writer: PartWriter,
    ) -> Result<u64> {
        let queue = QUEUE_PER_THREAD * rayon::current_num_threads();
        let (sender, receiver) = bounded(queue);
        let written = std::thread::scope(|scope| {
            let writing = scope.spawn(|| self.write(writer, receiver));
            rayon::broadcast(|_| {
                let _guard = StopOnPanic(&self.stop);
                let sender = sender.clone();
                if let Err(e) = self.labour(renderer, progress, &sender) {
                    self.fail(e);
                }
            });
            drop(sender);
            writing.join()
        });
        let writer = match written {
            Ok(result) => result?,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        match self.error.into_inner().unwrap_or_else(PoisonError::into_inner) {
            None => writer.finish().map(|()| self.held.peak()),
            Some(e) => {
                writer.suspend()?;
                Err(e)
            }
        }
    }

    fn fail(&self, e: Error) {
        self.stop.store(true, Ordering::Relaxed);
        self.error.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(e);
    }

    /// The writer's thread: appends what comes until all workers are gone. When it fails, the channel closes, and
    /// the workers stop.
    fn write(&self, mut writer: PartWriter, receiver: Receiver<Record>) -> Result<PartWriter> {
        for record in receiver {
            let appended = writer.append(record.layer, record.tile, &record.bytes);
            self.held.give_back(record.bytes.len() as u64);
            if let Err(e) = appended {
                self.stop.store(true, Ordering::Relaxed);
                return Err(e);
            }
        }
        Ok(writer)
    }

    /// A worker: takes the next piece of work until there is none.
    fn labour<R: TileRenderer>(
        &self,
        renderer: &R,
        progress: &(dyn Fn(Progress) -> Result<()> + Sync),
        sender: &Sender<Record>,
    ) -> Result<()> {
        let mut own = renderer.scratch();
        let mut scratch = Scratch::default();
        while !self.stop.load(Ordering::Relaxed) {
            let Some(work) = self.work.get(self.next.fetch_add(1, Ordering::Relaxed)) else {
                break;
            };
            match work {
                Work::Restore(tile) => {
                    let rasters = self.known.rasters(*tile, &mut scratch)?;
                    self.deliver(*tile, rasters, sender, &mut scratch);
                }
                Work::Render(address) => {
                    let Rendered { rasters, note } = renderer.render(*address, &mut own)?;
                    let tile = (*address).into();
                    self.check(tile, &rasters);
                    // The note first: where all layers are, it is.
                    let layer = note_layer(self.manifest);
                    if self.queue(Record { layer, tile, bytes: note }, sender) {
                        self.deliver(tile, rasters, sender, &mut scratch);
                    }
                    let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
                    progress(Progress { done, total: self.total, tile: *address })?;
                }
            }
        }
        Ok(())
    }

    fn check(&self, tile: TileKey, rasters: &[Raster]) {
        let size = self.manifest.pyramid().tile_pixels(tile);
        assert_eq!(rasters.len(), self.manifest.layers().len(), "{tile}: one raster a layer");
        assert!(rasters.iter().all(|r| r.size() == size), "{tile}: rasters of its size");
    }

    /// Sends a tile to the disk, then the overview tiles that it completes.
    fn deliver(
        &self,
        tile: TileKey,
        rasters: Vec<Raster>,
        sender: &Sender<Record>,
        scratch: &mut Scratch,
    ) {
        let layers = self.manifest.layers();
        let (mut tile, mut rasters) = (tile, rasters);
        loop {
            let bytes = rasters.iter().map(Raster::bytes).sum();
            self.held.take(bytes);
            let is_kept = self.known.has(tile) || self.send(tile, &rasters, sender, scratch);
            // A quarter is made without the lock, and so is the tile that it completes.
            let wanted = tile.level + 1 < self.manifest.pyramid().levels();
            if !is_kept || !wanted || self.known.has(tile.parent()) {
                self.held.give_back(bytes);
                return;
            }
            let quarter = Quarter::of(tile, layers, &rasters);
            self.held.take(quarter.bytes());
            drop(rasters);
            self.held.give_back(bytes);
            let gathered = self.builder.lock().unwrap_or_else(PoisonError::into_inner).add(quarter);
            let Some(gathered) = gathered else { return };
            // Its quarters go when it is joined.
            self.held.give_back(gathered.bytes());
            tile = gathered.tile();
            rasters = gathered.into_rasters();
        }
    }

    /// Encodes and sends all layers of a tile; false if the writer has gone.
    fn send(
        &self,
        tile: TileKey,
        rasters: &[Raster],
        sender: &Sender<Record>,
        scratch: &mut Scratch,
    ) -> bool {
        let (format, layers) = (self.manifest.format(), self.manifest.layers());
        let a_section = layers.len() / self.manifest.sections();
        // The tiles of the section before, where there are several: equal pixels are equal bytes.
        let mut before: Vec<Vec<u8>> = Vec::new();
        layers.iter().zip(rasters).enumerate().all(|(i, (layer, raster))| {
            let is_like = |k: usize| layers[k].is_like(layer) && rasters[k].is_same(raster);
            let bytes = match i.checked_sub(a_section).filter(|&k| is_like(k)) {
                Some(_) => std::mem::take(&mut before[i % a_section]),
                None => encode_tile(layer, raster, format.tile_size, format.compression, scratch),
            };
            if self.manifest.sections() > 1 {
                before.resize(a_section.max(before.len()), Vec::new());
                before[i % a_section].clone_from(&bytes);
            }
            self.queue(Record { layer: i, tile, bytes }, sender)
        })
    }

    /// Sends a record to the disk; false if the writer has gone.
    fn queue(&self, record: Record, sender: &Sender<Record>) -> bool {
        self.held.take(record.bytes.len() as u64);
        sender.send(record).is_ok()
    }
}
