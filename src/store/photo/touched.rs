//! Which tiles of a photo windows have touched.

use std::sync::atomic::{AtomicU64, Ordering};

use super::format::{Shape, TileId};

/// One bit a tile of the pyramid; any thread sets them.
#[derive(Debug)]
pub(super) struct Touched {
    shape: Shape,
    words: Vec<AtomicU64>,
}

impl Touched {
    pub(super) fn new(shape: Shape) -> Self {
        let words = usize::try_from(shape.tiles().div_ceil(64)).expect("at most 2^32 pixels");
        Self { shape, words: (0..words).map(|_| AtomicU64::new(0)).collect() }
    }

    /// Notes the tile of this number.
    pub(super) fn touch(&self, ordinal: u64) {
        let (word, bit) = (&self.words[place(ordinal)], 1 << (ordinal % 64));
        // Most are set already; writing would take the cache line from the other threads.
        if word.load(Ordering::Relaxed) & bit == 0 {
            word.fetch_or(bit, Ordering::Relaxed);
        }
    }

    /// Pixels of level 0 in or below the tiles that were touched, each counted once.
    pub(super) fn pixels(&self) -> u64 {
        let tiles = self.shape.level_tiles(0);
        let ids = (0..tiles.height).flat_map(|y| (0..tiles.width).map(move |x| (x, y)));
        let touched = ids.filter(|&(x, y)| {
            (0..self.shape.levels()).any(|level| {
                let id = TileId { level, x: x >> level, y: y >> level };
                self.is_touched(self.shape.ordinal(id))
            })
        });
        touched.map(|(x, y)| self.shape.tile_size(TileId { level: 0, x, y }).area()).sum()
    }

    fn is_touched(&self, ordinal: u64) -> bool {
        self.words[place(ordinal)].load(Ordering::Relaxed) & 1 << (ordinal % 64) != 0
    }
}

fn place(ordinal: u64) -> usize {
    usize::try_from(ordinal / 64).expect("it has a word")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Size;

    #[test]
    fn pixels_below_a_coarse_tile_are_needed_and_counted_once() {
        let shape = Shape { size: Size::new(1300, 700), channels: 1, bits: 8 };
        let touched = Touched::new(shape);
        assert_eq!(touched.pixels(), 0);
        let touch = |level, x, y| touched.touch(shape.ordinal(TileId { level, x, y }));
        touch(0, 5, 2);
        assert_eq!(touched.pixels(), 20 * 188);
        touch(0, 0, 0);
        touch(0, 0, 0);
        assert_eq!(touched.pixels(), 20 * 188 + 65536);
        touch(1, 0, 0);
        assert_eq!(touched.pixels(), 20 * 188 + 4 * 65536);
        touch(3, 0, 0);
        assert_eq!(touched.pixels(), 1300 * 700);
    }
}
