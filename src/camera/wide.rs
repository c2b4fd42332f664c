//! Lenses whose image shows angles rather than rays: COLMAP's fisheyes and its `FOV` model, [`Wide`].
//!
//! A ray of radius r is first drawn at radius `atan(c r) / omega`:
//! - `c = omega = 1` for fisheyes: the radius is the angle θ from the optical axis; then a [`Brown`] polynomial distorts
//!   the plane of angles (J. Kannala and S. S. Brandt, 2006, "A generic camera model and calibration method for
//!   conventional, wide-angle, and fish-eye lenses", IEEE PAMI 28 (8), 1335–1340, doi:10.1109/TPAMI.2006.153);
//! - `c = 2 tan(omega / 2)` for `FOV` (F. Devernay and O. Faugeras, 2001, "Straight lines have to be straight", Machine
//!   Vision and Applications 13, 14–24, doi:10.1007/PL00013269), with no polynomial.
//!
//! Nothing is approximated by a pinhole. Departure: rays of [`MAX_TANGENT`] and beyond are outside the valid radius,
//! because rays are (x/z, y/z) everywhere and have no value at 90°.

use glam::{DMat2, DVec2};

use super::brown::Brown;
use super::radial::scaled;

/// The radius of the rays at 85° from the optical axis, tan 85°: where such a lens ends.
pub(super) const MAX_TANGENT: f64 = 11.430_052_302_761_343;

/// Below this squared radius the scale's slope is taken for its limit: it moves a derivative by less than rounding.
const SMALL: f64 = 1e-20;

/// A ray drawn by its angle, then distorted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wide {
    c: f64,
    omega: f64,
    pub(super) brown: Brown,
}

impl Wide {
    /// A fisheye with that distortion of the plane of angles.
    pub(super) fn fisheye(brown: Brown) -> Self {
        Self { c: 1.0, omega: 1.0, brown }
    }

    /// The `FOV` model, `0 < omega < π`.
    pub(super) fn fov(omega: f64) -> Self {
        Self { c: 2.0 * libm::tan(0.5 * omega), omega, brown: Brown::NONE }
    }

    /// Drawn radius divided by ray radius, at squared ray radius `s`.
    #[inline]
    fn scale(&self, s: f64) -> f64 {
        let r = s.sqrt();
        let scale = libm::atan(self.c * r) / (self.omega * r);
        if r > 0.0 { scale } else { self.c / self.omega }
    }

    /// The distorted position of ray `q`, normalised.
    #[inline]
    pub(super) fn distort(&self, q: DVec2) -> DVec2 {
        self.brown.distort(q * self.scale(q.length_squared()))
    }

    /// The distorted position of ray `q`, and its derivative by the ray (column x, column y).
    #[inline]
    pub(super) fn distort_jacobian(&self, q: DVec2) -> (DVec2, DMat2) {
        let (s, c2) = (q.length_squared(), self.c * self.c);
        let scale = self.scale(s);
        // d/ds of atan(c √s) / (ω √s); the limit at 0 from its series.
        let slope = if s > SMALL {
            (self.c / (self.omega * (1.0 + c2 * s)) - scale) / (2.0 * s)
        } else {
            -self.c * c2 / (3.0 * self.omega)
        };
        let (at, outer) = self.brown.distort_jacobian(q * scale);
        (at, outer * scaled(q, scale, slope))
    }

    /// The distorted radius of ray radius `r`, by the radial part alone.
    pub(super) fn radial_distort(&self, r: f64) -> f64 {
        self.brown.radial_distort(self.drawn_radius(r))
    }

    /// The square of the ray radius up to which the model holds: the first fold of the polynomial, but
    /// [`MAX_TANGENT`] at most.
    pub(super) fn valid_square(&self) -> f64 {
        let fold = self.brown.radial_function().valid_square().sqrt();
        let radius = if fold < self.drawn_radius(MAX_TANGENT) {
            self.ray_radius(fold).map_or(MAX_TANGENT, |r| r.min(MAX_TANGENT))
        } else {
            MAX_TANGENT
        };
        radius * radius
    }

    /// The radius, before the polynomial, at which rays of radius `r` are drawn.
    pub(super) fn drawn_radius(&self, r: f64) -> f64 {
        r * self.scale(r * r)
    }

    /// The radius of the rays that are drawn at radius `drawn` before the polynomial; `None` from 90° on.
    pub(super) fn ray_radius(&self, drawn: f64) -> Option<f64> {
        let angle = self.omega * drawn;
        (angle < std::f64::consts::FRAC_PI_2).then(|| libm::tan(angle) / self.c)
    }

    /// The ray that would be drawn at `position` without radial and decentering terms; NaN if there is none.
    pub(super) fn ray_without_polynomial(&self, position: DVec2) -> DVec2 {
        let at = self.brown.unsheared(position);
        let drawn = at.length();
        match self.ray_radius(drawn) {
            Some(r) if drawn > 0.0 => at * (r / drawn),
            Some(_) => at,
            None => DVec2::NAN,
        }
    }

    /// The least and the greatest drawn radius divided by ray radius, over ray radii up to `reach`: it only falls.
    pub(super) fn scale_range(&self, reach: f64) -> (f64, f64) {
        (self.scale(reach * reach), self.c / self.omega)
    }
}
