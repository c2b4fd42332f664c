//! [`Distortion`]: the distorting part of every supported lens model, and its inverse.

use glam::{DMat2, DVec2};

use super::brown::Brown;
use super::opencv::OpenCv;
use super::radial::Radial;
use super::radius::RadialFunction;
use super::rational::Rational;
use super::wide::Wide;

/// The map from a ray (x/z, y/z) to its distorted position, both normalised by the focal length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Distortion {
    None,
    Radial(Radial),
    OpenCv(OpenCv),
    Rational(Rational),
    Brown(Brown),
    Wide(Wide),
}

impl Distortion {
    /// The distorted position of ray `q`.
    #[inline]
    pub(super) fn distort(&self, q: DVec2) -> DVec2 {
        match self {
            Self::None => q,
            Self::Radial(d) => d.distort(q),
            Self::OpenCv(d) => d.distort(q),
            Self::Rational(d) => d.distort(q),
            Self::Brown(d) => d.distort(q),
            Self::Wide(d) => d.distort(q),
        }
    }

    /// The distorted position of ray `q`, and its derivative by the ray (column x, column y).
    #[inline]
    pub(super) fn distort_jacobian(&self, q: DVec2) -> (DVec2, DMat2) {
        match self {
            Self::None => (q, DMat2::IDENTITY),
            Self::Radial(d) => d.distort_jacobian(q),
            Self::OpenCv(d) => d.distort_jacobian(q),
            Self::Rational(d) => d.distort_jacobian(q),
            Self::Brown(d) => d.distort_jacobian(q),
            Self::Wide(d) => d.distort_jacobian(q),
        }
    }

    /// The radial part as a function: of the ray's radius, or of that at which [`Wide`] draws it.
    pub(super) fn radial_function(&self) -> RadialFunction {
        match self {
            Self::None => RadialFunction::new(&[], &[]),
            Self::Radial(d) => RadialFunction::new(&[d.k1, d.k2], &[]),
            Self::OpenCv(d) => RadialFunction::new(&[d.radial.k1, d.radial.k2], &[]),
            Self::Rational(d) => RadialFunction::new(&d.numerator, &d.denominator),
            Self::Brown(d) => d.radial_function(),
            Self::Wide(d) => d.brown.radial_function(),
        }
    }

    /// The square of the ray radius up to which the model holds; perhaps infinite.
    pub(super) fn valid_square(&self) -> f64 {
        match self {
            Self::Wide(d) => d.valid_square(),
            Self::Brown(d) => {
                // The greatest circle about the principal point within the one about the centre.
                let radius = d.radial_function().valid_square().sqrt() - d.centre().length();
                radius.max(0.0) * radius.max(0.0)
            }
            _ => self.radial_function().valid_square(),
        }
    }

    /// The least `c` for which the tangential part is known to move no point of radius `r`, in the plane of
    /// [`Self::radial_function`], by more than `c r²`.
    pub(super) fn tangential_bound(&self) -> f64 {
        match self {
            Self::None | Self::Radial(_) => 0.0,
            Self::OpenCv(d) => d.tangential.greatest(),
            Self::Rational(d) => d.tangential.greatest(),
            Self::Brown(d) => d.tangential_bound(),
            Self::Wide(d) => d.brown.tangential_bound(),
        }
    }

    /// The ray of squared radius below `valid_square` whose distorted position is `target`.
    ///
    /// 1. Newton's method from `target` itself, or from the ray that a fisheye without distortion would show there,
    ///    which serves all but strong distortion.
    /// 2. If that fails, from the ray that the radial part alone would give, found by bisection.
    ///
    /// `None` if neither ends within 1e-12 (relative to 1 or to the target, whichever is greater).
    pub(super) fn undistort(&self, target: DVec2, valid_square: f64) -> Option<DVec2> {
        if matches!(self, Self::None) {
            return target.is_finite().then_some(target);
        }
        let first = match self {
            Self::Wide(d) => d.ray_without_polynomial(target),
            _ => target,
        };
        self.newton(first, target, valid_square).or_else(|| {
            let start = self.radial_start(target, valid_square)?;
            self.newton(start, target, valid_square)
        })
    }

    /// Damped Newton iteration: a step is halved until it stays within the valid radius and lessens the residual.
    fn newton(&self, start: DVec2, target: DVec2, valid_square: f64) -> Option<DVec2> {
        let is_valid = |q: DVec2| q.length_squared() < valid_square;
        if !is_valid(start) {
            return None;
        }
        let mut q = start;
        let mut error = (self.distort(q) - target).length();
        // Quadratic convergence needs six or seven steps; damped ones near a fold some tens.
        for _ in 0..60 {
            let (at, slope) = self.distort_jacobian(q);
            let det = slope.determinant();
            if error == 0.0 || det == 0.0 {
                break;
            }
            let r = at - target;
            let step = DVec2::new(
                slope.y_axis.y * r.x - slope.y_axis.x * r.y,
                slope.x_axis.x * r.y - slope.x_axis.y * r.x,
            ) / det;
            let better = (0..20).find_map(|halvings| {
                let trial = q - step * 0.5_f64.powi(halvings);
                let e = (self.distort(trial) - target).length();
                (is_valid(trial) && e < error).then_some((trial, e))
            });
            let Some(next) = better else { break };
            (q, error) = next;
        }
        (error <= 1e-12 * target.length().max(1.0)).then_some(q)
    }

    /// The ray in the direction of `target` that the radial part alone brings nearest to it.
    fn radial_start(&self, target: DVec2, valid_square: f64) -> Option<DVec2> {
        let target = match self {
            Self::Brown(d) => d.unsheared(target),
            Self::Wide(d) => d.brown.unsheared(target),
            _ => target,
        };
        let wanted = target.length();
        let direction = target.try_normalize()?;
        let radial = |r: f64| match self {
            Self::None => r,
            Self::Radial(d) => d.distort(DVec2::new(r, 0.0)).x,
            Self::OpenCv(d) => d.radial.distort(DVec2::new(r, 0.0)).x,
            Self::Rational(d) => d.radial_distort(r),
            Self::Brown(d) => d.radial_distort(r),
            Self::Wide(d) => d.radial_distort(r),
        };
        let end = match self {
            Self::Brown(d) => valid_square.sqrt() + d.centre().length(),
            _ => valid_square.sqrt(),
        };
        // Within the valid radius the distorted radius only grows: double until it is passed, then halve.
        let (mut lo, mut hi) = (0.0, wanted);
        while hi < end && radial(hi) < wanted {
            (lo, hi) = (hi, 2.0 * hi);
        }
        hi = hi.min(end);
        for _ in 0..50 {
            let mid = 0.5 * (lo + hi);
            if radial(mid) < wanted { lo = mid } else { hi = mid }
        }
        let centre = match self {
            Self::Brown(d) => d.centre(),
            _ => DVec2::ZERO,
        };
        Some(centre + direction * lo)
    }
}
