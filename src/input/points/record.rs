//! A point record of LAS: its place, and whether it is to be used. ASPRS (2019), "LAS Specification 1.4 - R15".

use glam::DVec3;

/// Bytes of a record of the formats 0 to 10, without extra bytes.
pub(super) const FORMAT_BYTES: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];
/// Formats from this one on have flags and class in bytes of their own.
const FIRST_NEW_FORMAT: u8 = 6;
/// Low point (noise), high noise.
const NOISE: [u8; 2] = [7, 18];

/// How a record becomes a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Decoding {
    /// Number of the point format, 0 to 10.
    pub(super) format: u8,
    /// Metres a step.
    pub(super) scale: DVec3,
    /// Metres.
    pub(super) offset: DVec3,
}

impl Decoding {
    /// The point of `record`, which has at least the bytes of its format; `None` if it is withheld or noise.
    #[inline]
    pub(super) fn point(&self, record: &[u8]) -> Option<DVec3> {
        let (withheld, class) = if self.format < FIRST_NEW_FORMAT {
            (record[15] & 0x80, record[15] & 0x1f)
        } else {
            (record[15] & 0x04, record[16])
        };
        if withheld != 0 || NOISE.contains(&class) {
            return None;
        }
        let step = |at: usize| {
            let bytes = [record[at], record[at + 1], record[at + 2], record[at + 3]];
            f64::from(i32::from_le_bytes(bytes))
        };
        Some(DVec3::new(step(0), step(4), step(8)) * self.scale + self.offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn withheld_points_and_noise_are_passed_over_in_old_and_new_formats() {
        let point = |format, flags: u8, class: u8| {
            let mut record = vec![0; FORMAT_BYTES[usize::from(format)]];
            record[..4].copy_from_slice(&(-5_i32).to_le_bytes());
            if format < FIRST_NEW_FORMAT {
                record[15] = flags << 7 | class;
            } else {
                (record[15], record[16]) = (flags << 2, class);
            }
            let (scale, offset) = (DVec3::splat(0.5), DVec3::new(10.0, 20.0, 30.0));
            Decoding { format, scale, offset }.point(&record)
        };
        let at = Some(DVec3::new(7.5, 20.0, 30.0));
        for format in 0..=10 {
            assert_eq!([point(format, 0, 2), point(format, 0, 0)], [at, at]);
            assert_eq!([point(format, 1, 2), point(format, 0, 7), point(format, 0, 18)], [None; 3]);
        }
        assert_eq!(point(6, 0, 130), at);
    }
}
