//! A rectangle of rays that holds every ray a lens shows within its frame.

use glam::DVec2;

use super::distortion::Distortion;
use super::radius::RadialFunction;
use super::wide::Wide;
use crate::geom::Bounds2;

/// Relative room for the rounding of this computation and of the projection itself.
const MARGIN: f64 = 1e-9;

/// Bounds of the rays (x/z, y/z) whose distorted position may lie in `frame` (normalised), or `None` if the model
/// maps rays of any radius into it.
///
/// 1. A shear of the axes is taken back: the frame becomes a parallelogram, and its bounds the frame. What follows is
///    counted from the centre of the distortion, where that is not the principal point.
/// 2. A ray of radius `r` is distorted to a radius of at least `m(r) = r g(r²) − c r²`, where `c r²` bounds the tangential
///    part; beyond the last `r` with `m(r) ≤` the frame's farthest corner no ray falls in: the *reach*.
/// 3. Up to the reach the tangential part moves a ray by at most `c · reach²`: the radial part of the distortion lies in
///    the frame grown by that.
/// 4. A ray is its radial position divided by `g`; the extremes of `g` up to the reach bound the quotient.
/// 5. Where a lens draws angles, all this holds in the plane of angles, and the way from there to rays is one more
///    radial function, with its own extremes up to the reach.
pub(super) fn ray_bounds(
    distortion: &Distortion,
    frame: Bounds2,
    valid_square: f64,
) -> Option<Bounds2> {
    let valid_radius = valid_square.sqrt();
    let (function, c) = (distortion.radial_function(), distortion.tangential_bound());
    match distortion {
        Distortion::None => {
            let room = DVec2::splat(MARGIN * (1.0 + farthest(frame)));
            Some(Bounds2 { min: frame.min - room, max: frame.max + room })
        }
        Distortion::Wide(d) => {
            let frame = d.brown.unsheared_bounds(frame);
            let end = d.drawn_radius(valid_radius) * (1.0 + MARGIN);
            let (drawn, reach) = polynomial_bounds(&function, c, frame, end)?;
            Some(rays_of_drawn(d, drawn, reach, valid_radius))
        }
        Distortion::Brown(d) => {
            let frame = d.unsheared_bounds(frame);
            let bounds =
                polynomial_bounds(&function, c, frame, valid_radius + d.centre().length())?.0;
            Some(d.uncentred_bounds(bounds))
        }
        Distortion::Radial(_) | Distortion::OpenCv(_) | Distortion::Rational(_) => {
            polynomial_bounds(&function, c, frame, valid_radius).map(|(bounds, _)| bounds)
        }
    }
}

/// The greatest distance of a point of the frame from the principal point.
fn farthest(frame: Bounds2) -> f64 {
    frame.min.abs().max(frame.max.abs()).length() * (1.0 + MARGIN)
}

/// Steps 2 to 4: the bounds, and the reach.
fn polynomial_bounds(
    function: &RadialFunction,
    c: f64,
    frame: Bounds2,
    valid_radius: f64,
) -> Option<(Bounds2, f64)> {
    let corner = farthest(frame);
    let reach = function.reach(corner, c, valid_radius);
    if !reach.is_finite() {
        return None;
    }
    let grown = DVec2::splat(MARGIN * (1.0 + corner)) + c * reach * reach;
    let frame = Bounds2 { min: frame.min - grown, max: frame.max + grown };
    Some((divided(frame, function.scale_range(reach), reach), reach))
}

/// Step 5: bounds of the rays that are drawn in `drawn`, no farther out than `reach`.
fn rays_of_drawn(lens: &Wide, drawn: Bounds2, reach: f64, valid_radius: f64) -> Bounds2 {
    let ray_reach = lens.ray_radius(reach).map_or(valid_radius, |r| r * (1.0 + MARGIN));
    let ray_reach = ray_reach.min(valid_radius);
    divided(drawn, lens.scale_range(ray_reach), ray_reach)
}

/// Bounds of what lies in `bounds` once multiplied by a factor of `least` to `greatest`, and within `reach` of 0.
fn divided(bounds: Bounds2, (least, greatest): (f64, f64), reach: f64) -> Bounds2 {
    // A bound away from the axis is farthest out where g is least, one beyond the axis where g is greatest.
    let outward = |bound: f64, sign: f64| {
        let g = if bound * sign > 0.0 { least } else { greatest };
        let limit = reach * sign;
        let ray = if bound * sign > 0.0 { (bound / g).abs().min(reach) * sign } else { bound / g };
        // Division by an infinite g gives 0, by none below the limit NaN: then the circle alone bounds.
        if ray.is_nan() { limit } else { ray }
    };
    let min = DVec2::new(outward(bounds.min.x, -1.0), outward(bounds.min.y, -1.0));
    let max = DVec2::new(outward(bounds.max.x, 1.0), outward(bounds.max.y, 1.0));
    let room = DVec2::splat(MARGIN * (1.0 + reach));
    Bounds2 { min: min - room, max: max + room }
}
