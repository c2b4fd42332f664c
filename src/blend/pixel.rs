//! Outliers, weighted mean and best photo of each pixel.

use super::stack::{Sample, SampleTile};
use super::tile::colour_of;
use super::{Blend, OrthoTile, Outliers, Settings, Statistics, Weights};
use crate::image::{Colour, Image, Samples};

/// Samples are equal if σ is below this share of the range: half an 8-bit grey value.
const LEAST_SIGMA: f64 = 0.5 / 255.0;
/// Relative guard of the outlier test, so that rounding does not drop a sample at just β·σ.
const GUARD: f64 = 1.0 + 1e-6;

/// What a pixel's samples come to.
struct Verdict<const C: usize> {
    /// Weighted mean of the kept samples.
    mean: [f64; C],
    /// The pixel's colour before rounding.
    colour: [f64; C],
    /// The heaviest kept photo.
    best: u16,
    /// Samples kept.
    used: usize,
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
    match settings.colour {
        Colour::Grey => blend_channels::<1>(settings, samples, tile, statistics),
        Colour::Rgb => blend_channels::<3>(settings, samples, tile, statistics),
    }
}

/// The same for `C` channels.
fn blend_channels<const C: usize>(
    settings: &Settings,
    samples: &mut SampleTile,
    tile: &mut OrthoTile,
    statistics: &mut Statistics,
) {
    let part = samples.rect();
    let mut kept = std::mem::take(&mut samples.kept);
    samples.for_each_pixel(|k, samples| {
        let verdict = judge::<C>(settings, samples, &mut kept);
        count::<C>(statistics, samples, &kept, &verdict.mean);
        let at = tile.index(part, k);
        put::<C>(tile, at, samples.len(), &verdict);
    });
    samples.kept = kept;
}

/// DESIGN.md §1.4 and §1.5 for one pixel with at least one sample; `kept` is overwritten.
fn judge<const C: usize>(
    settings: &Settings,
    samples: &[Sample],
    kept: &mut Vec<bool>,
) -> Verdict<C> {
    // Outliers.
    kept.clear();
    kept.resize(samples.len(), true);
    if settings.outliers == Outliers::Sigma && samples.len() > 2 {
        let range = f64::from(settings.depth.max());
        drop_outliers::<C>(settings.beta, range, samples, kept);
    }
    let used = || samples.iter().zip(&*kept).filter(|(_, kept)| **kept).map(|(s, _)| s);
    // Weights; all zero means all equal.
    let total: f64 = match settings.weights {
        Weights::Area => used().map(|s| s.weight).sum(),
        Weights::Equal => 0.0,
    };
    let weight = |s: &Sample| if total > 0.0 { s.weight } else { 1.0 };
    let count = used().count();
    let total = if total > 0.0 { total } else { count as f64 };
    // Weighted mean, as the first kept colour plus the weighted mean of the differences to it: samples that agree give
    // exactly the colour that they agree on. The best: only a heavier one replaces one of a lower id.
    let first = used().next().expect("one sample at least is kept");
    let base = first.channels::<C>();
    let (mut sum, mut best) = ([0.0; C], first);
    for s in used() {
        for ((sum, v), base) in sum.iter_mut().zip(s.channels::<C>()).zip(base) {
            *sum += weight(s) * (v - base);
        }
        if weight(s) > weight(best) {
            best = s;
        }
    }
    let mean = std::array::from_fn(|c| base[c] + sum[c] / total);
    let colour = match settings.blend {
        Blend::Mean => mean,
        Blend::Best => best.channels(),
    };
    Verdict { mean, colour, best: best.photo, used: count }
}

/// The outlier test; `kept` is all true when it is called. Distances are compared as squares.
fn drop_outliers<const C: usize>(beta: f64, range: f64, samples: &[Sample], kept: &mut [bool]) {
    let n = samples.len() as f64;
    let mut sum = [0.0; C];
    for s in samples {
        for (sum, v) in sum.iter_mut().zip(s.channels::<C>()) {
            *sum += v;
        }
    }
    let mean = sum.map(|sum| sum / n);
    let sigma_squared = samples.iter().map(|s| distance_squared::<C>(s, &mean)).sum::<f64>() / n;
    if sigma_squared < (LEAST_SIGMA * range) * (LEAST_SIGMA * range) {
        return;
    }
    let limit = (beta * GUARD) * (beta * GUARD) * sigma_squared;
    let mut nearest = (f64::INFINITY, 0);
    for (i, (s, kept)) in samples.iter().zip(&mut *kept).enumerate() {
        let d = distance_squared::<C>(s, &mean);
        *kept = d <= limit;
        if d < nearest.0 {
            nearest = (d, i);
        }
    }
    if !kept.contains(&true) {
        kept[nearest.1] = true;
    }
}

/// Square of the Euclidean distance over the channels.
fn distance_squared<const C: usize>(sample: &Sample, colour: &[f64; C]) -> f64 {
    sample.channels::<C>().iter().zip(colour).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Counts one pixel's samples.
fn count<const C: usize>(
    statistics: &mut Statistics,
    samples: &[Sample],
    kept: &[bool],
    mean: &[f64; C],
) {
    for (s, &kept) in samples.iter().zip(kept) {
        let photo = &mut statistics.photos[usize::from(s.photo)];
        photo.seen += 1;
        photo.used += u64::from(kept);
        photo.rejected += u64::from(!kept);
        if samples.len() > 1 {
            photo.compared += 1;
            photo.residual_256 += fixed(distance_squared::<C>(s, mean).sqrt());
        }
    }
}

/// A distance in 1/256, rounded half up.
fn fixed(distance: f64) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "rounding; a distance is not negative and far below 2^56"
    )]
    let rounded = (distance * 256.0 + 0.5) as u64;
    rounded
}

/// Writes one pixel.
fn put<const C: usize>(tile: &mut OrthoTile, at: usize, seen: usize, verdict: &Verdict<C>) {
    assert!(tile.count.data()[at] != OrthoTile::NO_SURFACE, "a sample needs a surface");
    let saturated = |n: usize| u8::try_from(n).unwrap_or(u8::MAX).min(OrthoTile::MAX_COUNT);
    tile.count.data_mut()[at] = saturated(seen);
    tile.used.data_mut()[at] = saturated(verdict.used);
    tile.coverage.data_mut()[at] = saturated(seen).min(3);
    tile.best.data_mut()[at] = verdict.best;
    match &mut tile.colour {
        Samples::U8(i) => {
            put_colour::<u8, C>(i, at, verdict, |v| u8::try_from(round(v, 255.0)).unwrap_or(255));
        }
        Samples::U16(i) => put_colour::<u16, C>(i, at, verdict, |v| round(v, 65535.0)),
    }
}

/// Writes one pixel's colour and alpha.
fn put_colour<T: Copy, const C: usize>(
    image: &mut Image<T>,
    at: usize,
    verdict: &Verdict<C>,
    round: impl Fn(f64) -> T,
) {
    let pixel = &mut image.data_mut()[at * (C + 1)..(at + 1) * (C + 1)];
    for (out, v) in pixel.iter_mut().zip(verdict.colour) {
        *out = round(v);
    }
    pixel[C] = round(f64::INFINITY);
}

/// Clamped to 0 … `max` and rounded half up: the only rounding on the way from photo to mosaic.
fn round(v: f64, max: f64) -> u16 {
    let clamped = v.clamp(0.0, max);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the whole part of a number from 0 to 65535"
    )]
    let whole = clamped as u16;
    whole + u16::from(clamped - f64::from(whole) >= 0.5)
}
