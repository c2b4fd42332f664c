//! The stages of `groundel ortho`, in order.

use std::fs;

use super::super::config::Config;
use super::super::console;
use super::super::interrupt;
use super::super::progress::Progress;
use super::super::sidecars::beside;
use super::forecast::{Outlook, Planned};
use super::grid::grid;
use super::inputs::Inputs;
use super::job::Job;
use super::outputs;
use super::reporting::{self, Outcome};
use super::stores::{Stores, UsablePhotos};
use crate::batch::{
    Assembly, Run, SceneTiles, TileAddress, assemble, completed, curve_order, run as run_batch,
    statistics,
};
use crate::image::{Colour, Depth};
use crate::output::{BigTiff, Layer};
use crate::plan::{Survey, photo_needs, tile_weight};
use crate::render::{Budget, TileDemand};
use crate::report::{MemoryUse, StageLog};
use crate::{Error, Result};

/// Overview levels that memory is set aside for: those of a mosaic 2¹⁰ tiles wide.
const MOST_LEVELS: u64 = 10;

/// How a command that made all it was asked for has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExitStatus {
    /// Everything was used.
    Done,
    /// Some photos had to be left out; each was named.
    PhotosLeftOut,
}

impl ExitStatus {
    /// The exit code of the command.
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::PhotosLeftOut => 1,
        }
    }
}

/// Makes the mosaic that `config` asks for.
///
/// # Errors
/// Bad input, a job over budget, or a failed file operation; no file bears a final name then.
pub(in crate::cli) fn run(config: &Config) -> Result<ExitStatus> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(config.threads).build();
    let pool = pool.map_err(|e| Error::usage(format!("--threads {}: {e}", config.threads)))?;
    pool.install(|| stages(config))
}

fn stages(config: &Config) -> Result<ExitStatus> {
    let mut log = StageLog::start();
    let budget = Budget::new(config.memory_bytes, config.threads, demand(config))?;
    let inputs = log.run("inputs", || Inputs::read(config))?;
    outputs::check(config, &inputs)?;
    let outlook = Outlook::before(config, &inputs, &budget)?;
    let mesh = log.run("mesh store", || Stores::build_mesh(config, &inputs, &budget))?;
    let budget = budget.with_mesh(mesh.file_bytes());
    let photos = log.run("photo headers", || UsablePhotos::check(config, &inputs))?;
    let (mosaic, needs) = log.run("grid", || {
        let mosaic = grid(config, &mesh, &inputs.cameras, &photos.photos)?;
        let needs = photo_needs(&mesh, &mosaic, &photos.photos);
        Ok((mosaic, needs))
    })?;
    let scene = Planned { mesh: &mesh, mosaic: &mosaic, photos: &photos.photos, needs: &needs };
    let (outlook, survey) = outlook.of_all(config, &budget, &scene)?;
    let stores =
        log.run("photo store", || Stores::build(config, &inputs, mesh, (photos, &needs), &budget))?;
    fs::create_dir_all(&config.work).map_err(|e| Error::io(&config.work, e))?;
    for left_out in &stores.left_out {
        console::note(&format!("groundel: {} is left out: {}", left_out.photo, left_out.reason));
    }
    let job = log.run("plan", || Job::plan(config, &inputs, mosaic, stores))?;
    for warning in &job.warnings {
        console::note(&format!("groundel: warning: {warning}"));
    }
    let memory = log.run("tiles", || tiles(config, &job, &budget, &survey))?;
    let parts = std::slice::from_ref(&job.part);
    let statistics = statistics(&job.manifest, parts, inputs.cameras.names.len())?;
    log.run("files", || files(config, &job))?;
    let outcome = Outcome { config, inputs: &inputs, job: &job, statistics, memory, outlook, log };
    reporting::report(&outcome)?;
    Ok(if job.left_out.is_empty() { ExitStatus::Done } else { ExitStatus::PhotosLeftOut })
}

/// What finished tiles take: known before anything is read, but for the colours, of which the most is assumed.
fn demand(config: &Config) -> TileDemand {
    let layers = config.layers.iter().filter_map(|&meaning| Layer::of(meaning));
    let mosaic = Layer::mosaic(Colour::Rgb, Depth::Sixteen);
    let pixel_bytes = layers.chain([mosaic]).map(|layer| layer.pixel_bytes() as u64).sum();
    TileDemand { tile_size: config.tile_size, pixel_bytes, levels: MOST_LEVELS }
}

/// Renders every tile into the job's part file; who held how much memory meanwhile.
fn tiles(config: &Config, job: &Job, budget: &Budget, survey: &Survey) -> Result<Vec<MemoryUse>> {
    let order = curve_order(&job.manifest.pyramid());
    let renderer = SceneTiles::new(&job.scene, &job.manifest, budget.block_bytes);
    let kept = completed(&job.manifest, &job.part)?;
    if !kept.is_empty() && !config.quiet {
        console::note(&format!("groundel: going on after {} of {} tiles", kept.len(), order.len()));
    }
    let weight = |tile: TileAddress| tile_weight(&survey.within(job.manifest.tile_rect(tile)));
    let sum = |tiles: &[TileAddress]| tiles.iter().map(|&t| weight(t)).sum::<f64>();
    let left = (order.len() - kept.len()) as u64;
    let progress = Progress::start("rendering", "tiles", left, config.quiet)
        .weighted(sum(&order) - sum(&kept));
    let batch = Run { manifest: &job.manifest, part: &job.part, others: &[], tiles: &order };
    let done = run_batch(&batch, &renderer, &|p| progress.add_weighted(1, weight(p.tile)));
    progress.finish();
    let finished = done?.peak_bytes;
    let blocks = renderer.peak_bytes() * config.threads as u64;
    let scene = &job.scene;
    // Those of masks counted.
    let stores = [Some(&scene.pixels), scene.masks.as_ref()];
    let photo_bytes = stores.into_iter().flatten().map(|s| s.statistics().peak_bytes).sum();
    let held = |consumer: &str, share_bytes, peak_bytes| MemoryUse {
        consumer: consumer.into(),
        share_bytes,
        peak_bytes,
    };
    Ok(vec![
        held("mesh store", budget.mesh_bytes, scene.mesh.held_bytes()),
        held("photo tiles", budget.photo_bytes, photo_bytes),
        held("blocks", budget.block_bytes * config.threads as u64, blocks),
        held("finished tiles", budget.output_bytes, finished),
    ])
}

/// Assembles the final files: layers first, then what lies beside the mosaic, the mosaic last.
fn files(config: &Config, job: &Job) -> Result<()> {
    let beside = beside(config, &job.manifest, &job.mosaic)?;
    let assembly = Assembly {
        manifest: &job.manifest,
        parts: std::slice::from_ref(&job.part),
        outputs: &job.outputs,
        beside: &beside,
        big_tiff: BigTiff::IfNeeded,
    };
    assemble(&assembly, &interrupt::check)?;
    fs::remove_dir_all(&job.folder).map_err(|e| Error::io(&job.folder, e))
}
