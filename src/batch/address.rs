//! [`TileAddress`] and the order of tiles.

use crate::geom::hilbert2;
use crate::output::{Pyramid, TileKey};

/// A tile of the mosaic: columns of tiles from the left, rows of tiles from the top.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
pub struct TileAddress {
    /// Column of the tile.
    pub x: u32,
    /// Row of the tile.
    pub y: u32,
}

impl From<TileAddress> for TileKey {
    fn from(tile: TileAddress) -> Self {
        Self::new(0, tile.x, tile.y)
    }
}

/// All tiles of the mosaic along the Hilbert curve: neighbours in the list are neighbours in the mosaic.
pub fn curve_order(pyramid: &Pyramid) -> Vec<TileAddress> {
    let tiles = pyramid.tiles(0);
    let bits = (u32::BITS - (tiles.width.max(tiles.height) - 1).leading_zeros()).max(1);
    let mut order: Vec<TileAddress> =
        pyramid.level_tiles(0).map(|t| TileAddress { x: t.x, y: t.y }).collect();
    order.sort_by_cached_key(|t| hilbert2([t.x, t.y], bits));
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Size;

    #[test]
    fn the_order_holds_every_tile_once_and_a_square_is_walked_in_single_steps() {
        for (w, h) in [(1, 1), (5, 3), (1, 9), (17, 2), (8, 8)] {
            let pyramid = Pyramid::new(Size::new(w * 128, h * 128), 128).unwrap();
            let order = curve_order(&pyramid);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            sorted.dedup();
            assert_eq!(sorted.len(), order.len());
            assert_eq!(order.len(), (w * h) as usize);
            if w == h {
                for pair in order.windows(2) {
                    assert_eq!(pair[0].x.abs_diff(pair[1].x) + pair[0].y.abs_diff(pair[1].y), 1);
                }
            }
        }
    }
}
