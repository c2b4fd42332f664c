//! One photo as the stage needs it.

use glam::{DVec2, DVec3};

use crate::camera::{Lens, LocalPose};
use crate::geom::{Bounds2, Bounds3};

/// A photo in the local frame of the mesh: interior and exterior orientation.
#[derive(Debug, Clone)]
pub struct ViewPhoto {
    /// Interior orientation.
    pub lens: Lens,
    /// Exterior orientation: camera from local.
    pub pose: LocalPose,
    /// Rays outside this rectangle cannot fall into the frame; none known: `None`.
    pub ray_bounds: Option<Bounds2>,
}

impl ViewPhoto {
    /// A photo from its orientation.
    pub fn new(lens: Lens, pose: LocalPose) -> Self {
        let ray_bounds = lens.ray_bounds();
        Self { lens, pose, ray_bounds }
    }

    /// A point of the local frame in camera coordinates, metres.
    #[inline]
    pub fn camera_from_local(&self, p: DVec3) -> DVec3 {
        to_camera(&self.pose, p)
    }

    /// Whether some point of the box might fall into the frame; `false` is proven.
    pub fn may_see(&self, bounds: &Bounds3) -> bool {
        if let Some(rays) = &self.ray_bounds {
            return Shaft::new(self, rays, f64::INFINITY).may_meet(bounds);
        }
        let axis = self.pose.rotation.row(2);
        bounds.linear_range(axis, -axis.dot(self.pose.centre)).1 > 0.0
    }
}

/// The part of space that is seen through a rectangle of rays and lies nearer than a depth.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shaft {
    /// `normal · p + offset ≥ 0` inside each plane; in the local frame.
    planes: [(DVec3, f64); 6],
}

impl Shaft {
    /// The shaft of `photo` through `rays`, from the perspective centre to depth `far`.
    pub(super) fn new(photo: &ViewPhoto, rays: &Bounds2, far: f64) -> Self {
        let normals = [
            DVec3::new(1.0, 0.0, -rays.min.x),
            DVec3::new(-1.0, 0.0, rays.max.x),
            DVec3::new(0.0, 1.0, -rays.min.y),
            DVec3::new(0.0, -1.0, rays.max.y),
            DVec3::Z,
            DVec3::NEG_Z,
        ];
        let back = photo.pose.rotation.transpose();
        let mut planes = normals.map(|n| {
            let n = back * n;
            (n, -n.dot(photo.pose.centre))
        });
        planes[5].1 += far;
        Self { planes }
    }

    /// Whether the box and the shaft may share a point; `false` is proven: the whole box lies beyond one plane, by
    /// more than rounding can explain.
    pub(super) fn may_meet(&self, bounds: &Bounds3) -> bool {
        let reach = bounds.min.abs().max(bounds.max.abs()).element_sum();
        self.planes.iter().all(|&(normal, offset)| {
            let (_, greatest) = bounds.linear_range(normal, offset);
            let size = normal.abs().max_element() * reach + offset.abs().min(f64::MAX);
            greatest >= -1e-12 * size || size.is_nan()
        })
    }

    /// Whether a triangle may share a point with the shaft; like [`Self::may_meet`], in camera coordinates.
    pub(super) fn rays_may_meet(rays: &Bounds2, corners: [DVec3; 3]) -> bool {
        let beyond = |side: fn(DVec3, &Bounds2) -> f64| {
            corners.iter().all(|&q| side(q, rays) < -1e-12 * q.length())
        };
        !(beyond(|q, r| (q.x - r.min.x * q.z) / (1.0 + r.min.x.abs()))
            || beyond(|q, r| (r.max.x * q.z - q.x) / (1.0 + r.max.x.abs()))
            || beyond(|q, r| (q.y - r.min.y * q.z) / (1.0 + r.min.y.abs()))
            || beyond(|q, r| (r.max.y * q.z - q.y) / (1.0 + r.max.y.abs())))
    }
}

/// `rotation · (p − centre)`, each component summed from the left.
#[inline]
pub(super) fn to_camera(pose: &LocalPose, p: DVec3) -> DVec3 {
    let (m, v) = (&pose.rotation, p - pose.centre);
    m.x_axis * v.x + m.y_axis * v.y + m.z_axis * v.z
}

/// The ray `(x/z, y/z)` of a point in camera coordinates; meaningful only for `z > 0`.
#[inline]
pub(super) fn ray_of(q: DVec3) -> DVec2 {
    DVec2::new(q.x / q.z, q.y / q.z)
}
