//! The radial part of a lens model as a function of the radius: how far out it holds, and how far its frame reaches.

use super::polynomial::Polynomial;

/// The radial part `g(s) = numerator(s) / denominator(s)` of a distortion, `s = r²`: the distorted radius is `r g(r²)`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RadialFunction {
    numerator: Polynomial,
    denominator: Polynomial,
}

impl RadialFunction {
    /// From the coefficients of `s`, `s²`, … of numerator and denominator, whose constants are 1.
    pub(super) fn new(numerator: &[f64], denominator: &[f64]) -> Self {
        let with_one = |k: &[f64]| Polynomial::new([&[1.0], k].concat());
        Self { numerator: with_one(numerator), denominator: with_one(denominator) }
    }

    /// The square of the radius up to which the model holds: the first positive root of the derivative of the
    /// distorted radius or of the denominator, whichever comes first; infinity if there is neither.
    ///
    /// The derivative of `r N(r²) / D(r²)` has the sign of `N D + 2 s (N' D − N D')`.
    pub(super) fn valid_square(&self) -> f64 {
        let (n, d) = (&self.numerator, &self.denominator);
        let slope = n.times(d).plus(2.0, &self.scale_slope().shifted(1));
        slope.first_positive_root().min(d.first_positive_root())
    }

    /// `N' D − N D'`, which has the sign of the derivative of `g`.
    fn scale_slope(&self) -> Polynomial {
        let (n, d) = (&self.numerator, &self.denominator);
        n.derivative().times(d).plus(-1.0, &n.times(&d.derivative()))
    }

    /// `g` at `s = r²`.
    pub(super) fn scale(&self, s: f64) -> f64 {
        self.numerator.at(s) / self.denominator.at(s)
    }

    /// The least and the greatest `g` over radii up to `radius`, finite and within the valid radius.
    pub(super) fn scale_range(&self, radius: f64) -> (f64, f64) {
        let end = radius * radius;
        let inner = self.scale_slope().sign_changes().into_iter().filter(|&s| s < end);
        inner.chain([end]).map(|s| self.scale(s)).fold((1.0, 1.0), |(lo, hi), g| {
            // At a root of the denominator, the end of the valid radius, g has no bound.
            if g.is_finite() && g > 0.0 { (lo.min(g), hi.max(g)) } else { (lo, f64::INFINITY) }
        })
    }

    /// The least radius beyond which, up to the valid radius, `r g(r²) − c r² > limit`; the valid radius
    /// itself (perhaps infinite) if there is none.
    pub(super) fn reach(&self, limit: f64, c: f64, valid_radius: f64) -> f64 {
        let (n, d) = (self.numerator.of_square(), self.denominator.of_square());
        let over = n.shifted(1).plus(-c, &d.shifted(2)).plus(-limit, &d);
        let roots: Vec<f64> =
            over.sign_changes().into_iter().filter(|&r| r < valid_radius).collect();
        let last = roots.last().copied().unwrap_or(0.0);
        // A probe between the last root and the end tells the sign that holds there.
        let probe = if valid_radius.is_finite() {
            0.5 * (last + valid_radius)
        } else {
            (2.0 * last).max(1.0)
        };
        if over.sign(probe) > 0 { last } else { valid_radius }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn barrel_distortion_alone_holds_up_to_where_it_folds() {
        for k1 in [-0.01, -0.25, -3.0] {
            let s = RadialFunction::new(&[k1], &[]).valid_square();
            assert!((s * -3.0 * k1 - 1.0).abs() < 1e-12, "{s}");
        }
    }

    #[test]
    fn growing_radii_hold_everywhere() {
        assert!(RadialFunction::new(&[0.2, 0.1], &[]).valid_square().is_infinite());
        // 1 + 3 k1 s + 5 k2 s² without a real root
        assert!(RadialFunction::new(&[-0.25, 0.32], &[]).valid_square().is_infinite());
    }

    #[test]
    fn the_first_of_several_folds_counts() {
        // 1 + 3 k1 s + 5 k2 s² + 7 k3 s³ = (1 − s)(1 − s/4)(1 − s/9)
        let (e1, e2, e3) = (1.0 + 0.25 + 1.0 / 9.0, 0.25 + 1.0 / 9.0 + 1.0 / 36.0, 1.0 / 36.0);
        let s = RadialFunction::new(&[-e1 / 3.0, e2 / 5.0, -e3 / 7.0], &[]).valid_square();
        assert!((s - 1.0).abs() < 1e-12, "{s}");
    }

    #[test]
    fn a_zero_of_the_denominator_before_any_fold_ends_the_model() {
        // g = 1 / (1 − s / 4): the distorted radius grows up to s = 4, and without bound
        let s = RadialFunction::new(&[], &[-0.25]).valid_square();
        assert!((s - 4.0).abs() < 1e-12, "{s}");
        // g = 1 / (1 + s): r / (1 + r²) turns back at r = 1
        let s = RadialFunction::new(&[], &[1.0]).valid_square();
        assert!((s - 1.0).abs() < 1e-12, "{s}");
    }

    #[test]
    fn the_reach_is_the_last_radius_that_still_falls_in() {
        // r − 0.25 r³ comes back in for great radii: nothing within the valid radius is far enough out
        let f = RadialFunction::new(&[-0.25], &[]);
        let valid = f.valid_square().sqrt();
        assert!(f.reach(1.0, 0.0, valid) >= valid);
        let near = f.reach(0.5, 0.0, valid);
        assert!((near * f.scale(near * near) - 0.5).abs() < 1e-12 && near < valid);
    }
}
