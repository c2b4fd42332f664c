//! The mesh store and the photo stores of a job.

use super::super::config::Config;
use super::super::progress::Progress;
use super::inputs::Inputs;
use super::masks::Mask;
use crate::camera::Photo;
use crate::geom::Size;
use crate::render::Budget;
use crate::report::LeftOut;
use crate::store::mesh::{BuildStage, MeshBuild, MeshStore};
use crate::store::photo::{PhotoSource, PhotoStore, Preparation, prepare_masks, prepare_photos};
use crate::{Error, Result};

/// The part of the photos' cache that masks get, where there are any: they compress to little, and decode fast.
const MASK_SHARE: u64 = 8;
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
        let build = MeshBuild {
            work: config.work.clone(),
            budget_bytes: usize::try_from(budget.build_bytes).unwrap_or(usize::MAX),
            resident_limit_bytes: budget.mesh_bytes,
        };
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

    /// Builds the photos' tile stores, or opens those that are there.
    pub(super) fn build(
        config: &Config,
        inputs: &Inputs,
        mesh: MeshStore,
        budget: &Budget,
    ) -> Result<Self> {
        let source = |photo: &Photo| PhotoSource {
            name: photo.name.clone(),
            path: config.photos.join(&photo.name),
            expected: Some(photo.lens.size()),
        };
        let sources: Vec<_> = inputs.photos.iter().map(source).collect();
        let folder = config.work.join("photos");
        let preparation = Preparation {
            folder: &folder,
            budget_bytes: budget.decode_bytes,
            threads: config.threads,
        };
        let progress = Progress::start("photo store", "photos", sources.len() as u64, config.quiet);
        let prepared = prepare_photos(&sources, &preparation, &|_| progress.add(1));
        progress.finish();
        let (mut photos, mut entries, mut left_out) =
            (Vec::new(), Vec::new(), inputs.left_out.clone());
        let mut sizes = Vec::new();
        for (photo, outcome) in inputs.photos.iter().zip(prepared?) {
            match outcome {
                Ok(tiles) => {
                    entries.push((photo.id.0 as usize, tiles.path().to_path_buf()));
                    photos.push(photo.clone());
                }
                Err(left) => {
                    sizes.push(left.sizes);
                    left_out.push(LeftOut {
                        photo: photo.name.clone(),
                        reason: left.reason.to_string(),
                    });
                }
            }
        }
        left_out.sort_by(|a, b| a.photo.cmp(&b.photo));
        if photos.is_empty() {
            return Err(Error::usage(none_usable(config, &left_out, &sizes)));
        }
        let masks = build_masks(config, inputs, &photos, budget)?;
        let mask_bytes = if masks.is_some() { budget.photo_bytes / MASK_SHARE } else { 0 };
        let pixels = PhotoStore::open(entries, budget.photo_bytes - mask_bytes)?;
        Ok(Self { mesh, pixels, masks, photos, left_out })
    }
}

/// Builds the tile stores of the masks of `photos`, or opens those that are there; `None` if there are no masks.
fn build_masks(
    config: &Config,
    inputs: &Inputs,
    photos: &[Photo],
    budget: &Budget,
) -> Result<Option<PhotoStore>> {
    if config.masks.is_none() {
        return Ok(None);
    }
    let is_used = |mask: &&Mask| photos.iter().any(|p| p.id.0 == mask.photo);
    let masks: Vec<_> = inputs.masks.iter().filter(is_used).collect();
    let sources: Vec<_> = masks.iter().map(|mask| mask.source.clone()).collect();
    let folder = config.work.join("masks");
    let preparation =
        Preparation { folder: &folder, budget_bytes: budget.decode_bytes, threads: config.threads };
    let progress = Progress::start("mask store", "masks", sources.len() as u64, config.quiet);
    let prepared = prepare_masks(&sources, &preparation, &|_| progress.add(1));
    progress.finish();
    let entries = masks
        .iter()
        .zip(prepared?)
        .map(|(mask, tiles)| (mask.photo as usize, tiles.path().to_path_buf()));
    PhotoStore::open(entries, budget.photo_bytes / MASK_SHARE).map(Some)
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
