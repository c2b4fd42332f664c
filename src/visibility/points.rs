//! The points of a block that one photo may see: everything but occlusion.

use crate::geom::{FaceId, held_bytes};
use crate::surface::SurfaceTile;

use super::photo::{ViewPhoto, ray_of};

/// Side of a sub-block, mosaic pixels: the points of a block are listed sub-block by sub-block, so that sampling and
/// blending can run on small pieces. 64² samples of seven photos fit a second-level cache.
pub const SUB_BLOCK: i64 = 64;

/// A surface point in the frame of a photo, on the right side of its face.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockPoint {
    pub(super) x: f64,
    pub(super) y: f64,
    /// Depth before which a face occludes the point.
    pub(super) limit: f64,
    /// Position in [`BlockPoints`].
    pub(super) index: u32,
    pub(super) face: FaceId,
}

/// The points of one photo on their way from [`BlockPoints::start`] to [`PointCells::start`](super::PointCells::start).
#[derive(Debug, Default)]
pub struct RayPoints(pub(super) Vec<BlockPoint>);

/// The points of a block that a photo may see, in the order of the sub-blocks.
#[derive(Debug, Default)]
pub struct BlockPoints {
    /// Pixel of the surface tile of each point.
    pixels: Vec<u32>,
    seen: Vec<bool>,
    /// First point of each sub-block, and the number of points at the end.
    starts: Vec<u32>,
    facing: Vec<bool>,
}

impl RayPoints {
    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.0)
    }
}

impl BlockPoints {
    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.pixels)
            + held_bytes(&self.seen)
            + held_bytes(&self.starts)
            + held_bytes(&self.facing)
    }

    /// Lists the points of `surface` that lie before the photo, in its frame and on the right side of their face;
    /// until a face is found before it, each counts as seen. `tolerance_m` is ε; `rays` receives the points.
    ///
    /// # Panics
    /// If the tile has 2³² pixels or more.
    pub fn start(
        &mut self,
        surface: &SurfaceTile,
        photo: &ViewPhoto,
        tolerance_m: f64,
        rays: &mut RayPoints,
    ) {
        self.pixels.clear();
        self.seen.clear();
        self.starts.clear();
        rays.0.clear();
        self.facing.clear();
        self.facing.extend(surface.faces.iter().map(|f| {
            let [a, ..] = surface.corners(f);
            f.normal.dot(photo.pose.centre - a) > 0.0
        }));
        let rect = surface.rect;
        for sub in rect.blocks(SUB_BLOCK) {
            self.starts.push(self.count());
            for y in sub.y0..sub.y1 {
                let row = usize::try_from(y - rect.y0).expect("inside the tile") * rect.width();
                let from = row + usize::try_from(sub.x0 - rect.x0).expect("inside the tile");
                for pixel in from..from + sub.width() {
                    if let Some(point) = self.point(surface, photo, tolerance_m, pixel) {
                        rays.0.push(point);
                        self.pixels
                            .push(u32::try_from(pixel).expect("a tile has fewer than 2³² pixels"));
                    }
                }
            }
        }
        self.starts.push(self.count());
        self.seen.resize(self.pixels.len(), true);
    }

    #[inline]
    fn point(
        &self,
        surface: &SurfaceTile,
        photo: &ViewPhoto,
        tolerance_m: f64,
        pixel: usize,
    ) -> Option<BlockPoint> {
        let face = surface.faces_at[pixel];
        if face == SurfaceTile::NO_FACE || !self.facing[face as usize] {
            return None;
        }
        let q = photo.camera_from_local(surface.points[pixel]);
        if q.z <= 0.0 {
            return None;
        }
        let ray = ray_of(q);
        let position = photo.lens.photo_from_ray(ray)?;
        let limit = q.z * (1.0 - tolerance_m / q.length());
        let face = surface.faces[face as usize].id;
        photo.lens.contains(position).then_some(BlockPoint {
            x: ray.x,
            y: ray.y,
            limit,
            index: self.count(),
            face,
        })
    }

    fn count(&self) -> u32 {
        u32::try_from(self.pixels.len()).expect("a tile has fewer than 2³² pixels")
    }

    /// Whether the photo may see nothing of the block.
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Takes a point out of sight.
    #[inline]
    pub(super) fn hide(&mut self, index: u32) {
        self.seen[index as usize] = false;
    }

    /// The pixels of the surface tile, in ascending order within a row, that the photo sees in sub-block `k` (in the
    /// order of [`PixelRect::blocks`](crate::geom::PixelRect::blocks)).
    pub fn seen_in(&self, k: usize) -> impl Iterator<Item = usize> + '_ {
        let range = self.starts[k] as usize..self.starts[k + 1] as usize;
        range.filter(|&i| self.seen[i]).map(|i| self.pixels[i] as usize)
    }
}
