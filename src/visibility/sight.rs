//! Points of the surface as one photo has them before it: rays, depths and photo positions of a batch.

use glam::{DVec2, DVec3};

use super::photo::{ViewPhoto, ray_of};
use crate::camera::{RAYS, Rays};
use crate::geom::{Kernel, run_widest};
use crate::surface::SurfaceTile;

/// A photo before a surface, and the tolerance of its occlusion test.
#[derive(Debug, Clone, Copy)]
pub struct Sight<'a> {
    /// The photo.
    pub photo: &'a ViewPhoto,
    /// What the mosaic shows.
    pub surface: &'a SurfaceTile,
    /// ε: a face less than this before a point does not occlude it.
    pub tolerance: Tolerance,
}

/// The part of the segment before a surface point in which a face does not occlude it.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Tolerance {
    /// Metres.
    Fixed(f64),
    /// This part of the point's elevation, which is its depth in a perspective view.
    OfDepth(f64),
}

impl Tolerance {
    /// Metres, at a point of this elevation.
    #[inline]
    pub fn at(self, elevation: f64) -> f64 {
        match self {
            Self::Fixed(metres) => metres,
            Self::OfDepth(part) => part * elevation,
        }
    }

    /// The greatest at any point of a surface, metres.
    pub fn greatest(self, surface: &SurfaceTile) -> f64 {
        match self {
            Self::Fixed(metres) => metres,
            Self::OfDepth(part) => {
                surface.elevations.iter().fold(0.0, |m: f64, &e| m.max(part * e))
            }
        }
    }
}

impl Sight<'_> {
    /// The ray of the surface point at `pixel` and the depth before which a face occludes it.
    #[inline]
    pub(super) fn ray_and_limit(&self, pixel: usize) -> (DVec2, f64) {
        let q = self.photo.camera_from_local(self.surface.points.at(pixel));
        let tolerance_m = self.tolerance.at(self.surface.elevations[pixel]);
        (ray_of(q), q.z * (1.0 - tolerance_m / q.length()))
    }
}

/// A batch of at most [`RAYS`] points as the photo has them before it.
#[derive(Debug, Clone)]
pub(super) struct Batch {
    /// Depth of each point, metres.
    pub(super) depth: [f64; RAYS],
    pub(super) rays: Rays,
}

impl Default for Batch {
    fn default() -> Self {
        Self { depth: [0.0; RAYS], rays: Rays::default() }
    }
}

impl Batch {
    /// Fills in depths and rays of points, their coordinates in three arrays of one length: bit for bit those of one
    /// point alone.
    pub(super) fn sight(&mut self, photo: &ViewPhoto, points: [&[f64]; 3]) {
        run_widest(ToCamera { photo, batch: self, points });
    }
}

struct ToCamera<'a> {
    photo: &'a ViewPhoto,
    batch: &'a mut Batch,
    points: [&'a [f64]; 3],
}

impl Kernel for ToCamera<'_> {
    type Output = ();

    #[inline(always)]
    #[expect(clippy::inline_always, reason = "compiled for the widest vectors where it is inlined")]
    fn run(self) {
        let Batch { depth, rays } = self.batch;
        let count = self.points[0].len();
        let [x, y, z] = self.points.map(|of| &of[..count]);
        let (ray_x, ray_y) = (&mut rays.x[..count], &mut rays.y[..count]);
        let depth = &mut depth[..count];
        let pose = self.photo.pose;
        for k in 0..count {
            let q = super::photo::to_camera(&pose, DVec3::new(x[k], y[k], z[k]));
            let ray = ray_of(q);
            (ray_x[k], ray_y[k], depth[k]) = (ray.x, ray.y, q.z);
        }
    }
}
