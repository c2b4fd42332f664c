//! [`Pyramid`]: the levels of a file and their tiles.

use super::Compression;
use crate::geom::{PixelRect, Size};
use crate::{Error, Result};

/// The coarsest level fits in a square of this side, or in one tile if that is smaller: readers (and
/// `rio cogeo validate`) expect overviews of anything greater.
const COARSEST_SIDE: u32 = 512;
/// GDAL counts pixels in 31 bits.
const MAX_SIDE: u32 = i32::MAX as u32;
/// Greatest tile size: a mosaic tile of 16-bit RGB + alpha is then 128 MiB.
const MAX_TILE_SIZE: u32 = 4096;
/// TIFF demands that tile sides are multiples of this.
const TILE_STEP: u32 = 16;

/// Side of the tiles and their compression.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct TileFormat {
    /// Side of a tile in pixels.
    pub tile_size: u32,
    /// How tiles are compressed.
    pub compression: Compression,
}

/// A tile of a level: 0 is full resolution. Ordered by level, then row by row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileKey {
    /// The level.
    pub level: u32,
    /// Row of the tile.
    pub y: u32,
    /// Column of the tile.
    pub x: u32,
}

/// The levels of a file: each has half the size of the one before, rounded up, until one tile (or 512 × 512 pixels,
/// if that is less) holds it; and each is cut into tiles from its upper-left corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pyramid {
    size: Size,
    tile_size: u32,
}

impl TileKey {
    /// Tile `(x, y)` of `level`.
    pub fn new(level: u32, x: u32, y: u32) -> Self {
        Self { level, y, x }
    }

    /// The tile of the next coarser level that shows this one.
    #[must_use]
    pub fn parent(self) -> Self {
        Self { level: self.level + 1, x: self.x / 2, y: self.y / 2 }
    }
}

impl Pyramid {
    /// The levels of an image of `size`.
    ///
    /// # Errors
    /// If the size is zero or beyond 2³¹ − 1, or the tile size is no multiple of 16 from 16 to 4096.
    pub fn new(size: Size, tile_size: u32) -> Result<Self> {
        for (what, side) in [("mosaic width", size.width), ("mosaic height", size.height)] {
            if side == 0 {
                return Err(Error::usage(format!("{what}: expected at least 1 pixel, found 0")));
            }
            if side > MAX_SIDE {
                return Err(Error::Limit {
                    what: what.into(),
                    limit: MAX_SIDE.into(),
                    found: side.into(),
                });
            }
        }
        if tile_size == 0 || !tile_size.is_multiple_of(TILE_STEP) || tile_size > MAX_TILE_SIZE {
            return Err(Error::usage(format!(
                "--tile-size: expected a multiple of {TILE_STEP} up to {MAX_TILE_SIZE}, found {tile_size}"
            )));
        }
        Ok(Self { size, tile_size })
    }

    /// Side of a tile in pixels.
    pub fn tile_size(&self) -> u32 {
        self.tile_size
    }

    /// Number of levels, full resolution counted.
    pub fn levels(&self) -> u32 {
        let side = self.tile_size.min(COARSEST_SIDE);
        let mut size = self.size;
        let mut levels = 1;
        while size.width > side || size.height > side {
            size = size.halved();
            levels += 1;
        }
        levels
    }

    /// Size of a level in pixels.
    pub fn level_size(&self, level: u32) -> Size {
        (0..level).fold(self.size, |size, _| size.halved())
    }

    /// Tiles of a level, across and down.
    pub fn tiles(&self, level: u32) -> Size {
        let size = self.level_size(level);
        Size::new(size.width.div_ceil(self.tile_size), size.height.div_ceil(self.tile_size))
    }

    /// Number of tiles of a level.
    ///
    /// # Panics
    /// If they cannot be counted, let alone stored: on a 32-bit system.
    pub fn tile_count(&self, level: u32) -> usize {
        usize::try_from(self.tiles(level).area()).expect("tiles fit in memory")
    }

    /// Whether there is such a tile.
    pub fn contains(&self, tile: TileKey) -> bool {
        let tiles = self.tiles(tile.level.min(64));
        tile.level < self.levels() && tile.x < tiles.width && tile.y < tiles.height
    }

    /// The pixels of its level that a tile shows; clipped to the level.
    pub fn tile_rect(&self, tile: TileKey) -> PixelRect {
        let side = i64::from(self.tile_size);
        let (x, y) = (i64::from(tile.x) * side, i64::from(tile.y) * side);
        PixelRect::new(x, y, x + side, y + side).intersection(&self.level_size(tile.level).rect())
    }

    /// Size of a tile's pixels, as [`Self::tile_rect`].
    pub fn tile_pixels(&self, tile: TileKey) -> Size {
        let level = self.level_size(tile.level);
        let side = |whole: u32, at: u32| {
            whole.saturating_sub(at.saturating_mul(self.tile_size)).min(self.tile_size)
        };
        Size::new(side(level.width, tile.x), side(level.height, tile.y))
    }

    /// The up to four tiles of the next finer level that a tile of an overview shows; row by row.
    pub fn children(&self, tile: TileKey) -> impl Iterator<Item = TileKey> {
        let finer = tile.level.wrapping_sub(1);
        let tiles = if tile.level == 0 { Size::new(0, 0) } else { self.tiles(finer) };
        let (x, y) = (tile.x * 2, tile.y * 2);
        [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)]
            .into_iter()
            .filter(move |(x, y)| *x < tiles.width && *y < tiles.height)
            .map(move |(x, y)| TileKey::new(finer, x, y))
    }

    /// The tiles of a level, row by row.
    pub fn level_tiles(&self, level: u32) -> impl Iterator<Item = TileKey> + use<> {
        let tiles = self.tiles(level);
        (0..tiles.height)
            .flat_map(move |y| (0..tiles.width).map(move |x| TileKey::new(level, x, y)))
    }

    /// The tiles of all levels in the order in which their bytes stand in a file: the coarsest level first, full
    /// resolution last, each row by row.
    pub fn file_order(&self) -> impl Iterator<Item = TileKey> + use<> {
        let this = *self;
        (0..self.levels()).rev().flat_map(move |level| this.level_tiles(level))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_end_when_one_tile_or_512_pixels_hold_them() {
        let levels = |w, h, t| Pyramid::new(Size::new(w, h), t).unwrap().levels();
        assert_eq!(levels(1, 1, 512), 1);
        assert_eq!(levels(512, 512, 512), 1);
        assert_eq!(levels(513, 1, 512), 2);
        assert_eq!(levels(100, 33, 16), 4);
        assert_eq!(levels(1000, 1000, 1024), 2);
        assert_eq!(levels(MAX_SIDE, MAX_SIDE, 16), 28);
    }

    #[test]
    fn tiles_of_a_level_cover_it_and_children_share_it_out() {
        let pyramid = Pyramid::new(Size::new(1003, 517), 64).unwrap();
        for level in 0..pyramid.levels() {
            let area: usize = pyramid.level_tiles(level).map(|t| pyramid.tile_rect(t).area()).sum();
            assert_eq!(area as u64, pyramid.level_size(level).area());
            let mut children: Vec<_> =
                pyramid.level_tiles(level).flat_map(|t| pyramid.children(t)).collect();
            children.sort_by_key(|t| (t.y, t.x));
            let finer: Vec<_> =
                level.checked_sub(1).map_or(vec![], |l| pyramid.level_tiles(l).collect());
            assert_eq!(children, finer);
            assert!(pyramid.level_tiles(level).all(|t| pyramid.contains(t)));
            assert!(pyramid.children(TileKey::new(level, 0, 0)).all(|t| t.parent().level == level));
        }
        assert!(!pyramid.contains(TileKey::new(0, 16, 0)));
        assert!(!pyramid.contains(TileKey::new(pyramid.levels(), 0, 0)));
    }

    #[test]
    fn a_tile_size_that_tiff_forbids_is_a_usage_error() {
        for t in [0, 8, 500, 8192] {
            assert_eq!(Pyramid::new(Size::new(5, 5), t).unwrap_err().exit_code(), 2);
        }
        assert!(Pyramid::new(Size::new(0, 5), 512).is_err());
        assert!(Pyramid::new(Size::new(5, u32::MAX), 512).is_err());
    }
}
