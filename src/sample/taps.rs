//! Which pixels a sample reads.

use glam::DVec2;

use crate::geom::{Kernel, LANES, PixelRect, run_widest};

/// How a colour between pixel centres is made.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    Default,
    serde::Serialize,
    serde::Deserialize,
    clap::ValueEnum,
)]
pub enum Interpolation {
    /// The pixel that holds the position: 1 × 1 taps.
    Nearest,
    /// Linear in x and y: 2 × 2 taps.
    Bilinear,
    /// Cubic convolution with a = −½: 4 × 4 taps (Keys 1981, see [`sample_into`](super::sample_into)).
    #[default]
    Bicubic,
}

impl Interpolation {
    /// Taps along one side.
    pub fn side(self) -> i64 {
        match self {
            Self::Nearest => 1,
            Self::Bilinear => 2,
            Self::Bicubic => 4,
        }
    }

    /// Taps before the anchor.
    pub(super) fn before(self) -> i64 {
        match self {
            Self::Nearest | Self::Bilinear => 0,
            Self::Bicubic => 1,
        }
    }
}

/// A position in the grid of one level: its floor is the anchor tap, its fraction the interpolation weight.
///
/// The level's pixel `i` has its centre at `i + ½`, so between centres the grid is the position less ½; nearest
/// takes the pixel around the position itself. The scale is a power of two, hence exact.
#[inline(always)]
#[expect(clippy::inline_always, reason = "part of a kernel")]
pub(super) fn grid_of(position: DVec2, scale: f64, half: f64) -> DVec2 {
    position * scale - half
}

/// Offset of a pixel's centre in the grid of an interpolation.
pub(super) fn half_of(interpolation: Interpolation) -> f64 {
    if interpolation == Interpolation::Nearest { 0.0 } else { 0.5 }
}

/// 2^−level.
pub(super) fn scale_of(level: u32) -> f64 {
    assert!(level < 64, "no photo has 64 levels");
    1.0 / f64::from_bits((1023 + u64::from(level)) << 52)
}

/// ⌊v⌋, for |v| < 2³¹ (saturating beyond; 0 for NaN): one conversion, where `f64::floor` is a library call on x86-64.
#[inline(always)]
#[expect(clippy::inline_always, reason = "part of a kernel")]
pub(super) fn floor(v: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "truncation is the first half of a floor")]
    let t = v as i32;
    t - i32::from(v < f64::from(t))
}

/// The pixels of `level` that a sample at `position` reads; `position` in level-0 photo pixels.
///
/// The rectangle may reach over the photo's edge.
pub fn taps(interpolation: Interpolation, position: DVec2, level: u32) -> PixelRect {
    let grid = grid_of(position, scale_of(level), half_of(interpolation));
    let x0 = i64::from(floor(grid.x)) - interpolation.before();
    let y0 = i64::from(floor(grid.y)) - interpolation.before();
    PixelRect::new(x0, y0, x0 + interpolation.side(), y0 + interpolation.side())
}

/// The least rectangle of `level` that holds the taps of all `positions`; empty when there are none.
pub fn taps_of(interpolation: Interpolation, positions: &[DVec2], level: u32) -> PixelRect {
    if positions.is_empty() {
        return PixelRect::new(0, 0, 0, 0);
    }
    // Taps are monotonic in each coordinate, so the extreme positions have the extreme taps.
    let (min, max) = run_widest(Extremes { positions });
    let (a, b) = (taps(interpolation, min, level), taps(interpolation, max, level));
    PixelRect::new(a.x0, a.y0, b.x1, b.y1)
}

/// The least and the greatest coordinates of some positions; what is not a number counts as nothing.
pub(super) struct Extremes<'a> {
    pub(super) positions: &'a [DVec2],
}

impl Kernel for Extremes<'_> {
    type Output = (DVec2, DVec2);

    #[inline(always)]
    #[expect(clippy::inline_always, reason = "a kernel")]
    fn run(self) -> (DVec2, DVec2) {
        let (mut min, mut max) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
        let (whole, rest) = self.positions.as_chunks::<{ LANES / 2 }>();
        let mut at = [0.0; LANES];
        for positions in whole {
            for (k, p) in positions.iter().enumerate() {
                (at[2 * k], at[2 * k + 1]) = (p.x, p.y);
            }
            for k in 0..LANES {
                min[k] = if at[k] < min[k] { at[k] } else { min[k] };
                max[k] = if at[k] > max[k] { at[k] } else { max[k] };
            }
        }
        let pairs =
            |of: [f64; LANES]| (0..LANES / 2).map(move |k| DVec2::new(of[2 * k], of[2 * k + 1]));
        let rest = || rest.iter().copied();
        (
            pairs(min).chain(rest()).fold(DVec2::INFINITY, DVec2::min),
            pairs(max).chain(rest()).fold(DVec2::NEG_INFINITY, DVec2::max),
        )
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;

    const ALL: [Interpolation; 3] =
        [Interpolation::Nearest, Interpolation::Bilinear, Interpolation::Bicubic];

    #[test]
    fn at_a_pixel_centre_the_anchor_is_that_pixel() {
        let p = DVec2::new(7.5, 3.5);
        assert_eq!(taps(Interpolation::Nearest, p, 0), PixelRect::new(7, 3, 8, 4));
        assert_eq!(taps(Interpolation::Bilinear, p, 0), PixelRect::new(7, 3, 9, 5));
        assert_eq!(taps(Interpolation::Bicubic, p, 0), PixelRect::new(6, 2, 10, 6));
    }

    #[test]
    fn the_photos_upper_left_corner_reads_over_the_edge() {
        assert_eq!(taps(Interpolation::Bicubic, DVec2::ZERO, 0), PixelRect::new(-2, -2, 2, 2));
        assert_eq!(taps(Interpolation::Nearest, DVec2::ZERO, 0), PixelRect::new(0, 0, 1, 1));
    }

    #[test]
    fn a_level_halves_the_position_and_keeps_the_corner() {
        // Level-0 pixels 8..16 are pixel 1 of level 3.
        for x in [8.0, 12.0, 16_f64.next_down()] {
            let t = taps(Interpolation::Nearest, DVec2::splat(x), 3);
            assert_eq!(t, PixelRect::new(1, 1, 2, 2));
        }
    }

    #[test]
    fn a_floor_is_a_floor() {
        for v in [-2.0, -1.5, -1.0, -0.5, -1e-300, -0.0, 0.0, 0.5, 1_f64.next_down(), 1.0, 7.9] {
            assert!((f64::from(floor(v)) - v.floor()).abs() < 0.5, "{v}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(7), ..ProptestConfig::default() })]

        #[test]
        fn the_taps_of_many_are_the_union_of_the_taps_of_each(
            points in prop::collection::vec((-9.0..99.0_f64, -9.0..99.0_f64), 1..20),
            level in 0..5_u32,
            which in 0..3_usize,
        ) {
            let points: Vec<_> = points.into_iter().map(DVec2::from).collect();
            let each: Vec<_> = points.iter().map(|&p| taps(ALL[which], p, level)).collect();
            let of = |f: fn(&PixelRect) -> i64| each.iter().map(f);
            let union = PixelRect::new(
                of(|r| r.x0).min().unwrap(),
                of(|r| r.y0).min().unwrap(),
                of(|r| r.x1).max().unwrap(),
                of(|r| r.y1).max().unwrap(),
            );
            prop_assert_eq!(taps_of(ALL[which], &points, level), union);
        }
    }
}
