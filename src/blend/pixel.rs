//! Outliers, weighted mean and best photo of each pixel, a strip of pixels at once.
//!
//! Each pixel of the strip is on its own; a photo that does not see it adds an exact zero to its sums. So the result is
//! that of one pixel after the other. Every step is a short loop over the strip, which becomes vector instructions.

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "loops over strips, compiled for the widest vectors where they are inlined into the kernel"
)]

use super::stack::{Plane, STRIP, SampleTile};
use super::tile::colour_of;
use super::{Blend, OrthoTile, Outliers, PhotoStats, Settings, Statistics, Weights};
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
            run_widest(BlendBlock::<1> { settings, planes, scratch, part, tile, statistics });
        }
        Colour::Rgb => {
            run_widest(BlendBlock::<3> { settings, planes, scratch, part, tile, statistics });
        }
    }
}

/// What is known of one photo's samples of the pixels at hand, and counted of all of the block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scratch {
    /// Square of the distance to the mean of all.
    distance_squared: Strip,
    /// The weight of a kept sample; below 0 for others.
    kept: Strip,
    /// Counts, whole numbers: of samples, of those kept, of those compared, of their distances in 1/256.
    seen: Strip,
    used: Strip,
    compared: Strip,
    residual_256: Strip,
}

impl Scratch {
    const NONE: Self = Self {
        distance_squared: [0.0; STRIP],
        kept: [0.0; STRIP],
        seen: [0.0; STRIP],
        used: [0.0; STRIP],
        compared: [0.0; STRIP],
        residual_256: [0.0; STRIP],
    };

    fn counts(&self) -> PhotoStats {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole numbers below 2^53"
        )]
        let whole = |strip: &Strip| strip.iter().sum::<f64>() as u64;
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
    statistics: &'a mut Statistics,
}

impl<const C: usize> Kernel for BlendBlock<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { settings, planes, scratch, part, tile, statistics } = self;
        scratch.clear();
        scratch.resize(planes.len(), Scratch::NONE);
        let area = part.area();
        for first in (0..area).step_by(STRIP) {
            let verdict = judge::<C>(settings, planes, scratch, first);
            let count = STRIP.min(area - first);
            for k in (0..count).filter(|&k| verdict.seen[k] > 0.0) {
                let at = tile.index(part, first + k);
                put::<C>(tile, at, &verdict, k, planes);
            }
        }
        for (plane, counted) in planes.iter().zip(&*scratch) {
            statistics.photos[usize::from(plane.photo)].merge(&counted.counts());
        }
    }
}

/// The samples of a plane from pixel `first` on: weights, and colours by channel.
#[inline(always)]
fn samples_at<const C: usize>(plane: &Plane, first: usize) -> (&Strip, [Strip; C]) {
    let weights = plane.weights[first..].first_chunk().expect("whole strips");
    let mut colours = [[0.0; STRIP]; C];
    for c in 0..C {
        let of: &[f32; STRIP] = plane.colours[c][first..].first_chunk().expect("whole strips");
        for k in 0..STRIP {
            colours[c][k] = f64::from(of[k]);
        }
    }
    (weights, colours)
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
    for plane in planes {
        let (weights, colours) = samples_at::<C>(plane, first);
        for k in 0..STRIP {
            let is_seen = weights[k] >= 0.0;
            seen[k] += select(is_seen, 1.0, 0.0);
            for c in 0..C {
                mean[c][k] += select(is_seen, colours[c][k], 0.0);
            }
        }
    }
    for of in &mut mean {
        for k in 0..STRIP {
            of[k] /= seen[k];
        }
    }
    keep::<C>(settings, planes, scratch, first, (&seen, &mean));
    let verdict = mean_of_kept::<C>(settings, planes, scratch, first, &seen);
    let Mean { used, best, mean, chosen } = verdict;
    compare::<C>(planes, scratch, first, (&seen, &mean));
    let max = f64::from(settings.depth.max());
    let mut colour = chosen;
    for of in &mut colour {
        for v in of {
            *v = round(*v, max);
        }
    }
    Verdict { seen, used, best, colour }
}

/// Outliers: enters in `scratch` the weights of the samples that are kept.
#[inline(always)]
fn keep<const C: usize>(
    settings: &Settings,
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
    (seen, mean): (&Strip, &[Strip; C]),
) {
    let is_tested = settings.outliers == Outliers::Sigma && seen.iter().any(|&n| n > 2.0);
    if !is_tested {
        for (plane, s) in planes.iter().zip(scratch) {
            s.kept = *samples_at::<C>(plane, first).0;
        }
        return;
    }
    let mut sum = [0.0; STRIP];
    for (plane, s) in planes.iter().zip(&mut *scratch) {
        let (weights, colours) = samples_at::<C>(plane, first);
        s.distance_squared = distance_squared(&colours, mean);
        for k in 0..STRIP {
            sum[k] += select(weights[k] >= 0.0, s.distance_squared[k], 0.0);
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
    for (plane, s) in planes.iter().zip(&mut *scratch) {
        let (weights, _) = samples_at::<C>(plane, first);
        for k in 0..STRIP {
            let is_kept = (weights[k] >= 0.0) & (s.distance_squared[k] <= limit[k]);
            s.kept[k] = select(is_kept, weights[k], -1.0);
            used[k] += select(is_kept, 1.0, 0.0);
        }
    }
    for k in (0..STRIP).filter(|&k| used[k] == 0.0 && seen[k] > 0.0) {
        keep_nearest(planes, scratch, first, k);
    }
}

/// A β below 1 may drop all samples of a pixel: the nearest to the mean stays, of equals the lowest id.
#[cold]
fn keep_nearest(planes: &[Plane], scratch: &mut [Scratch], first: usize, k: usize) {
    let mut nearest = (f64::INFINITY, 0);
    for (i, (plane, s)) in planes.iter().zip(&*scratch).enumerate() {
        let d = s.distance_squared[k];
        if plane.weights[first + k] >= 0.0 && d < nearest.0 {
            nearest = (d, i);
        }
    }
    let (_, i) = nearest;
    scratch[i].kept[k] = planes[i].weights[first + k];
}

/// Square of the Euclidean distance over the channels.
#[inline(always)]
fn distance_squared<const C: usize>(colours: &[Strip; C], mean: &[Strip; C]) -> Strip {
    let mut sum = [0.0; STRIP];
    for c in 0..C {
        for k in 0..STRIP {
            let d = colours[c][k] - mean[c][k];
            sum[k] += d * d;
        }
    }
    sum
}

/// Weighted mean of the kept samples.
struct Mean<const C: usize> {
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
    scratch: &[Scratch],
    first: usize,
    seen: &Strip,
) -> Mean<C> {
    // Weights; all zero means all equal.
    let (mut used, mut total) = ([0.0; STRIP], [0.0; STRIP]);
    for s in scratch {
        for k in 0..STRIP {
            let is_kept = s.kept[k] >= 0.0;
            used[k] += select(is_kept, 1.0, 0.0);
            total[k] += select(is_kept, s.kept[k], 0.0);
        }
    }
    if settings.weights == Weights::Equal {
        total = [0.0; STRIP];
    }
    let mut divisor = [0.0; STRIP];
    for k in 0..STRIP {
        divisor[k] = select(total[k] > 0.0, total[k], used[k]);
    }
    let zero = [[0.0; STRIP]; C];
    let (mut base, mut sum, mut best_colour) = (zero, zero, zero);
    let (mut best, mut best_weight) = ([0.0; STRIP], [-1.0; STRIP]);
    for (i, (plane, s)) in planes.iter().zip(scratch).enumerate() {
        let (_, colours) = samples_at::<C>(plane, first);
        let i = i as f64;
        let mut weight = [0.0; STRIP];
        for k in 0..STRIP {
            let equal = select(s.kept[k] >= 0.0, 1.0, -1.0);
            weight[k] = select(total[k] > 0.0, s.kept[k], equal);
        }
        for c in 0..C {
            for k in 0..STRIP {
                let v = colours[c][k];
                let is_first = (weight[k] >= 0.0) & (best_weight[k] < 0.0);
                base[c][k] = select(is_first, v, base[c][k]);
                let share = weight[k] * (v - base[c][k]);
                sum[c][k] += select(weight[k] >= 0.0, share, 0.0);
                // Below 0 it is not kept, and never heavier.
                best_colour[c][k] = select(weight[k] > best_weight[k], v, best_colour[c][k]);
            }
        }
        for k in 0..STRIP {
            let is_best = weight[k] > best_weight[k];
            best[k] = select(is_best, i, best[k]);
            best_weight[k] = select(is_best, weight[k], best_weight[k]);
        }
    }
    let mut mean = zero;
    for c in 0..C {
        for k in 0..STRIP {
            mean[c][k] = base[c][k] + sum[c][k] / divisor[k];
        }
    }
    debug_assert!(used.iter().zip(seen).all(|(used, seen)| used <= seen));
    let chosen = match settings.blend {
        Blend::Mean => mean,
        Blend::Best => best_colour,
    };
    Mean { used, best, mean, chosen }
}

/// Counts the samples, and how far they are from the mean of those kept.
#[inline(always)]
fn compare<const C: usize>(
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
    (seen, mean): (&Strip, &[Strip; C]),
) {
    for (plane, s) in planes.iter().zip(scratch) {
        let (weights, colours) = samples_at::<C>(plane, first);
        let d = distance_squared(&colours, mean);
        for k in 0..STRIP {
            s.seen[k] += select(weights[k] >= 0.0, 1.0, 0.0);
            s.used[k] += select(s.kept[k] >= 0.0, 1.0, 0.0);
        }
        for k in 0..STRIP {
            let is_compared = (weights[k] >= 0.0) & (seen[k] > 1.0);
            s.compared[k] += select(is_compared, 1.0, 0.0);
            // In 1/256, rounded half up.
            let distance = whole(d[k].sqrt() * 256.0 + 0.5);
            s.residual_256[k] += select(is_compared, distance, 0.0);
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

/// Writes one pixel.
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
    k: usize,
    planes: &[Plane],
) {
    assert!(tile.count.data()[at] != OrthoTile::NO_SURFACE, "a sample needs a surface");
    let saturated = |n: f64| (n as u8).min(OrthoTile::MAX_COUNT);
    let seen = saturated(verdict.seen[k]);
    tile.count.data_mut()[at] = seen;
    tile.used.data_mut()[at] = saturated(verdict.used[k]);
    tile.coverage.data_mut()[at] = seen.min(3);
    tile.best.data_mut()[at] = planes[verdict.best[k] as usize].photo;
    let colour = verdict.colour.each_ref().map(|of| of[k]);
    match &mut tile.colour {
        Samples::U8(i) => put_colour(i, at, colour.map(|v| v as u8), u8::MAX),
        Samples::U16(i) => put_colour(i, at, colour.map(|v| v as u16), u16::MAX),
    }
}

/// Writes one pixel's colour and alpha.
#[inline(always)]
fn put_colour<T: Copy, const C: usize>(image: &mut Image<T>, at: usize, colour: [T; C], alpha: T) {
    let pixel = &mut image.data_mut()[at * (C + 1)..(at + 1) * (C + 1)];
    pixel[..C].copy_from_slice(&colour);
    pixel[C] = alpha;
}
