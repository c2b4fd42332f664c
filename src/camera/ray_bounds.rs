//! A rectangle of rays that holds every ray a lens shows within its frame.

use glam::DVec2;

use super::distortion::Distortion;
use crate::geom::Bounds2;

/// Relative room for the rounding of this computation and of the projection itself.
const MARGIN: f64 = 1e-9;

/// Bounds of the rays (x/z, y/z) whose distorted position may lie in `frame` (normalised), or `None` if the model
/// maps rays of any radius into it.
///
/// 1. A ray of radius `r` is distorted to a radius of at least `m(r) = r g(r²) − c r²`, where `c r²` bounds the tangential
///    part; beyond the last `r` with `m(r) ≤` the frame's farthest corner no ray falls in: the *reach*.
/// 2. Up to the reach the tangential part moves a ray by at most `c · reach²`: the radial part of the distortion lies in
///    the frame grown by that.
/// 3. A ray is its radial position divided by `g`; the extremes of `g` up to the reach bound the quotient.
pub(super) fn ray_bounds(
    distortion: &Distortion,
    frame: Bounds2,
    valid_square: f64,
) -> Option<Bounds2> {
    let far = frame.min.abs().max(frame.max.abs());
    let corner = far.length() * (1.0 + MARGIN);
    let room = DVec2::splat(MARGIN * (1.0 + corner));
    if matches!(distortion, Distortion::None) {
        return Some(Bounds2 { min: frame.min - room, max: frame.max + room });
    }
    let (radial, c) = (distortion.radial_function(), distortion.tangential_bound());
    let reach = radial.reach(corner, c, valid_square.sqrt());
    if !reach.is_finite() {
        return None;
    }
    let grown = room + c * reach * reach;
    let (min, max) = (frame.min - grown, frame.max + grown);
    let (least, greatest) = radial.scale_range(reach);
    // A bound away from the axis is farthest out where g is least, one beyond the axis where g is greatest.
    let outward = |bound: f64, sign: f64| {
        let g = if bound * sign > 0.0 { least } else { greatest };
        let limit = reach * sign;
        let ray = if bound * sign > 0.0 { (bound / g).abs().min(reach) * sign } else { bound / g };
        // Division by an infinite g gives 0, by none below the limit NaN: then the circle alone bounds.
        if ray.is_nan() { limit } else { ray }
    };
    let min = DVec2::new(outward(min.x, -1.0), outward(min.y, -1.0));
    let max = DVec2::new(outward(max.x, 1.0), outward(max.y, 1.0));
    let room = DVec2::splat(MARGIN * (1.0 + reach));
    Some(Bounds2 { min: min - room, max: max + room })
}
