//! How fast this machine is beside the one on which the forecast's costs were measured.
//!
//! One number cannot say it all: processor, memory and disk differ one by one, and what else runs changes by the minute.
//! What is measured is what the tiles spend most time on, double-precision arithmetic in one thread; the disk is taken
//! to be as fast as the reference machine's.

use std::hint::black_box;
use std::time::Instant;

use glam::DVec2;

use crate::camera::{Lens, LensModel};
use crate::geom::Size;

/// Projections of a round, and rounds; the fastest counts, because others can only disturb.
const PROJECTIONS: u32 = 40_000;
const ROUNDS: u32 = 8;
/// Seconds of a round on the reference machine; `scripts/fit_forecast.py` says how it is measured.
const REFERENCE_SECONDS: f64 = 1.11e-3;
/// What one measurement can be wrong by at most, so that a forecast stays one.
const RANGE: [f64; 2] = [0.05, 20.0];

/// Speed of this machine beside the reference machine's, 1 for equal. Takes some 10 ms.
pub(super) fn speed() -> f64 {
    let params = [0.83, 0.83, 0.5, 0.5, -0.118, 0.062, 0.0009, -0.0007];
    let Ok(lens) = Lens::new(LensModel::OpenCv, Size::new(1, 1), &params) else { return 1.0 };
    let seconds = (0..ROUNDS).map(|_| round(&lens)).fold(f64::INFINITY, f64::min);
    (REFERENCE_SECONDS / seconds).clamp(RANGE[0], RANGE[1])
}

fn round(lens: &Lens) -> f64 {
    let begun = Instant::now();
    let mut sum = 0.0;
    for k in 0..PROJECTIONS {
        let k = f64::from(k) / f64::from(PROJECTIONS);
        let ray = DVec2::new(k - 0.5, 0.4 * k);
        if let Some((at, by)) = lens.photo_from_ray_jacobian(black_box(ray)) {
            sum += at.x + by.determinant();
        }
    }
    black_box(sum);
    begun.elapsed().as_secs_f64()
}
