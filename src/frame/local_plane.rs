//! [`LocalPlane`]: the grid of pixels on a plane, in local coordinates.

use glam::{DMat3, DVec3};

use super::mosaic::Mosaic;
use super::plane::Plane;

/// A mosaic on a plane, related to local coordinates (ground minus an origin).
///
/// [`project`](Self::project) and [`lift`](Self::lift) are inverse to each other to the rounding of the local
/// coordinates alone, however far the local origin lies from the frame's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalPlane {
    /// Rows: column, row and elevation by a local displacement.
    rows: [DVec3; 3],
    /// Column, row and elevation of the local origin.
    at_origin: DVec3,
    /// Local displacement by column, row and elevation.
    steps: DMat3,
    /// The local point of mosaic (0, 0), elevation 0.
    corner: DVec3,
    towards_viewer: DVec3,
    pixel_size: f64,
    slab: [f64; 2],
}

impl LocalPlane {
    /// The plane's mosaic in the coordinates `ground − origin_ground`.
    pub(super) fn new(plane: &Plane, mosaic: &Mosaic, origin_ground: DVec3) -> Self {
        let p = mosaic.pixel_size;
        let (u, v, n) = (plane.u, plane.v, plane.n);
        // The local origin's frame coordinates: exact differences, so that no digit is lost far from the ground's origin.
        let coordinate =
            |axis: DVec3, start: f64| dot_minus(axis, origin_ground, plane.origin, start);
        let at_origin = DVec3::new(
            coordinate(u, mosaic.extent[0]) / p,
            -coordinate(v, mosaic.extent[3]) / p,
            coordinate(n, 0.0),
        );
        let rows = [u / p, -v / p, n];
        // The axes are orthonormal to 1e-12 only: lift by the exact inverse, not by the transpose.
        let inverse = DMat3::from_cols(u, v, n).transpose().inverse();
        let steps = DMat3::from_cols(inverse.x_axis * p, -inverse.y_axis * p, inverse.z_axis);
        let mut local = Self {
            rows,
            at_origin,
            steps,
            corner: steps * -at_origin,
            towards_viewer: n,
            pixel_size: p,
            slab: mosaic.slab,
        };
        // Refine the corner until it projects to (0, 0, 0).
        for _ in 0..2 {
            local.corner -= steps * local.project(local.corner);
        }
        local
    }

    /// Column (px), row (px) and elevation (m) of a local point: a function of the point alone.
    #[inline]
    pub fn project(&self, point: DVec3) -> DVec3 {
        let [x, y, elevation] = self.rows;
        DVec3::new(x.dot(point), y.dot(point), elevation.dot(point)) + self.at_origin
    }

    /// The local point at a column (px), row (px) and elevation (m).
    #[inline]
    pub fn lift(&self, x: f64, y: f64, elevation: f64) -> DVec3 {
        self.corner + self.steps * DVec3::new(x, y, elevation)
    }

    /// The direction from the surface to the viewer, a unit vector; the same at every point.
    #[inline]
    pub fn towards_viewer(&self) -> DVec3 {
        self.towards_viewer
    }

    /// The local displacement of one column, metres: +u · pixel size.
    #[inline]
    pub fn column_step(&self) -> DVec3 {
        self.steps.x_axis
    }

    /// The local displacement of one row, metres: −v · pixel size.
    #[inline]
    pub fn row_step(&self) -> DVec3 {
        self.steps.y_axis
    }

    /// Side of a pixel, metres.
    #[inline]
    pub fn pixel_size(&self) -> f64 {
        self.pixel_size
    }

    /// `[min, max]` of the elevations shown, metres, perhaps infinite.
    #[inline]
    pub fn slab(&self) -> [f64; 2] {
        self.slab
    }
}

/// `axis · (a − b) − start`, as if in twice the precision.
///
/// T. Ogita, S. M. Rump, S. Oishi (2005), "Accurate sum and dot product", SIAM J. Sci. Comput. 26 (6), 1955–1988,
/// doi:10.1137/030601818 (`Dot2`), over the seven terms.
fn dot_minus(axis: DVec3, a: DVec3, b: DVec3, start: f64) -> f64 {
    let terms = axis
        .to_array()
        .into_iter()
        .zip(a.to_array())
        .chain(axis.to_array().into_iter().zip((-b).to_array()).chain([(-1.0, start)]));
    let (sum, rest) = terms.fold((0.0, 0.0), |(sum, rest), (x, y)| {
        let (product, low) = two_product(x, y);
        let (sum, lost) = two_sum(sum, product);
        (sum, rest + (low + lost))
    });
    sum + rest
}

/// `a + b` and its rounding error (Knuth).
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// `a · b` and its rounding error (Dekker, Veltkamp's splitting by 2²⁷ + 1).
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let split = |x: f64| {
        let c = 134_217_729.0 * x;
        let high = c - (c - x);
        (high, x - high)
    };
    let product = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    (product, al * bl - (((product - ah * bh) - al * bh) - ah * bl))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Result;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    fn plane_of(mosaic: &Mosaic, origin: DVec3) -> LocalPlane {
        LocalPlane::new(mosaic.plane().unwrap(), mosaic, origin)
    }

    fn mosaic(pixel_size: f64, extent: [f64; 4]) -> Result<Mosaic> {
        Mosaic::new(Plane::top(), pixel_size, extent, [f64::NEG_INFINITY, f64::INFINITY])
    }

    /// A plane whose u axis is turned by `a` about z, then tilted by `b`.
    fn oblique(origin: DVec3, a: f64, b: f64) -> Plane {
        let u = [a.cos(), a.sin(), 0.0];
        let v = [-a.sin() * b.cos(), a.cos() * b.cos(), b.sin()];
        Plane::new(origin.into(), u, v).unwrap()
    }

    #[test]
    fn the_upper_left_corner_is_u_min_v_max() {
        let m = mosaic(0.5, [10.0, 20.0, 13.0, 25.0]).unwrap();
        let local = plane_of(&m, DVec3::new(11.0, 22.0, 3.0));
        assert_eq!(local.lift(0.0, 0.0, 7.0), DVec3::new(-1.0, 3.0, 4.0));
        assert_eq!(local.project(DVec3::new(-1.0, 3.0, 4.0)), DVec3::new(0.0, 0.0, 7.0));
        assert_eq!(local.column_step(), DVec3::new(0.5, 0.0, 0.0));
        assert_eq!(local.row_step(), DVec3::new(0.0, -0.5, 0.0));
        assert_eq!(local.towards_viewer(), DVec3::Z);
    }

    #[test]
    fn a_rounding_error_is_kept_in_the_low_part() {
        let (product, low) = two_product(1.0 + f64::EPSILON, 1.0 + f64::EPSILON);
        assert_eq!((product, low), (1.0 + 2.0 * f64::EPSILON, f64::EPSILON * f64::EPSILON));
        let d = dot_minus(DVec3::new(1.0, 1.0, 0.0), DVec3::new(1e16, 1.0, 0.0), DVec3::ZERO, 1e16);
        assert_eq!(d.to_bits(), 1.0_f64.to_bits());
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, rng_seed: RngSeed::Fixed(7), ..ProptestConfig::default() })]

        #[test]
        fn pixel_to_ground_to_pixel_closes_at_utm_coordinates(
            a in 0.0..6.3_f64,
            b in 0.0..6.3_f64,
            pixel_size in prop::sample::select(vec![0.001, 0.002, 0.01, 0.3]),
            at in prop::array::uniform3(0.0..1.0_f64),
            far in any::<bool>(),
        ) {
            // The frame's origin at the ground's, so that u and v are as great as the coordinates; or nearby.
            let store = DVec3::new(512_345.678, 5_432_109.876, 123.456);
            let origin = if far { DVec3::ZERO } else { store + DVec3::new(3.3, -7.7, 1.1) };
            let plane = oblique(origin, a, b);
            let d = store - origin;
            let (u, v) = (plane.u.dot(d), plane.v.dot(d));
            let m = Mosaic::new(plane.clone(), pixel_size, [u - 40.0, v - 30.0, u + 40.0, v + 30.0], [-1.0, 1e9]).unwrap();
            let local = plane_of(&m, store);
            let x = at[0] * f64::from(m.size.width);
            let y = at[1] * f64::from(m.size.height);
            let elevation = plane.n.dot(d) + 10.0 * at[2];
            let point = local.lift(x, y, elevation);
            let back = local.project(point);
            prop_assert!((back.x - x).abs() < 1e-6 && (back.y - y).abs() < 1e-6, "{back} {x} {y}");
            prop_assert!((back.z - elevation).abs() <= 4.0 * f64::EPSILON * elevation.abs().max(100.0));
            // Against the definition: the frame coordinates of the ground point, computed from its distance to the
            // corner's.
            let ground = point + store;
            let cu = plane.u.dot(ground - origin);
            prop_assert!((cu - (m.extent[0] + x * pixel_size)).abs() < 4.0 * 5.5e6 * f64::EPSILON);
        }
    }
}
