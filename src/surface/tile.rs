//! [`SurfaceTile`].

use glam::DVec3;

use crate::geom::{Coordinates, FaceId, HaloRect, PixelRect};

/// A triangle that at least one pixel of a tile shows.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceFace {
    /// Indices of its corners in [`SurfaceTile::vertices`].
    pub corners: [u32; 3],
    /// Its id.
    pub id: FaceId,
    /// Twice its area vector, m², on the side of the mosaic's viewer.
    pub normal: DVec3,
}

/// The surface that a rectangle of the mosaic shows: one value a pixel, `height × width`, row-major.
#[derive(Debug, Clone, Default)]
pub struct SurfaceTile {
    /// The rectangle, mosaic pixels.
    pub rect: PixelRect,
    /// The part of it that is to be coloured; what lies around it tells where photos begin and end to see the surface.
    pub inner: PixelRect,
    /// Elevation above the frame's plane or cylinder, or depth in a perspective view, metres; NaN where there is no
    /// surface.
    pub elevations: Vec<f64>,
    /// Index in [`Self::faces`]; [`Self::NO_FACE`] where there is no surface.
    pub faces_at: Vec<u32>,
    /// The surface point at the pixel's centre, local frame; NaN where there is no surface.
    pub points: Coordinates,
    /// Of a cylinder or a perspective view: the direction of each pixel's line over the area that the pixel covers there,
    /// per m²; empty for a plane, where they are the same everywhere. The length of the direction is 1 where the area is
    /// square to it, else that which has a component of 1 square to the area.
    pub lines: Coordinates,
    /// The triangles shown; once, or once for each of their sides.
    pub faces: Vec<SurfaceFace>,
    /// Their vertices, local frame.
    pub vertices: Vec<DVec3>,
}

impl SurfaceTile {
    /// Stands in [`Self::faces_at`] for "no surface".
    pub const NO_FACE: u32 = u32::MAX;

    /// The face shown at pixel `k` of the tile, if there is one.
    ///
    /// # Panics
    /// If `k` is not below the number of pixels.
    #[inline]
    pub fn face_at(&self, k: usize) -> Option<&SurfaceFace> {
        match self.faces_at[k] {
            Self::NO_FACE => None,
            f => Some(&self.faces[f as usize]),
        }
    }

    /// The pixel of the tile at a column and row of the mosaic.
    ///
    /// # Panics
    /// If it may not be in the tile.
    #[inline]
    pub fn pixel_at(&self, x: i64, y: i64) -> usize {
        let inside = |v: i64| usize::try_from(v).expect("inside the tile");
        inside(y - self.rect.y0) * self.rect.width() + inside(x - self.rect.x0)
    }

    /// The pixel of the tile that is pixel `k`, row-major, of `part`, which lies in it.
    #[inline]
    pub fn pixel_in(&self, part: PixelRect, k: usize) -> usize {
        let (row, column) = (k / part.width(), k % part.width());
        self.pixel_at(part.x0, part.y0) + row * self.rect.width() + column
    }

    /// The rectangle with the part that is to be coloured.
    pub fn halo(&self) -> HaloRect {
        HaloRect { inner: self.inner, outer: self.rect }
    }

    /// The three corners of a face, local frame.
    #[inline]
    pub fn corners(&self, face: &SurfaceFace) -> [DVec3; 3] {
        face.corners.map(|v| self.vertices[v as usize])
    }

    /// Whether no pixel shows a surface.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }
}
