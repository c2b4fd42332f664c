//! What a block's samples come to in numbers, for the report: whole numbers, so that sums do not depend on their order.

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "loops over strips, compiled for the widest vectors where they are inlined into the kernel"
)]

use std::ops::Range;

use super::stack::{Plane, STRIP};
use super::strip::{Strip, distance_squared, select, whole};
use super::{Parts, PhotoStats, Statistics};

/// What is known of one photo's samples of the pixels at hand, and counted of all of the block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scratch {
    /// Square of the distance to the mean of all.
    pub(super) distance_squared: Strip,
    /// 1 for a pixel that the photo sees, else 0; 1 for one whose sample is kept, else 0.
    pub(super) is_seen: Strip,
    pub(super) is_kept: Strip,
    /// The sample's weight; what it is where there is no sample means nothing.
    pub(super) weight: Strip,
    /// Of soft weights: the quality as a part of the pixel's best, what the sample's vote counts, and how far it is
    /// from the centre.
    pub(super) ratio: [f32; STRIP],
    pub(super) vote: [f32; STRIP],
    pub(super) far: [f32; STRIP],
    /// Counts, whole numbers: of samples, of those kept, of those compared, of their distances in 1/256.
    pub(super) seen: Strip,
    pub(super) used: Strip,
    pub(super) compared: Strip,
    pub(super) residual_256: Strip,
}

impl Scratch {
    pub(super) const NONE: Self = Self {
        distance_squared: [0.0; STRIP],
        is_seen: [0.0; STRIP],
        is_kept: [0.0; STRIP],
        weight: [0.0; STRIP],
        ratio: [0.0; STRIP],
        vote: [0.0; STRIP],
        far: [0.0; STRIP],
        seen: [0.0; STRIP],
        used: [0.0; STRIP],
        compared: [0.0; STRIP],
        residual_256: [0.0; STRIP],
    };

    pub(super) fn counts(&self) -> PhotoStats {
        self.counted(|strip| strip.iter().sum())
    }

    /// The counts of one pixel of the strip.
    fn counts_at(&self, k: usize) -> PhotoStats {
        self.counted(|strip| strip[k])
    }

    fn counted(&self, of: impl Fn(&Strip) -> f64) -> PhotoStats {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "whole numbers below 2^53"
        )]
        let whole = |strip: &Strip| of(strip) as u64;
        let (seen, used) = (whole(&self.seen), whole(&self.used));
        PhotoStats {
            seen,
            used,
            rejected: seen - used,
            compared: whole(&self.compared),
            residual_256: whole(&self.residual_256),
        }
    }
}

/// Moves what was counted of a strip, the pixels `of` of the block, to the statistics of each pixel's part, and of all.
pub(super) fn count_parts(
    planes: &[Plane],
    scratch: &mut [Scratch],
    of: Range<usize>,
    all: &mut Statistics,
    parts: &mut Parts<'_>,
) {
    for (plane, s) in planes.iter().zip(scratch) {
        let photo = usize::from(plane.photo);
        for (k, pixel) in of.clone().enumerate() {
            if s.seen[k] > 0.0 {
                let counts = s.counts_at(k);
                all.photos[photo].merge(&counts);
                let part = usize::from(parts.part_of[pixel]);
                parts.statistics[part].photos[photo].merge(&counts);
            }
        }
        let zero = [0.0; STRIP];
        (s.seen, s.used, s.compared, s.residual_256) = (zero, zero, zero, zero);
    }
}

/// Counts the samples, and how far they are from the mean of those kept.
#[inline(always)]
pub(super) fn compare<const C: usize>(
    planes: &[Plane],
    scratch: &mut [Scratch],
    first: usize,
    (seen, mean): (&Strip, &[Strip; C]),
) {
    let mut is_compared = [0.0; STRIP];
    for k in 0..STRIP {
        is_compared[k] = select(seen[k] > 1.0, 1.0, 0.0);
    }
    let mut d = [0.0; STRIP];
    for (plane, s) in planes.iter().zip(scratch) {
        distance_squared(plane, first, mean, &mut d);
        for k in 0..STRIP {
            s.seen[k] += s.is_seen[k];
            s.used[k] += s.is_kept[k];
            s.compared[k] += s.is_seen[k] * is_compared[k];
        }
        for k in 0..STRIP {
            // In 1/256, rounded half up; not a number where nobody sees anything.
            let distance = whole(d[k].sqrt() * 256.0 + 0.5);
            let is_counted = s.is_seen[k] * is_compared[k] > 0.0;
            s.residual_256[k] += select(is_counted, distance, 0.0);
        }
    }
}
