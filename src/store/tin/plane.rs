//! [`TinPlane`]: where points lie over the plane that they are triangulated on.

use glam::{DVec2, DVec3};

/// A coordinate of the plane below this is 0, metres: 2⁻¹⁰⁰, far above what exact predicates can take.
const LEAST_M: f64 = 1.0 / (1_u128 << 100) as f64;

/// A plane by its axes, which are orthonormal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TinPlane {
    /// The ground point with the coordinates 0, 0.
    pub origin: DVec3,
    /// Unit vector along u, ground.
    pub u: DVec3,
    /// Unit vector along v, ground.
    pub v: DVec3,
    /// `u × v`: elevation grows along it.
    pub n: DVec3,
}

impl TinPlane {
    /// Coordinates in the plane and elevation of a ground point, metres: a function of the point alone.
    pub(super) fn place(&self, ground: DVec3) -> (DVec2, f64) {
        let from_origin = ground - self.origin;
        // `+ 0.0` turns −0 into 0.
        let clean = |x: f64| if x.abs() < LEAST_M { 0.0 } else { x + 0.0 };
        let at = DVec2::new(clean(from_origin.dot(self.u)), clean(from_origin.dot(self.v)));
        (at, from_origin.dot(self.n) + 0.0)
    }

    /// All its numbers.
    pub(super) fn numbers(&self) -> [f64; 12] {
        let mut all = [0.0; 12];
        for (three, axis) in all.chunks_exact_mut(3).zip([self.origin, self.u, self.v, self.n]) {
            three.copy_from_slice(&axis.to_array());
        }
        all
    }
}
