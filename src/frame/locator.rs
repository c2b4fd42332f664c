//! [`Locator`]: from a mosaic's pixels to the ground, and back.

use glam::DVec3;

use super::local::LocalMosaic;
use super::mosaic::{Mosaic, MosaicFrame};

/// Columns nearer than this before a full turn are the seam, which is column 0.
const SEAM_PX: f64 = 1e-6;

/// The way between the pixels of a mosaic and the ground; (0.5, 0.5) is the middle of the upper-left pixel.
///
/// [`ground`](Self::ground) and [`pixel`](Self::pixel) are inverse to each other, to 1e-6 pixel or 4 ulp of the largest
/// coordinate; on a cylinder up to full turns.
#[derive(Debug, Clone)]
pub struct Locator {
    local: LocalMosaic,
    /// Ground; near the mosaic, so that no digit is lost.
    origin: DVec3,
    /// Columns of the mosaic.
    width: f64,
}

impl Locator {
    /// The way between `mosaic` and the ground.
    pub fn new(mosaic: &Mosaic) -> Self {
        let near = match &mosaic.frame {
            MosaicFrame::Perspective(view) => view.pose.centre_ground,
            _ => mosaic.local(DVec3::ZERO).lift(0.5, 0.5, 0.0),
        };
        let origin = near.round();
        Self { local: mosaic.local(origin), origin, width: mosaic.size.width.into() }
    }

    /// The ground point at a column (px), row (px) and elevation (m; of a perspective view the depth); `None` where a
    /// lens has no ray.
    pub fn ground(&self, column: f64, row: f64, elevation: f64) -> Option<DVec3> {
        let point = self.local.lift(column, row, elevation) + self.origin;
        (!point.is_nan()).then_some(point)
    }

    /// Column (px), row (px) and elevation (m) of a ground point; `None` where a perspective view does not show it. A
    /// point beside the mosaic has a column below 0 or beyond its width, on a cylinder the nearer one.
    pub fn pixel(&self, point: DVec3) -> Option<DVec3> {
        let mut at = self.local.project(point - self.origin);
        if let LocalMosaic::Cylinder(cylinder) = &self.local {
            // The column is from 0 to a turn.
            let before = at.x - cylinder.turn_px();
            if -before <= SEAM_PX || -before < at.x - self.width {
                at.x = before;
            }
        }
        (!at.is_nan()).then_some(at)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::frame::{Cylinder, Facing};

    fn development(facing: Facing, extent: [f64; 4]) -> Locator {
        let axis = DVec3::new(0.1, -0.2, 1.0).normalize();
        let cylinder = Cylinder {
            origin: DVec3::new(500_000.3, 4_200_000.7, 12.5),
            axis,
            zero: axis.any_orthonormal_vector(),
            radius: 5.0,
            facing,
            pixel_size: None,
            extent: None,
            elevation: None,
        };
        let slab = [f64::NEG_INFINITY, f64::INFINITY];
        Locator::new(&Mosaic::new(cylinder, 0.01, extent, slab).unwrap())
    }

    #[test]
    fn the_edges_of_an_arc_are_not_a_turn_away() {
        for facing in [Facing::Outside, Facing::Inside] {
            let arc = development(facing, [-2.0, -1.0, 7.0, 1.0]);
            for column in [-20.0, 0.0, 0.5, 449.9, 900.0, 950.0] {
                let ground = arc.ground(column, 100.25, 0.4).unwrap();
                let back = arc.pixel(ground).unwrap();
                let off = back - DVec3::new(column, 100.25, 0.4);
                assert!(off.abs().max_element() < 1e-6, "{column}: {back}");
            }
        }
    }

    #[test]
    fn the_seam_of_a_full_turn_is_its_first_column() {
        let all = development(Facing::Outside, [-PI * 5.0, 0.0, PI * 5.0, 1.0]);
        for column in [0.0, 1000.0 * PI] {
            let back = all.pixel(all.ground(column, 3.0, 0.0).unwrap()).unwrap();
            assert!(back.x.abs() < 1e-6, "{column}: {back}");
        }
    }
}
