//! [`LocalCylinder`]: the grid of pixels on a development, in local coordinates.
//!
//! The line of a pixel is radial: it begins on the axis, square to it, and faces are not approximated on it. u grows
//! with the angle counter-clockwise, as seen from the axis's tip, if the viewer is outside, against it if inside.

use glam::DVec3;

use super::local::PixelRay;
use super::mosaic::Mosaic;
use super::spec::{Cylinder, Facing};
use crate::geom::{Bounds3, Coordinates, PixelRect, held_bytes};

/// Room for rounding, pixels: far more than what angles may err.
const MARGIN_PX: f64 = 1e-3;

/// A mosaic of a cylinder, related to local coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalCylinder {
    /// Where v = 0 on the axis.
    origin: DVec3,
    axis: DVec3,
    zero: DVec3,
    /// A quarter turn from `zero`.
    across: DVec3,
    radius: f64,
    /// +1 outside, −1 inside.
    sense: f64,
    pixel_size: f64,
    u_min: f64,
    v_max: f64,
    slab: [f64; 2],
}

/// A point as the cylinder has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AroundAxis {
    /// −π to π.
    pub angle: f64,
    /// Metres from the axis.
    pub distance: f64,
    /// Metres along the axis.
    pub v: f64,
}

impl Cylinder {
    /// The cylinder in the coordinates `ground − origin_ground`, with pixels of a metre from u = `u_min`, v = 0 on.
    pub fn local(&self, origin_ground: DVec3, u_min: f64) -> LocalCylinder {
        let slab = self.elevation.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        LocalCylinder::with(self, 1.0, [u_min, 0.0], slab, origin_ground)
    }
}

impl LocalCylinder {
    pub(super) fn new(cylinder: &Cylinder, mosaic: &Mosaic, origin_ground: DVec3) -> Self {
        let [u_min, _, _, v_max] = mosaic.extent;
        Self::with(cylinder, mosaic.pixel_size, [u_min, v_max], mosaic.slab, origin_ground)
    }

    fn with(
        cylinder: &Cylinder,
        pixel_size: f64,
        [u_min, v_max]: [f64; 2],
        slab: [f64; 2],
        origin_ground: DVec3,
    ) -> Self {
        let Cylinder { origin, axis, zero, radius, facing, .. } = *cylinder;
        Self {
            origin: origin - origin_ground,
            axis,
            zero,
            across: axis.cross(zero),
            radius,
            sense: if facing == Facing::Outside { 1.0 } else { -1.0 },
            pixel_size,
            u_min,
            v_max,
            slab,
        }
    }

    /// `[min, max]` of the elevations shown, metres.
    pub fn slab(&self) -> [f64; 2] {
        self.slab
    }

    /// Whether of two points on a line the one nearer to the axis is shown.
    pub fn shows_nearest(&self) -> bool {
        self.sense < 0.0
    }

    /// Elevation at a distance from the axis.
    #[inline]
    pub fn elevation(&self, distance: f64) -> f64 {
        self.sense * (distance - self.radius)
    }

    /// Distance from the axis at an elevation.
    #[inline]
    pub fn distance(&self, elevation: f64) -> f64 {
        self.radius + self.sense * elevation
    }

    /// The line through a place of the mosaic.
    pub fn ray(&self, x: f64, y: f64) -> PixelRay {
        PixelRay { origin: self.on_axis(y), direction: self.direction(x) }
    }

    /// The point of the axis beside a row.
    fn on_axis(&self, y: f64) -> DVec3 {
        self.origin + self.axis * (self.v_max - y * self.pixel_size)
    }

    /// The direction through a column.
    fn direction(&self, x: f64) -> DVec3 {
        let u = self.u_min + x * self.pixel_size;
        let angle = self.sense * (u / self.radius);
        self.zero * libm::cos(angle) + self.across * libm::sin(angle)
    }

    /// A point of the local frame as the cylinder has it.
    #[inline]
    pub fn around_axis(&self, point: DVec3) -> AroundAxis {
        let d = point - self.origin;
        let (x, y) = (d.dot(self.zero), d.dot(self.across));
        AroundAxis {
            angle: libm::atan2(y, x),
            distance: (x * x + y * y).sqrt(),
            v: d.dot(self.axis),
        }
    }

    /// A full turn, pixels.
    pub(super) fn turn_px(&self) -> f64 {
        2.0 * std::f64::consts::PI * self.radius / self.pixel_size
    }

    fn column(&self, angle: f64) -> f64 {
        (self.sense * angle * self.radius - self.u_min) / self.pixel_size
    }

    fn row(&self, v: f64) -> f64 {
        (self.v_max - v) / self.pixel_size
    }

    /// Column and row (px) and elevation (m) of a local point; the column within a turn of the first.
    pub fn project(&self, point: DVec3) -> DVec3 {
        let at = self.around_axis(point);
        let x = self.column(at.angle).rem_euclid(self.turn_px());
        DVec3::new(x, self.row(at.v), self.elevation(at.distance))
    }

    /// The direction to the viewer at a local point, of any length.
    pub fn towards_viewer(&self, point: DVec3) -> DVec3 {
        let d = point - self.origin;
        self.sense * (d - self.axis * d.dot(self.axis))
    }

    pub(super) fn pixel_area(&self, point: DVec3) -> f64 {
        self.area_at(self.around_axis(point).distance)
    }

    /// Area of a pixel at a distance from the axis, square to its line, m².
    #[inline]
    pub fn area_at(&self, distance: f64) -> f64 {
        self.pixel_size * self.pixel_size * (distance / self.radius)
    }

    /// Angle range (from the first to the second, perhaps beyond ± π; `None`: any), v range and distance range of a box.
    fn of_box(&self, bounds: &Bounds3) -> (Option<[f64; 2]>, [f64; 2], [f64; 2]) {
        let centre = self.around_axis(0.5 * (bounds.min + bounds.max));
        let reach = 0.5 * (bounds.max - bounds.min).length() * (1.0 + 1e-9) + 1e-9;
        let (v_min, v_max) = bounds.linear_range(self.axis, -self.axis.dot(self.origin));
        let is_clear = reach < 0.999 * centre.distance;
        let half = is_clear.then(|| libm::asin(reach / centre.distance));
        let angles = half.map(|half| [centre.angle - half, centre.angle + half]);
        let distances = [(centre.distance - reach).max(0.0), centre.distance + reach];
        (angles, [v_min, v_max], distances)
    }

    fn elevations(&self, [near, far]: [f64; 2]) -> [f64; 2] {
        let (a, b) = (self.elevation(near), self.elevation(far));
        [a.min(b), a.max(b)]
    }

    pub(super) fn may_show(&self, bounds: &Bounds3, rect: &PixelRect) -> bool {
        let (angles, [v_min, v_max], distances) = self.of_box(bounds);
        let [low, high] = self.elevations(distances);
        let room = MARGIN_PX * self.pixel_size;
        self.row(v_max) <= rect.y1 as f64 + MARGIN_PX
            && self.row(v_min) >= rect.y0 as f64 - MARGIN_PX
            && high >= self.slab[0] - room
            && low <= self.slab[1] + room
            && angles.is_none_or(|[from, to]| !self.columns([from, to], rect).is_empty())
    }

    /// Columns, rows (px) and elevations (m) of what is in a box, or more; the first column within a turn of the
    /// mosaic's.
    pub fn box_range(&self, bounds: &Bounds3) -> Bounds3 {
        let (angles, [v_min, v_max], distances) = self.of_box(bounds);
        let [low, high] = self.elevations(distances);
        let turn = self.turn_px();
        let (x0, x1) = match angles {
            Some([from, to]) => {
                let (a, b) = (self.column(from), self.column(to));
                let x0 = a.min(b).rem_euclid(turn);
                (x0, x0 + (a - b).abs())
            }
            None => (0.0, turn),
        };
        Bounds3 {
            min: DVec3::new(x0, self.row(v_max), low),
            max: DVec3::new(x1, self.row(v_min), high),
        }
    }

    /// The ranges of columns of `rect`, first and one past the last, whose centres may lie in a range of angles.
    #[expect(clippy::cast_possible_truncation, reason = "clamped to the rectangle")]
    fn columns(&self, [from, to]: [f64; 2], rect: &PixelRect) -> Vec<[i64; 2]> {
        let (a, b) = (self.column(from), self.column(to));
        let (x0, x1) = (a.min(b) - 0.5 - MARGIN_PX, a.max(b) - 0.5 + MARGIN_PX);
        let turn = self.turn_px();
        let (first, last) = (rect.x0 as f64, (rect.x1 - 1) as f64);
        let mut found = Vec::new();
        let mut k = ((first - x1) / turn).ceil();
        while x0 + k * turn <= last {
            let from = (x0 + k * turn).ceil().max(first);
            let to = (x1 + k * turn).floor().min(last);
            if from <= to {
                found.push([from as i64, to as i64 + 1]);
            }
            k += 1.0;
        }
        found
    }

    /// The pixels of `rect` that a triangle may touch.
    #[expect(clippy::cast_possible_truncation, reason = "clamped to the rectangle")]
    pub fn pixels_of(
        &self,
        corners: [AroundAxis; 3],
        rect: &PixelRect,
        mut visit: impl FnMut(PixelRect),
    ) {
        let [a, b, c] = corners;
        let (v_min, v_max) = (a.v.min(b.v).min(c.v), a.v.max(b.v).max(c.v));
        let (first, last) = (rect.y0 as f64, (rect.y1 - 1) as f64);
        let y0 = (self.row(v_max) - 0.5 - MARGIN_PX).ceil().max(first);
        let y1 = (self.row(v_min) - 0.5 + MARGIN_PX).floor().min(last);
        if y0 > y1 {
            return;
        }
        let (y0, y1) = (y0 as i64, y1 as i64 + 1);
        let Some(angles) = AroundAxis::angles_of(corners) else {
            return visit(PixelRect::new(rect.x0, y0, rect.x1, y1));
        };
        for [x0, x1] in self.columns(angles, rect) {
            visit(PixelRect::new(x0, y0, x1, y1));
        }
    }

    /// u at an angle, metres.
    pub fn along(&self, angle: f64) -> f64 {
        self.sense * angle * self.radius
    }
}

impl AroundAxis {
    /// The range of angles of a triangle, perhaps beyond ± π; `None` if it may reach around the axis.
    pub fn angles_of([a, b, c]: [Self; 3]) -> Option<[f64; 2]> {
        // A triangle beside the axis is seen from it under less than half a turn.
        let [b, c] = [b, c].map(|p| half_turn(p.angle - a.angle));
        let (from, to) = (b.min(c).min(0.0), b.max(c).max(0.0));
        (to - from < 0.999 * std::f64::consts::PI).then_some([a.angle + from, a.angle + to])
    }
}

/// An angle between −2π and 2π, brought to −π to π.
fn half_turn(angle: f64) -> f64 {
    let pi = std::f64::consts::PI;
    if angle > pi {
        angle - 2.0 * pi
    } else if angle < -pi {
        angle + 2.0 * pi
    } else {
        angle
    }
}

/// The lines of a rectangle of pixels.
#[derive(Debug, Clone, Default)]
pub struct CylinderBlock {
    /// The point of the axis beside each row's centre.
    origins: Vec<DVec3>,
    /// The direction through each column's centre.
    directions: Coordinates,
}

impl CylinderBlock {
    pub(super) fn set(&mut self, cylinder: &LocalCylinder, rect: PixelRect) {
        self.origins.clear();
        self.origins.extend((rect.y0..rect.y1).map(|y| cylinder.on_axis(y as f64 + 0.5)));
        self.directions.clear();
        (rect.x0..rect.x1).for_each(|x| self.directions.push(cylinder.direction(x as f64 + 0.5)));
    }

    /// The line of a pixel, by its column and row in the rectangle.
    ///
    /// # Panics
    /// If it is outside.
    #[inline]
    pub fn ray(&self, column: usize, row: usize) -> PixelRay {
        PixelRay { origin: self.origins[row], direction: self.directions.at(column) }
    }

    pub(super) fn memory_bytes(&self) -> u64 {
        held_bytes(&self.origins) + self.directions.memory_bytes()
    }
}
