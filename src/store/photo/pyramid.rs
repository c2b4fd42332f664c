//! Rows of a photo to the tiles of all its levels, in one pass and without a second copy.
//!
//! Each level keeps one strip of tiles: when it is full, its tiles are handed on, and its rows, averaged two by two,
//! go to the strip of the next level. Strips begin at even rows, so pairs never straddle two of them.

use super::codec::{Sample, TileView};
use super::format::{Shape, TILE_SIDE, TileId};
use super::halve::average_rows;
use crate::Result;

/// Takes the tiles as they are finished, each once, in an order that depends on the shape alone.
type TileSink<'a, S> = &'a mut dyn FnMut(TileId, TileView<'_, S>) -> Result<()>;

/// The strips of all levels of a photo that is being read.
pub(super) struct Pyramid<S> {
    shape: Shape,
    strips: Vec<Strip<S>>,
}

/// The rows of one row of tiles, as far as they have come.
struct Strip<S> {
    /// Whole rows, `rows × width × channels`.
    samples: Vec<S>,
    /// Samples of a row.
    stride: usize,
    /// Rows of tiles finished before this one.
    tile_y: u32,
}

impl<S: Sample> Pyramid<S> {
    pub(super) fn new(shape: Shape) -> Self {
        let strip = |level| {
            let size = shape.level_size(level);
            let stride = size.width as usize * shape.channels;
            let rows = size.height.min(TILE_SIDE) as usize;
            Strip { samples: Vec::with_capacity(stride * rows), stride, tile_y: 0 }
        };
        Self { shape, strips: (0..shape.levels()).map(strip).collect() }
    }

    /// Bytes of all strips of a photo of this shape.
    pub(super) fn bytes(shape: Shape) -> u64 {
        let rows = u64::from(shape.size.height.min(TILE_SIDE));
        let stride = u64::from(shape.size.width) * shape.channels as u64 * size_of::<S>() as u64;
        // Each level's rows are half as long.
        2 * rows * stride
    }

    /// Takes whole rows of level 0, the next ones downwards.
    pub(super) fn push(&mut self, rows: &[S], sink: TileSink<'_, S>) -> Result<()> {
        let mut rest = rows;
        while !rest.is_empty() {
            let strip = &mut self.strips[0];
            let full = strip.stride * TILE_SIDE as usize;
            let (now, later) = rest.split_at((full - strip.samples.len()).min(rest.len()));
            strip.samples.extend_from_slice(now);
            if strip.samples.len() == full {
                self.flush(0, sink)?;
            }
            rest = later;
        }
        Ok(())
    }

    /// Hands on what is left in the strips; to be called once, after the last row.
    pub(super) fn finish(mut self, sink: TileSink<'_, S>) -> Result<()> {
        (0..self.strips.len()).try_for_each(|level| self.flush(level, sink))
    }

    /// Hands on the tiles of a strip and its averaged rows.
    fn flush(&mut self, level: usize, sink: TileSink<'_, S>) -> Result<()> {
        let channels = self.shape.channels;
        let (upper, lower) = self.strips.split_at_mut(level + 1);
        let strip = &mut upper[level];
        if strip.samples.is_empty() {
            return Ok(());
        }
        strip.tiles(level, channels, sink)?;
        let next = lower.first_mut();
        let is_next_full = next.is_some_and(|next| {
            for pair in strip.samples.chunks(2 * strip.stride) {
                average_rows(pair, strip.stride, channels, &mut next.samples);
            }
            next.samples.len() == next.stride * TILE_SIDE as usize
        });
        strip.samples.clear();
        strip.tile_y += 1;
        if is_next_full { self.flush(level + 1, sink) } else { Ok(()) }
    }
}

impl<S: Sample> Strip<S> {
    fn tiles(&self, level: usize, channels: usize, sink: TileSink<'_, S>) -> Result<()> {
        let height = self.samples.len() / self.stride;
        let level = u32::try_from(level).expect("a pyramid has at most 32 levels");
        let tile_stride = TILE_SIDE as usize * channels;
        for (x, left) in (0..).zip((0..self.stride).step_by(tile_stride)) {
            let width = (self.stride - left).min(tile_stride) / channels;
            let samples = &self.samples[left..];
            let view = TileView { samples, stride: self.stride, width, height, channels };
            sink(TileId { level, x, y: self.tile_y }, view)?;
        }
        Ok(())
    }
}
