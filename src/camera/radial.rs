//! Radial distortion: COLMAP's `SIMPLE_RADIAL` and `RADIAL`, `q · (1 + k1 r² + k2 r⁴)`.

use glam::{DMat2, DVec2};

/// Coefficients of the radial polynomial; `SIMPLE_RADIAL` has `k2 = 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Radial {
    pub(super) k1: f64,
    pub(super) k2: f64,
}

impl Radial {
    /// The distorted position of ray `q`, normalised.
    #[inline]
    pub(super) fn distort(&self, q: DVec2) -> DVec2 {
        let s = q.length_squared();
        q * (1.0 + s * (self.k1 + s * self.k2))
    }

    /// The distorted position of ray `q`, and its derivative by the ray (column x, column y).
    #[inline]
    pub(super) fn distort_jacobian(&self, q: DVec2) -> (DVec2, DMat2) {
        let s = q.length_squared();
        let scale = 1.0 + s * (self.k1 + s * self.k2);
        let slope = self.k1 + 2.0 * self.k2 * s;
        (q * scale, scaled(q, scale, slope))
    }
}

/// The derivative of `q · g(|q|²)`: `g I + 2 g' q qᵀ`, with `g = scale` and `g' = slope` at `|q|²`.
#[inline]
pub(super) fn scaled(q: DVec2, scale: f64, slope: f64) -> DMat2 {
    let w = q * (2.0 * slope);
    DMat2::from_cols(
        DVec2::new(scale + w.x * q.x, w.x * q.y),
        DVec2::new(w.y * q.x, scale + w.y * q.y),
    )
}
