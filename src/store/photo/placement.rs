//! Where a window lies on a level, and its edges beyond it.

use super::format::{Shape, TILE_SIDE, TileId};
use crate::geom::{PixelRect, Size};

/// A distance within a window or tile.
pub(super) fn offset(difference: i64) -> usize {
    usize::try_from(difference).expect("a part begins within its whole")
}

/// Where the part of a window that lies in the level goes.
pub(super) struct Placement {
    /// The window, each side clamped to the level: at least one pixel.
    pub(super) inner: PixelRect,
    /// Column and row of the window where `inner` begins.
    pub(super) left: usize,
    pub(super) top: usize,
}

impl Placement {
    /// The place of `rect` on a level of this size.
    pub(super) fn of(rect: PixelRect, size: Size) -> Self {
        let (x0, x1, left) = place(rect.x0, rect.x1, size.width.into());
        let (y0, y1, top) = place(rect.y0, rect.y1, size.height.into());
        Self { inner: PixelRect::new(x0, y0, x1, y1), left, top }
    }

    /// Copies a tile's part of `inner` to its place in `out`, whose rows are `stride` samples long.
    pub(super) fn copy<S: Copy>(
        &self,
        id: TileId,
        tile: &[S],
        shape: Shape,
        stride: usize,
        out: &mut [S],
    ) {
        let channels = shape.channels;
        let side = i64::from(TILE_SIDE);
        let (x, y) = (i64::from(id.x) * side, i64::from(id.y) * side);
        let part = PixelRect::new(x, y, x + side, y + side).intersection(&self.inner);
        let width = shape.tile_size(id).width as usize * channels;
        let left = offset(part.x0 - x) * channels;
        let length = part.width() * channels;
        let rows = tile.chunks_exact(width).skip(offset(part.y0 - y));
        let to = (self.top + offset(part.y0 - self.inner.y0)) * stride
            + (self.left + offset(part.x0 - self.inner.x0)) * channels;
        for (row, out_row) in rows.zip(out[to..].chunks_mut(stride).take(part.height())) {
            out_row[..length].copy_from_slice(&row[left..left + length]);
        }
    }

    /// The pixels of level 0, whose size is `size`, below `inner`, which lies on level `level`.
    pub(super) fn finest(&self, level: u32, size: Size) -> PixelRect {
        let PixelRect { x0, y0, x1, y1 } = self.inner;
        let below = PixelRect::new(x0 << level, y0 << level, x1 << level, y1 << level);
        below.intersection(&size.rect())
    }

    /// Copies the samples of all of `inner` to their place in `out`, whose rows are `stride` samples long.
    pub(super) fn put<S: Copy>(
        &self,
        samples: &[S],
        channels: usize,
        stride: usize,
        out: &mut [S],
    ) {
        let row = self.inner.width() * channels;
        let to = self.top * stride + self.left * channels;
        for (samples, out) in samples.chunks_exact(row).zip(out[to..].chunks_mut(stride)) {
            out[..row].copy_from_slice(samples);
        }
    }

    /// Repeats the outermost columns and rows of `inner`, which is in its place in `out`.
    pub(super) fn repeat_edges<S: Copy>(&self, out: &mut [S], stride: usize, channels: usize) {
        let (begin, end) = (self.left * channels, (self.left + self.inner.width()) * channels);
        let rows = self.inner.height();
        if begin > 0 || end < stride {
            for row in out.chunks_exact_mut(stride).skip(self.top).take(rows) {
                let (before, rest) = row.split_at_mut(begin);
                let (inner, after) = rest.split_at_mut(end - begin);
                before
                    .chunks_exact_mut(channels)
                    .for_each(|p| p.copy_from_slice(&inner[..channels]));
                let last = &inner[inner.len() - channels..];
                after.chunks_exact_mut(channels).for_each(|p| p.copy_from_slice(last));
            }
        }
        let first = self.top * stride;
        for row in 0..self.top {
            out.copy_within(first..first + stride, row * stride);
        }
        let last = first + (rows - 1) * stride;
        let mut below = last + stride;
        while below < out.len() {
            out.copy_within(last..last + stride, below);
            below += stride;
        }
    }
}

/// A half-open range clamped to `0..length`, keeping one pixel at least, and the position in the range where it goes.
fn place(begin: i64, end: i64, length: i64) -> (i64, i64, usize) {
    let inner_begin = begin.clamp(0, length - 1);
    let inner_end = end.clamp(inner_begin + 1, length);
    let at = inner_begin.saturating_sub(begin).clamp(0, end - begin - 1);
    (inner_begin, inner_end, offset(at))
}
