//! Radial, decentering and thin-prism distortion with a shear of the axes: [`Brown`].
//!
//! D. C. Brown (1971), "Close-range camera calibration", Photogrammetric Engineering 37 (8), 855–866; the prism terms after
//! J. Weng, P. Cohen and M. Herniou (1992), "Camera calibration with distortion models and accuracy evaluation", IEEE
//! PAMI 14 (10), 965–980, doi:10.1109/34.159901, as in COLMAP's `THIN_PRISM_FISHEYE`:
//! `x' = x g + 2 p1 x y + p2 (r² + 2 x²) + sx r²`, `y' = y g + 2 p2 x y + p1 (r² + 2 y²) + sy r²`,
//! `g = 1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸`; then `x'' = x' + shear · y'`, `y'' = y'`. All may be taken about a centre
//! other than the principal point: of positions less that centre, which is added again before the shear.

use glam::{DMat2, DVec2};

use super::radial::scaled;
use super::radius::RadialFunction;
use crate::geom::Bounds2;

/// A polynomial in the plane of rays, or in that of angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Brown {
    /// `k1 … k4`.
    pub(super) radial: [f64; 4],
    /// `(p2, p1)`.
    decentering: DVec2,
    /// `(p2 + sx, p1 + sy)`: all that is multiplied by r² alone.
    square: DVec2,
    /// What a unit of y adds to x.
    shear: f64,
    /// Where r is 0.
    centre: DVec2,
}

impl Brown {
    /// No distortion at all.
    pub(super) const NONE: Self = Self::radial([0.0; 4]);

    /// From the radial coefficients alone.
    pub(super) const fn radial(radial: [f64; 4]) -> Self {
        Self {
            radial,
            decentering: DVec2::ZERO,
            square: DVec2::ZERO,
            shear: 0.0,
            centre: DVec2::ZERO,
        }
    }

    /// The same with decentering terms `p1`, `p2`.
    pub(super) fn decentered(self, p1: f64, p2: f64) -> Self {
        let p = DVec2::new(p2, p1);
        Self { decentering: self.decentering + p, square: self.square + p, ..self }
    }

    /// The same with thin-prism terms `sx`, `sy`.
    pub(super) fn with_prism(self, sx: f64, sy: f64) -> Self {
        Self { square: self.square + DVec2::new(sx, sy), ..self }
    }

    /// The same with sheared axes.
    pub(super) fn sheared(self, shear: f64) -> Self {
        Self { shear, ..self }
    }

    /// The same about another centre.
    pub(super) fn about(self, centre: DVec2) -> Self {
        Self { centre, ..self }
    }

    /// Where the radius is 0.
    pub(super) fn centre(&self) -> DVec2 {
        self.centre
    }

    /// The distorted position of `q`.
    #[inline]
    pub(super) fn distort(&self, q: DVec2) -> DVec2 {
        let q = q - self.centre;
        self.at(q, q.length_squared())
    }

    /// The distorted position of `q` from the centre, `s` its squared length.
    #[inline]
    fn at(&self, q: DVec2, s: f64) -> DVec2 {
        let [k1, k2, k3, k4] = self.radial;
        let scale = 1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)));
        let at = q * (scale + 2.0 * self.decentering.dot(q)) + self.square * s + self.centre;
        DVec2::new(at.x + self.shear * at.y, at.y)
    }

    /// The distorted position of `q`, and its derivative by `q` (column x, column y).
    #[inline]
    pub(super) fn distort_jacobian(&self, q: DVec2) -> (DVec2, DMat2) {
        let q = q - self.centre;
        let s = q.length_squared();
        let [k1, k2, k3, k4] = self.radial;
        let (p, w) = (self.decentering, self.square);
        // 1. The radial part, as if it also held the part of the decentering that is along q.
        let scale = 1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4))) + 2.0 * p.dot(q);
        let slope = k1 + s * (2.0 * k2 + s * (3.0 * k3 + s * (4.0 * k4)));
        // 2. The rest: 2 q pᵀ + 2 w qᵀ.
        let (q2, w2) = (2.0 * q, 2.0 * w);
        let m =
            scaled(q, scale, slope) + DMat2::from_cols(q2 * p.x + w2 * q.x, q2 * p.y + w2 * q.y);
        // 3. The shear, a multiple of the second row added to the first.
        let sheared = |c: DVec2| DVec2::new(c.x + self.shear * c.y, c.y);
        (self.at(q, s), DMat2::from_cols(sheared(m.x_axis), sheared(m.y_axis)))
    }

    /// The distorted radius of radius `r`, by the radial part alone.
    pub(super) fn radial_distort(&self, r: f64) -> f64 {
        let (s, [k1, k2, k3, k4]) = (r * r, self.radial);
        r * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4))))
    }

    /// The radial part as a function.
    pub(super) fn radial_function(&self) -> RadialFunction {
        RadialFunction::new(&self.radial, &[])
    }

    /// A `c` for which all but radial part and shear is known to move no `q` by more than `c |q|²`.
    pub(super) fn tangential_bound(&self) -> f64 {
        2.0 * self.decentering.length() + self.square.length()
    }

    /// The position before the shear, from the centre.
    pub(super) fn unsheared(&self, position: DVec2) -> DVec2 {
        DVec2::new(position.x - self.shear * position.y, position.y) - self.centre
    }

    /// `bounds` of positions from the centre as bounds of positions from the principal point.
    pub(super) fn uncentred_bounds(&self, bounds: Bounds2) -> Bounds2 {
        Bounds2 { min: bounds.min + self.centre, max: bounds.max + self.centre }
    }

    /// A rectangle that holds all positions of `bounds` before the shear, from the centre.
    pub(super) fn unsheared_bounds(&self, bounds: Bounds2) -> Bounds2 {
        let (a, b) = (self.shear * bounds.min.y, self.shear * bounds.max.y);
        Bounds2 {
            min: DVec2::new(bounds.min.x - a.max(b), bounds.min.y) - self.centre,
            max: DVec2::new(bounds.max.x - a.min(b), bounds.max.y) - self.centre,
        }
    }
}
