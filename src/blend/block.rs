//! Outliers, weighted mean and best photo of each pixel, a strip of pixels at once.
//!
//! Each pixel of the strip is on its own; a photo that does not see it adds an exact zero to its sums. So the result is
//! that of one pixel after the other. Every step is a short loop over the strip, which becomes vector instructions.

#![expect(
    clippy::inline_always,
    reason = "loops over strips, compiled for the widest vectors where they are inlined into the kernel"
)]

use std::ops::Range;

use super::counting::{Scratch, count_parts};
use super::stack::{Plane, STRIP, SampleTile};
use super::strip::Strip;
use super::tile::colour_of;
use super::{OrthoTile, Outliers, Parts, Settings, Statistics, robust, sigma};
use crate::geom::{Kernel, PixelRect, run_widest};
use crate::image::{Colour, Image, Samples};

/// What the samples of some neighbouring pixels come to.
pub(super) struct Verdict<const C: usize> {
    /// Photos that see the pixel, those whose sample was kept, and the heaviest of these as an index of the planes.
    pub(super) seen: Strip,
    pub(super) used: Strip,
    pub(super) best: Strip,
    /// The pixel's colour, clamped and rounded half up: the only rounding on the way from photo to mosaic.
    pub(super) colour: [Strip; C],
}

/// Blends each pixel of the block `samples` into `tile` and counts its samples in `statistics`.
///
/// Pixels of the block without samples stay as they are: transparent, in the undefined colour. `settings` must be
/// those that the tile was made with.
///
/// # Panics
/// If the block is not inside the tile, a pixel with samples has no surface, or a photo's index is beyond
/// `statistics`.
pub fn blend_into(
    settings: &Settings,
    samples: &mut SampleTile,
    tile: &mut OrthoTile,
    statistics: &mut Statistics,
) {
    blend_block(settings, samples, tile, (statistics, None));
}

/// As [`blend_into`]; counts the samples also in the statistics of the parts of the block.
///
/// # Panics
/// As [`blend_into`], and if a pixel with samples is of no part.
pub fn blend_parts_into(
    settings: &Settings,
    samples: &mut SampleTile,
    tile: &mut OrthoTile,
    statistics: &mut Statistics,
    parts: Parts<'_>,
) {
    blend_block(settings, samples, tile, (statistics, Some(parts)));
}

fn blend_block(
    settings: &Settings,
    samples: &mut SampleTile,
    tile: &mut OrthoTile,
    counting: (&mut Statistics, Option<Parts<'_>>),
) {
    assert_eq!(
        (tile.colour.bits(), colour_of(&tile.colour)),
        (settings.depth.bits(), settings.colour),
        "a tile of the same settings"
    );
    if samples.is_empty() {
        return;
    }
    let part = samples.rect();
    let (planes, scratch) = samples.planes_and_scratch();
    match settings.colour {
        Colour::Grey => {
            run_widest(BlendBlock::<1> { settings, planes, scratch, part, tile, counting });
        }
        Colour::Rgb => {
            run_widest(BlendBlock::<3> { settings, planes, scratch, part, tile, counting });
        }
    }
}

/// The whole block, for `C` channels.
struct BlendBlock<'a, const C: usize> {
    settings: &'a Settings,
    planes: &'a [Plane],
    scratch: &'a mut Vec<Scratch>,
    part: PixelRect,
    tile: &'a mut OrthoTile,
    counting: (&'a mut Statistics, Option<Parts<'a>>),
}

impl<const C: usize> Kernel for BlendBlock<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { settings, planes, scratch, part, tile, counting } = self;
        let (statistics, mut parts) = counting;
        scratch.clear();
        scratch.resize(planes.len(), Scratch::NONE);
        let area = part.area();
        for first in (0..area).step_by(STRIP) {
            let verdict = if settings.outliers == Outliers::Robust {
                robust::judge::<C>(settings, planes, scratch, first)
            } else {
                sigma::judge::<C>(settings, planes, scratch, first)
            };
            // A strip may reach over several rows.
            let end = area.min(first + STRIP);
            let mut k = first;
            while k < end {
                let of_row = (end - k).min(part.width() - k % part.width());
                put::<C>(
                    tile,
                    tile.index(part, k),
                    &verdict,
                    k - first..k - first + of_row,
                    planes,
                );
                k += of_row;
            }
            if let Some(parts) = &mut parts {
                count_parts(planes, scratch, first..end, statistics, parts);
            }
        }
        for (plane, counted) in planes.iter().zip(&*scratch) {
            statistics.photos[usize::from(plane.photo)].merge(&counted.counts());
        }
    }
}

/// Writes the pixels `of_row` of a strip, which lie side by side from `at` on.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole numbers within the range of the target, or saturating by intent"
)]
fn put<const C: usize>(
    tile: &mut OrthoTile,
    at: usize,
    verdict: &Verdict<C>,
    of_row: Range<usize>,
    planes: &[Plane],
) {
    let (from, count) = (of_row.start, of_row.len());
    let Verdict { seen, used, best, colour } = verdict;
    let (seen, used) = (&seen[of_row.clone()], &used[of_row.clone()]);
    let best = &best[of_row];
    let saturated = |n: f64| (n as u8).min(OrthoTile::MAX_COUNT);
    let range = at..at + count;
    let counts = &mut tile.count.data_mut()[range.clone()];
    for (count, &seen) in counts.iter_mut().zip(seen).filter(|(_, seen)| **seen > 0.0) {
        assert!(*count != OrthoTile::NO_SURFACE, "a sample needs a surface");
        *count = saturated(seen);
    }
    let layers = [(&mut tile.used, used, OrthoTile::MAX_COUNT), (&mut tile.coverage, seen, 3)];
    for (layer, v, most) in layers {
        for (k, out) in layer.data_mut()[range.clone()].iter_mut().enumerate() {
            *out = if seen[k] > 0.0 { saturated(v[k]).min(most) } else { *out };
        }
    }
    for (k, out) in tile.best.data_mut()[range.clone()].iter_mut().enumerate() {
        if seen[k] > 0.0 {
            *out = planes[best[k] as usize].photo;
        }
    }
    match &mut tile.colour {
        Samples::U8(i) => put_colours(i, range, seen, u8::MAX, |c, k| colour[c][from + k] as u8),
        Samples::U16(i) => put_colours(i, range, seen, u16::MAX, |c, k| colour[c][from + k] as u16),
    }
}

/// Writes colour and alpha of the pixels that anyone sees.
#[inline(always)]
fn put_colours<T: Copy>(
    image: &mut Image<T>,
    range: Range<usize>,
    seen: &[f64],
    alpha: T,
    colour: impl Fn(usize, usize) -> T,
) {
    let channels = image.channels();
    let pixels = &mut image.data_mut()[range.start * channels..range.end * channels];
    for (k, pixel) in pixels.chunks_exact_mut(channels).enumerate() {
        if seen[k] > 0.0 {
            for (c, out) in pixel[..channels - 1].iter_mut().enumerate() {
                *out = colour(c, k);
            }
            pixel[channels - 1] = alpha;
        }
    }
}
