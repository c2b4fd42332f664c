//! [`RayTriangle`]: where a line meets a triangle.

use glam::DVec3;

/// A triangle before lines through one point, its corners relative to that point.
///
/// The side of an edge on which a line passes is the sign of d · (a × b), of the line's direction and the edge's ends:
/// for the two triangles that share an edge it is the same number with the opposite sign, to the last bit. Within its
/// rounding it counts as zero: a line through an edge or a corner meets all that share it, so none slips between them.
#[derive(Debug, Clone, Copy)]
pub struct RayTriangle {
    edges: [DVec3; 3],
    normal: DVec3,
    offset: f64,
    rounding: f64,
}

impl RayTriangle {
    /// Rounding of d · (a × b), in units of (largest coordinate of the corners)² · (sum of |d|): 16 × 2⁻⁵³. A component
    /// of the cross product is off by at most 4 u M², the dot product adds at most 8 u M² |d|; room left.
    pub const ROUNDING: f64 = 16.0 / 9_007_199_254_740_992.0;

    /// The triangle with these corners.
    #[inline]
    pub fn new([a, b, c]: [DVec3; 3]) -> Self {
        let normal = (b - a).cross(c - a);
        let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
        Self {
            edges: [b.cross(c), c.cross(a), a.cross(b)],
            normal,
            offset: normal.dot(a),
            rounding: Self::ROUNDING * largest * largest,
        }
    }

    /// Twice its area vector.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The t at which `t · direction` lies on the triangle, of either sign; `None` if it does nowhere, or the line lies in
    /// the triangle's plane: seen exactly edge-on it has no extent, and its neighbours decide.
    #[inline]
    pub fn meet(&self, direction: DVec3) -> Option<f64> {
        let [e0, e1, e2] = self.edges.map(|edge| edge.dot(direction));
        let zero = self.rounding * direction.abs().element_sum();
        let (least, greatest) = (e0.min(e1).min(e2), e0.max(e1).max(e2));
        let inside = (least >= -zero && greatest > zero) || (greatest <= zero && least < -zero);
        let facing = self.normal.dot(direction);
        (inside && facing != 0.0).then(|| self.offset / facing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_triangle_is_met_before_the_point_or_behind_it_and_not_beside() {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 4.0));
        let triangle = RayTriangle::new(corners);
        assert_eq!(triangle.meet(DVec3::Z), Some(4.0));
        assert_eq!(triangle.meet(DVec3::NEG_Z), Some(-4.0));
        assert_eq!(triangle.meet(DVec3::X), None);
        assert_eq!(triangle.meet(DVec3::new(0.9, 0.9, 1.0)), None);
    }

    proptest! {
        #[test]
        fn a_line_through_a_fan_meets_at_least_one_of_its_triangles(
            inner in prop::array::uniform2(-0.4..0.4_f64),
            at in prop::array::uniform2(-0.99..0.99_f64),
            depth in prop::array::uniform4(1.0..3.0_f64),
        ) {
            let corner = |x: f64, y: f64, z: f64| DVec3::new(x * z, y * z, z);
            let rim = [
                corner(-1.0, -1.0, depth[0]), corner(1.0, -1.0, depth[1]),
                corner(1.0, 1.0, depth[2]), corner(-1.0, 1.0, depth[3]),
            ];
            let middle = corner(inner[0], inner[1], 2.0);
            let fan = [0, 1, 2, 3].map(|k: usize| RayTriangle::new([rim[k], rim[(k + 1) % 4], middle]));
            let hits = |d: DVec3| fan.iter().filter(|t| t.meet(d).is_some()).count();
            prop_assert!(hits(DVec3::new(at[0], at[1], 1.0)) >= 1);
            // Through the middle, all four.
            prop_assert_eq!(hits(middle), 4);
        }
    }
}
