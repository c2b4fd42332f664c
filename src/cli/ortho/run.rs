//! `groundel ortho`: a job is planned, rendered in one batch, and assembled.

use std::fs;

use super::super::config::Config;
use super::super::console;
use super::super::job::{BatchRun, Files, assemble_files};
use super::inputs::Inputs;
use super::job::{Job, Place};
use super::outputs;
use super::planning::{Planned, budget, plan, sections_at_once};
use super::points::add_tin;
use super::reporting::{Found, Outcome, found};
use crate::batch::{Rivals, TileAddress, statistics};
use crate::plan::tile_weight;
use crate::report::{MemoryUse, PhotoPixels, Run, StageLog, peak_resident_bytes};
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

    /// The end of a job of which photos were left out, or none.
    pub(in crate::cli) fn of(left_out: usize) -> Self {
        if left_out == 0 { Self::Done } else { Self::PhotosLeftOut }
    }
}

/// Runs `work` on so many threads.
///
/// # Errors
/// If there cannot be so many; those of the work.
pub(in crate::cli) fn on_threads<T: Send>(
    threads: usize,
    work: impl FnOnce() -> Result<T> + Send,
) -> Result<T> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Error::usage(format!("--threads {threads}: {e}")))?.install(work)
}

/// Makes the mosaic that `config` asks for.
///
/// # Errors
/// Bad input, a job over budget, or a failed file operation; no file bears a final name then.
pub(in crate::cli) fn run(config: &Config) -> Result<ExitStatus> {
    on_threads(config.threads, || stages(config))
}

fn stages(config: &Config) -> Result<ExitStatus> {
    let mut log = StageLog::start();
    let groups = groups(config);
    for group in &groups {
        budget(group)?;
    }
    let mut inputs = log.run("inputs", || Inputs::read(config))?;
    outputs::check(config, &inputs)?;
    if !inputs.clouds.is_empty() {
        log.run("point clouds", || add_tin(config, &mut inputs, &budget(&groups[0])?))?;
    }
    let mut all = Vec::new();
    let mut last = None;
    for (number, group) in groups.iter().enumerate() {
        // The stores of the group before are closed.
        drop(last.take());
        if groups.len() > 1 && !config.quiet {
            let (sections, all) = (group.sections.len(), groups.len());
            console::note(&format!(
                "groundel: {sections} sections, part {} of {all}: --memory holds no more at once",
                number + 1
            ));
        }
        let mut made = mosaics(group, &inputs, &mut log)?;
        // From the lowest: each group lies below the one before.
        made.found.append(&mut all);
        all = std::mem::take(&mut made.found);
        last = Some(made);
    }
    let Made { planned, memory, .. } = last.expect("at least one group");
    let Planned { job, outlook, .. } = &planned;
    let run = Run {
        threads: config.threads,
        memory_cap_bytes: config.memory_bytes,
        stages: log.stages().to_vec(),
        seconds: log.seconds(),
        peak_memory_bytes: peak_resident_bytes(),
        memory,
        photo_pixels: photo_pixels(job),
        forecast: outlook.forecast,
        forecast_of: outlook.demand,
    };
    let outcome = Outcome { record: &job.record, mosaic: &job.mosaic, found: all, run };
    outcome.report(config.report.as_deref(), config.quiet)?;
    Ok(ExitStatus::of(job.record.inputs.cameras.left_out.len()))
}

/// The job in pieces whose finished tiles fit the memory: as many sections at a time as that takes, from the highest.
fn groups(config: &Config) -> Vec<Config> {
    if config.sections.is_empty() {
        return vec![config.clone()];
    }
    let of = |sections: &[f64]| Config { sections: sections.to_vec(), ..config.clone() };
    config.sections.rchunks(sections_at_once(config)).map(of).collect()
}

/// What a run over one group has made.
struct Made {
    planned: Planned,
    memory: Vec<MemoryUse>,
    found: Vec<Found>,
}

/// Plans, renders and assembles a mosaic, or one group of its sections.
fn mosaics(config: &Config, inputs: &Inputs, log: &mut StageLog) -> Result<Made> {
    let planned = plan(config, inputs, budget(config)?, Place::Work)?;
    let Planned { job, .. } = &planned;
    log.extend(&planned.log);
    job.record.save(&job.folder)?;
    let memory = log.run("tiles", || tiles(config, &planned))?;
    let parts = [job.folder.parts()?.finished_file(0)];
    let statistics = statistics(&job.record.manifest, &parts, job.record.names.len())?;
    let files = Files::of(&job.record, &config.out);
    log.run("files", || {
        assemble_files((&job.record, &job.mosaic), &parts, &files)?;
        let folder = job.folder.path();
        fs::remove_dir_all(folder).map_err(|e| Error::io(folder, e))
    })?;
    let found = found(&job.record, statistics, &files);
    Ok(Made { planned, memory, found })
}

/// Renders every tile; who held how much memory meanwhile.
fn tiles(config: &Config, planned: &Planned) -> Result<Vec<MemoryUse>> {
    let Planned { job, budget, survey, .. } = planned;
    let weight =
        |tile: TileAddress| tile_weight(&survey.within(job.record.manifest.tile_rect(tile)));
    let batch = BatchRun {
        job,
        budget,
        parts: &job.folder.parts()?,
        batch: 0,
        tiles: &job.record.tiles_by_batch()[0],
        rivals: Rivals::Refuse,
        weight: &weight,
        quiet: config.quiet,
    };
    batch.run()
}

fn photo_pixels(job: &Job) -> PhotoPixels {
    let found = job.scene.pixels.statistics();
    PhotoPixels { needed: found.pixels_needed, decoded: found.pixels_decoded }
}
