//! `groundel assemble`: the parts of a job become its files.

use std::path::PathBuf;

use super::super::config::all_processors;
use super::super::interrupt;
use super::super::job_args::AssembleArgs;
use super::super::ortho::{ExitStatus, Outcome, found, on_threads};
use super::files::{Files, check_name, check_writable};
use super::folder::JobFolder;
use super::record::JobRecord;
use crate::batch::{Assembly, Parts, assemble, join, statistics};
use crate::frame::{Mosaic, frame_toml};
use crate::output::{BigTiff, write_atomically};
use crate::report::{Run, StageLog, peak_resident_bytes};
use crate::{Error, Result};

/// Batches that are named when they are missing.
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
        Ok(ExitStatus::of(record.inputs.cameras.left_out.len()))
    })
}

/// Assembles the files of a job: frames and layers first, the mosaics last.
///
/// # Errors
/// If tiles are missing, a part is damaged, or the disk refuses.
pub(in crate::cli) fn assemble_files(
    (record, mosaic): (&JobRecord, &Mosaic),
    parts: &[PathBuf],
    files: &Files,
) -> Result<()> {
    for (section, file) in record.section_mosaics(mosaic).iter().zip(&files.frames) {
        write_atomically(file, frame_toml(section).as_bytes())?;
    }
    let (manifest, outputs) = (&record.manifest, &files.layers);
    let assembly = Assembly { manifest, parts, outputs, big_tiff: BigTiff::IfNeeded };
    assemble(&assembly, &interrupt::check)
}

fn refuse_missing(record: &JobRecord, parts: &Parts) -> Result<()> {
    let mut missing = Vec::new();
    for batch in 0..record.batch_count() {
        if !parts.is_finished(&record.manifest, batch)? {
            missing.push(batch.to_string());
        }
    }
    if missing.is_empty() {
        return Ok(());
    }
    let (count, all) = (missing.len(), record.batch_count());
    missing.truncate(NAMED);
    let more = if count > NAMED { format!(" and {} more", count - NAMED) } else { String::new() };
    let names = missing.join(", ");
    Err(Error::usage(format!(
        "the job is not finished: {count} of {all} batches are missing: {names}{more} (`groundel render` makes them)"
    )))
}
