//! [`open`]: a planned job, made ready to render some of its tiles.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::super::ortho::{Job, Shelf, Stores, canvas, scene, tile_demand};
use super::folder::JobFolder;
use super::record::{FileRecord, JobRecord, PhotoRecord};
use super::stamp::Stamp;
use crate::camera::Photo;
use crate::geom::PixelRect;
use crate::plan::{PhotoNeed, photo_needs};
use crate::render::Budget;
use crate::store::mesh::MeshStore;
use crate::store::photo::{Demand, PhotoSource};
use crate::{Error, Result};

/// Where the inputs of a job lie now, if not where its manifest says; and what rendering may take.
#[derive(Debug, Clone, Default)]
pub(in crate::cli) struct Circumstances {
    /// The folder of the photos.
    pub(in crate::cli) photos: Option<PathBuf>,
    /// The folder of the masks.
    pub(in crate::cli) masks: Option<PathBuf>,
    /// The memory cap, bytes.
    pub(in crate::cli) memory_bytes: u64,
    pub(in crate::cli) quiet: bool,
}

/// Opens the stores of a job for the tiles in `rect`: photos that these cannot show are not looked at. The pixels are the
/// same whatever the rectangle.
///
/// # Errors
/// If the stores are missing or damaged; [`Error::Usage`] if an input is not the one that the job was planned with, or a
/// photo cannot be read any more; [`Error::OverBudget`].
pub(in crate::cli) fn open(
    folder: &JobFolder,
    record: JobRecord,
    rect: &PixelRect,
    circumstances: &Circumstances,
) -> Result<(Job, Budget)> {
    let Circumstances { memory_bytes, quiet, .. } = *circumstances;
    let (format, layers) = (record.manifest.format(), record.manifest.layers());
    let sections = record.manifest.sections();
    let demand = tile_demand(format.tile_size, layers.iter().cloned(), sections);
    let budget = Budget::new(memory_bytes, rayon::current_num_threads(), demand)?;
    record.mesh.files.iter().try_for_each(|file| check_mesh(folder, file))?;
    let work = folder.resolve(&record.stores);
    let mesh = mesh_store(&work, &record, budget.mesh_bytes)?;
    let budget = budget.with_mesh(mesh.file_bytes());
    let mosaic = record.mosaic(folder)?;
    let photos = record.photos(folder)?;
    let needs = photo_needs(&mesh, &mosaic, rect, &photos);
    let places = Places::of(folder, &record, circumstances);
    let wanted: Vec<Wanted<'_>> = record
        .photos
        .iter()
        .zip(photos)
        .zip(needs)
        .filter_map(|((record, photo), need)| Some(Wanted { record, photo, need: need? }))
        .collect();
    wanted.par_iter().try_for_each(|photo| places.check(photo))?;
    let has_masks = record.mask_folder.is_some();
    let shelf = Shelf { folder: &work, budget: &budget, has_masks, in_memory: true, quiet };
    let sources: Vec<_> = wanted.iter().map(|photo| places.photo(photo)).collect();
    let prepared = shelf.prepare(&sources, &mesh)?;
    let mut entries = Vec::new();
    for (photo, ready) in wanted.iter().zip(prepared) {
        entries.push((photo.record.id as usize, ready.map_err(|left_out| left_out.reason)?));
    }
    let masks: Vec<_> = wanted.iter().filter_map(|photo| places.mask(photo)).collect();
    let masks = shelf.masks(&masks, &mesh)?;
    let pixels = shelf.pixels(entries)?;
    let records = wanted.iter().map(|photo| photo.record);
    let tones: Vec<_> =
        records.map(|record| record.levelled.as_ref().map(|levelled| &levelled.tone)).collect();
    let photos = wanted.into_iter().map(|photo| photo.photo).collect();
    let stores = Stores { mesh, pixels, masks, photos, left_out: Vec::new() };
    let canvas = canvas(&record.section_mosaics(&mosaic), &record.rendering, stores.mesh.origin());
    let scene = scene(&record.rendering, stores, &tones, record.names.len())?;
    Ok((Job { folder: folder.clone(), record, mosaic, canvas, scene }, budget))
}

/// The mesh store of a job, in the folder `work` of its stores.
pub(in crate::cli) fn mesh_store(
    work: &Path,
    record: &JobRecord,
    resident_limit_bytes: u64,
) -> Result<MeshStore> {
    let path = work.join(&record.mesh.store);
    let mesh = MeshStore::open(&path, resident_limit_bytes)?;
    let key = mesh.key().hex();
    if key == record.mesh.key {
        Ok(mesh)
    } else {
        Err(Error::corrupt(path, "key", record.mesh.key.as_str(), key))
    }
}

/// A photo that the tiles may show.
struct Wanted<'a> {
    record: &'a PhotoRecord,
    photo: Photo,
    need: PhotoNeed,
}

/// The folders of the inputs.
struct Places {
    photos: PathBuf,
    masks: PathBuf,
}

impl Places {
    fn of(folder: &JobFolder, record: &JobRecord, now: &Circumstances) -> Self {
        let stated = |stated: &str| folder.resolve(stated);
        let photos = now.photos.clone().unwrap_or_else(|| stated(&record.photo_folder));
        let masks = now.masks.clone();
        let masks = masks.or_else(|| record.mask_folder.as_deref().map(stated));
        Self { photos, masks: masks.unwrap_or_default() }
    }

    /// That photo and mask are those that the job was planned with.
    fn check(&self, wanted: &Wanted<'_>) -> Result<()> {
        let record = wanted.record;
        let photo = self.photos.join(&record.name);
        if let Some(stamp) = &record.stamp {
            check(&photo, stamp)?;
        }
        record.mask.iter().try_for_each(|mask| check(&self.masks.join(&mask.file), &mask.stamp))
    }

    fn photo(&self, wanted: &Wanted<'_>) -> PhotoSource {
        let Wanted { record, photo, need } = wanted;
        PhotoSource {
            name: record.name.clone(),
            path: self.photos.join(&record.name),
            expected: Some(photo.lens.size()),
            demand: Some(Demand { pixels: need.pixels, level: need.level }),
        }
    }

    fn mask(&self, wanted: &Wanted<'_>) -> Option<(u32, PhotoSource)> {
        let Wanted { record, photo, .. } = wanted;
        let source = PhotoSource {
            name: record.name.clone(),
            path: self.masks.join(&record.mask.as_ref()?.file),
            expected: Some(photo.lens.size()),
            demand: Some(Demand::ALL),
        };
        Some((record.id, source))
    }
}

/// A mesh is in its store; where its file is still there, it must be the same.
fn check_mesh(folder: &JobFolder, file: &FileRecord) -> Result<()> {
    let path = folder.resolve(&file.file);
    if path.exists() { check(&path, &file.stamp) } else { Ok(()) }
}

fn check(path: &Path, stamp: &Stamp) -> Result<()> {
    if stamp.fits(path)? {
        return Ok(());
    }
    Err(Error::corrupt(
        path,
        "content",
        "the file that the job was planned with",
        "another one (plan the job again, with --changed to keep what still holds)",
    ))
}
