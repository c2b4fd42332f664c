//! `groundel render`: a batch of a job's tiles, or all that are missing.

use super::super::config::{all_processors, default_memory_bytes};
use super::super::job_args::RenderArgs;
use super::super::ortho::{ExitStatus, Job, on_threads};
use super::super::{console, interrupt};
use super::folder::JobFolder;
use super::open::{Circumstances, open};
use super::record::JobRecord;
use super::tiles::BatchRun;
use crate::batch::{Parts, Rivals, TileAddress};
use crate::geom::PixelRect;
use crate::render::Budget;
use crate::{Error, Result};

/// Renders what `args` ask for of a job; a batch that is finished already is left as it is.
///
/// # Errors
/// No job, no such batch, inputs that have changed, a job over budget, or a failed file operation.
pub(in crate::cli) fn run(args: &RenderArgs) -> Result<ExitStatus> {
    let folder = JobFolder::new(&args.job);
    let record = JobRecord::load(&folder)?;
    let parts = folder.parts()?;
    let batches = wanted(args, &record, &parts)?;
    if args.missing {
        let lines: Vec<_> = batches.iter().map(ToString::to_string).collect();
        console::answer(&if lines.is_empty() { String::new() } else { lines.join("\n") + "\n" });
        return Ok(ExitStatus::Done);
    }
    if let Some(parent) = args.parent {
        interrupt::end_with(parent)?;
    }
    if !batches.is_empty() {
        on_threads(args.threads.unwrap_or_else(all_processors), || {
            batches_of(args, &folder, record, &parts, &batches)
        })?;
    }
    Ok(ExitStatus::Done)
}

/// The batches to render: the one that is asked for, or all, if they are not finished.
fn wanted(args: &RenderArgs, record: &JobRecord, parts: &Parts) -> Result<Vec<u32>> {
    let count = record.batch_count();
    let asked = match args.batch {
        Some(batch) if batch >= count => {
            let message = format!("expected a batch from 0 to {}, found {batch}", count - 1);
            return Err(Error::usage(format!("--batch: {message}")));
        }
        Some(batch) => batch..batch + 1,
        None => 0..count,
    };
    let mut wanted = Vec::new();
    for batch in asked {
        if !parts.is_finished(&record.manifest, batch)? {
            wanted.push(batch);
        }
    }
    Ok(wanted)
}

fn batches_of(
    args: &RenderArgs,
    folder: &JobFolder,
    record: JobRecord,
    parts: &Parts,
    batches: &[u32],
) -> Result<()> {
    let tiles = record.tiles_by_batch();
    let of = |batch: u32| &tiles[batch as usize];
    let rect = |tiles: &mut dyn Iterator<Item = &TileAddress>| {
        tiles.map(|&tile| record.manifest.tile_rect(tile)).reduce(hull).unwrap_or_default()
    };
    let rect = rect(&mut batches.iter().flat_map(|&batch| of(batch)));
    let circumstances = Circumstances {
        photos: args.photos.clone(),
        masks: args.masks.clone(),
        memory_bytes: args.memory.unwrap_or_else(default_memory_bytes),
        quiet: args.quiet,
    };
    let (job, budget) = open(folder, record, &rect, &circumstances)?;
    for &batch in batches {
        interrupt::check()?;
        batch_of((&job, &budget), parts, (batch, of(batch)), args.quiet)?;
    }
    Ok(())
}

fn batch_of(
    (job, budget): (&Job, &Budget),
    parts: &Parts,
    (batch, tiles): (u32, &[TileAddress]),
    quiet: bool,
) -> Result<()> {
    if !quiet {
        let last = job.record.batch_count() - 1;
        console::note(&format!("groundel: batch {batch} of 0 to {last}: {} tiles", tiles.len()));
    }
    let rivals = Rivals::Ignore;
    let weight = &|_: TileAddress| 1.0;
    BatchRun { job, budget, parts, batch, tiles, rivals, weight, quiet }.run().map(drop)
}

fn hull(a: PixelRect, b: PixelRect) -> PixelRect {
    PixelRect::new(a.x0.min(b.x0), a.y0.min(b.y0), a.x1.max(b.x1), a.y1.max(b.y1))
}
