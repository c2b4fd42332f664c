//! What a run says of itself before it begins: memory, disk and time; and its refusal where the disk is too small.
//!
//! Twice: before the mesh store is built, of what is known from headers and flags alone; after it, of the whole job.

use std::path::Path;

use super::super::config::Config;
use super::super::console;
use super::super::frame_choice::FrameChoice;
use super::super::job::section_mosaics;
use super::disk::Room;
use super::grid;
use super::inputs::Inputs;
use super::speed::speed;
use super::stores::mesh_build;
use crate::Result;
use crate::camera::Photo;
use crate::frame::{FrameSpec, Mosaic};
use crate::output::{Compression, Layer, Meaning};
use crate::plan::{Forecast, JobDemand, PhotoNeed, Survey, check_pixels};
use crate::render::{Budget, Outliers};
use crate::store::mesh::MeshStore;

/// What is known of a job, and what it will take.
#[derive(Debug, Clone, Copy)]
pub(in crate::cli) struct Outlook {
    pub(in crate::cli) demand: JobDemand,
    pub(in crate::cli) forecast: Forecast,
    speed: f64,
}

/// What is decided of a job before photos are read.
#[derive(Debug)]
pub(super) struct Scope<'a> {
    pub(super) mesh: &'a MeshStore,
    pub(super) mosaic: &'a Mosaic,
    pub(super) photos: &'a [Photo],
    /// What is needed of each photo.
    pub(super) needs: &'a [Option<PhotoNeed>],
}

/// Bytes of a pixel as Deflate leaves it, overviews counted, of a colour mosaic that is no finer than its photos.
const COLOUR_BYTES: f64 = 2.1;
/// A mosaic finer than its photos is smoother: its bytes go with this power of the photo pixels that a mosaic pixel
/// covers (measured at 0.03, 0.3, 0.43 and 2.9), down to the least share.
const SMOOTHNESS: f64 = 0.225;
const LEAST_SHARE: f64 = 0.1;
/// Likewise of the layers, a photo pixel's side not counted.
const LAYER_BYTES: [(Meaning, f64); 6] = [
    (Meaning::Elevation, 1.6),
    (Meaning::Face, 2.0),
    (Meaning::Count, 0.08),
    (Meaning::Used, 0.25),
    (Meaning::Coverage, 0.05),
    (Meaning::Best, 0.15),
];
/// Bytes of a photo pixel: all levels in memory, where all photos fit there; else in an index of a JPEG, or in a store.
const MEMORY_BYTES: f64 = 4.0;
const INDEX_BYTES: f64 = 0.008;
const STORE_BYTES: f64 = 1.3;
/// Pixels of a block, and what each takes for itself and for each photo that sees it, bytes: more if each shows a face of
/// its own.
const BLOCK_PIXELS: f64 = 256.0 * 256.0;
const SURFACE_BYTES: [f64; 2] = [100.0, 50.0];
const VIEW_BYTES: [f64; 2] = [35.0, 60.0];
/// Finished tiles of a thread on their way to the disk, while that is fast enough, bytes.
const FINISHED_BYTES: u64 = 2 << 20;
/// Sections whose surface is surveyed, at most.
const SURVEYED_SECTIONS: usize = 8;
/// Bytes beside the tiles: headers, names of photos; for each file.
const FILE_BYTES: u64 = 16 << 10;

impl Outlook {
    /// What headers and flags tell.
    ///
    /// # Errors
    /// [`crate::Error::NoRoom`] if the disk surely cannot hold that; those of asking the files.
    pub(super) fn before(config: &Config, inputs: &Inputs, budget: &Budget) -> Result<Self> {
        let build = mesh_build(config, budget);
        let sources: Vec<_> = inputs.meshes.iter().map(AsRef::as_ref).collect();
        let mut demand = JobDemand { threads: config.threads as u64, ..JobDemand::default() };
        if !build.is_built(&sources)? {
            let mesh = build.forecast(&sources);
            demand.faces_to_build = sources.iter().map(|s| s.face_count()).sum();
            demand.mesh_store_bytes = mesh.store_bytes;
            demand.mesh_temporary_bytes = mesh.likely_bytes - mesh.store_bytes;
            demand.held_bytes[0] = mesh.working_bytes.min(budget.build_bytes);
        }
        if let Some(mosaic) = stated_mosaic(config, inputs) {
            let pixels = mosaic.size.area() as f64;
            demand.output_bytes = output_bytes(config, pixels, 0.0);
        }
        Room::of(config, &demand)?.check()?;
        let speed = speed();
        let outlook = Self { demand, forecast: demand.forecast(speed), speed };
        if !config.quiet && demand.faces_to_build > 0 {
            let disk = demand.mesh_store_bytes.saturating_add(demand.mesh_temporary_bytes);
            console::note(&format!(
                "groundel: forecast: mesh store of {:.1} million faces, {} of disk, {}",
                demand.faces_to_build as f64 / 1e6,
                size(disk),
                time(outlook.forecast.stages[0])
            ));
        }
        Ok(outlook)
    }

    /// What the whole job will take, the mesh store counted although it is built by now.
    ///
    /// # Errors
    /// [`crate::Error::NoRoom`] if the disk surely cannot hold that; those of asking the files.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive; saturates"
    )]
    pub(super) fn of_all(
        self,
        config: &Config,
        budget: &Budget,
        scene: &Scope<'_>,
    ) -> Result<(Self, Survey)> {
        let survey = Survey::of(scene.mesh, scene.mosaic, scene.photos)?;
        let work = survey.total();
        let mosaic_pixels = scene.mosaic.size.area();
        let is_soft = config.outliers == Outliers::Robust;
        let soft_samples = if is_soft { work.samples } else { 0.0 };
        let mut demand = JobDemand { mosaic_pixels, work, soft_samples, ..self.demand };
        let surface_pixels = surface_of_all(config, scene, work.surface_pixels)?;
        demand.output_bytes = output_bytes(config, surface_pixels, work.footprint());
        let needed = || {
            let both = scene.photos.iter().zip(scene.needs);
            both.filter(|(_, need)| need.is_some()).map(|(photo, _)| photo)
        };
        demand.photo_pixels = needed().map(|photo| photo.lens.size().area()).sum();
        let decoded = (demand.photo_pixels as f64 * MEMORY_BYTES) as u64;
        if decoded > budget.photo_bytes {
            let bytes = |photo: &Photo| photo.lens.size().area() as f64 * store_bytes(photo);
            demand.photo_store_bytes = needed().map(bytes).sum::<f64>() as u64;
        }
        demand.held_bytes[2] = held_while_rendering(config, budget, scene.mesh, &demand);
        // What is left to be written: the store is there.
        let left = JobDemand { mesh_store_bytes: 0, mesh_temporary_bytes: 0, ..demand };
        let room = Room::of(config, &left)?;
        room.check()?;
        let mut forecast = demand.forecast(self.speed);
        forecast.memory_bytes = forecast.memory_bytes.min(config.memory_bytes);
        if !config.quiet {
            console::note(&format!(
                "groundel: forecast: {} of memory, {} of temporary disk, {} of output, {} in all",
                size(forecast.memory_bytes),
                size(forecast.temporary_bytes),
                size(forecast.output_bytes),
                time(forecast.seconds)
            ));
        }
        if let Some(warning) = room.warning() {
            console::note(&format!("groundel: warning: {warning}"));
        }
        Ok((Self { demand, forecast, ..self }, survey))
    }
}

/// The mosaic, if its grid is stated; what is wrong with it is said when the grid is decided.
fn stated_mosaic(config: &Config, inputs: &Inputs) -> Option<Mosaic> {
    let slab = [f64::NEG_INFINITY, f64::INFINITY];
    let mosaic = match &config.frame {
        FrameChoice::Fit(_) => return None,
        FrameChoice::Stated(FrameSpec::Plane(plane)) => {
            Mosaic::new(plane.clone(), plane.pixel_size?, plane.extent?, slab).ok()?
        }
        FrameChoice::Stated(FrameSpec::Cylinder(c)) => {
            Mosaic::new(c.clone(), c.pixel_size?, c.extent?, slab).ok()?
        }
        FrameChoice::Stated(FrameSpec::Perspective(view)) => {
            grid::of_view(view, &inputs.cameras).ok()?
        }
    };
    let photo_pixels = inputs.photos.iter().map(|p| p.lens.size().area()).sum();
    check_pixels(mosaic.size, photo_pixels, config.force).ok().map(|()| mosaic)
}

/// Bytes in the work folder for a pixel of a photo that does not stay in memory, as its name tells of its format.
fn store_bytes(photo: &Photo) -> f64 {
    let extension = Path::new(&photo.name).extension();
    let is_jpeg = extension
        .is_some_and(|e| ["jpg", "jpeg"].iter().any(|known| e.eq_ignore_ascii_case(known)));
    if is_jpeg { INDEX_BYTES } else { STORE_BYTES }
}

/// Pixels with a surface in all files: of the mosaic, or of all its sections, of which some are surveyed.
fn surface_of_all(config: &Config, scene: &Scope<'_>, of_one: f64) -> Result<f64> {
    if config.sections.is_empty() {
        return Ok(of_one);
    }
    let sections = section_mosaics(scene.mosaic, &config.sections);
    let (mut sum, mut looked_at) = (0.0, 0.0);
    for section in sections.iter().step_by(sections.len().div_ceil(SURVEYED_SECTIONS)) {
        sum += Survey::of(scene.mesh, section, &[])?.total().surface_pixels;
        looked_at += 1.0;
    }
    Ok(sum / looked_at * sections.len() as f64)
}

/// Bytes of all files, for so many pixels with a surface, of `footprint` photo pixels each.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive; saturates")]
fn output_bytes(config: &Config, pixels: f64, footprint: f64) -> u64 {
    let share = footprint.powf(SMOOTHNESS).clamp(LEAST_SHARE, 1.0);
    let of = |layer: Meaning| LAYER_BYTES.iter().find(|(m, _)| *m == layer).map_or(0.0, |l| l.1);
    let bytes = match config.compression {
        // Overviews are a third of the pixels again.
        Compression::None => {
            let layers = config.layers.iter().filter_map(|&m| Layer::of(m));
            let whole: usize = layers.map(|l| l.pixel_bytes()).sum();
            (4 + whole) as f64 * 4.0 / 3.0
        }
        _ => COLOUR_BYTES * share + config.layers.iter().map(|&m| of(m)).sum::<f64>(),
    };
    let files = (1 + config.layers.len() as u64) * config.sections.len().max(1) as u64;
    ((pixels * bytes) as u64).saturating_add(FILE_BYTES * files)
}

/// Memory of the stores' caches, of the blocks and of finished tiles, as far as they are filled.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive; saturates")]
fn held_while_rendering(
    config: &Config,
    budget: &Budget,
    mesh: &MeshStore,
    demand: &JobDemand,
) -> u64 {
    let work = &demand.work;
    let photos = if demand.photo_store_bytes == 0 {
        demand.photo_pixels as f64 * MEMORY_BYTES
    } else {
        // Tiles of three bytes a pixel, at the level that is sampled.
        work.sampled_photo_pixels().min(demand.photo_pixels as f64) * 3.0
    } as u64;
    let views = work.samples / work.surface_pixels.max(1.0);
    let pixels = BLOCK_PIXELS.min(f64::from(config.tile_size).powi(2));
    let shown = (work.faces / work.surface_pixels.max(1.0)).min(1.0);
    let bytes = |[pixel, face]: [f64; 2]| pixel + face * shown;
    let mut block = pixels * (bytes(SURFACE_BYTES) + bytes(VIEW_BYTES) * views);
    // One that does not fit is rendered in quarters, down to 16 pixels a side.
    let least = block / 256.0;
    while block > budget.block_bytes as f64 && block > least {
        block /= 4.0;
    }
    let blocks = block as u64 * config.threads as u64;
    // A mesh store stays as far as it is used, if all of it may; else only what is being looked at does.
    let used = (work.faces / mesh.counts().triangles.max(1) as f64).min(1.0);
    let held = mesh.held_bytes();
    let mesh = if held < mesh.file_bytes() { held } else { (held as f64 * used) as u64 };
    mesh + budget.photo_bytes.min(photos)
        + blocks
        + budget.output_bytes.min(FINISHED_BYTES * config.threads as u64)
}

/// Bytes in the unit that fits.
fn size(bytes: u64) -> String {
    let mib = bytes.div_ceil(1 << 20);
    if mib < 10_000 { format!("{mib} MiB") } else { format!("{} GiB", mib.div_ceil(1 << 10)) }
}

/// A time in the unit that fits, two digits.
fn time(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => "less than a second".into(),
        s if s < 100.0 => format!("about {s:.0} s"),
        s if s < 6000.0 => format!("about {:.0} min", s / 60.0),
        s => format!("about {:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_times_are_said_in_the_unit_that_fits() {
        assert_eq!(
            [size(1), size(9_000 << 20), size(20_000 << 20)],
            ["1 MiB", "9000 MiB", "20 GiB"]
        );
        let said = [0.4, 42.4, 125.0, 8000.0].map(time);
        assert_eq!(said, ["less than a second", "about 42 s", "about 2 min", "about 2.2 h"]);
    }
}
