//! A number for each of some neighbouring pixels, and what is done to all of them at once.

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "loops over strips, compiled for the widest vectors where they are inlined into the kernel"
)]

use super::stack::{Plane, STRIP};

/// A number for each of some neighbouring pixels.
pub(super) type Strip = [f64; STRIP];

/// A channel of a plane from pixel `first` on; finite, also where the photo sees nothing.
#[inline(always)]
pub(super) fn channel(plane: &Plane, c: usize, first: usize) -> &[f32; STRIP] {
    plane.colours[c][first..].first_chunk().expect("whole strips")
}

/// `a` where `is` holds, else `b`: by bits, lest the compiler make a branch or a masked store of it.
#[inline(always)]
pub(super) fn select(is: bool, a: f64, b: f64) -> f64 {
    let mask = u64::from(is).wrapping_neg();
    f64::from_bits((a.to_bits() & mask) | (b.to_bits() & !mask))
}

/// Square of the Euclidean distance over the channels.
#[inline(always)]
pub(super) fn distance_squared<const C: usize>(
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

/// ⌊v⌋ for 0 ≤ v < 2⁵¹: where `f64::floor` is a library call on x86-64, this becomes a few vector instructions.
#[inline(always)]
pub(super) fn whole(v: f64) -> f64 {
    const TWO_52: f64 = 4_503_599_627_370_496.0;
    let nearest = (v + TWO_52) - TWO_52;
    select(nearest > v, nearest - 1.0, nearest)
}

/// Clamped to 0 … `max` and rounded half up.
#[inline(always)]
pub(super) fn round(v: f64, max: f64) -> f64 {
    let clamped = select(v > 0.0, select(v < max, v, max), 0.0);
    let whole = whole(clamped);
    whole + select(clamped - whole >= 0.5, 1.0, 0.0)
}
