//! [`Known`]: the tiles that parts hold already, and what is left to do.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use super::notes::note_layer;
use super::part::Entry;
use super::{Manifest, PartReader, TileAddress};
use crate::output::{Pyramid, Raster, Scratch, TileKey, decode_tile};
use crate::{Error, Result};

/// Files of parts that are open at the same time, at most.
const MAX_OPEN: usize = 64;

/// Parts of a job, seen as one.
///
/// Memory: 40 bytes a tile beside the parts' own.
#[derive(Debug)]
pub(super) struct Known<'a> {
    manifest: &'a Manifest,
    parts: Vec<PartReader>,
    /// Every tile of every layer once, with the first part that holds it; in the order of [`Entry`].
    index: Vec<(Entry, u32)>,
    /// The parts read last, the latest first.
    recent: Mutex<Vec<u32>>,
}

/// A piece of work of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Work {
    /// Render a tile.
    Render(TileAddress),
    /// Read a tile back, because an overview that needs it is missing.
    Restore(TileKey),
}

impl<'a> Known<'a> {
    pub(super) fn new(manifest: &'a Manifest, parts: Vec<PartReader>) -> Self {
        let numbered = (0_u32..).zip(&parts);
        let mut index: Vec<_> = numbered
            .flat_map(|(number, part)| part.entries().iter().map(move |entry| (*entry, number)))
            .collect();
        index.sort_unstable_by_key(|(entry, number)| (place(entry), *number));
        index.dedup_by_key(|(entry, _)| place(entry));
        Self { manifest, parts, index, recent: Mutex::default() }
    }

    pub(super) fn parts(&self) -> &[PartReader] {
        &self.parts
    }

    /// Whether all layers of a tile are there, and its note if it is one that is rendered.
    pub(super) fn has(&self, tile: TileKey) -> bool {
        let layers = note_layer(self.manifest) + usize::from(tile.level == 0);
        (0..layers).all(|layer| self.find(layer, tile).is_some())
    }

    /// Where a tile of a layer stands.
    pub(super) fn find(&self, layer: usize, tile: TileKey) -> Option<&(Entry, u32)> {
        let wanted = place(&Entry::new(layer, tile, 0, 0));
        let at = self.index.binary_search_by_key(&wanted, |(entry, _)| place(entry)).ok()?;
        Some(&self.index[at])
    }

    /// Reads what [`Self::find`] found into `bytes`, replacing what they held.
    ///
    /// # Errors
    /// As [`PartReader::read`].
    pub(super) fn read(&self, found: &(Entry, u32), bytes: &mut Vec<u8>) -> Result<()> {
        let (entry, number) = found;
        {
            let mut recent = self.recent.lock().unwrap_or_else(PoisonError::into_inner);
            match recent.iter().position(|n| n == number) {
                Some(at) => recent[..=at].rotate_right(1),
                None => recent.insert(0, *number),
            }
            if recent.len() > MAX_OPEN
                && let Some(oldest) = recent.pop()
            {
                self.parts[oldest as usize].close();
            }
        }
        self.parts[*number as usize].read(entry, bytes)
    }

    /// The pixels of a tile, one raster for each layer.
    ///
    /// # Errors
    /// If it is not there, or damaged.
    pub(super) fn rasters(&self, tile: TileKey, scratch: &mut Scratch) -> Result<Vec<Raster>> {
        let format = self.manifest.format();
        let size = self.manifest.pyramid().tile_pixels(tile);
        let mut bytes = Vec::new();
        let mut rasters = Vec::new();
        for (i, layer) in self.manifest.layers().iter().enumerate() {
            let found = self.find(i, tile).ok_or_else(|| missing(tile))?;
            self.read(found, &mut bytes)?;
            let raster =
                decode_tile(layer, &bytes, size, format.tile_size, format.compression, scratch)
                    .map_err(|damage| {
                        let place = format!("byte {}, {tile}", found.0.offset);
                        damage.into_error(self.parts[found.1 as usize].path(), place)
                    })?;
            rasters.push(raster);
        }
        Ok(rasters)
    }

    /// What is to be done so that all of `tiles` and all overviews of them are there, in the order of `tiles`.
    ///
    /// A tile that is there, at whatever level, is read back only if the overview above it is missing.
    pub(super) fn work(&self, tiles: &[TileAddress]) -> Vec<Work> {
        let levels = self.manifest.pyramid().levels();
        let mut restored = BTreeSet::new();
        let mut work = Vec::new();
        for tile in tiles {
            let mut at = TileKey::from(*tile);
            let mut there = self.has(at);
            if !there {
                work.push(Work::Render(*tile));
            }
            while at.level + 1 < levels {
                let parent = at.parent();
                let parent_there = self.has(parent);
                if there && !parent_there && restored.insert(at) {
                    work.push(Work::Restore(at));
                }
                (at, there) = (parent, parent_there);
            }
        }
        work
    }

    /// The tiles of a level that are not there.
    pub(super) fn missing(&self, pyramid: &Pyramid, level: u32) -> BTreeSet<TileKey> {
        pyramid.level_tiles(level).filter(|tile| !self.has(*tile)).collect()
    }
}

/// What identifies a tile of a layer, in the order of [`Entry`].
fn place(entry: &Entry) -> (u16, u32, u32, u16) {
    (entry.level, entry.y, entry.x, entry.layer)
}

fn missing(tile: TileKey) -> Error {
    Error::usage(format!("{tile}: expected in the parts of the job, found nowhere"))
}
