//! [`Shelf`]: the folder of the stores, and the memory that photos and masks get.

use std::path::Path;

use super::super::progress::Progress;
use crate::Result;
use crate::render::Budget;
use crate::store::mesh::MeshStore;
use crate::store::photo::{
    LeftOut, PhotoSource, PhotoStore, Preparation, PreparedPhoto, Reading, prepare_masks,
    prepare_photos,
};

/// The part of the photos' cache that masks get, where there are any: they compress to little, and decode fast.
const MASK_SHARE: u64 = 8;
/// The part of the photos' cache, at most, that is set aside for windows that are being decoded: not all threads do so at
/// the same time.
const MOST_WINDOWS: u64 = 2;

/// Where photo stores lie, and within what they are made and read.
#[derive(Debug, Clone, Copy)]
pub(in crate::cli) struct Shelf<'a> {
    /// The folder of the stores.
    pub(in crate::cli) folder: &'a Path,
    pub(in crate::cli) budget: &'a Budget,
    pub(in crate::cli) has_masks: bool,
    /// Whether photos may be decoded into memory: not if other processes are to read them.
    pub(in crate::cli) in_memory: bool,
    pub(in crate::cli) quiet: bool,
}

impl Shelf<'_> {
    /// Makes photos ready to be read: in the order of `sources`, or why they cannot be used.
    pub(in crate::cli) fn prepare(
        &self,
        sources: &[PhotoSource],
        mesh: &MeshStore,
    ) -> Result<Vec<std::result::Result<PreparedPhoto, LeftOut>>> {
        let folder = self.folder.join("photos");
        let memory_bytes = if self.in_memory { self.photo_bytes() } else { 0 };
        let preparation = Preparation { memory_bytes, ..self.preparation(&folder, mesh) };
        let progress = Progress::start("photo store", "photos", sources.len() as u64, self.quiet);
        let prepared = prepare_photos(sources, &preparation, &|_| progress.add(1));
        progress.finish();
        prepared
    }

    /// The store of prepared photos, each with its number.
    pub(in crate::cli) fn pixels(
        &self,
        entries: Vec<(usize, PreparedPhoto)>,
    ) -> Result<PhotoStore> {
        let held: u64 = entries.iter().map(|(_, photo)| photo.memory_bytes()).sum();
        let threads = rayon::current_num_threads() as u64;
        let windows = if entries.iter().any(|(_, photo)| photo.is_indexed()) {
            (PhotoStore::WINDOW_BYTES * threads).min(self.photo_bytes() / MOST_WINDOWS)
        } else {
            0
        };
        PhotoStore::new(entries, self.photo_bytes().saturating_sub(held + windows))
    }

    /// Builds the tile stores of masks, or opens those that are there; `None` if masks were not asked for.
    pub(in crate::cli) fn masks(
        &self,
        masks: &[(u32, PhotoSource)],
        mesh: &MeshStore,
    ) -> Result<Option<PhotoStore>> {
        if !self.has_masks {
            return Ok(None);
        }
        let sources: Vec<_> = masks.iter().map(|(_, source)| source.clone()).collect();
        let folder = self.folder.join("masks");
        let progress = Progress::start("mask store", "masks", sources.len() as u64, self.quiet);
        let preparation = self.preparation(&folder, mesh);
        let prepared = prepare_masks(&sources, &preparation, &|_| progress.add(1));
        progress.finish();
        let entries = masks.iter().map(|(photo, _)| *photo as usize).zip(prepared?);
        PhotoStore::new(entries, self.mask_bytes()).map(Some)
    }

    fn mask_bytes(&self) -> u64 {
        if self.has_masks { self.budget.photo_bytes / MASK_SHARE } else { 0 }
    }

    fn photo_bytes(&self) -> u64 {
        self.budget.photo_bytes - self.mask_bytes()
    }

    fn preparation<'a>(&self, folder: &'a Path, mesh: &MeshStore) -> Preparation<'a> {
        Preparation {
            folder,
            budget_bytes: self.budget.decode_bytes,
            beside_bytes: mesh.held_bytes(),
            threads: rayon::current_num_threads(),
            memory_bytes: 0,
            reading: Reading::Auto,
        }
    }
}
