//! The circle through the corners of a triangle: whether a point forbids the triangle, and where such points may lie.

use std::cmp::Ordering;

use glam::DVec2;

use super::delaunay::{Corners, Site};
use super::leaves::{holds, meets};
use crate::geom::{Bounds2, incircle, orient2d};

/// Bound of the relative errors of the few products and sums here: far above 2⁻⁵³ times their number.
const SLACK: f64 = 1e-14;
/// A circle whose doubled area, relative to its terms, is below this has no box that is worth anything.
const FLAT: f64 = 1e-5;
/// By this part of its radius a circle's box is larger than computed.
const BOX_SLACK: f64 = 1e-6;

/// The circle through three points that turn from +u towards +v, the lowest number first.
///
/// The power of a point at e from the first corner is |e|² − 2 e·o, o the centre from that corner. Multiplied by the
/// doubled area D that is D |e|² − 2 e·N with polynomials D and N of the corners, which stay exact enough however flat the
/// triangle is.
#[derive(Debug)]
pub(super) struct Circle {
    corners: Corners,
    d: f64,
    n: DVec2,
    /// Bounds of the errors of `d` and `n`.
    d_error: f64,
    n_error: DVec2,
}

impl Circle {
    pub(super) fn new(corners: Corners) -> Self {
        let [a, b, c] = corners.map(|site| site.at);
        let (b, c) = (b - a, c - a);
        let (bb, cc) = (b.length_squared(), c.length_squared());
        let (left, right) = (2.0 * b.x * c.y, 2.0 * b.y * c.x);
        let n = DVec2::new(c.y * bb - b.y * cc, b.x * cc - c.x * bb);
        let terms = DVec2::new(c.y.abs() * bb + b.y.abs() * cc, b.x.abs() * cc + c.x.abs() * bb);
        let d_error = SLACK * (left.abs() + right.abs());
        Self { corners, d: left - right, n, d_error, n_error: terms * SLACK }
    }

    /// Whether a triangulation with `site` cannot have this triangle: it lies inside, or on the circle so that the fan
    /// from the lowest number there is another. Exact.
    pub(super) fn forbids(&self, site: Site) -> bool {
        let [a, b, c] = self.corners;
        if self.corners.iter().any(|corner| corner.number == site.number) {
            return false;
        }
        match incircle(a.at, b.at, c.at, site.at) {
            inside if inside > 0.0 => true,
            outside if outside < 0.0 => false,
            _ => site.number < a.number || orient2d(b.at, c.at, site.at) < 0.0,
        }
    }

    /// Whether every point of `data` within the circle surely lies within `known`.
    pub(super) fn lies_within(&self, known: &Bounds2, data: &Bounds2) -> bool {
        let terms = self.d_error / SLACK;
        if self.d <= FLAT * terms {
            return false;
        }
        let from_first = self.n / self.d;
        let radius = from_first.length();
        let centre = self.corners[0].at + from_first;
        let reach = DVec2::splat(radius * (1.0 + BOX_SLACK) + centre.abs().max_element() * SLACK);
        let (min, max) = ((centre - reach).max(data.min), (centre + reach).min(data.max));
        holds(known, &Bounds2 { min, max })
    }

    /// Whether the circle may meet `rect`: false only if it surely does not.
    pub(super) fn may_meet(&self, rect: &Bounds2) -> bool {
        let first = self.corners[0].at;
        let (low, high) = (rect.min - first, rect.max - first);
        let d = (self.d - self.d_error).max(0.0);
        // The least of d e² − 2 e n on each axis, and what the terms may be wrong by.
        let least = |low: f64, high: f64, n: f64, n_error: f64| {
            let e = if d > 0.0 {
                (n / d).max(low).min(high)
            } else if n > 0.0 {
                high
            } else {
                low
            };
            let far = low.abs().max(high.abs());
            let error = SLACK * (d * far * far + 2.0 * far * n.abs()) + 2.0 * far * n_error;
            d * e * e - 2.0 * e * n - error
        };
        let u = least(low.x, high.x, self.n.x, self.n_error.x);
        let v = least(low.y, high.y, self.n.y, self.n_error.y);
        // NaN may meet.
        (u + v).partial_cmp(&0.0) != Some(Ordering::Greater)
    }

    /// Whether a point of `rect` that is not within `known` may lie in the circle.
    pub(super) fn may_hold_unknown(&self, rect: &Bounds2, known: &Bounds2) -> bool {
        !(meets(rect, known) && holds(known, rect)) && self.may_meet(rect)
    }
}
