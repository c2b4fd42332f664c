//! The occlusion predicate: does a face cut the segment from the perspective centre to a point?

use glam::DVec3;

use crate::raster::RayTriangle;

/// A face in camera coordinates, ready to be tested against rays `(x, y, 1)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct FaceTest {
    triangle: RayTriangle,
    near: f64,
    far: f64,
}

impl FaceTest {
    /// Prepares a face; its corners in camera coordinates (metres). No clipping is needed for corners behind the
    /// camera: the sides of the edges are homogeneous.
    #[inline]
    pub(super) fn new([a, b, c]: [DVec3; 3]) -> Self {
        Self {
            triangle: RayTriangle::new([a, b, c]),
            near: a.z.min(b.z).min(c.z),
            far: a.z.max(b.z).max(c.z),
        }
    }

    /// Whether the closed face cuts the ray `(x, y, 1)` at a depth above 0 and below `limit`.
    ///
    /// A face seen exactly edge-on has no extent and cuts nothing: its neighbours decide.
    #[inline]
    pub(super) fn cuts(&self, x: f64, y: f64, limit: f64) -> bool {
        // The depth on the face's plane; the face itself lies between its corners' depths.
        self.triangle.meet(DVec3::new(x, y, 1.0)).is_some_and(|depth| {
            let depth = depth.clamp(self.near, self.far);
            depth > 0.0 && depth < limit
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FACE: [DVec3; 3] =
        [DVec3::new(-1.0, -1.0, 4.0), DVec3::new(1.0, -1.0, 4.0), DVec3::new(0.0, 1.0, 4.0)];

    #[test]
    fn a_face_before_the_limit_cuts_and_one_behind_it_does_not() {
        let test = FaceTest::new(FACE);
        assert!(test.cuts(0.0, 0.0, 4.1));
        assert!(!test.cuts(0.0, 0.0, 4.0));
        assert!(!test.cuts(0.3, 0.1, 4.1));
    }

    #[test]
    fn edges_and_corners_belong_to_the_face() {
        let test = FaceTest::new(FACE);
        assert!(test.cuts(0.0, -0.25, 5.0));
        assert!(test.cuts(-0.25, -0.25, 5.0));
        assert!(test.cuts(0.0, 0.25, 5.0));
    }

    #[test]
    fn winding_does_not_matter() {
        let [a, b, c] = FACE;
        for (x, y) in [(0.0, 0.0), (0.1, -0.2), (0.24, -0.25), (0.0, 0.26)] {
            assert_eq!(
                FaceTest::new([a, b, c]).cuts(x, y, 5.0),
                FaceTest::new([a, c, b]).cuts(x, y, 5.0)
            );
        }
    }

    #[test]
    fn an_edge_on_face_cuts_neither_inside_nor_beside_its_extent() {
        let test = FaceTest::new([
            DVec3::new(0.0, -1.0, 2.0),
            DVec3::new(0.0, 1.0, 2.0),
            DVec3::new(0.0, 0.0, 3.0),
        ]);
        assert!(!test.cuts(0.0, 0.0, 9.0));
        assert!(!test.cuts(0.0, 5.0, 9.0));
    }

    #[test]
    fn a_face_through_the_photos_plane_cuts_where_it_lies_in_front() {
        // A floor one metre below the camera, from five metres behind it to five metres before it.
        let test = FaceTest::new([
            DVec3::new(-9.0, 1.0, -5.0),
            DVec3::new(9.0, 1.0, -5.0),
            DVec3::new(0.0, 1.0, 5.0),
        ]);
        assert!(test.cuts(0.0, 0.5, 3.0));
        assert!(!test.cuts(0.0, 0.5, 1.9));
        assert!(!test.cuts(0.0, -0.5, 3.0));
        assert!(!test.cuts(0.0, 0.1, 99.0));
    }
}
