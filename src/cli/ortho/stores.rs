//! The mesh store and the photo stores of a job.

use std::path::Path;

use super::super::config::Config;
use super::super::progress::Progress;
use super::inputs::Inputs;
use super::masks::Mask;
use crate::camera::Photo;
use crate::geom::Size;
use crate::plan::PhotoNeed;
use crate::render::Budget;
use crate::report::LeftOut;
use crate::store::mesh::{BuildStage, MeshBuild, MeshStore};
use crate::store::photo::{
    self, Demand, PhotoSource, PhotoStore, Preparation, Reading, check_headers, prepare_masks,
    prepare_photos,
};
use crate::{Error, Result};

/// The part of the photos' cache that masks get, where there are any: they compress to little, and decode fast.
const MASK_SHARE: u64 = 8;
/// The part of the photos' cache, at most, that is set aside for windows that are being decoded: not all threads do so at
/// the same time.
const MOST_WINDOWS: u64 = 2;
/// Sides that differ by one factor agree to this part of a pixel.
const FACTOR_SLACK_PX: f64 = 1.0;

/// What a job renders from.
#[derive(Debug)]
pub(super) struct Stores {
    pub(super) mesh: MeshStore,
    pub(super) pixels: PhotoStore,
    /// The masks of those of the photos that have one.
    pub(super) masks: Option<PhotoStore>,
    /// The photos in the store, by id.
    pub(super) photos: Vec<Photo>,
    /// The photos that were chosen but could not be used, by name.
    pub(super) left_out: Vec<LeftOut>,
}

impl Stores {
    /// Builds the mesh store, or opens the one that is there.
    pub(super) fn build_mesh(
        config: &Config,
        inputs: &Inputs,
        budget: &Budget,
    ) -> Result<MeshStore> {
        let build = mesh_build(config, budget);
        let sources: Vec<_> = inputs.meshes.iter().map(AsRef::as_ref).collect();
        let progress = Progress::start("mesh store", "%", 100, config.quiet);
        let mut shown = 0;
        let built = build.open_or_build(&sources, &mut |stage, done, total| {
            let percent = percent(stage, done, total);
            let more = percent.saturating_sub(shown);
            shown = shown.max(percent);
            progress.add(more)
        });
        progress.finish();
        built
    }

    /// Makes those of `photos` that are needed ready to be read; `needs` are in their order.
    pub(super) fn build(
        config: &Config,
        inputs: &Inputs,
        mesh: MeshStore,
        (photos, needs): (UsablePhotos, &[Option<PhotoNeed>]),
        budget: &Budget,
    ) -> Result<Self> {
        let demand = |need: &PhotoNeed| Demand { pixels: need.pixels, level: need.level };
        let source = |(photo, need): (&Photo, &Option<PhotoNeed>)| {
            photo_source(config, photo, need.as_ref().map(demand))
        };
        let sources: Vec<_> = photos.photos.iter().zip(needs).map(source).collect();
        let share = if config.masks.is_some() { budget.photo_bytes / MASK_SHARE } else { 0 };
        let photo_bytes = budget.photo_bytes - share;
        let folder = config.work.join("photos");
        let preparation = Preparation {
            memory_bytes: photo_bytes,
            ..preparation(config, &folder, &mesh, budget)
        };
        let progress = Progress::start("photo store", "photos", sources.len() as u64, config.quiet);
        let prepared = prepare_photos(&sources, &preparation, &|_| progress.add(1));
        progress.finish();
        let UsablePhotos { photos: usable, mut left_out, mut sizes } = photos;
        let (mut photos, mut entries) = (Vec::new(), Vec::new());
        for (photo, outcome) in usable.into_iter().zip(prepared?) {
            match outcome {
                Ok(ready) => {
                    entries.push((photo.id.0 as usize, ready));
                    photos.push(photo);
                }
                Err(left) => {
                    sizes.push(left.sizes);
                    left_out.push(named(&photo, &left));
                }
            }
        }
        left_out.sort_by(|a, b| a.photo.cmp(&b.photo));
        if photos.is_empty() {
            return Err(Error::usage(none_usable(config, &left_out, &sizes)));
        }
        let is_needed = |id: u32| {
            let at = entries.binary_search_by_key(&(id as usize), |(k, _)| *k);
            at.is_ok_and(|at| entries[at].1.is_needed())
        };
        let masks: Vec<_> = inputs.masks.iter().filter(|m| is_needed(m.photo)).collect();
        let masks = build_masks(config, &masks, &mesh, budget)?;
        let held: u64 = entries.iter().map(|(_, photo)| photo.memory_bytes()).sum();
        let windows = if entries.iter().any(|(_, photo)| photo.is_indexed()) {
            (PhotoStore::WINDOW_BYTES * config.threads as u64).min(photo_bytes / MOST_WINDOWS)
        } else {
            0
        };
        let pixels = PhotoStore::new(entries, photo_bytes.saturating_sub(held + windows))?;
        Ok(Self { mesh, pixels, masks, photos, left_out })
    }
}

/// The photos whose headers are in order.
#[derive(Debug)]
pub(super) struct UsablePhotos {
    /// By id.
    pub(super) photos: Vec<Photo>,
    left_out: Vec<LeftOut>,
    /// Of those left out, expected and found size, if only the size is wrong.
    sizes: Vec<Option<(Size, Size)>>,
}

impl UsablePhotos {
    /// Reads the photos' headers.
    pub(super) fn check(config: &Config, inputs: &Inputs) -> Result<Self> {
        let sources: Vec<_> = inputs.photos.iter().map(|p| photo_source(config, p, None)).collect();
        let headers = check_headers(&sources, config.threads)?;
        let (mut photos, mut left_out, mut sizes) =
            (Vec::new(), inputs.left_out.clone(), Vec::new());
        for (photo, header) in inputs.photos.iter().zip(headers) {
            match header {
                Ok(_) => photos.push(photo.clone()),
                Err(left) => {
                    sizes.push(left.sizes);
                    left_out.push(named(photo, &left));
                }
            }
        }
        if photos.is_empty() {
            left_out.sort_by(|a, b| a.photo.cmp(&b.photo));
            return Err(Error::usage(none_usable(config, &left_out, &sizes)));
        }
        Ok(Self { photos, left_out, sizes })
    }
}

fn photo_source(config: &Config, photo: &Photo, demand: Option<Demand>) -> PhotoSource {
    let path = config.photos.join(&photo.name);
    PhotoSource { name: photo.name.clone(), path, expected: Some(photo.lens.size()), demand }
}

fn named(photo: &Photo, left: &photo::LeftOut) -> LeftOut {
    LeftOut { photo: photo.name.clone(), reason: left.reason.to_string() }
}

fn preparation<'a>(
    config: &Config,
    folder: &'a Path,
    mesh: &MeshStore,
    budget: &Budget,
) -> Preparation<'a> {
    Preparation {
        folder,
        budget_bytes: budget.decode_bytes,
        beside_bytes: mesh.held_bytes(),
        threads: config.threads,
        memory_bytes: 0,
        reading: Reading::Auto,
    }
}

/// How the mesh store is built.
pub(super) fn mesh_build(config: &Config, budget: &Budget) -> MeshBuild {
    MeshBuild {
        work: config.work.clone(),
        budget_bytes: usize::try_from(budget.build_bytes).unwrap_or(usize::MAX),
        resident_limit_bytes: budget.mesh_bytes,
    }
}

/// Builds the tile stores of the masks, or opens those that are there; `None` if masks were not asked for.
fn build_masks(
    config: &Config,
    masks: &[&Mask],
    mesh: &MeshStore,
    budget: &Budget,
) -> Result<Option<PhotoStore>> {
    if config.masks.is_none() {
        return Ok(None);
    }
    let sources: Vec<_> = masks.iter().map(|mask| mask.source.clone()).collect();
    let folder = config.work.join("masks");
    let progress = Progress::start("mask store", "masks", sources.len() as u64, config.quiet);
    let prepared =
        prepare_masks(&sources, &preparation(config, &folder, mesh, budget), &|_| progress.add(1));
    progress.finish();
    let entries = masks.iter().map(|mask| mask.photo as usize).zip(prepared?);
    PhotoStore::new(entries, budget.photo_bytes / MASK_SHARE).map(Some)
}

/// How far the whole building is, when `done` of `total` of a stage are done. The faces take most of the time.
fn percent(stage: BuildStage, done: u64, total: u64) -> u64 {
    let (from, share) = match stage {
        BuildStage::Bounds => (0, 5),
        BuildStage::Vertices => (5, 15),
        BuildStage::Faces => (20, 40),
        BuildStage::Partitions => (60, 40),
    };
    from + share * done.min(total) / total.max(1)
}

/// Why no photo can be used; says so if none is there, or all have another size than their camera by one factor.
fn none_usable(config: &Config, left_out: &[LeftOut], sizes: &[Option<(Size, Size)>]) -> String {
    if left_out.iter().all(|l| !config.photos.join(&l.photo).exists()) {
        return format!(
            "--photos {} holds none of the {} photos of {} (the first is {}): are they in another folder?",
            config.photos.display(),
            left_out.len(),
            config.cameras.display(),
            left_out.first().map_or("", |l| &l.photo)
        );
    }
    let first = left_out.first().map(|l| l.reason.clone()).unwrap_or_default();
    let hint = match common_factor(sizes) {
        Some(factor) => format!(
            "; all photos are {factor:.6} × as large as their cameras say: give the photos that the cameras were solved with, or scale the cameras"
        ),
        None => String::new(),
    };
    format!(
        "no photo can be used: {} are left out, the first because {first}{hint}",
        left_out.len()
    )
}

/// The one factor by which all photos differ from their cameras, if there is one.
fn common_factor(sizes: &[Option<(Size, Size)>]) -> Option<f64> {
    let (expected, found) = sizes.first().copied()??;
    let factor = f64::from(found.width) / f64::from(expected.width);
    let fits = |sides: &Option<(Size, Size)>| {
        sides.is_some_and(|(e, f)| {
            (f64::from(e.width) * factor - f64::from(f.width)).abs() <= FACTOR_SLACK_PX
                && (f64::from(e.height) * factor - f64::from(f.height)).abs() <= FACTOR_SLACK_PX
        })
    };
    sizes.iter().all(fits).then_some(factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_that_all_differ_by_one_factor_are_told_so() {
        let pair = |w, h, f: u32| Some((Size::new(w, h), Size::new(w / f, h / f)));
        assert_eq!(common_factor(&[pair(3000, 2000, 2), pair(2000, 3000, 2)]), Some(0.5));
        assert_eq!(common_factor(&[pair(3000, 2000, 2), pair(2000, 3000, 4)]), None);
        assert_eq!(common_factor(&[pair(3000, 2000, 2), None]), None);
    }
}
