//! Outliers, weighted mean and best photo of each pixel, a strip of pixels at once.
//!
//! Each pixel of the strip is on its own; a photo that does not see it adds an exact zero to its sums. So the result is
//! that of one pixel after the other. Every step is a short loop over the strip, which becomes vector instructions.

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    clippy::needless_bitwise_bool,
    reason = "loops over strips, compiled for the widest vectors where they are inlined into the kernel"
)]

use std::ops::Range;

use super::stack::{Plane, STRIP, SampleTile};
use super::tile::colour_of;
use super::{Blend, OrthoTile, Outliers, Parts, PhotoStats, Settings, Statistics, Weights};
use crate::geom::{Kernel, PixelRect, run_widest};

use crate::image::{Colour, Image, Samples};

/// Samples are equal if σ is below this share of the range: half an 8-bit grey value.
const LEAST_SIGMA: f64 = 0.5 / 255.0;
/// Relative guard of the outlier test, so that rounding does not drop a sample at just β·σ.
const GUARD: f64 = 1.0 + 1e-6;

/// A number for each of some neighbouring pixels.
type Strip = [f64; STRIP];

/// What the samples of some neighbouring pixels come to.
struct Verdict<const C: usize> {
    /// Photos that see the pixel, those whose sample was kept, and the heaviest of these as an index of the planes.
    seen: Strip,
    used: Strip,
    best: Strip,
    /// The pixel's colour, clamped and rounded half up: the only rounding on the way from photo to mosaic.
    colour: [Strip; C],
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

/// What is known of one photo's samples of the pixels at hand, and counted of all of the block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scratch {
    /// Square of the distance to the mean of all.
    distance_squared: Strip,
    /// 1 for a pixel that the photo sees, else 0; 1 for one whose sample is kept, else 0.
    is_seen: Strip,
    is_kept: Strip,
    /// The sample's weight; what it is where there is no sample means nothing.
    weight: Strip,
    /// Counts, whole numbers: of samples, of those kept, of those compared, of their distances in 1/256.
    seen: Strip,
    used: Strip,
    compared: Strip,
    residual_256: Strip,
}

impl Scratch {
    const NONE: Self = Self {
        distance_squared: [0.0; STRIP],
        is_seen: [0.0; STRIP],
        is_kept: [0.0; STRIP],
        weight: [0.0; STRIP],
        seen: [0.0; STRIP],
        used: [0.0; STRIP],
        compared: [0.0; STRIP],
        residual_256: [0.0; STRIP],
    };

    fn counts(&self) -> PhotoStats {
        self.counted(|strip| strip.iter().sum())
    }

    /// The counts of one pixel of the strip.
    fn counts_at(&self, k: usize) -> PhotoStats {
        self.counted(|strip| strip[k])
    }

    fn counted(&self, of: impl Fn(&Strip) -> f64) -> PhotoStats {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole numbers below 2^53"
        )]
        let whole = |strip: &Strip| of(strip) as u64;
        let (seen, used) = (whole(&self.seen), whole(&self.used));
        PhotoStats {
            seen,
            used,
            rejected: seen - used,
            compared: whole(&self.compared),
            residual_256: whole(&self.residual_256),
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
            let verdict = judge::<C>(settings, planes, scratch, first);
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

/// Moves what was counted of a strip, the pixels `of` of the block, to the statistics of each pixel's part, and of all.
fn count_parts(
    planes: &[Plane],
    scratch: &mut [Scratch],
    of: Range<usize>,
    all: &mut Statistics,
    parts: &mut Parts<'_>,
) {
    for (plane, s) in planes.iter().zip(scratch) {
        let photo = usize::from(plane.photo);
        for (k, pixel) in of.clone().enumerate() {
            if s.seen[k] > 0.0 {
                let counts = s.counts_at(k);
                all.photos[photo].merge(&counts);
                let part = usize::from(parts.part_of[pixel]);
                parts.statistics[part].photos[photo].merge(&counts);
            }
        }
        let zero = [0.0; STRIP];
        (s.seen, s.used, s.compared, s.residual_256) = (zero, zero, zero, zero);
    }
}

/// A channel of a plane from pixel `first` on; finite, also where the photo sees nothing.
#[inline(always)]
fn channel(plane: &Plane, c: usize, first: usize) -> &[f32; STRIP] {
    plane.colours[c][first..].first_chunk().expect("whole strips")
}

/// `a` where `is` holds, else `b`: by bits, lest the compiler make a branch or a masked store of it.
#[inline(always)]
fn select(is: bool, a: f64, b: f64) -> f64 {
    let mask = u64::from(is).wrapping_neg();
    f64::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

/// DESIGN.md §1.4 and §1.5 for the pixels from `first` on.
#[inline(always)]
fn judge<const C: usize>(
    settings: &Settings,
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
) -> Verdict<C> {
    // How many see each pixel, and the unweighted mean colour.
    let (mut seen, mut mean) = ([0.0; STRIP], [[0.0; STRIP]; C]);
    for (plane, s) in planes.iter().zip(&mut *scratch) {
        s.weight = *plane.weights[first..].first_chunk().expect("whole strips");
        for k in 0..STRIP {
            s.is_seen[k] = select(s.weight[k] >= 0.0, 1.0, 0.0);
            seen[k] += s.is_seen[k];
        }
        for c in 0..C {
            let colour = channel(plane, c, first);
            for k in 0..STRIP {
                mean[c][k] += s.is_seen[k] * f64::from(colour[k]);
            }
        }
    }
    for c in 0..C {
        for k in 0..STRIP {
            mean[c][k] /= seen[k];
        }
    }
    keep::<C>(settings, planes, scratch, first, (&seen, &mean));
    let Merged { used, best, mean, mut chosen } =
        mean_of_kept::<C>(settings, planes, scratch, first);
    compare::<C>(planes, scratch, first, (&seen, &mean));
    let max = f64::from(settings.depth.max());
    for c in 0..C {
        for k in 0..STRIP {
            chosen[c][k] = round(chosen[c][k], max);
        }
    }
    Verdict { seen, used, best, colour: chosen }
}

/// Outliers: tells in `scratch` which samples are kept.
#[inline(always)]
fn keep<const C: usize>(
    settings: &Settings,
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
    (seen, mean): (&Strip, &[Strip; C]),
) {
    if settings.outliers == Outliers::None || seen.iter().all(|&n| n <= 2.0) {
        for s in scratch {
            s.is_kept = s.is_seen;
        }
        return;
    }
    let mut sum = [0.0; STRIP];
    for (plane, s) in planes.iter().zip(&mut *scratch) {
        // Where nobody sees anything the mean is not a number, nor is what comes of it, which nobody reads.
        distance_squared(plane, first, mean, &mut s.distance_squared);
        for k in 0..STRIP {
            sum[k] += s.is_seen[k] * s.distance_squared[k];
        }
    }
    let range = f64::from(settings.depth.max());
    let least = (LEAST_SIGMA * range) * (LEAST_SIGMA * range);
    let factor = (settings.beta * GUARD) * (settings.beta * GUARD);
    let mut limit = [0.0; STRIP];
    for k in 0..STRIP {
        let sigma_squared = sum[k] / seen[k];
        let all_stay = (seen[k] <= 2.0) | (sigma_squared < least);
        limit[k] = select(all_stay, f64::INFINITY, factor * sigma_squared);
    }
    let mut used = [0.0; STRIP];
    for s in &mut *scratch {
        for k in 0..STRIP {
            s.is_kept[k] = select(s.distance_squared[k] <= limit[k], s.is_seen[k], 0.0);
            used[k] += s.is_kept[k];
        }
    }
    for k in (0..STRIP).filter(|&k| used[k] == 0.0 && seen[k] > 0.0) {
        keep_nearest(scratch, k);
    }
}

/// A β below 1 may drop all samples of a pixel: the nearest to the mean stays, of equals the lowest id.
#[cold]
fn keep_nearest(scratch: &mut [Scratch], k: usize) {
    let mut nearest = (f64::INFINITY, 0);
    for (i, s) in scratch.iter().enumerate() {
        if s.is_seen[k] > 0.0 && s.distance_squared[k] < nearest.0 {
            nearest = (s.distance_squared[k], i);
        }
    }
    scratch[nearest.1].is_kept[k] = 1.0;
}

/// Square of the Euclidean distance over the channels.
#[inline(always)]
fn distance_squared<const C: usize>(
    plane: &Plane,
    first: usize,
    mean: &[Strip; C],
    sum: &mut Strip,
) {
    *sum = [0.0; STRIP];
    for c in 0..C {
        let colour = channel(plane, c, first);
        for k in 0..STRIP {
            let d = f64::from(colour[k]) - mean[c][k];
            sum[k] += d * d;
        }
    }
}

/// What the kept samples come to.
struct Merged<const C: usize> {
    used: Strip,
    best: Strip,
    mean: [Strip; C],
    /// The mean, or the colour of the best.
    chosen: [Strip; C],
}

/// Weighted mean, as the first kept colour plus the weighted mean of the differences to it: samples that agree give
/// exactly the colour that they agree on. The best: only a heavier one replaces one of a lower id.
#[inline(always)]
fn mean_of_kept<const C: usize>(
    settings: &Settings,
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
) -> Merged<C> {
    let (used, total) = weigh(settings, scratch);
    // The colour of the first that is kept: of the last, going back.
    let zero = [[0.0; STRIP]; C];
    let (mut base, mut sum) = (zero, zero);
    for (plane, s) in planes.iter().zip(&*scratch).rev() {
        for c in 0..C {
            let colour = channel(plane, c, first);
            for k in 0..STRIP {
                base[c][k] = select(s.is_kept[k] > 0.0, f64::from(colour[k]), base[c][k]);
            }
        }
    }
    for (plane, s) in planes.iter().zip(&*scratch) {
        for c in 0..C {
            let colour = channel(plane, c, first);
            for k in 0..STRIP {
                sum[c][k] += s.weight[k] * (f64::from(colour[k]) - base[c][k]);
            }
        }
    }
    let mut mean = zero;
    for c in 0..C {
        for k in 0..STRIP {
            mean[c][k] = base[c][k] + sum[c][k] / total[k];
        }
    }
    let (mut best, mut best_weight) = ([0.0; STRIP], [-1.0; STRIP]);
    let mut best_colour = zero;
    for (i, (plane, s)) in planes.iter().zip(&*scratch).enumerate() {
        let mut weight = [0.0; STRIP];
        for k in 0..STRIP {
            weight[k] = select(s.is_kept[k] > 0.0, s.weight[k], -1.0);
        }
        if settings.blend == Blend::Best {
            for c in 0..C {
                let colour = channel(plane, c, first);
                for k in 0..STRIP {
                    let is_best = weight[k] > best_weight[k];
                    best_colour[c][k] = select(is_best, f64::from(colour[k]), best_colour[c][k]);
                }
            }
        }
        let i = i as f64;
        for k in 0..STRIP {
            let is_best = weight[k] > best_weight[k];
            best[k] = select(is_best, i, best[k]);
            best_weight[k] = select(is_best, weight[k], best_weight[k]);
        }
    }
    let chosen = match settings.blend {
        Blend::Mean => mean,
        Blend::Best => best_colour,
    };
    Merged { used, best, mean, chosen }
}

/// Enters in `scratch` what each sample weighs, 0 where it is not kept: how many are, and what they weigh together.
#[inline(always)]
fn weigh(settings: &Settings, scratch: &mut [Scratch]) -> (Strip, Strip) {
    let (mut used, mut total) = ([0.0; STRIP], [0.0; STRIP]);
    for s in &*scratch {
        for k in 0..STRIP {
            used[k] += s.is_kept[k];
            total[k] += s.is_kept[k] * s.weight[k];
        }
    }
    if settings.weights == Weights::Equal {
        total = [0.0; STRIP];
    }
    for s in scratch {
        for k in 0..STRIP {
            // All zero means all equal.
            s.weight[k] = s.is_kept[k] * select(total[k] > 0.0, s.weight[k], 1.0);
        }
    }
    for k in 0..STRIP {
        total[k] = select(total[k] > 0.0, total[k], used[k]);
    }
    (used, total)
}

/// Counts the samples, and how far they are from the mean of those kept.
#[inline(always)]
fn compare<const C: usize>(
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
    (seen, mean): (&Strip, &[Strip; C]),
) {
    let mut is_compared = [0.0; STRIP];
    for k in 0..STRIP {
        is_compared[k] = select(seen[k] > 1.0, 1.0, 0.0);
    }
    let mut d = [0.0; STRIP];
    for (plane, s) in planes.iter().zip(scratch) {
        distance_squared(plane, first, mean, &mut d);
        for k in 0..STRIP {
            s.seen[k] += s.is_seen[k];
            s.used[k] += s.is_kept[k];
            s.compared[k] += s.is_seen[k] * is_compared[k];
        }
        for k in 0..STRIP {
            // In 1/256, rounded half up; not a number where nobody sees anything.
            let distance = whole(d[k].sqrt() * 256.0 + 0.5);
            let is_counted = s.is_seen[k] * is_compared[k] > 0.0;
            s.residual_256[k] += select(is_counted, distance, 0.0);
        }
    }
}

/// ⌊v⌋ for 0 ≤ v < 2⁵¹: where `f64::floor` is a library call on x86-64, this becomes a few vector instructions.
#[inline(always)]
fn whole(v: f64) -> f64 {
    const TWO_52: f64 = 4_503_599_627_370_496.0;
    let nearest = (v + TWO_52) - TWO_52;
    select(nearest > v, nearest - 1.0, nearest)
}

/// Clamped to 0 … `max` and rounded half up.
#[inline(always)]
fn round(v: f64, max: f64) -> f64 {
    let clamped = select(v > 0.0, select(v < max, v, max), 0.0);
    let whole = whole(clamped);
    whole + select(clamped - whole >= 0.5, 1.0, 0.0)
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
