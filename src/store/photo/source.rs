//! The tiles of a photo, from wherever its samples come.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::PhotoStore;
use super::cache::{Key, Tile};
use super::format::{TILE_SIDE, TileId};
use super::halve::halve_into;
use super::jpeg::IndexedJpeg;
use super::prepared::{PreparedPhoto, Source};
use crate::geom::PixelRect;
use crate::{Error, Result};

/// Columns and rows of tiles that are decoded from a photo's own file in one go.
const BLOCK: (i64, i64) = (4, 2);

impl PreparedPhoto {
    /// Columns and rows of tiles that are best asked for in one go.
    pub(super) fn block(&self) -> (i64, i64) {
        if self.is_indexed() { BLOCK } else { (1, 1) }
    }
}

/// The tiles of a rectangle of columns and rows of tiles, row by row.
pub(super) fn tile_ids(level: u32, tiles: PixelRect) -> impl Iterator<Item = TileId> {
    let index = |at: i64| u32::try_from(at).expect("tiles of a level start at 0");
    (tiles.y0..tiles.y1).flat_map(move |y| {
        (tiles.x0..tiles.x1).map(move |x| TileId { level, x: index(x), y: index(y) })
    })
}

impl PhotoStore {
    /// Memory that a thread holds at most while it decodes a window of a photo that is read by an index, bytes: samples of
    /// a block of tiles and a margin, tiles cut from them, the window's data twice, and the decoder's rows; or what a window of a coarse level is halved from.
    pub const WINDOW_BYTES: u64 = 14 << 20;

    /// Decoded tiles of a photo, row by row, from memory, the cache or the photo's source; at most a
    /// [block](PreparedPhoto::block) of them.
    pub(super) fn tiles(
        &self,
        photo: usize,
        level: u32,
        block: PixelRect,
    ) -> Result<Vec<Arc<Tile>>> {
        match &self.photo(photo).source {
            Source::Indexed(indexed) if level == 0 => self.indexed_tiles(photo, indexed, block),
            _ => tile_ids(level, block).map(|id| self.tile(photo, id)).collect(),
        }
    }

    fn tile(&self, photo: usize, id: TileId) -> Result<Arc<Tile>> {
        let prepared = self.photo(photo);
        match &prepared.source {
            Source::Memory(.., tiles) => {
                self.counts.hits.fetch_add(1, Ordering::Relaxed);
                Ok(tiles.tile(prepared.shape.ordinal(id)))
            }
            Source::Tiles(tiles) => self.cached(photo, id, |mut tile| {
                match &mut tile {
                    Tile::U8(buffer) => self.files.read(photo, tiles, id, buffer)?,
                    Tile::U16(buffer) => self.files.read(photo, tiles, id, buffer)?,
                }
                Ok(tile)
            }),
            Source::Indexed(_) => self.cached(photo, id, |tile| self.halved(photo, id, tile)),
            Source::Unread(path) => Err(Error::usage(format!(
                "{}: no part of it was expected to be needed, so it was not prepared",
                path.display()
            ))),
        }
    }

    /// A tile from the cache, or made by `make`, which is given one of the right size.
    fn cached(
        &self,
        photo: usize,
        id: TileId,
        make: impl FnOnce(Tile) -> Result<Tile>,
    ) -> Result<Arc<Tile>> {
        let key = Key::new(photo, id);
        if let Some(tile) = self.cache.get(key) {
            self.counts.hits.fetch_add(1, Ordering::Relaxed);
            return Ok(tile);
        }
        self.counts.decoded.fetch_add(1, Ordering::Relaxed);
        let shape = self.photo(photo).shape;
        let samples = shape.tile_samples(id);
        let mut room = self.cache.reserve(key, (samples * shape.sample_bytes()) as u64);
        let old = room.recycled();
        let tile = make(Tile::of(shape.bits, samples, old))?;
        Ok(room.keep(tile))
    }

    /// A tile of a level above 0, from the tiles below it.
    fn halved(&self, photo: usize, id: TileId, mut tile: Tile) -> Result<Tile> {
        let shape = self.photo(photo).shape;
        let below = id.level - 1;
        let size = shape.level_tiles(below);
        let (x, y) = (i64::from(id.x) * 2, i64::from(id.y) * 2);
        let all = PixelRect::new(0, 0, size.width.into(), size.height.into());
        let four = PixelRect::new(x, y, x + 2, y + 2).intersection(&all);
        // Level 0 is decoded in one go; of the others one tile at a time is held.
        let parts = if below == 0 { vec![four] } else { four.blocks(1).collect() };
        for part in parts {
            for (from, samples) in tile_ids(below, part).zip(self.tiles(photo, below, part)?) {
                match (&*samples, &mut tile) {
                    (Tile::U8(samples), Tile::U8(tile)) => {
                        halve_into(shape, (from, samples), (id, tile));
                    }
                    (Tile::U16(samples), Tile::U16(tile)) => {
                        halve_into(shape, (from, samples), (id, tile));
                    }
                    _ => {}
                }
            }
        }
        Ok(tile)
    }

    /// Tiles of level 0 from the photo's own file: those that are not in the cache are decoded in one go.
    fn indexed_tiles(
        &self,
        photo: usize,
        indexed: &IndexedJpeg,
        block: PixelRect,
    ) -> Result<Vec<Arc<Tile>>> {
        let mut tiles: Vec<_> =
            tile_ids(0, block).map(|id| self.cache.get(Key::new(photo, id))).collect();
        let missing =
            || tile_ids(0, block).zip(&tiles).filter(|(_, t)| t.is_none()).map(|(id, _)| id);
        let found = tiles.len() - missing().count();
        self.counts.hits.fetch_add(found as u64, Ordering::Relaxed);
        let Some(wanted) = missing().map(tile_pixels).reduce(around) else {
            return Ok(tiles.into_iter().flatten().collect());
        };
        let shape = self.photo(photo).shape;
        let part = self.indexed.read(photo, indexed, wanted.intersection(&shape.size.rect()))?;
        self.counts.pixels.fetch_add(part.rect.area() as u64, Ordering::Relaxed);
        for (id, slot) in tile_ids(0, block).zip(&mut tiles).filter(|(_, slot)| slot.is_none()) {
            let cut = |mut tile: Tile| {
                if let Tile::U8(buffer) = &mut tile {
                    part.copy(
                        tile_pixels(id).intersection(&shape.size.rect()),
                        shape.channels,
                        buffer,
                    );
                }
                Ok(tile)
            };
            *slot = Some(self.cached(photo, id, cut)?);
        }
        Ok(tiles.into_iter().flatten().collect())
    }
}

/// The pixels of a tile of level 0, beyond the photo's edge too.
fn tile_pixels(id: TileId) -> PixelRect {
    let side = i64::from(TILE_SIDE);
    let (x, y) = (i64::from(id.x) * side, i64::from(id.y) * side);
    PixelRect::new(x, y, x + side, y + side)
}

/// The least rectangle that holds both.
fn around(a: PixelRect, b: PixelRect) -> PixelRect {
    PixelRect::new(a.x0.min(b.x0), a.y0.min(b.y0), a.x1.max(b.x1), a.y1.max(b.y1))
}
