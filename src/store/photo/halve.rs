//! Means of 2 × 2 pixels: a level from the one before.

use super::codec::Sample;
use super::format::{Shape, TILE_SIDE, TileId};

/// Appends to `out` the row of means of 2 × 2 pixels of two rows, or of 2 × 1 of the single row in `pair`; the last
/// pixel of an odd width is the mean of what is there.
pub(super) fn average_rows<S: Sample>(
    pair: &[S],
    stride: usize,
    channels: usize,
    out: &mut Vec<S>,
) {
    if channels == 3 {
        average::<S, 3>(pair, stride, out);
    } else {
        average::<S, 1>(pair, stride, out);
    }
}

fn average<S: Sample, const CHANNELS: usize>(pair: &[S], stride: usize, out: &mut Vec<S>) {
    let (top, bottom) = pair.split_at(stride);
    let (above, odd_above) = top.split_at(stride - stride % (2 * CHANNELS));
    if bottom.is_empty() {
        for two in above.chunks_exact(2 * CHANNELS) {
            let mean = |c: usize| S::mean(two[c].widen() + two[CHANNELS + c].widen(), 2);
            out.extend::<[S; CHANNELS]>(std::array::from_fn(mean));
        }
        out.extend_from_slice(odd_above);
        return;
    }
    let (below, odd_below) = bottom.split_at(above.len());
    let begin = out.len();
    out.resize(begin + above.len() / 2, S::default());
    let pairs = above.chunks_exact(2 * CHANNELS).zip(below.chunks_exact(2 * CHANNELS));
    for ((a, b), mean) in pairs.zip(out[begin..].chunks_exact_mut(CHANNELS)) {
        for c in 0..CHANNELS {
            let sum = a[c].widen() + a[CHANNELS + c].widen();
            mean[c] = S::mean(sum + b[c].widen() + b[CHANNELS + c].widen(), 4);
        }
    }
    let odd = odd_above.iter().zip(odd_below);
    out.extend(odd.map(|(a, b)| S::mean(a.widen() + b.widen(), 2)));
}

/// The part of tile `id`, of a level above 0, that lies over tile `below` of the level before: means of `samples` into
/// their place in `tile`. Tiles begin at even rows and columns, so pairs never straddle two of them.
pub(super) fn halve_into<S: Sample>(
    shape: Shape,
    (below, samples): (TileId, &[S]),
    (id, tile): (TileId, &mut [S]),
) {
    let channels = shape.channels;
    let stride = shape.tile_size(below).width as usize * channels;
    let out_stride = shape.tile_size(id).width as usize * channels;
    let half = TILE_SIDE as usize / 2;
    let left = if below.x.is_multiple_of(2) { 0 } else { half * channels };
    let top = if below.y.is_multiple_of(2) { 0 } else { half };
    let mut row = Vec::with_capacity(stride.div_ceil(2) + channels);
    let out_rows = tile.chunks_exact_mut(out_stride).skip(top);
    for (pair, out) in samples.chunks(2 * stride).zip(out_rows) {
        row.clear();
        average_rows(pair, stride, channels, &mut row);
        out[left..left + row.len()].copy_from_slice(&row);
    }
}
