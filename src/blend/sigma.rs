//! The paper's rule for a strip of pixels: outliers by σ, weighted mean, best photo (Grammatikopoulos et al. 2004, §2.3).

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    clippy::needless_bitwise_bool,
    reason = "loops over strips, compiled for the widest vectors where they are inlined into the kernel"
)]

use super::block::Verdict;
use super::counting::{Scratch, compare};
use super::stack::{Plane, STRIP};
use super::strip::{Strip, channel, distance_squared, round, select};
use super::{Blend, Edges, Outliers, Settings, Weights};

/// Samples are equal if σ is below this share of the range: half an 8-bit grey value.
const LEAST_SIGMA: f64 = 0.5 / 255.0;
/// Relative guard of the outlier test, so that rounding does not drop a sample at just β·σ.
const GUARD: f64 = 1.0 + 1e-6;

/// Outliers and weighted mean of the pixels from `first` on.
#[inline(always)]
pub(super) fn judge<const C: usize>(
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
    if settings.weights == Weights::Equal && settings.edges == Edges::None {
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
