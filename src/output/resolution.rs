//! [`PrintResolution`]: how large the pixels are on paper.
//!
//! TIFF states dots per inch as rational numbers of 32 bits: `XResolution` (282), `YResolution` (283), with
//! `ResolutionUnit` (296) = 2, inch. An overview of level n covers the same paper with pixels 2ⁿ times as large, so its
//! directory states 1/2ⁿ of the resolution. Without a resolution the unit is 1, none, and the tags say that pixels are
//! square.

use super::ifd::Directory;

/// An inch is 254 of these parts of a metre.
const PARTS_OF_A_METRE: f64 = 10_000.0;
/// The least and the greatest resolution, dots per inch: a printer's and a film's lie well within.
const RANGE_DPI: std::ops::RangeInclusive<f64> = 1.0..=100_000.0;

/// Dots per inch, from 1 to 100000.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct PrintResolution(f64);

impl PrintResolution {
    /// The resolution of `dpi` dots per inch; `None` if it is not from 1 to 100000.
    pub fn new(dpi: f64) -> Option<Self> {
        RANGE_DPI.contains(&dpi).then_some(Self(dpi))
    }

    /// Dots per inch.
    pub fn dpi(self) -> f64 {
        self.0
    }

    /// Side of a pixel on the object, metres, if the print is to have the scale 1:`denominator`:
    /// denominator × 0.0254 / dpi, rounded once if both are whole numbers.
    pub fn pixel_size_m(self, denominator: f64) -> f64 {
        denominator * 254.0 / (self.0 * PARTS_OF_A_METRE)
    }

    /// The same to 32 bits above and below the bar, lowest terms; exact for up to nine decimals as far as these go.
    fn rational(self) -> [u32; 2] {
        let mut found = [0, 1];
        let mut denominator: u32 = 1;
        for _ in 0..10 {
            let numerator = (self.0 * f64::from(denominator)).round();
            if numerator > f64::from(u32::MAX) {
                break;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a whole number of at least 1, and below 2³² as just seen"
            )]
            let whole = numerator as u32;
            found = [whole, denominator];
            let is_exact = (numerator / f64::from(denominator)).to_bits() == self.0.to_bits();
            match denominator.checked_mul(10) {
                Some(next) if !is_exact => denominator = next,
                _ => break,
            }
        }
        let divisor = greatest_common_divisor(found);
        found.map(|part| part / divisor)
    }

    /// The numerator and denominator in the directory of an overview level.
    fn of_level(self, level: u32) -> [u32; 2] {
        let [numerator, denominator] = self.rational();
        // A shift that loses no bit; where there is none, the other side loses what cannot be said.
        let shift = level.min(denominator.leading_zeros());
        [(numerator >> (level - shift).min(31)).max(1), denominator << shift.min(31)]
    }
}

impl TryFrom<f64> for PrintResolution {
    type Error = String;

    fn try_from(dpi: f64) -> Result<Self, String> {
        Self::new(dpi).ok_or_else(|| format!("{dpi} dots per inch"))
    }
}

impl From<PrintResolution> for f64 {
    fn from(resolution: PrintResolution) -> Self {
        resolution.0
    }
}

fn greatest_common_divisor([mut a, mut b]: [u32; 2]) -> u32 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a.max(1)
}

/// Adds the tags of the directory of a level.
pub(super) fn add_tags(resolution: Option<PrintResolution>, level: u32, d: &mut Directory) {
    let [numerator, denominator] = resolution.map_or([1, 1], |r| r.of_level(level));
    d.rational(282, numerator, denominator); // XResolution
    d.rational(283, numerator, denominator); // YResolution
    d.shorts(296, &[if resolution.is_some() { 2 } else { 1 }]); // ResolutionUnit: inch, or none
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolution(dpi: f64) -> PrintResolution {
        PrintResolution::new(dpi).unwrap()
    }

    #[test]
    fn whole_and_decimal_resolutions_are_exact_rationals() {
        for (dpi, expected) in [
            (300.0, [300, 1]),
            (1.0, [1, 1]),
            (100_000.0, [100_000, 1]),
            (72.5, [145, 2]),
            (299.9994, [1_499_997, 5000]),
            (118.11, [11_811, 100]),
        ] {
            assert_eq!(resolution(dpi).rational(), expected, "{dpi}");
        }
        let [a, b] = resolution(1000.0 / 7.0).rational();
        assert!((f64::from(a) / f64::from(b) - 1000.0 / 7.0).abs() < 1e-6, "{a}/{b}");
    }

    #[test]
    fn an_overview_has_half_the_resolution_of_the_level_before() {
        assert_eq!(resolution(300.0).of_level(0), [300, 1]);
        assert_eq!(resolution(300.0).of_level(3), [300, 8]);
        assert_eq!(resolution(300.0).of_level(40), [1, 1 << 31]);
        let [a, b] = resolution(118.11).of_level(30);
        let found = f64::from(a) / f64::from(b) * 2_f64.powi(30);
        assert!((found / 118.11 - 1.0).abs() < 1e-3, "{found}");
    }

    #[test]
    fn a_scale_gives_the_pixel_size_to_the_last_bit() {
        assert_eq!(resolution(254.0).pixel_size_m(100.0).to_bits(), 0.01_f64.to_bits());
        assert_eq!(resolution(300.0).pixel_size_m(50.0).to_bits(), (127.0_f64 / 30e3).to_bits());
        assert_eq!(resolution(2540.0).pixel_size_m(20.0).to_bits(), 0.0002_f64.to_bits());
    }

    #[test]
    fn what_no_printer_has_is_refused_in_a_file_too() {
        for dpi in [0.0, -300.0, 0.99, 100_001.0, f64::NAN, f64::INFINITY] {
            assert_eq!(PrintResolution::new(dpi), None);
        }
        assert_eq!(serde_json::from_str::<PrintResolution>("300").unwrap(), resolution(300.0));
        assert!(serde_json::from_str::<PrintResolution>("0.5").is_err());
    }
}
