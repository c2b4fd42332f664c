//! Conservative bounds of a mosaic rectangle and of boxes over it: what a query for partitions needs.

use super::LocalPlane;
use crate::geom::{Bounds3, PixelRect};

/// Room for rounding when a box is compared with a rectangle, pixels: thousands of times what projecting may err.
const MARGIN_PX: f64 = 1e-3;

impl LocalPlane {
    /// Whether something inside `bounds` (local frame) may project onto a pixel of `rect` within the slab; `false` is
    /// proven.
    pub fn may_cover(&self, bounds: &Bounds3, rect: &PixelRect) -> bool {
        let projected = self.project_bounds(bounds);
        let [low, high] = self.slab();
        let room = MARGIN_PX * self.pixel_size();
        projected.max.x >= rect.x0 as f64 - MARGIN_PX
            && projected.min.x <= rect.x1 as f64 + MARGIN_PX
            && projected.max.y >= rect.y0 as f64 - MARGIN_PX
            && projected.min.y <= rect.y1 as f64 + MARGIN_PX
            && projected.max.z >= low - room
            && projected.min.z <= high + room
    }

    /// Bounds (local frame) of the points over `rect` whose elevation is within the slab and within that of `bounds`.
    pub fn column_bounds(&self, bounds: &Bounds3, rect: &PixelRect) -> Bounds3 {
        let projected = self.project_bounds(bounds);
        let [low, high] = self.slab();
        let (low, high) = (projected.min.z.max(low), projected.max.z.min(high));
        if low > high || rect.is_empty() {
            return Bounds3::EMPTY;
        }
        let (xs, ys) = ([rect.x0, rect.x1], [rect.y0, rect.y1]);
        let corners = xs.into_iter().flat_map(|x| {
            ys.into_iter().flat_map(move |y| {
                [low, high].map(|elevation| self.lift(x as f64, y as f64, elevation))
            })
        });
        let column = Bounds3::of(corners);
        let room = MARGIN_PX * self.pixel_size();
        Bounds3 { min: column.min - room, max: column.max + room }
    }

    /// Column, row (px) and elevation (m) range of a box: exact up to rounding, because projecting is affine.
    pub fn project_bounds(&self, bounds: &Bounds3) -> Bounds3 {
        if bounds.is_empty() {
            return Bounds3::EMPTY;
        }
        Bounds3::of(bounds.corners().map(|c| self.project(c)))
    }
}
