//! Rational radial and tangential distortion: COLMAP's `FULL_OPENCV`.
//!
//! As `OPENCV`, but with `g = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)`.

use glam::{DMat2, DVec2};

use super::opencv::Tangential;
use super::radial::scaled;

/// A rational radial function and a tangential part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rational {
    /// `k1, k2, k3`.
    pub(super) numerator: [f64; 3],
    /// `k4, k5, k6`.
    pub(super) denominator: [f64; 3],
    pub(super) tangential: Tangential,
}

/// `1 + k[0] s + k[1] s² + k[2] s³` and its derivative by `s`.
#[inline]
fn cubic(k: [f64; 3], s: f64) -> (f64, f64) {
    (1.0 + s * (k[0] + s * (k[1] + s * k[2])), k[0] + s * (2.0 * k[1] + s * (3.0 * k[2])))
}

impl Rational {
    /// The distorted position of ray `q`, normalised.
    #[inline]
    pub(super) fn distort(&self, q: DVec2) -> DVec2 {
        let s = q.length_squared();
        let scale = cubic(self.numerator, s).0 / cubic(self.denominator, s).0;
        q * scale + self.tangential.shift(q)
    }

    /// The distorted radius of radius `r`, by the radial part alone.
    pub(super) fn radial_distort(&self, r: f64) -> f64 {
        r * cubic(self.numerator, r * r).0 / cubic(self.denominator, r * r).0
    }

    /// The distorted position of ray `q`, and its derivative by the ray.
    #[inline]
    pub(super) fn distort_jacobian(&self, q: DVec2) -> (DVec2, DMat2) {
        let s = q.length_squared();
        let (n, dn) = cubic(self.numerator, s);
        let (d, dd) = cubic(self.denominator, s);
        let scale = n / d;
        let slope = (dn - scale * dd) / d;
        (
            q * scale + self.tangential.shift(q),
            scaled(q, scale, slope) + self.tangential.jacobian(q),
        )
    }
}
