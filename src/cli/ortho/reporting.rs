//! What a run found: the report file and the summary.

use std::path::{Path, PathBuf};

use super::super::config::Config;
use super::super::console;
use super::super::job::{Files, JobRecord, Levelled};
use super::inputs::Inputs;
use super::stores::Stores;
use crate::frame::{Mosaic, MosaicFrame};
use crate::output::{Meaning, write_atomically};
use crate::render::{OrthoTile, Statistics};
use crate::report::{
    CameraInput, Coverage, FrameSummary, Inputs as InputReport, MeshInput, OutputFile,
    PhotoLevelling, PhotoReport, PhotoTally, Report, Run, SectionReport,
};
use crate::{Error, Result};

/// What a job has to report on.
#[derive(Debug)]
pub(in crate::cli) struct Outcome<'a> {
    pub(in crate::cli) record: &'a JobRecord,
    pub(in crate::cli) mosaic: &'a Mosaic,
    /// The mosaic; of several sections each, from the lowest.
    pub(in crate::cli) found: Vec<Found>,
    pub(in crate::cli) run: Run,
}

/// What was found in a mosaic or a section, and where it lies.
#[derive(Debug)]
pub(in crate::cli) struct Found {
    /// The elevation at which a section ends.
    elevation: Option<f64>,
    statistics: Statistics,
    /// The layers, what lies beside the mosaic, and last the mosaic.
    files: Vec<PathBuf>,
}

/// What was found in the mosaic, or the sections, of a job.
pub(in crate::cli) fn found(
    record: &JobRecord,
    statistics: Vec<Statistics>,
    files: &Files,
) -> Vec<Found> {
    let each = statistics.into_iter().enumerate();
    let of = |(section, statistics): (usize, Statistics)| {
        let both = record.manifest.layers().iter().zip(&files.layers);
        let own = both.filter(|(layer, _)| usize::from(layer.section()) == section);
        let (mosaics, mut written): (Vec<_>, Vec<_>) =
            own.partition(|(layer, _)| layer.meaning() == Meaning::Mosaic);
        let paths = written.drain(..).map(|(_, path)| path);
        let beside = files.sidecars[section].iter().chain([&files.frames[section]]);
        let files = paths.chain(beside).chain(mosaics.iter().map(|(_, path)| *path));
        let elevation = record.sections.get(section).copied();
        Found { elevation, statistics, files: files.cloned().collect() }
    };
    each.map(of).collect()
}

impl Outcome<'_> {
    /// Writes the report to `file`, if one is asked for, and says the summary unless `quiet`.
    pub(in crate::cli) fn report(self, file: Option<&Path>, quiet: bool) -> Result<()> {
        let highest = self.found.last().expect("at least one section");
        let (coverage, photos) = self.tell(&highest.statistics);
        let sections = self.found.iter().filter_map(|found| self.section(found)).collect();
        let report = Report {
            groundel: self.record.groundel.clone(),
            inputs: self.record.inputs.clone(),
            frame: frame(self.mosaic),
            settings: self.record.settings.clone(),
            coverage,
            photos,
            sections,
            warnings: self.record.warnings.clone(),
            outputs: outputs(&self.found)?,
            run: self.run,
        };
        if let Some(path) = file {
            write_atomically(path, report.to_json().as_bytes())?;
        }
        if !quiet {
            console::note(&report.summary());
        }
        Ok(())
    }

    /// What some statistics say of pixels and photos.
    fn tell(&self, statistics: &Statistics) -> (Coverage, Vec<PhotoReport>) {
        let photos = photos(self.record, statistics);
        let rejected = photos.iter().map(|p| p.pixels_rejected).sum();
        let pixels = self.mosaic.size.area();
        (Coverage::new(pixels, &histogram(statistics), rejected), photos)
    }

    /// The report of a section; none of an ordinary mosaic.
    fn section(&self, found: &Found) -> Option<SectionReport> {
        let elevation = found.elevation?;
        let (coverage, photos) = self.tell(&found.statistics);
        let file = found.files.last().map(|file| file.display().to_string()).unwrap_or_default();
        Some(SectionReport { file, elevation, coverage, photos })
    }
}

/// What was read.
pub(super) fn inputs(config: &Config, inputs: &Inputs, stores: &Stores) -> InputReport {
    let counts = stores.mesh.counts();
    let meshes = inputs.meshes.iter().map(|m| MeshInput {
        file: m.path().display().to_string(),
        vertices: m.vertex_count(),
        faces: m.face_count(),
    });
    let (all, used) = (inputs.cameras.names.len() as u64, stores.photos.len() as u64);
    InputReport {
        meshes: meshes.collect(),
        tin: inputs.clouds.report(),
        degenerate_faces_dropped: counts.faces_dropped(),
        unused_non_finite_vertices: counts.vertices_unusable,
        cameras: CameraInput {
            path: config.cameras.display().to_string(),
            photos: all,
            photos_used: used,
            photos_excluded: all - used - stores.left_out.len() as u64,
            left_out: stores.left_out.clone(),
        },
    }
}

fn frame(mosaic: &Mosaic) -> FrameSummary {
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

fn photos(record: &JobRecord, statistics: &Statistics) -> Vec<PhotoReport> {
    let range = f64::from(record.rendering.blend.depth.max());
    let report = |photo: &super::super::job::PhotoRecord| {
        let found = &statistics.photos[photo.id as usize];
        let tally = PhotoTally {
            seen: found.seen,
            used: found.used,
            rejected: found.rejected,
            compared: found.compared,
            residual_256: found.residual_256,
        };
        let levelling = photo.levelled.as_ref().map(|levelled| levelling(record, levelled));
        PhotoReport { levelling, ..PhotoReport::new(photo.id, photo.name.clone(), &tally, range) }
    };
    record.photos.iter().map(report).collect()
}

fn levelling(record: &JobRecord, levelled: &Levelled) -> PhotoLevelling {
    let Levelled { tone, fit } = levelled;
    PhotoLevelling {
        gain: tone.gain.map(|log| (-log).exp()),
        vignetting: tone.vignetting,
        points: fit.points as u64,
        residual_before: fit.before,
        residual_after: fit.after,
        group: record.photos.get(fit.group).map_or(0, |photo| photo.id),
    }
}

/// Pixels with a surface by the number of photos that see them, up to the last that occurs.
fn histogram(statistics: &Statistics) -> Vec<u64> {
    let counts = &statistics.counts[..usize::from(OrthoTile::NO_SURFACE)];
    let last = counts.iter().rposition(|&n| n > 0).map_or(0, |k| k + 1);
    counts[..last].to_vec()
}

fn outputs(found: &[Found]) -> Result<Vec<OutputFile>> {
    let size = |path: &Path| -> Result<OutputFile> {
        let found = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
        Ok(OutputFile { file: path.display().to_string(), bytes: found.len() })
    };
    found.iter().flat_map(|found| &found.files).map(|path| size(path)).collect()
}
