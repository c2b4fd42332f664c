//! [`LocalMosaic`]: a mosaic of any kind in local coordinates, and [`Block`]: the rays of some of its pixels.

use glam::DVec3;

use super::central::{CentralBlock, LocalCentral};
use super::cylinder::{CylinderBlock, LocalCylinder};
use super::local_plane::LocalPlane;
use crate::geom::{Bounds3, PixelRect};

/// A mosaic related to local coordinates (ground minus an origin).
#[derive(Debug, Clone, PartialEq)]
pub enum LocalMosaic {
    /// On a plane.
    Plane(LocalPlane),
    /// Of a cylinder.
    Cylinder(LocalCylinder),
    /// What a camera sees.
    Central(Box<LocalCentral>),
}

/// The line of a pixel: points are `origin + t · direction`, t > 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelRay {
    /// A point of the axis, or the perspective centre; local frame.
    pub origin: DVec3,
    /// Local frame; of unit length (cylinder), or of unit depth (perspective).
    pub direction: DVec3,
}

impl LocalMosaic {
    /// Column (px), row (px) and elevation (m) of a local point: a function of the point alone. Not numbers where a
    /// perspective view does not show it.
    #[inline]
    pub fn project(&self, point: DVec3) -> DVec3 {
        match self {
            Self::Plane(plane) => plane.project(point),
            Self::Cylinder(cylinder) => cylinder.project(point),
            Self::Central(central) => central.project(point),
        }
    }

    /// The local point at a column (px), row (px) and elevation (m); not a number where a perspective view has no ray.
    #[inline]
    pub fn lift(&self, x: f64, y: f64, elevation: f64) -> DVec3 {
        let on = |ray: PixelRay, t: f64| ray.origin + ray.direction * t;
        match self {
            Self::Plane(plane) => plane.lift(x, y, elevation),
            Self::Cylinder(c) => on(c.ray(x, y), c.distance(elevation)),
            Self::Central(c) => c.ray(x, y).map_or(DVec3::NAN, |ray| on(ray, elevation)),
        }
    }

    /// Whether the lines of all pixels are parallel: it is on a plane.
    pub fn is_parallel(&self) -> bool {
        matches!(self, Self::Plane(_))
    }

    /// `[min, max]` of the elevations shown, metres, perhaps infinite.
    #[inline]
    pub fn slab(&self) -> [f64; 2] {
        match self {
            Self::Plane(plane) => plane.slab(),
            Self::Cylinder(cylinder) => cylinder.slab(),
            Self::Central(central) => central.slab(),
        }
    }

    /// The direction to the viewer at a local point, of any length.
    pub fn towards_viewer(&self, point: DVec3) -> DVec3 {
        match self {
            Self::Plane(plane) => plane.towards_viewer(),
            Self::Cylinder(cylinder) => cylinder.towards_viewer(point),
            Self::Central(central) => central.centre() - point,
        }
    }

    /// Area that a pixel covers at a local point, square to the line to the viewer or as good as, m².
    pub fn pixel_area(&self, point: DVec3) -> f64 {
        match self {
            Self::Plane(plane) => plane.pixel_size() * plane.pixel_size(),
            Self::Cylinder(cylinder) => cylinder.pixel_area(point),
            Self::Central(central) => central.pixel_area(point),
        }
    }

    /// Column and row range (px) and elevation range (m) of what is in a box, or more; `None` if nothing of it can be
    /// shown.
    pub fn box_range(&self, bounds: &Bounds3) -> Option<Bounds3> {
        match self {
            Self::Plane(plane) => Some(plane.project_bounds(bounds)),
            Self::Cylinder(cylinder) => Some(cylinder.box_range(bounds)),
            Self::Central(central) => central.box_range(bounds),
        }
    }
}

/// A rectangle of a mosaic, and what is computed once for all faces over it.
#[derive(Debug, Clone, Default)]
pub struct Block {
    rect: PixelRect,
    cylinder: CylinderBlock,
    central: CentralBlock,
}

impl Block {
    /// A rectangle of `mosaic`.
    pub fn new(mosaic: &LocalMosaic, rect: PixelRect) -> Self {
        let mut block = Self::default();
        block.set(mosaic, rect);
        block
    }

    /// A rectangle alone, of any size: enough for [`may_be_shown`](Self::may_be_shown).
    pub fn outline(rect: PixelRect) -> Self {
        Self { rect, ..Self::default() }
    }

    /// Whether something inside `bounds` (local frame) may show at a pixel of the rectangle, judged by the mosaic alone
    /// without the rays of pixels; `false` is proven.
    pub fn may_be_shown(&self, mosaic: &LocalMosaic, bounds: &Bounds3) -> bool {
        match mosaic {
            LocalMosaic::Plane(plane) => plane.may_cover(bounds, &self.rect),
            LocalMosaic::Cylinder(cylinder) => cylinder.may_show(bounds, &self.rect),
            LocalMosaic::Central(central) => central.box_range(bounds).is_some(),
        }
    }

    /// Makes it another rectangle of `mosaic`.
    pub fn set(&mut self, mosaic: &LocalMosaic, rect: PixelRect) {
        self.rect = rect;
        match mosaic {
            LocalMosaic::Plane(_) => {}
            LocalMosaic::Cylinder(cylinder) => self.cylinder.set(cylinder, rect),
            LocalMosaic::Central(central) => self.central.set(central, rect),
        }
    }

    /// The rectangle, mosaic pixels.
    pub fn rect(&self) -> PixelRect {
        self.rect
    }

    /// Of a cylinder: its lines.
    pub fn cylinder(&self) -> &CylinderBlock {
        &self.cylinder
    }

    /// Of a perspective view: its rays.
    pub fn central(&self) -> &CentralBlock {
        &self.central
    }

    /// Whether something inside `bounds` (local frame) may show at a pixel of the block within the slab; `false` is
    /// proven.
    pub fn may_show(&self, mosaic: &LocalMosaic, bounds: &Bounds3) -> bool {
        match mosaic {
            LocalMosaic::Plane(plane) => plane.may_cover(bounds, &self.rect),
            LocalMosaic::Cylinder(cylinder) => cylinder.may_show(bounds, &self.rect),
            LocalMosaic::Central(central) => self.central.may_show(central, bounds),
        }
    }

    /// Bounds (local frame) of what the block may show within `bounds`.
    pub fn shown_bounds(&self, mosaic: &LocalMosaic, bounds: &Bounds3) -> Bounds3 {
        match mosaic {
            LocalMosaic::Plane(plane) => plane.column_bounds(bounds, &self.rect),
            _ => *bounds,
        }
    }

    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        self.cylinder.memory_bytes() + self.central.memory_bytes()
    }
}
