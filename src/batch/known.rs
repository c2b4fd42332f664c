//! [`Known`]: the tiles that parts hold already, and what is left to do.

use std::collections::BTreeSet;

use super::notes::note_layer;
use super::part::Entry;
use super::{Manifest, PartReader, TileAddress};
use crate::output::{Pyramid, Raster, Scratch, TileKey, decode_tile};
use crate::{Error, Result};

/// Open parts of a job, seen as one.
#[derive(Debug)]
pub(super) struct Known<'a> {
    manifest: &'a Manifest,
    parts: Vec<PartReader>,
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
        Self { manifest, parts }
    }

    pub(super) fn parts(&self) -> &[PartReader] {
        &self.parts
    }

    /// Whether all layers of a tile are there, and its note if it is one that is rendered.
    pub(super) fn has(&self, tile: TileKey) -> bool {
        let layers = note_layer(self.manifest) + usize::from(tile.level == 0);
        (0..layers).all(|layer| self.find(layer, tile).is_some())
    }

    /// The part that holds a tile of a layer, and where.
    pub(super) fn find(&self, layer: usize, tile: TileKey) -> Option<(&PartReader, &Entry)> {
        self.parts.iter().find_map(|part| part.find(layer, tile).map(|entry| (part, entry)))
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
            let (part, entry) = self.find(i, tile).ok_or_else(|| missing(tile))?;
            part.read(entry, &mut bytes)?;
            let raster =
                decode_tile(layer, &bytes, size, format.tile_size, format.compression, scratch)
                    .map_err(|damage| {
                        let place = format!("byte {}, {tile}", entry.offset);
                        damage.into_error(part.path(), place)
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

fn missing(tile: TileKey) -> Error {
    Error::usage(format!("{tile}: expected in the parts of the job, found nowhere"))
}
