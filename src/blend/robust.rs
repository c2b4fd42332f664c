//! Soft outlier weights for a strip of pixels.
#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "loops over strips, compiled for the widest vectors where they are inlined into the kernel"
)]

use super::block::Verdict;
use super::counting::{Scratch, compare};
use super::stack::{Plane, STRIP};
use super::strip::{Strip, channel, round, select};
use super::{Blend, Settings, Weights};

/// A number for each of some neighbouring pixels.
type Soft = [f32; STRIP];

const ITERATIONS: usize = 6;
const LEAST_RATIO: f32 = 1e-6;
const LEAST_VOTE: f32 = 0.1;
const LEAST_TRUST: f32 = 1e-5;
const NOISE: f32 = 8.0 / 255.0;

#[inline(always)]
fn of(list: &[f32], first: usize) -> &[f32; STRIP] {
    list[first..].first_chunk().expect("whole strips")
}

#[inline(always)]
fn distance2<const C: usize>(plane: &[Vec<f32>; 3], first: usize, to: &[Soft; C]) -> Soft {
    let mut sum = [0.0; STRIP];
    for c in 0..C {
        let colour = of(&plane[c], first);
        for k in 0..STRIP {
            let d = colour[k] - to[c][k];
            sum[k] += d * d;
        }
    }
    sum
}

/// Soft weights and weighted mean of the pixels from `first` on.
#[inline(always)]
pub(super) fn judge<const C: usize>(
    settings: &Settings,
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
) -> Verdict<C> {
    let range = settings.depth.max() as f32;
    let (mut seen, mut best_quality) = ([0.0; STRIP], [0.0_f32; STRIP]);
    for (plane, s) in planes.iter().zip(&mut *scratch) {
        let weight: &Strip = plane.weights[first..].first_chunk().expect("whole strips");
        let quality = of(&plane.soft.quality, first);
        for k in 0..STRIP {
            s.is_seen[k] = select(weight[k] >= 0.0, 1.0, 0.0);
            seen[k] += s.is_seen[k];
            let q = s.is_seen[k] as f32 * quality[k];
            best_quality[k] = if q > best_quality[k] { q } else { best_quality[k] };
        }
    }
    // votes
    let mut centre = [[0.0_f32; STRIP]; C];
    let mut total = [0.0_f32; STRIP];
    for (plane, s) in planes.iter().zip(&mut *scratch) {
        let quality = of(&plane.soft.quality, first);
        let guard = of(&plane.soft.guards, first);
        for k in 0..STRIP {
            let ratio = (quality[k] / best_quality[k]).max(LEAST_RATIO);
            s.ratio[k] = ratio;
            s.vote[k] = s.is_seen[k] as f32 * guard[k].max(LEAST_VOTE) * ratio.sqrt().sqrt();
            total[k] += s.vote[k];
        }
        for c in 0..C {
            let colour = of(&plane.soft.coarse[c], first);
            for k in 0..STRIP {
                centre[c][k] += s.vote[k] * colour[k];
            }
        }
    }
    for c in 0..C {
        for k in 0..STRIP {
            centre[c][k] /= total[k];
        }
    }
    for _ in 0..ITERATIONS {
        let mut sum = [[0.0_f32; STRIP]; C];
        let mut total = [0.0_f32; STRIP];
        for (plane, s) in planes.iter().zip(&*scratch) {
            let d2 = distance2::<C>(&plane.soft.coarse, first, &centre);
            let mut w = [0.0_f32; STRIP];
            for k in 0..STRIP {
                w[k] = s.vote[k] / (d2[k] + 1.0).sqrt();
                total[k] += w[k];
            }
            for c in 0..C {
                let colour = of(&plane.soft.coarse[c], first);
                for k in 0..STRIP {
                    sum[c][k] += w[k] * colour[k];
                }
            }
        }
        for c in 0..C {
            for k in 0..STRIP {
                centre[c][k] = sum[c][k] / total[k];
            }
        }
    }
    // noise
    let mut spread = [0.0_f32; STRIP];
    for (plane, s) in planes.iter().zip(&*scratch) {
        for c in 0..C {
            let (fine, coarse) = (channel(plane, c, first), of(&plane.soft.coarse[c], first));
            for k in 0..STRIP {
                let d = fine[k] - coarse[k];
                spread[k] += s.is_seen[k] as f32 * d * d;
            }
        }
    }
    let floor = NOISE * range;
    let mut scale = [0.0_f32; STRIP];
    for k in 0..STRIP {
        scale[k] = 1.0 / (2.25 * 2.0 * (floor * floor + spread[k] / seen[k] as f32));
    }
    // final weights
    let (mut sum, mut total, mut used) = ([[0.0_f64; STRIP]; C], [0.0_f64; STRIP], [0.0; STRIP]);
    let (mut best, mut best_weight) = ([0.0; STRIP], [-1.0_f64; STRIP]);
    let mut best_colour = [[0.0_f64; STRIP]; C];
    for (i, (plane, s)) in planes.iter().zip(&mut *scratch).enumerate() {
        let d2 = distance2::<C>(&plane.soft.coarse, first, &centre);
        let fade = of(&plane.soft.fades, first);
        for k in 0..STRIP {
            let trust = f64::from(libm::expf(-d2[k] * scale[k]).max(LEAST_TRUST));
            let r = f64::from(s.ratio[k]);
            let power = if settings.weights == Weights::Sharp { r * r * r * r } else { r };
            s.weight[k] = s.is_seen[k] * trust * f64::from(fade[k]) * power;
            s.is_kept[k] = select(trust > 0.1, s.is_seen[k], 0.0);
            used[k] += s.is_kept[k];
            total[k] += s.weight[k];
        }
        for c in 0..C {
            let colour = channel(plane, c, first);
            for k in 0..STRIP {
                sum[c][k] += s.weight[k] * f64::from(colour[k]);
            }
        }
        for k in 0..STRIP {
            let is_better = (s.weight[k] > best_weight[k]) & (s.is_seen[k] > 0.0);
            best[k] = select(is_better, i as f64, best[k]);
            best_weight[k] = select(is_better, s.weight[k], best_weight[k]);
            for c in 0..C {
                let colour = channel(plane, c, first);
                best_colour[c][k] = select(is_better, f64::from(colour[k]), best_colour[c][k]);
            }
        }
    }
    let mut mean = [[0.0; STRIP]; C];
    for c in 0..C {
        for k in 0..STRIP {
            mean[c][k] = sum[c][k] / total[k];
        }
    }
    compare::<C>(planes, scratch, first, (&seen, &mean));
    let max = f64::from(settings.depth.max());
    let chosen = if settings.blend == Blend::Best { best_colour } else { mean };
    let mut colour = [[0.0; STRIP]; C];
    for c in 0..C {
        for k in 0..STRIP {
            colour[c][k] = round(chosen[c][k], max);
        }
    }
    Verdict { seen, used, best, colour }
}
