//! Soft outlier weights for a strip of pixels: no sample is dropped by a hard switch, so no switch shows.
//!
//! 1. Each photo has a vote on a pixel's colour: one, less near the border of what it sees. Its quality does not count: what
//!    stands before the surface may be seen best of all.
//! 2. The centre is the geometric median of the *coarse* colours, means over the pixel's surroundings, by the votes
//!    (E. Weiszfeld, F. Plastria (2009), "On the point for which the sum of the distances to n given points is minimum",
//!    doi:10.1007/s10479-008-0352-z). Half a pixel between photos makes little of a difference to them.
//! 3. A sample is trusted by about exp(−d²/2τ²) of its coarse colour's distance d to the centre, Welsch's weight (P. W.
//!    Holland, R. E. Welsch (1977), doi:10.1080/03610927708827533). τ² is that of noise and of what a pixel's surroundings
//!    differ by. Two votes cannot tell who is wrong: distrust comes in as they become three.
//! 4. Clear pixels, on which the votes agree, take the detail of the best: qualities to the fourth power, if
//!    [`Weights::Sharp`] asks for it. The less clear a pixel is, the more alike its samples count: that errs least.
//! 5. The colour is the mean of the fine colours by trust × quality × fade.
//!
//! Sums run in photo order; votes in f32, colours in f64.

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    clippy::cast_possible_truncation,
    reason = "loops over strips, compiled for the widest vectors where they are inlined into the kernel; votes are f32"
)]

use super::block::Verdict;
use super::counting::{Scratch, compare};
use super::stack::{Plane, STRIP};
use super::strip::{Strip, channel, round, select};
use super::{Blend, Settings, Weights};

/// A number for each of some neighbouring pixels.
type Soft = [f32; STRIP];

/// Steps towards the geometric median: more move it by less than noise does.
const STEPS: usize = 4;
/// A distance of 0 counts as this one, of an 8-bit range: the median may fall on a sample.
const LEAST_DISTANCE: f32 = 1.0 / 255.0;
/// What is left of a vote at a border. Its square root counts.
const LEAST_VOTE: f32 = 0.1;
/// Noise of coarse colours over all channels, of the range: photos that agree differ by as much.
const NOISE: f32 = 8.0 / 255.0;
/// The part of the variance of a pixel's surroundings that coarse colours of photos that agree may differ by, and the
/// breadth of the weight by their standard deviation.
const SURROUNDINGS: f32 = 0.25;
const BREADTH: f32 = 1.5;
/// A quality is at least this part of the best: all its powers are numbers.
const LEAST_RATIO: f32 = 1e-6;
/// What is left of a sample that is not trusted: enough where there is no other.
const LEAST_TRUST: f32 = 1e-5;
/// The share of the votes that agrees on a pixel which is not clear at all, and on one that is.
const CLEAR: [f32; 2] = [0.5, 0.7];
/// A sample that is trusted less than this counts as rejected in the layers and the report.
const KEPT: f32 = 0.1;

/// Soft weights and weighted mean of the pixels from `first` on.
#[inline(always)]
pub(super) fn judge<const C: usize>(
    settings: &Settings,
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
) -> Verdict<C> {
    let (seen, votes) = vote(planes, scratch, first);
    let range = f32::from(settings.depth.max());
    measure::<C>(planes, scratch, first, &seen, range);
    weigh(settings, planes, scratch, first, &votes);
    let Merged { used, best, mean, best_colour } = merge::<C>(planes, scratch, first);
    compare::<C>(planes, scratch, first, (&seen, &mean));
    let max = f64::from(settings.depth.max());
    let mut colour = if settings.blend == Blend::Best { best_colour } else { mean };
    for c in 0..C {
        for k in 0..STRIP {
            colour[c][k] = round(colour[c][k], max);
        }
    }
    Verdict { seen, used, best, colour }
}

/// A list from pixel `first` on; finite, also where the photo sees nothing.
#[inline(always)]
fn strip_of(list: &[f32], first: usize) -> &Soft {
    list[first..].first_chunk().expect("whole strips")
}

/// 3 t² − 2 t³ within 0 and 1.
#[inline(always)]
fn smooth_step(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// All votes of a pixel: their sum and the greatest.
struct Votes {
    total: Soft,
    greatest: Soft,
}

/// Enters quality and vote of each sample; how many see each pixel, and its votes.
#[inline(always)]
fn vote(planes: &[Plane], scratch: &mut [Scratch], first: usize) -> (Strip, Votes) {
    let (mut seen, mut finest) = ([0.0; STRIP], [0.0; STRIP]);
    let (mut total, mut greatest) = ([0.0; STRIP], [0.0; STRIP]);
    for (plane, s) in planes.iter().zip(&mut *scratch) {
        let weight: &Strip = plane.weights[first..].first_chunk().expect("whole strips");
        let quality = strip_of(&plane.soft.quality, first);
        let guard = strip_of(&plane.soft.guards, first);
        for k in 0..STRIP {
            s.is_seen[k] = select(weight[k] >= 0.0, 1.0, 0.0);
            seen[k] += s.is_seen[k];
            let is_seen = s.is_seen[k] as f32;
            finest[k] = (is_seen * quality[k]).max(finest[k]);
            s.vote[k] = is_seen * guard[k].max(LEAST_VOTE).sqrt();
            total[k] += s.vote[k];
            greatest[k] = s.vote[k].max(greatest[k]);
        }
    }
    for (plane, s) in planes.iter().zip(scratch) {
        let quality = strip_of(&plane.soft.quality, first);
        for k in 0..STRIP {
            // At most 1 also where the photo sees nothing and its quality means nothing: 0 times it is 0.
            s.ratio[k] = (quality[k] / finest[k]).clamp(LEAST_RATIO, 1.0);
        }
    }
    (seen, Votes { total, greatest })
}

/// Square of the distance of coarse colours to `to`, over the channels.
#[inline(always)]
fn distance_squared<const C: usize>(plane: &Plane, first: usize, to: &[Soft; C]) -> Soft {
    let mut sum = [0.0; STRIP];
    for c in 0..C {
        let colour = strip_of(&plane.soft.coarse[c], first);
        for k in 0..STRIP {
            let d = colour[k] - to[c][k];
            sum[k] += d * d;
        }
    }
    sum
}

/// The mean of coarse colours, each by what `weight` says of it.
#[inline(always)]
fn coarse_mean<const C: usize>(
    planes: &[Plane],
    scratch: &[Scratch],
    first: usize,
    weight: impl Fn(&Plane, &Scratch) -> Soft,
) -> [Soft; C] {
    let (mut sum, mut total) = ([[0.0; STRIP]; C], [0.0; STRIP]);
    for (plane, s) in planes.iter().zip(scratch) {
        let weight = weight(plane, s);
        for k in 0..STRIP {
            total[k] += weight[k];
        }
        for c in 0..C {
            let colour = strip_of(&plane.soft.coarse[c], first);
            for k in 0..STRIP {
                sum[c][k] += weight[k] * colour[k];
            }
        }
    }
    for c in 0..C {
        for k in 0..STRIP {
            sum[c][k] /= total[k];
        }
    }
    sum
}

/// Enters how far each sample is from the centre: d²/2τ².
#[inline(always)]
fn measure<const C: usize>(
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
    seen: &Strip,
    range: f32,
) {
    let least = (LEAST_DISTANCE * range) * (LEAST_DISTANCE * range);
    let mut centre: [Soft; C] = coarse_mean(planes, scratch, first, |_, s| s.vote);
    for _ in 0..STEPS {
        centre = coarse_mean(planes, scratch, first, |plane, s| {
            let d = distance_squared(plane, first, &centre);
            let mut weight = s.vote;
            for k in 0..STRIP {
                weight[k] /= (d[k] + least).sqrt();
            }
            weight
        });
    }
    let mut spread = [0.0; STRIP];
    for (plane, s) in planes.iter().zip(&*scratch) {
        for c in 0..C {
            let fine = channel(plane, c, first);
            let coarse = strip_of(&plane.soft.coarse[c], first);
            for k in 0..STRIP {
                let d = fine[k] - coarse[k];
                spread[k] += s.is_seen[k] as f32 * (d * d);
            }
        }
    }
    let noise = (NOISE * range) * (NOISE * range);
    let mut scale = [0.0; STRIP];
    for k in 0..STRIP {
        let variance = noise + SURROUNDINGS * (spread[k] / seen[k] as f32);
        scale[k] = 1.0 / (2.0 * BREADTH * BREADTH * variance);
    }
    for (plane, s) in planes.iter().zip(scratch) {
        let d = distance_squared(plane, first, &centre);
        for k in 0..STRIP {
            s.far[k] = d[k] * scale[k];
        }
    }
}

/// About exp(−x), as (1 − x/8)⁸: 0 from 8 on, and the same bits everywhere.
#[inline(always)]
fn welsch(x: f32) -> f32 {
    let t = (1.0 - 0.125 * x).max(0.0);
    let t = t * t;
    let t = t * t;
    t * t
}

/// Enters what each sample weighs, and whether it counts as kept.
#[inline(always)]
fn weigh(
    settings: &Settings,
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
    votes: &Votes,
) {
    let mut agreed = [0.0; STRIP];
    for s in &*scratch {
        for k in 0..STRIP {
            agreed[k] += s.vote[k] * welsch(s.far[k]);
        }
    }
    let (mut clear, mut majority) = ([0.0; STRIP], [0.0; STRIP]);
    for k in 0..STRIP {
        // Two votes are none.
        majority[k] = smooth_step(votes.total[k] / votes.greatest[k] - 2.0);
        clear[k] = smooth_step((agreed[k] / votes.total[k] - CLEAR[0]) / (CLEAR[1] - CLEAR[0]));
    }
    let is_sharp = settings.weights == Weights::Sharp;
    for (plane, s) in planes.iter().zip(scratch) {
        let fade = strip_of(&plane.soft.fades, first);
        for k in 0..STRIP {
            let (ratio, clear) = (s.ratio[k], clear[k]);
            let power = if is_sharp {
                let square = ratio * ratio;
                let root = ratio.sqrt().sqrt();
                root + clear * (square * square - root)
            } else {
                ratio
            };
            let doubtful = fade[k].sqrt();
            let fade = doubtful + clear * (fade[k] - doubtful);
            let trust = welsch(s.far[k] * majority[k]).max(LEAST_TRUST);
            s.weight[k] = s.is_seen[k] * f64::from(trust * (fade * power));
            s.is_kept[k] = select(trust >= KEPT, s.is_seen[k], 0.0);
        }
    }
}

/// What the samples come to.
struct Merged<const C: usize> {
    used: Strip,
    best: Strip,
    mean: [Strip; C],
    best_colour: [Strip; C],
}

/// The weighted mean of the fine colours, and the heaviest sample, of equals that of the lowest id.
#[inline(always)]
fn merge<const C: usize>(planes: &[Plane], scratch: &[Scratch], first: usize) -> Merged<C> {
    let (mut used, mut total) = ([0.0; STRIP], [0.0; STRIP]);
    let (mut best, mut greatest) = ([0.0; STRIP], [0.0; STRIP]);
    let (mut mean, mut best_colour) = ([[0.0; STRIP]; C], [[0.0; STRIP]; C]);
    for (i, (plane, s)) in planes.iter().zip(scratch).enumerate() {
        let mut is_better = [false; STRIP];
        for k in 0..STRIP {
            used[k] += s.is_kept[k];
            total[k] += s.weight[k];
            // A weight is above 0 wherever the photo sees the pixel.
            is_better[k] = s.weight[k] > greatest[k];
            best[k] = select(is_better[k], i as f64, best[k]);
            greatest[k] = select(is_better[k], s.weight[k], greatest[k]);
        }
        for c in 0..C {
            let colour = channel(plane, c, first);
            for k in 0..STRIP {
                let v = f64::from(colour[k]);
                mean[c][k] += s.weight[k] * v;
                best_colour[c][k] = select(is_better[k], v, best_colour[c][k]);
            }
        }
    }
    for c in 0..C {
        for k in 0..STRIP {
            mean[c][k] /= total[k];
        }
    }
    Merged { used, best, mean, best_colour }
}
