//! Exact predicates.

use glam::DVec2;

/// Rounding-error bound of the plain determinant, Shewchuk's `ccwerrboundA` = (3 + 16 ε) ε, ε = 2⁻⁵³.
const FILTER: f64 = 3.330_669_073_875_471_6e-16;

/// Twice the signed area of the triangle `a b c`, with a sign that is exact.
///
/// Positive when `a → b → c` turns from +x towards +y (clockwise on a screen whose y points down); zero if and
/// only if the three points are collinear. The sign is antisymmetric under an exchange of two points, so two
/// triangles that share an edge always agree on which side of it a point lies.
///
/// J. R. Shewchuk (1997), "Adaptive precision floating-point arithmetic and fast robust geometric predicates",
/// Discrete & Computational Geometry 18, 305–363, doi:10.1007/PL00009321. The filter stands here so that it can
/// be inlined; the exact expansion is that of the `robust` crate.
#[inline]
pub fn orient2d(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let left = (a.x - c.x) * (b.y - c.y);
    let right = (a.y - c.y) * (b.x - c.x);
    let det = left - right;
    if det.abs() >= FILTER * (left.abs() + right.abs()) && det != 0.0 {
        det
    } else {
        exact(a, b, c)
    }
}

#[cold]
fn exact(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| robust::Coord { x: p.x, y: p.y };
    robust::orient2d(coord(a), coord(b), coord(c))
}

/// A number whose sign is exact: positive if `d` lies inside the circle through `a`, `b`, `c`, negative if outside, zero if
/// on it, where `a → b → c` turns from +x towards +y; the other way about if they turn back.
pub fn incircle(a: DVec2, b: DVec2, c: DVec2, d: DVec2) -> f64 {
    let coord = |p: DVec2| robust::Coord { x: p.x, y: p.y };
    robust::incircle(coord(a), coord(b), coord(c), coord(d))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_one_ulp_off_a_line_far_from_the_origin_is_seen_to_be_off() {
        let (a, b) = (DVec2::new(1e7, 1e7), DVec2::new(3e7, 3e7));
        let on = DVec2::new(2e7, 2e7);
        let above = DVec2::new(2e7, 2e7_f64.next_up());
        assert!(orient2d(a, b, on).abs() < f64::MIN_POSITIVE);
        assert!(orient2d(a, b, above) > 0.0);
        assert!(orient2d(b, a, above) < 0.0);
    }

    #[test]
    fn a_point_one_ulp_off_a_circle_far_from_the_origin_is_seen_to_be_off() {
        let far = DVec2::new(5e5, 4.2e6);
        let [a, b, c, d] =
            [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|p| far + DVec2::from(p));
        assert!(incircle(a, b, c, d).abs() < f64::MIN_POSITIVE);
        assert!(incircle(a, b, c, DVec2::new(d.x.next_up(), d.y)) > 0.0);
        assert!(incircle(a, b, c, DVec2::new(d.x.next_down(), d.y)) < 0.0);
    }
}
