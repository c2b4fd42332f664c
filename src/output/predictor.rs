//! TIFF predictors on rows of little-endian samples: 2 for integers, 3 for floating point.
//!
//! Adobe (1992), TIFF 6.0, section 14 (predictor 2); Adobe (2005), TIFF Technical Note 3 (predictor 3). Both work
//! row by row and never look across rows, so a row is predicted alone.

use super::SampleType;

/// How samples are changed before compression.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Predictor {
    /// Not at all.
    None,
    /// Each integer minus the same channel of the pixel to its left.
    Horizontal,
    /// Bytes of a row sorted by significance, greatest first, then each minus the byte `channels` before it.
    FloatingPoint,
}

impl Predictor {
    /// Value of the TIFF tag 317.
    pub(super) fn tag(self) -> u16 {
        match self {
            Self::None => 1,
            Self::Horizontal => 2,
            Self::FloatingPoint => 3,
        }
    }

    /// Predicts one row in place; `spare` is working memory of any length.
    pub(super) fn apply(
        self,
        row: &mut [u8],
        sample: SampleType,
        channels: usize,
        spare: &mut Vec<u8>,
    ) {
        match self {
            Self::None => {}
            Self::Horizontal => match sample.bytes() {
                1 => difference(row, channels),
                2 => difference_wide(row, channels, |a, b| {
                    u16::from_le_bytes(a).wrapping_sub(u16::from_le_bytes(b)).to_le_bytes()
                }),
                _ => difference_wide(row, channels, |a, b| {
                    u32::from_le_bytes(a).wrapping_sub(u32::from_le_bytes(b)).to_le_bytes()
                }),
            },
            Self::FloatingPoint => {
                spare.clear();
                for byte in (0..4).rev() {
                    spare.extend(row.iter().skip(byte).step_by(4));
                }
                row.copy_from_slice(spare);
                difference(row, channels);
            }
        }
    }

    /// The inverse of [`Self::apply`].
    pub(super) fn undo(
        self,
        row: &mut [u8],
        sample: SampleType,
        channels: usize,
        spare: &mut Vec<u8>,
    ) {
        match self {
            Self::None => {}
            Self::Horizontal => match sample.bytes() {
                1 => sum(row, channels),
                2 => sum_wide(row, channels, |a, b| {
                    u16::from_le_bytes(a).wrapping_add(u16::from_le_bytes(b)).to_le_bytes()
                }),
                _ => sum_wide(row, channels, |a, b| {
                    u32::from_le_bytes(a).wrapping_add(u32::from_le_bytes(b)).to_le_bytes()
                }),
            },
            Self::FloatingPoint => {
                sum(row, channels);
                spare.clear();
                spare.extend_from_slice(row);
                let samples = row.len() / 4;
                for (i, value) in row.chunks_exact_mut(4).enumerate() {
                    for (byte, v) in value.iter_mut().enumerate() {
                        *v = spare[(3 - byte) * samples + i];
                    }
                }
            }
        }
    }
}

fn difference(row: &mut [u8], stride: usize) {
    for i in (stride..row.len()).rev() {
        row[i] = row[i].wrapping_sub(row[i - stride]);
    }
}

fn sum(row: &mut [u8], stride: usize) {
    for i in stride..row.len() {
        row[i] = row[i].wrapping_add(row[i - stride]);
    }
}

fn difference_wide<const N: usize>(
    row: &mut [u8],
    stride: usize,
    minus: impl Fn([u8; N], [u8; N]) -> [u8; N],
) {
    let samples = row.as_chunks_mut::<N>().0;
    for i in (stride..samples.len()).rev() {
        samples[i] = minus(samples[i], samples[i - stride]);
    }
}

fn sum_wide<const N: usize>(
    row: &mut [u8],
    stride: usize,
    plus: impl Fn([u8; N], [u8; N]) -> [u8; N],
) {
    let samples = row.as_chunks_mut::<N>().0;
    for i in stride..samples.len() {
        samples[i] = plus(samples[i], samples[i - stride]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_become_differences_to_the_pixel_on_the_left() {
        let mut row = [10, 200, 13, 190, 5, 0];
        Predictor::Horizontal.apply(&mut row, SampleType::U8, 2, &mut Vec::new());
        assert_eq!(row, [10, 200, 3, 246, 248, 66]);
        let mut row: Vec<u8> = [256_u16, 255, 65535].iter().flat_map(|v| v.to_le_bytes()).collect();
        Predictor::Horizontal.apply(&mut row, SampleType::U16, 1, &mut Vec::new());
        let want: Vec<u8> = [256_u16, 65535, 65280].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(row, want);
    }

    #[test]
    fn floats_become_differences_of_bytes_sorted_by_significance() {
        // 1.0 = 3f800000, 2.0 = 40000000: planes 3f 40 | 80 00 | 00 00 | 00 00.
        let mut row: Vec<u8> = [1.0_f32, 2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        Predictor::FloatingPoint.apply(&mut row, SampleType::F32, 1, &mut Vec::new());
        assert_eq!(row, [0x3f, 0x01, 0x40, 0x80, 0x00, 0x00, 0x00, 0x00]);
    }
}
