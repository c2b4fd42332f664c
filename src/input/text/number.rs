//! Numbers in text, rounded to the nearest `f64`.

/// The powers of ten that a `f64` holds exactly, as far as they are needed.
const TENS: [f64; 19] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18,
];

/// A number in text. What C libraries print for one that is not finite, such as `-nan(ind)` or `1.#QNAN`, is NaN.
pub(in crate::input) fn number(word: &[u8]) -> Option<f64> {
    if let Some(value) = short_decimal(word) {
        return Some(value);
    }
    let text = str::from_utf8(word).ok()?;
    match text.parse() {
        Ok(value) => Some(value),
        Err(_) if text.contains("nan(") || text.contains(".#") => Some(f64::NAN),
        Err(_) => None,
    }
}

/// A decimal number without exponent whose digits are below 2⁵³: one division of two exact numbers, so that it is
/// rounded correctly. W. D. Clinger (1990), "How to read floating point numbers accurately",
/// doi:10.1145/93548.93557, section 4.
fn short_decimal(word: &[u8]) -> Option<f64> {
    let (is_negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        digits => (false, digits),
    };
    // Eighteen digits and a point: below 2⁶⁴.
    if digits.len() > 19 {
        return None;
    }
    let (mut value, mut count, mut point) = (0_u64, 0, None);
    for &byte in digits {
        match byte {
            b'0'..=b'9' => {
                value = value.wrapping_mul(10).wrapping_add(u64::from(byte - b'0'));
                count += 1;
            }
            b'.' if point.is_none() => point = Some(count),
            _ => return None,
        }
    }
    if count == 0 || count > 18 || value > 1 << 53 {
        return None;
    }
    let magnitude = value as f64 / TENS[count - point.unwrap_or(count)];
    Some(if is_negative { -magnitude } else { magnitude })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn numbers_are_read_to_the_last_digit_and_what_is_not_finite_is_known() {
        assert_eq!(number(b"4200000.12345"), Some(4_200_000.123_45));
        assert_eq!(number(b"17"), Some(17.0));
        assert_eq!(number(b"+17."), Some(17.0));
        assert_eq!(number(b"-1e-3"), Some(-0.001));
        assert_eq!(number(b"999999999999999999999"), Some(1e21));
        assert_eq!(number(b"-0").map(f64::to_bits), Some((-0.0_f64).to_bits()));
        for word in ["nan", "-nan", "NaN", "-nan(ind)", "1.#QNAN", "-1.#IND"] {
            assert!(number(word.as_bytes()).unwrap().is_nan(), "{word}");
        }
        assert_eq!(number(b"inf"), Some(f64::INFINITY));
        for word in ["", "x", "1,5", "0x10", "1.0.0", ".", "-", "-.", "1 2", "--1"] {
            assert_eq!(number(word.as_bytes()), None, "{word}");
        }
    }

    proptest! {
        #[test]
        fn a_decimal_is_read_as_the_standard_library_reads_it(
            digits in "-?[0-9]{0,19}(\\.[0-9]{0,12})?",
        ) {
            let found = number(digits.as_bytes()).map(f64::to_bits);
            prop_assert_eq!(found, digits.parse::<f64>().ok().map(f64::to_bits));
        }
    }
}
