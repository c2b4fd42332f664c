//! The stages of `groundel ortho`, in order.

use std::fs;

use super::super::config::Config;
use super::super::console;
use super::super::interrupt;
use super::super::progress::Progress;
use super::inputs::Inputs;
use super::job::Job;
use super::reporting;
use super::stores::Stores;
use crate::batch::{
    Assembly, Run, SceneTiles, assemble, completed, curve_order, run as run_batch, statistics,
};
use crate::frame::frame_toml;
use crate::output::{BigTiff, write_atomically};
use crate::render::Budget;
use crate::report::StageLog;
use crate::{Error, Result};

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
    let budget = Budget::new(config.memory_bytes, config.threads);
    let inputs = log.run("inputs", || Inputs::read(config))?;
    let mesh = log.run("mesh store", || Stores::build_mesh(config, &inputs, &budget))?;
    let stores = log.run("photo store", || Stores::build(config, &inputs, mesh, &budget))?;
    fs::create_dir_all(&config.work).map_err(|e| Error::io(&config.work, e))?;
    for left_out in &stores.left_out {
        console::note(&format!("groundel: {} is left out: {}", left_out.photo, left_out.reason));
    }
    let job = log.run("plan", || Job::plan(config, &inputs, stores))?;
    log.run("tiles", || tiles(config, &job, &budget))?;
    let parts = std::slice::from_ref(&job.part);
    let statistics = statistics(&job.manifest, parts, inputs.cameras.names.len())?;
    log.run("files", || files(config, &job))?;
    reporting::report(config, &inputs, &job, &statistics, &log)?;
    Ok(if job.left_out.is_empty() { ExitStatus::Done } else { ExitStatus::PhotosLeftOut })
}

/// Renders every tile into the job's part file.
fn tiles(config: &Config, job: &Job, budget: &Budget) -> Result<()> {
    let order = curve_order(&job.manifest.pyramid());
    let renderer = SceneTiles::new(&job.scene, &job.manifest, budget.block_bytes);
    let kept = completed(&job.manifest, &job.part)?.len();
    if kept > 0 && !config.quiet {
        console::note(&format!("groundel: going on after {kept} of {} tiles", order.len()));
    }
    let left = (order.len() - kept) as u64;
    let progress = Progress::start("rendering", "tiles", left, config.quiet);
    let batch = Run { manifest: &job.manifest, part: &job.part, others: &[], tiles: &order };
    let done = run_batch(&batch, &renderer, &|_| progress.add(1));
    progress.finish();
    done.map(|_| ())
}

/// Assembles the final files: layers first, the mosaic last.
fn files(config: &Config, job: &Job) -> Result<()> {
    write_atomically(config.frame_file(), frame_toml(&job.mosaic).as_bytes())?;
    let assembly = Assembly {
        manifest: &job.manifest,
        parts: std::slice::from_ref(&job.part),
        outputs: &job.outputs,
        big_tiff: BigTiff::IfNeeded,
    };
    assemble(&assembly, &interrupt::check)?;
    fs::remove_dir_all(&job.folder).map_err(|e| Error::io(&job.folder, e))
}
