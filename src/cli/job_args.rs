//! The arguments of the commands that make a job in steps.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};

use super::args::OrthoArgs;
use super::values;

/// What `groundel plan` takes.
#[derive(Clone, Debug, Args)]
pub struct PlanArgs {
    /// The flags of `ortho`; the files are named when the job is assembled.
    #[command(flatten)]
    pub ortho: Box<OrthoArgs>,
    /// Folder of the job; made if it is not there
    #[arg(long, value_name = "JOB", help_heading = "Job", value_parser = OsStringValueParser::new().try_map(values::path))]
    pub job: PathBuf,
    /// Batches to cut the tiles into, of about equal work [default: by --batch-mpx]
    #[arg(long, value_name = "N", help_heading = "Job", value_parser = clap::value_parser!(u32).range(1..))]
    pub batches: Option<u32>,
    /// Megapixels of the mosaic in a batch, on average [default: 100]
    #[arg(long, value_name = "M", help_heading = "Job", conflicts_with = "batches", value_parser = values::positive)]
    pub batch_mpx: Option<f64>,
    /// Replace the job in the folder, and keep its tiles that no changed photo, mask or camera touches
    #[arg(long, help_heading = "Job")]
    pub changed: bool,
}

/// What `groundel render` takes.
#[derive(Clone, Debug, Args)]
pub struct RenderArgs {
    /// Folder of the job
    pub job: PathBuf,
    /// The batch, from 0 [default: all that are missing]
    #[arg(long, value_name = "K", conflicts_with = "missing")]
    pub batch: Option<u32>,
    /// Only print the numbers of the missing batches, one a line
    #[arg(long)]
    pub missing: bool,
    /// Folder of the photos, if not where it was planned from
    #[arg(long, value_name = "DIR", value_parser = OsStringValueParser::new().try_map(values::path))]
    pub photos: Option<PathBuf>,
    /// Folder of the masks, if not where it was planned from
    #[arg(long, value_name = "DIR", value_parser = OsStringValueParser::new().try_map(values::path))]
    pub masks: Option<PathBuf>,
    /// Memory cap of the process, at least 256MiB [default: half of the physical memory]
    #[arg(long, value_name = "SIZE", value_parser = values::memory)]
    pub memory: Option<u64>,
    /// Threads [default: all processors]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub threads: Option<usize>,
    /// End when the process that started this one, with this number, has ended: for schedulers
    #[arg(long, value_name = "PID")]
    pub parent: Option<u32>,
    /// Show no progress
    #[arg(long)]
    pub quiet: bool,
}

/// What `groundel assemble` takes.
#[derive(Clone, Debug, Args)]
pub struct AssembleArgs {
    /// Folder of the job
    pub job: PathBuf,
    /// The mosaic; layers and frame are written beside it
    #[arg(long, value_name = "OUT.tif", value_parser = OsStringValueParser::new().try_map(values::path))]
    pub out: PathBuf,
    /// Run report: counts, coverage, photos [default: none]
    #[arg(long, value_name = "FILE.json", value_parser = OsStringValueParser::new().try_map(values::path))]
    pub report: Option<PathBuf>,
    /// Remove the job's parts once the files are in their places; the stores stay
    #[arg(long)]
    pub remove: bool,
    /// Threads that make the overviews between batches [default: all processors]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub threads: Option<usize>,
    /// Show no summary
    #[arg(long)]
    pub quiet: bool,
}
