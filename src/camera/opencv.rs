//! Radial and tangential distortion: COLMAP's `OPENCV`.
//!
//! D. C. Brown (1966), "Decentering distortion of lenses", Photogrammetric Engineering 32 (3), 444–462. In the field's
//! usual order of the tangential coefficients: `x' = x g + 2 p1 x y + p2 (r² + 2 x²)`,
//! `y' = y g + 2 p2 x y + p1 (r² + 2 y²)`, `g = 1 + k1 r² + k2 r⁴`.

use glam::{DMat2, DVec2};

use super::radial::Radial;

/// A radial polynomial and a tangential part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OpenCv {
    pub(super) radial: Radial,
    pub(super) tangential: Tangential,
}

impl OpenCv {
    /// The distorted position of ray `q`, normalised.
    #[inline]
    pub(super) fn distort(&self, q: DVec2) -> DVec2 {
        self.radial.distort(q) + self.tangential.shift(q)
    }

    /// The distorted position of ray `q`, and its derivative by the ray.
    #[inline]
    pub(super) fn distort_jacobian(&self, q: DVec2) -> (DVec2, DMat2) {
        let (at, slope) = self.radial.distort_jacobian(q);
        (at + self.tangential.shift(q), slope + self.tangential.jacobian(q))
    }
}

/// The tangential part, with `p = (p2, p1)`: then the shift is `2 (p · q) q + |q|² p`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tangential {
    p: DVec2,
}

impl Tangential {
    /// From COLMAP's `p1`, `p2`.
    pub(super) fn new(p1: f64, p2: f64) -> Self {
        Self { p: DVec2::new(p2, p1) }
    }

    /// The greatest `c` with `|shift(q)| = c |q|²`: the shift's length lies between `|p| |q|²` and `3 |p| |q|²`.
    pub(super) fn greatest(&self) -> f64 {
        3.0 * self.p.length()
    }

    #[inline]
    pub(super) fn shift(&self, q: DVec2) -> DVec2 {
        q * (2.0 * self.p.dot(q)) + self.p * q.length_squared()
    }

    /// The derivative of [`Self::shift`]: `2 (p · q) I + 2 q pᵀ + 2 p qᵀ`, symmetric.
    #[inline]
    pub(super) fn jacobian(&self, q: DVec2) -> DMat2 {
        let (p, dot) = (self.p, self.p.dot(q));
        let cross = 2.0 * (p.x * q.y + p.y * q.x);
        DMat2::from_cols(
            DVec2::new(2.0 * dot + 4.0 * p.x * q.x, cross),
            DVec2::new(cross, 2.0 * dot + 4.0 * p.y * q.y),
        )
    }
}
