//! `groundel plan`: a job's stores and its manifest, for any machine to render from.

use std::fs;

use super::super::config::Config;
use super::super::console;
use super::super::job_args::PlanArgs;
use super::super::ortho::{ExitStatus, Inputs, Place, Planned, add_tin, budget, on_threads, plan};
use super::batches::cut;
use super::changed::{self, Earlier};
use super::folder::JobFolder;
use crate::batch::{TileAddress, curve_order};
use crate::plan::tile_weight;
use crate::{Error, Result};

/// Pixels of a batch where nothing is said of batches: a worker of two processors has some minutes to do.
const BATCH_PIXELS: f64 = 100e6;
/// More batches than this are a mistake: each is a file.
const MOST_BATCHES: u64 = 99_999;

/// Plans the job that `args` ask for in its folder. A job that is there already and is the same stays as it is, its
/// finished batches too.
///
/// # Errors
/// Bad input, a job over budget, another job in the folder, or a failed file operation.
pub(in crate::cli) fn run(args: PlanArgs) -> Result<ExitStatus> {
    let folder = JobFolder::new(&args.job);
    let config = Config::build_for(&folder, *args.ortho)?;
    let cutting = Cutting { batches: args.batches, batch_mpx: args.batch_mpx };
    on_threads(config.threads, || stages(&config, &folder, &cutting, args.changed))
}

/// How many batches are asked for.
struct Cutting {
    batches: Option<u32>,
    batch_mpx: Option<f64>,
}

fn stages(
    config: &Config,
    folder: &JobFolder,
    cutting: &Cutting,
    is_change: bool,
) -> Result<ExitStatus> {
    let shares = budget(config)?;
    let mut inputs = Inputs::read(config)?;
    let earlier = Earlier::find(folder, is_change)?;
    let stores = folder.stores();
    fs::create_dir_all(&stores).map_err(|e| Error::io(&stores, e))?;
    add_tin(config, &mut inputs, &shares)?;
    let mut planned = plan(config, &inputs, shares, Place::Own(folder))?;
    let weights = weights(&planned);
    let pixels = planned.job.mosaic.size.area();
    let count = cutting.count(pixels, weights.len())?;
    planned.job.record.batches = match earlier.batches(&planned.job.record) {
        Some(batches) if cutting.is_open() => batches.to_vec(),
        _ => cut(&weights, count),
    };
    changed::replace(earlier, &planned.job, config.quiet)?;
    let record = &planned.job.record;
    let (count, tiles) = (record.batch_count(), weights.len());
    let job = folder.path().display();
    console::answer(&format!("{job}: {tiles} tiles in {count} batches, 0 to {}\n", count - 1));
    Ok(ExitStatus::of(record.inputs.cameras.left_out.len()))
}

impl Cutting {
    /// Whether nothing is asked for.
    fn is_open(&self) -> bool {
        self.batches.is_none() && self.batch_mpx.is_none()
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive; saturates"
    )]
    fn count(&self, pixels: u64, tiles: usize) -> Result<usize> {
        let per_batch = self.batch_mpx.map_or(BATCH_PIXELS, |mpx| mpx * 1e6);
        let by_size = (pixels as f64 / per_batch).ceil() as u64;
        let count = self.batches.map_or(by_size, u64::from).clamp(1, tiles as u64);
        if count > MOST_BATCHES {
            let what = "batches of the job".into();
            return Err(Error::Limit { what, limit: MOST_BATCHES, found: count });
        }
        Ok(usize::try_from(count).unwrap_or(1))
    }
}

/// The estimated work of each tile, along the curve.
fn weights(planned: &Planned) -> Vec<f64> {
    let manifest = &planned.job.record.manifest;
    let weight =
        |tile: &TileAddress| tile_weight(&planned.survey.within(manifest.tile_rect(*tile)));
    curve_order(&manifest.pyramid()).iter().map(weight).collect()
}
