//! What a run found: the report file and the summary.

use std::path::Path;

use super::super::config::Config;
use super::super::console;
use super::forecast::Outlook;
use super::inputs::Inputs;
use super::job::Job;
use crate::frame::MosaicFrame;
use crate::output::write_atomically;
use crate::render::{OrthoTile, Statistics};
use crate::report::{
    CameraInput, Coverage, FrameSummary, Inputs as InputReport, MemoryUse, MeshInput, OutputFile,
    PhotoPixels, PhotoReport, PhotoTally, Report, Run, StageLog, peak_resident_bytes,
};
use crate::{Error, Result};

/// What a run has to report on.
#[derive(Debug)]
pub(super) struct Outcome<'a> {
    pub(super) config: &'a Config,
    pub(super) inputs: &'a Inputs,
    pub(super) job: &'a Job,
    pub(super) statistics: Statistics,
    pub(super) memory: Vec<MemoryUse>,
    pub(super) outlook: Outlook,
    pub(super) log: StageLog,
}

/// Writes the report that was asked for and says the summary.
pub(super) fn report(outcome: &Outcome<'_>) -> Result<()> {
    let Outcome { config, inputs, job, statistics, memory, outlook, log } = outcome;
    let photos = photos(job, statistics);
    let rejected = photos.iter().map(|p| p.pixels_rejected).sum();
    let histogram = histogram(statistics);
    let report = Report {
        groundel: env!("CARGO_PKG_VERSION").to_string(),
        inputs: input_report(config, inputs, job),
        frame: frame(job),
        settings: config.described(),
        coverage: Coverage::new(job.mosaic.size.area(), &histogram, rejected),
        photos,
        warnings: job.warnings.clone(),
        outputs: outputs(config, job)?,
        run: Run {
            threads: config.threads,
            memory_cap_bytes: config.memory_bytes,
            stages: log.stages().to_vec(),
            seconds: log.seconds(),
            peak_memory_bytes: peak_resident_bytes(),
            memory: memory.clone(),
            photo_pixels: photo_pixels(job),
            forecast: outlook.forecast,
            forecast_of: outlook.demand,
        },
    };
    if let Some(path) = &config.report {
        write_atomically(path, report.to_json().as_bytes())?;
    }
    if !config.quiet {
        console::note(&report.summary());
    }
    Ok(())
}

fn input_report(config: &Config, inputs: &Inputs, job: &Job) -> InputReport {
    let counts = job.scene.mesh.counts();
    let meshes = inputs.meshes.iter().map(|m| MeshInput {
        file: m.path().display().to_string(),
        vertices: m.vertex_count(),
        faces: m.face_count(),
    });
    InputReport {
        meshes: meshes.collect(),
        degenerate_faces_dropped: counts.faces_dropped(),
        unused_non_finite_vertices: counts.vertices_unusable,
        cameras: CameraInput {
            path: config.cameras.display().to_string(),
            photos: inputs.cameras.names.len() as u64,
            photos_used: job.photos.len() as u64,
            photos_excluded: (inputs.cameras.names.len() - job.photos.len() - job.left_out.len())
                as u64,
            left_out: job.left_out.clone(),
        },
    }
}

fn photo_pixels(job: &Job) -> PhotoPixels {
    let found = job.scene.pixels.statistics();
    PhotoPixels { needed: found.pixels_needed, decoded: found.pixels_decoded }
}

fn frame(job: &Job) -> FrameSummary {
    let mosaic = &job.mosaic;
    let (kind, has_ground) = match mosaic.frame {
        MosaicFrame::Plane(_) => ("plane", true),
        MosaicFrame::Cylinder(_) => ("cylinder", true),
        MosaicFrame::Perspective(_) => ("perspective", false),
    };
    FrameSummary {
        kind: kind.into(),
        width: mosaic.size.width.into(),
        height: mosaic.size.height.into(),
        pixel_size: has_ground.then_some(mosaic.pixel_size),
        extent: has_ground.then_some(mosaic.extent),
        elevation: mosaic.slab.map(|e| e.is_finite().then_some(e)),
        crs: mosaic.plane().and_then(|plane| plane.crs.clone()),
    }
}

fn photos(job: &Job, statistics: &Statistics) -> Vec<PhotoReport> {
    let range = f64::from(job.scene.blend.depth.max());
    let report = |photo: &crate::camera::Photo| {
        let found = &statistics.photos[photo.id.0 as usize];
        let tally = PhotoTally {
            seen: found.seen,
            used: found.used,
            rejected: found.rejected,
            compared: found.compared,
            residual_256: found.residual_256,
        };
        PhotoReport::new(photo.id.0, photo.name.clone(), &tally, range)
    };
    job.photos.iter().map(report).collect()
}

/// Pixels with a surface by the number of photos that see them, up to the last that occurs.
fn histogram(statistics: &Statistics) -> Vec<u64> {
    let counts = &statistics.counts[..usize::from(OrthoTile::NO_SURFACE)];
    let last = counts.iter().rposition(|&n| n > 0).map_or(0, |k| k + 1);
    counts[..last].to_vec()
}

fn outputs(config: &Config, job: &Job) -> Result<Vec<OutputFile>> {
    let size = |path: &Path| -> Result<OutputFile> {
        let found = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
        Ok(OutputFile { file: path.display().to_string(), bytes: found.len() })
    };
    let (mosaic, layers) = job.outputs.split_first().expect("the mosaic is a layer");
    let frame = config.frame_file();
    layers.iter().chain([&frame, mosaic]).map(|path| size(path)).collect()
}
