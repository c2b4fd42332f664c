//! The fill rule.
//!
//! A centre belongs to a triangle when it lies strictly inside, or on a *top* edge (horizontal, the inside below it)
//! or a *left* edge (the inside to its right). The side of an edge is an exact predicate
//! ([`crate::geom::orient2d`]), never a value stepped along a row.

use glam::DVec2;

use crate::geom::{PixelRect, orient2d};

/// A triangle with a non-zero area, its corners in positive order (see [`orient2d`]).
#[derive(Debug, Clone, Copy)]
pub struct Triangle {
    corners: [DVec2; 3],
    owns: [bool; 3],
    flipped: bool,
    double_area: f64,
}

impl Triangle {
    /// The triangle `corners`, or `None` if they are collinear: such a triangle holds no centre.
    pub fn new(corners: [DVec2; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        let area = orient2d(a, b, c);
        let flipped = area < 0.0;
        let corners = if flipped { [a, c, b] } else { corners };
        let owns = [0, 1, 2].map(|i| {
            let edge = corners[(i + 1) % 3] - corners[i];
            edge.y < 0.0 || (edge.y == 0.0 && edge.x > 0.0)
        });
        (area != 0.0).then_some(Self { corners, owns, flipped, double_area: area.abs() })
    }

    /// Whether the given corners turned the negative way.
    pub fn flipped(&self) -> bool {
        self.flipped
    }

    /// The barycentric coordinates of the *given* second and third corner at `p`, if the triangle holds `p`.
    #[inline]
    pub fn weights_at(&self, p: DVec2) -> Option<[f64; 2]> {
        let [a, b, c] = self.corners;
        let [own_ab, own_bc, own_ca] = self.owns;
        let ab = orient2d(a, b, p);
        if !(ab > 0.0 || (ab == 0.0 && own_ab)) {
            return None;
        }
        let bc = orient2d(b, c, p);
        if !(bc > 0.0 || (bc == 0.0 && own_bc)) {
            return None;
        }
        let ca = orient2d(c, a, p);
        if !(ca > 0.0 || (ca == 0.0 && own_ca)) {
            return None;
        }
        let (second, third) = (ca / self.double_area, ab / self.double_area);
        Some(if self.flipped { [third, second] } else { [second, third] })
    }

    /// The pixels whose centres lie in the triangle's bounding box.
    pub fn pixel_bounds(&self) -> PixelRect {
        let [a, b, c] = self.corners;
        let (lo, hi) = (a.min(b).min(c) - 0.5, a.max(b).max(c) - 0.5);
        PixelRect::new(
            pixel(lo.x.ceil()),
            pixel(lo.y.ceil()),
            pixel(hi.x.floor()) + 1,
            pixel(hi.y.floor()) + 1,
        )
    }
}

/// Calls `visit(x, y, weights)` for each pixel of `clip` whose centre the triangle holds; `weights` are the
/// barycentric coordinates of the given second and third corner there.
#[inline]
pub fn scan(triangle: &Triangle, clip: &PixelRect, mut visit: impl FnMut(i64, i64, [f64; 2])) {
    let rect = triangle.pixel_bounds().intersection(clip);
    for y in rect.y0..rect.y1 {
        for x in rect.x0..rect.x1 {
            if let Some(weights) = triangle.weights_at(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) {
                visit(x, y, weights);
            }
        }
    }
}

/// A whole f64 as a pixel index; beyond ± 2⁶² it saturates, which no mosaic reaches.
#[expect(clippy::cast_possible_truncation, reason = "whole by its callers, saturates")]
fn pixel(v: f64) -> i64 {
    v.clamp(-4.6e18, 4.6e18) as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn hits(triangles: &[[DVec2; 3]], clip: &PixelRect) -> Vec<u32> {
        let mut count = vec![0; clip.area()];
        for t in triangles.iter().filter_map(|&t| Triangle::new(t)) {
            scan(&t, clip, |x, y, _| {
                let at = (y - clip.y0) * (clip.x1 - clip.x0) + x - clip.x0;
                count[usize::try_from(at).unwrap()] += 1;
            });
        }
        count
    }

    #[test]
    fn a_pixel_on_a_shared_edge_belongs_to_one_triangle() {
        // Corners on pixel centres, the diagonal through them: every case of the fill rule.
        let p = |x: f64, y: f64| DVec2::new(x + 0.5, y + 0.5);
        let square =
            [[p(0.0, 0.0), p(4.0, 0.0), p(4.0, 4.0)], [p(0.0, 0.0), p(4.0, 4.0), p(0.0, 4.0)]];
        let count = hits(&square, &PixelRect::new(-1, -1, 7, 7));
        assert_eq!(count.iter().sum::<u32>(), 16);
        assert!(count.iter().all(|&c| c <= 1));
    }

    #[test]
    fn winding_does_not_change_the_pixels_and_weights_follow_the_given_corners() {
        let (a, b, c) = (DVec2::new(0.2, 0.1), DVec2::new(9.7, 1.3), DVec2::new(3.1, 8.8));
        let clip = PixelRect::new(0, 0, 10, 10);
        assert_eq!(hits(&[[a, b, c]], &clip), hits(&[[a, c, b]], &clip));
        for (corners, second, third) in [([a, b, c], b, c), ([a, c, b], c, b)] {
            let t = Triangle::new(corners).unwrap();
            scan(&t, &clip, |x, y, [u, v]| {
                let p = a + (second - a) * u + (third - a) * v;
                assert!(p.distance(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) < 1e-12);
            });
        }
    }

    proptest! {
        #[test]
        fn a_fan_around_an_inner_vertex_covers_every_pixel_of_its_square_once(
            x in 0.001..31.999_f64, y in 0.001..31.999_f64, snap in any::<bool>(), far in any::<bool>(),
        ) {
            let inner = if snap { DVec2::new(x.floor() + 0.5, y.floor() + 0.5) } else { DVec2::new(x, y) };
            let shift = if far { 1_000_000.0 } else { 0.0 };
            let corner = [(0.0, 0.0), (32.0, 0.0), (32.0, 32.0), (0.0, 32.0)].map(|(x, y)| DVec2::new(x + shift, y));
            let inner = inner + DVec2::new(shift, 0.0);
            let fan: Vec<_> = (0..4).map(|i| [corner[i], corner[(i + 1) % 4], inner]).collect();
            #[expect(clippy::cast_possible_truncation, reason = "0 or a million")]
            let x0 = shift as i64;
            let count = hits(&fan, &PixelRect::new(x0, 0, x0 + 32, 32));
            prop_assert!(count.iter().all(|&c| c == 1));
        }
    }
}
