//! [`Random`]: a small generator of numbers that are the same on every machine.

/// A stream of pseudo-random numbers from a seed; the generator `SplitMix64`.
///
/// G. L. Steele, D. Lea, C. H. Flood (2014), "Fast splittable pseudorandom number generators", OOPSLA 2014,
/// 453–472, doi:10.1145/2660193.2660195.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// The stream of `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// The next number, uniform in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        unit(self.bits())
    }

    /// The next number, uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// The next whole number below `count`, which must not be 0.
    pub fn below(&mut self, count: u64) -> u64 {
        self.bits() % count
    }
}

/// A number in `[0, 1)` that belongs to `key` alone: the same key, the same number.
pub(super) fn hash_unit(key: u64) -> f64 {
    unit(mix(key.wrapping_add(0x9e37_79b9_7f4a_7c15)))
}

fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stream_is_that_of_the_published_generator() {
        // First outputs of SplitMix64 for seed 1234567, as its reference implementation prints them.
        let mut r = Random::new(1_234_567);
        assert_eq!(r.bits(), 6_457_827_717_110_365_317);
        assert_eq!(r.bits(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn numbers_fill_the_unit_interval_evenly() {
        let mut r = Random::new(7);
        let mut bins = [0_u32; 10];
        for _ in 0..100_000 {
            let x = r.unit();
            assert!((0.0..1.0).contains(&x));
            let bin = (0..10).rfind(|&b| x * 10.0 >= f64::from(b)).unwrap();
            bins[usize::try_from(bin).unwrap()] += 1;
        }
        assert!(bins.iter().all(|&b| b.abs_diff(10_000) < 500), "{bins:?}");
    }
}
