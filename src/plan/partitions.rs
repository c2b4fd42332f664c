//! The mesh as the plan reads it, and its faces in the coordinates of a plane.

use glam::{DVec2, DVec3};

use crate::Result;
use crate::frame::{Cylinder, LocalCylinder, Plane};
use crate::geom::{Bounds2, Bounds3, FaceBlock};
use crate::store::mesh::{MeshStore, PartitionBuffer, PartitionId};

/// A mesh in partitions, numbered from 0 in an order that depends on the mesh alone.
pub trait Partitions {
    /// Ground position of the local frame's origin, metres.
    fn origin(&self) -> DVec3;

    /// Number of partitions.
    fn count(&self) -> usize;

    /// Bounds of a partition, local frame, metres.
    fn bounds(&self, partition: usize) -> Bounds3;

    /// Number of triangles of a partition.
    fn faces(&self, partition: usize) -> usize;

    /// Calls `f` with the faces of a partition.
    ///
    /// # Errors
    /// If the partition cannot be read.
    fn visit(&self, partition: usize, f: &mut dyn FnMut(&FaceBlock<'_>)) -> Result<()>;
}

impl Partitions for MeshStore {
    fn origin(&self) -> DVec3 {
        self.origin()
    }

    fn count(&self) -> usize {
        self.partition_count()
    }

    fn bounds(&self, partition: usize) -> Bounds3 {
        self.partition_bounds(id(partition))
    }

    fn faces(&self, partition: usize) -> usize {
        self.partition_triangles(id(partition))
    }

    fn visit(&self, partition: usize, f: &mut dyn FnMut(&FaceBlock<'_>)) -> Result<()> {
        let mut buffer = PartitionBuffer::new();
        self.load(id(partition), &mut buffer)?;
        f(&buffer.block());
        Ok(())
    }
}

fn id(partition: usize) -> PartitionId {
    PartitionId(u32::try_from(partition).expect("partition numbers have 32 bits"))
}

/// The part of space that a mosaic shows: a plane or a cylinder with a range of elevations.
#[derive(Debug, Clone, Copy)]
pub struct Slab<'a> {
    /// The plane or the cylinder.
    pub base: Base<'a>,
    /// `[min, max]` of elevation, metres, perhaps infinite.
    pub elevation: [f64; 2],
}

/// What elevations are measured from.
#[derive(Debug, Clone, Copy)]
pub enum Base<'a> {
    /// A plane.
    Plane(&'a Plane),
    /// A cylinder.
    Cylinder(&'a Cylinder),
}

/// Local to frame coordinates (u, v, elevation), metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct SlabFrame {
    axes: [DVec3; 3],
    at_origin: DVec3,
    /// Instead of the axes.
    around: Option<Around>,
    elevation: [f64; 2],
}

/// A cylinder whose mosaic has pixels of a metre and begins at u = `u_min`, v = 0.
#[derive(Debug, Clone, Copy)]
struct Around {
    cylinder: LocalCylinder,
    u_min: f64,
}

impl SlabFrame {
    /// The coordinates of a slab for points relative to `origin_ground`.
    pub(super) fn new(slab: Slab<'_>, origin_ground: DVec3) -> Self {
        let Slab { base, elevation } = slab;
        match base {
            Base::Plane(plane) => {
                let axes = [plane.u, plane.v, plane.n];
                let at_origin = DVec3::from(axes.map(|a| a.dot(origin_ground - plane.origin)));
                Self { axes, at_origin, around: None, elevation }
            }
            Base::Cylinder(cylinder) => {
                let u_min = cylinder
                    .extent
                    .map_or(-std::f64::consts::PI * cylinder.radius, |extent| extent[0]);
                let around = Around { cylinder: cylinder.local(origin_ground, u_min), u_min };
                Self {
                    axes: [DVec3::ZERO; 3],
                    at_origin: DVec3::ZERO,
                    around: Some(around),
                    elevation,
                }
            }
        }
    }

    /// u, v and elevation of a local point, metres.
    pub(super) fn project(&self, point: DVec3) -> DVec3 {
        if let Some(Around { cylinder, u_min }) = &self.around {
            let at = cylinder.project(point);
            return DVec3::new(u_min + at.x, -at.y, at.z);
        }
        DVec3::from(self.axes.map(|a| a.dot(point))) + self.at_origin
    }

    /// The local point of u, v and elevation, metres; axes are orthonormal to 1e-12.
    pub(super) fn lift(&self, at: DVec3) -> DVec3 {
        let [u, v, n] = self.axes;
        let d = at - self.at_origin;
        u * d.x + v * d.y + n * d.z
    }

    /// The direction to the viewer at a local point.
    pub(super) fn towards_viewer(&self, point: DVec3) -> DVec3 {
        match &self.around {
            Some(Around { cylinder, .. }) => cylinder.towards_viewer(point),
            None => self.axes[2],
        }
    }

    /// Whether an elevation is in the slab.
    pub(super) fn holds(&self, elevation: f64) -> bool {
        self.elevation[0] <= elevation && elevation <= self.elevation[1]
    }

    /// u, v and elevation bounds of a local box.
    pub(super) fn project_box(&self, bounds: &Bounds3) -> Bounds3 {
        if bounds.is_empty() {
            return Bounds3::EMPTY;
        }
        if let Some(Around { cylinder, u_min }) = &self.around {
            let Bounds3 { min, max } = cylinder.box_range(bounds);
            let (min, max) = (DVec3::new(min.x, -max.y, min.z), DVec3::new(max.x, -min.y, max.z));
            let start = DVec3::X * *u_min;
            return Bounds3 { min: min + start, max: max + start };
        }
        Bounds3::of(bounds.corners().map(|c| self.project(c)))
    }

    /// u, v bounds of a local box, any u on a cylinder; empty if it misses the slab.
    pub(super) fn box_bounds(&self, bounds: &Bounds3) -> Bounds2 {
        let b = self.project_box(bounds);
        let misses = b.max.z < self.elevation[0] || b.min.z > self.elevation[1];
        if misses {
            return Bounds2::EMPTY;
        }
        if self.around.is_some() {
            // Whichever turn it is counted in.
            return Bounds2 {
                min: DVec2::new(f64::NEG_INFINITY, b.min.y),
                max: DVec2::new(f64::INFINITY, b.max.y),
            };
        }
        Bounds2 { min: b.min.truncate(), max: b.max.truncate() }
    }

    /// u, v bounds of the part of a triangle, local frame, that lies in the slab; empty if none does.
    pub(super) fn face_bounds(&self, corners: [DVec3; 3]) -> Bounds2 {
        if self.around.is_some() {
            return self.box_bounds(&Bounds3::of(corners));
        }
        let corners = corners.map(|c| self.project(c));
        let inside = corners.into_iter().filter(|c| self.holds(c.z));
        let mut bounds = Bounds2::of(inside.map(DVec3::truncate));
        // Where an edge crosses one of the slab's two faces.
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            for level in self.elevation {
                if (a.z < level) != (b.z < level) && level.is_finite() {
                    let t = ((level - a.z) / (b.z - a.z)).clamp(0.0, 1.0);
                    bounds = bounds.including((a + t * (b - a)).truncate());
                }
            }
        }
        bounds
    }
}

#[cfg(test)]
pub(super) mod soup {
    //! A mesh for tests: faces in memory, cut into partitions of a given size.

    use super::*;
    use crate::geom::FaceId;

    /// Faces that share no vertex.
    pub(in super::super) struct Soup {
        origin: DVec3,
        partitions: Vec<Vec<DVec3>>,
    }

    impl Soup {
        /// `faces` in the local frame of `origin`, `size` a partition.
        pub(in super::super) fn new(origin: DVec3, faces: &[[DVec3; 3]], size: usize) -> Self {
            let partitions = faces.chunks(size).map(<[[DVec3; 3]]>::concat).collect();
            Self { origin, partitions }
        }
    }

    impl Partitions for Soup {
        fn origin(&self) -> DVec3 {
            self.origin
        }

        fn count(&self) -> usize {
            self.partitions.len()
        }

        fn bounds(&self, partition: usize) -> Bounds3 {
            Bounds3::of(self.partitions[partition].iter().copied())
        }

        fn faces(&self, partition: usize) -> usize {
            self.partitions[partition].len() / 3
        }

        fn visit(&self, partition: usize, f: &mut dyn FnMut(&FaceBlock<'_>)) -> Result<()> {
            let positions = &self.partitions[partition];
            let count = u16::try_from(positions.len() / 3).expect("a small test mesh");
            let triangles: Vec<_> = (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            let ids: Vec<_> = (0..u32::from(count)).map(FaceId).collect();
            let bounds = self.bounds(partition);
            f(&FaceBlock { positions, triangles: &triangles, ids: &ids, bounds });
            Ok(())
        }
    }
}
