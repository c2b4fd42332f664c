//! `groundel assemble`: the parts of a job become its files.

use std::path::PathBuf;

use super::super::config::all_processors;
use super::super::interrupt;
use super::super::job_args::AssembleArgs;
use super::super::ortho::{ExitStatus, Outcome, found, on_threads};
use super::super::sidecars;
use super::files::{Files, check_name, check_writable};
use super::folder::JobFolder;
use super::record::JobRecord;
use crate::batch::{Assembly, Parts, assemble, join, statistics};
use crate::frame::Mosaic;
use crate::output::BigTiff;
use crate::report::{Run, StageLog, peak_resident_bytes};
use crate::{Error, Result};

/// Batches, and tiles, that are named when they are missing.
const NAMED: usize = 10;

/// Assembles a job of which all batches are finished.
///
/// # Errors
/// No job, batches that are missing (they are named), a damaged part, or a failed file operation; no file bears a final
/// name then.
pub(in crate::cli) fn run(args: &AssembleArgs) -> Result<ExitStatus> {
    let folder = JobFolder::new(&args.job);
    let record = JobRecord::load(&folder)?;
    let out = check_name(args.out.clone())?;
    let files = Files::of(&record, &out);
    check_writable(files.all().chain(args.report.as_deref()))?;
    let parts = folder.parts()?;
    refuse_missing(&record, &parts)?;
    let threads = args.threads.unwrap_or_else(all_processors);
    on_threads(threads, || {
        let mut log = StageLog::start();
        let finished = parts.finished(&record.manifest)?;
        let all = log.run("overviews", || join(&record.manifest, &finished, &parts.joined()))?;
        let mosaic = record.mosaic(&folder)?;
        log.run("files", || assemble_files((&record, &mosaic), &all, &files))?;
        let statistics = statistics(&record.manifest, &all, record.names.len())?;
        let run = Run {
            threads,
            stages: log.stages().to_vec(),
            seconds: log.seconds(),
            peak_memory_bytes: peak_resident_bytes(),
            ..Run::default()
        };
        let found = found(&record, statistics, &files);
        let outcome = Outcome { record: &record, mosaic: &mosaic, found, run };
        outcome.report(args.report.as_deref(), args.quiet)?;
        parts.sweep()?;
        if args.remove {
            parts.remove()?;
        }
        Ok(ExitStatus::of(record.inputs.cameras.left_out.len()))
    })
}

/// Assembles the files of a job: the layers first, then what lies beside the mosaics, the mosaics last.
///
/// # Errors
/// If tiles are missing, a part is damaged, or the disk refuses.
pub(in crate::cli) fn assemble_files(
    (record, mosaic): (&JobRecord, &Mosaic),
    parts: &[PathBuf],
    files: &Files,
) -> Result<()> {
    let (manifest, outputs) = (&record.manifest, &files.layers);
    let mut beside = Vec::new();
    for (section, mosaic) in record.section_mosaics(mosaic).iter().zip(&files.mosaics) {
        beside.extend(sidecars::beside(manifest, section, mosaic)?);
    }
    let (beside, big_tiff) = (&beside[..], BigTiff::IfNeeded);
    let assembly = Assembly { manifest, parts, outputs, beside, big_tiff };
    assemble(&assembly, &interrupt::check)
}

/// Names the batches that are missing, and their tiles.
fn refuse_missing(record: &JobRecord, parts: &Parts) -> Result<()> {
    let (mut batches, mut tiles) = (Vec::new(), Vec::new());
    for (batch, own) in (0..).zip(record.tiles_by_batch()) {
        if !parts.is_finished(&record.manifest, batch)? {
            batches.push(batch.to_string());
            tiles.extend(own.iter().map(|tile| format!("({}, {})", tile.x, tile.y)));
        }
    }
    if batches.is_empty() {
        return Ok(());
    }
    let (count, all) = (batches.len(), record.batch_count());
    Err(Error::usage(format!(
        "the job is not finished: {count} of {all} batches are missing: {}; {} tiles: {} (`groundel render` makes them)",
        first(&batches),
        tiles.len(),
        first(&tiles)
    )))
}

/// The first of some names, and how many more there are.
fn first(names: &[String]) -> String {
    let more = names.len().saturating_sub(NAMED);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{rest}", names[..names.len() - more].join(", "))
}
