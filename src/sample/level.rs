//! The pyramid level that a pixel samples.

/// Pyramid level for a footprint: max(0, ⌊log₂ footprint⌋), at most `levels − 1`.
///
/// `footprint_squared` is the square of the number of level-0 photo pixels, along a side, that the mosaic pixel
/// covers; `levels` the number of levels that the photo has, level 0 included. The result is exact: with `e` the
/// binary exponent of the argument, ⌊log₂ f⌋ = ⌊½ log₂ f²⌋ = ⌊e / 2⌋, and `e` is read from the bits. A footprint
/// that is zero, negative or not a number takes level 0; an infinite one takes the last level.
pub fn level_of(footprint_squared: f64, levels: u32) -> u32 {
    const MANTISSA_BITS: u32 = f64::MANTISSA_DIGITS - 1;
    const BIAS: u32 = 1023;
    // Below 1 there is nothing to choose; `max` lets nothing but numbers through.
    let at_least_1 = footprint_squared.max(1.0);
    // The sign bit is 0, so what is left of the mantissa is the biased exponent.
    let exponent = (at_least_1.to_bits() >> MANTISSA_BITS) as u32 - BIAS;
    let level = exponent / 2;
    level.min(levels.saturating_sub(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_begins_exactly_at_its_power_of_two() {
        for level in 0..30_u32 {
            let begin = 4_f64.powi(i32::try_from(level).unwrap());
            assert_eq!(level_of(begin, 40), level);
            assert_eq!(level_of(begin.next_up(), 40), level);
            assert_eq!(level_of(begin.next_down(), 40), level.saturating_sub(1));
            assert_eq!(
                level_of(begin * 2.0, 40),
                level,
                "√2 times the footprint is the same level"
            );
        }
    }

    #[test]
    fn small_and_absurd_footprints_take_the_first_and_the_last_level() {
        for f in [0.0, -0.0, -4.0, 1e-310, 0.25, f64::NAN, f64::NEG_INFINITY] {
            assert_eq!(level_of(f, 8), 0, "{f}");
        }
        assert_eq!(level_of(f64::INFINITY, 8), 7);
        assert_eq!(level_of(f64::MAX, 8), 7);
        assert_eq!((level_of(1e9, 1), level_of(1e9, 0)), (0, 0));
    }
}
