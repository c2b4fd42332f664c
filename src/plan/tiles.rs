//! [`TileGrid`]: the mosaic cut into tiles.

use crate::geom::{PixelRect, Size, hilbert2};
use crate::{Error, Result};

/// Number of a tile: row-major from the upper left, as tiles stand in a TIFF file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileId(pub u32);

/// A mosaic cut into square tiles; those at the right and lower edge may be cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileGrid {
    size: Size,
    tile_size: u32,
    columns: u32,
    rows: u32,
}

impl TileGrid {
    /// A mosaic of `size` pixels in tiles of `tile_size` pixels a side.
    ///
    /// # Errors
    /// [`Error::Limit`] for 2³² tiles or more; [`Error::Usage`] for a tile size or a mosaic of 0.
    pub fn new(size: Size, tile_size: u32) -> Result<Self> {
        if tile_size == 0 || size.area() == 0 {
            return Err(Error::usage(format!(
                "expected a mosaic and tiles of at least one pixel, found {} × {} in tiles of {tile_size}",
                size.width, size.height
            )));
        }
        let (columns, rows) = (size.width.div_ceil(tile_size), size.height.div_ceil(tile_size));
        let found = u64::from(columns) * u64::from(rows);
        let limit = u64::from(u32::MAX);
        if found > limit {
            return Err(Error::Limit { what: "number of tiles".into(), limit, found });
        }
        Ok(Self { size, tile_size, columns, rows })
    }

    /// Width and height of the mosaic, pixels.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Side of a tile, pixels.
    pub fn tile_size(&self) -> u32 {
        self.tile_size
    }

    /// Tiles in a row.
    pub fn columns(&self) -> u32 {
        self.columns
    }

    /// Rows of tiles.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Number of tiles; their ids run from 0.
    pub fn count(&self) -> u32 {
        self.columns * self.rows
    }

    /// Column and row of a tile.
    ///
    /// # Panics
    /// If the grid has no such tile.
    pub fn address(&self, tile: TileId) -> (u32, u32) {
        assert!(tile.0 < self.count(), "{tile:?} of {} tiles", self.count());
        (tile.0 % self.columns, tile.0 / self.columns)
    }

    /// The tile in a column and row.
    ///
    /// # Panics
    /// If the grid has no such tile.
    pub fn tile(&self, column: u32, row: u32) -> TileId {
        assert!(column < self.columns && row < self.rows, "tile {column}, {row} outside the grid");
        TileId(row * self.columns + column)
    }

    /// The pixels of a tile, cut at the mosaic's edge.
    ///
    /// # Panics
    /// If the grid has no such tile.
    pub fn rect(&self, tile: TileId) -> PixelRect {
        let (column, row) = self.address(tile);
        let side = i64::from(self.tile_size);
        let (x, y) = (i64::from(column) * side, i64::from(row) * side);
        PixelRect::new(x, y, x + side, y + side).intersection(&self.size.rect())
    }

    /// All tiles, once, along a Hilbert curve: neighbours on it are neighbours in the mosaic, so that what one tile
    /// read is likely of use to the next. Four bytes a tile.
    pub fn order(&self) -> Vec<TileId> {
        let side = self.columns.max(self.rows);
        // The least number of bits that can tell the columns and rows apart, at least 1.
        let bits = (u32::BITS - (side - 1).leading_zeros()).max(1);
        let mut order: Vec<_> = (0..self.count()).map(TileId).collect();
        order.sort_unstable_by_key(|&tile| {
            let (column, row) = self.address(tile);
            hilbert2([column, row], bits)
        });
        order
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_every_pixel_exactly_once() {
        let grid = TileGrid::new(Size::new(130, 65), 32).unwrap();
        assert_eq!((grid.columns(), grid.rows(), grid.count()), (5, 3, 15));
        let mut hits = vec![0; 130 * 65];
        for tile in (0..grid.count()).map(TileId) {
            let r = grid.rect(tile);
            assert!(!r.is_empty());
            for y in r.y0..r.y1 {
                for x in r.x0..r.x1 {
                    hits[usize::try_from(y * 130 + x).unwrap()] += 1;
                }
            }
        }
        assert!(hits.iter().all(|h| *h == 1));
    }

    #[test]
    fn ids_run_row_by_row_and_address_is_their_inverse() {
        let grid = TileGrid::new(Size::new(130, 65), 32).unwrap();
        assert_eq!(grid.address(TileId(7)), (2, 1));
        assert_eq!(grid.rect(TileId(14)), PixelRect::new(128, 64, 130, 65));
        for tile in (0..grid.count()).map(TileId) {
            let (column, row) = grid.address(tile);
            assert_eq!(grid.tile(column, row), tile);
        }
    }

    #[test]
    fn the_order_holds_every_tile_once_and_a_square_is_walked_in_single_steps() {
        for (w, h) in [(1, 1), (5, 3), (1, 9), (17, 2), (8, 8)] {
            let grid = TileGrid::new(Size::new(w * 16, h * 16), 16).unwrap();
            let order = grid.order();
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..w * h).map(TileId).collect::<Vec<_>>());
            if w == h {
                for pair in order.windows(2) {
                    let ((ax, ay), (bx, by)) = (grid.address(pair[0]), grid.address(pair[1]));
                    assert_eq!(ax.abs_diff(bx) + ay.abs_diff(by), 1);
                }
            }
        }
    }

    #[test]
    fn too_many_tiles_or_none_are_refused() {
        let side = i32::MAX.unsigned_abs();
        assert!(matches!(TileGrid::new(Size::new(side, side), 16), Err(Error::Limit { .. })));
        assert!(TileGrid::new(Size::new(side, side), 65536).is_ok());
        assert!(matches!(TileGrid::new(Size::new(0, 5), 16), Err(Error::Usage(_))));
        assert!(matches!(TileGrid::new(Size::new(5, 5), 0), Err(Error::Usage(_))));
    }
}
