//! The mesh store and the photo stores of a job.

use super::super::config::Config;
use super::super::progress::Progress;
use super::inputs::Inputs;
use super::job::Place;
use super::shelf::Shelf;
use crate::camera::Photo;
use crate::geom::Size;
use crate::plan::PhotoNeed;
use crate::render::Budget;
use crate::report::LeftOut;
use crate::store::mesh::{BuildStage, MeshBuild, MeshStore};
use crate::store::photo::{self, Demand, PhotoSource, PhotoStore, check_headers};
use crate::{Error, Result};

/// Sides that differ by one factor agree to this part of a pixel.
const FACTOR_SLACK_PX: f64 = 1.0;

/// What a job renders from.
#[derive(Debug)]
pub(in crate::cli) struct Stores {
    pub(in crate::cli) mesh: MeshStore,
    pub(in crate::cli) pixels: PhotoStore,
    /// The masks of those of the photos that have one.
    pub(in crate::cli) masks: Option<PhotoStore>,
    /// The photos in the store, by id.
    pub(in crate::cli) photos: Vec<Photo>,
    /// The photos that were chosen but could not be used, by name.
    pub(in crate::cli) left_out: Vec<LeftOut>,
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
        (budget, place): (&Budget, Place<'_>),
    ) -> Result<Self> {
        let demand = |need: &PhotoNeed| Demand { pixels: need.pixels, level: need.level };
        let source = |(photo, need): (&Photo, &Option<PhotoNeed>)| {
            photo_source(config, photo, need.as_ref().map(demand))
        };
        let sources: Vec<_> = photos.photos.iter().zip(needs).map(source).collect();
        let shelf = Shelf {
            folder: &config.work,
            budget,
            has_masks: config.masks.is_some(),
            in_memory: matches!(place, Place::Work),
            quiet: config.quiet,
        };
        let prepared = shelf.prepare(&sources, &mesh)?;
        let UsablePhotos { photos: usable, mut left_out, mut sizes } = photos;
        let (mut photos, mut entries) = (Vec::new(), Vec::new());
        for (photo, outcome) in usable.into_iter().zip(prepared) {
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
        let masks = inputs.masks.iter().filter(|m| is_needed(m.photo));
        let masks: Vec<_> = masks.map(|mask| (mask.photo, mask.source.clone())).collect();
        let masks = shelf.masks(&masks, &mesh)?;
        let pixels = shelf.pixels(entries)?;
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

/// How the mesh store is built.
pub(super) fn mesh_build(config: &Config, budget: &Budget) -> MeshBuild {
    MeshBuild {
        work: config.work.clone(),
        budget_bytes: usize::try_from(budget.build_bytes).unwrap_or(usize::MAX),
        resident_limit_bytes: budget.mesh_bytes,
    }
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
