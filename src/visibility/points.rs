//! The points of a block that one photo may see: everything but occlusion.

use glam::DVec2;

use super::sight::{Batch, Sight};
use crate::camera::RAYS;
use crate::geom::{PixelRect, held_bytes};
use crate::surface::SurfaceTile;

/// Side of a sub-block, mosaic pixels: the points of a block are listed sub-block by sub-block, so that sampling and
/// blending can run on small pieces. 64² samples of seven photos fit a second-level cache.
pub const SUB_BLOCK: i64 = 64;

/// A row of a sub-block is one batch.
const SIDE: usize = RAYS;
const _: () = assert!(SIDE as i64 == SUB_BLOCK);

/// The points of one photo on their way from [`BlockPoints::start`] to [`PointCells::start`](super::PointCells::start),
/// one entry a point in each array.
#[derive(Debug, Default)]
pub struct RayPoints {
    /// A ray near those of the points.
    pub(super) origin: DVec2,
    /// Ray less `origin`, times the focal length: pixels of an undistorted photo.
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    /// At least the depth before which a face occludes the point, also when that face's depth is rounded to f32.
    pub(super) limit: Vec<f32>,
    /// Id of the point's own face.
    pub(super) face: Vec<u32>,
}

impl RayPoints {
    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.x) + held_bytes(&self.y) + held_bytes(&self.limit) + held_bytes(&self.face)
    }

    fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.limit.clear();
        self.face.clear();
    }
}

/// Part of a depth that a limit is raised by: more than rounding the limit and a face's depth to f32 can take away.
const LIMIT_SLACK: f32 = 1.0 + 8.0 * f32::EPSILON;

/// The points of a block that a photo may see, in the order of the sub-blocks.
#[derive(Debug, Default)]
pub struct BlockPoints {
    /// Place of each point in its sub-block: row × [`SUB_BLOCK`] + column.
    places: Vec<u16>,
    seen: Vec<bool>,
    /// First point of each sub-block, and the number of points at the end.
    starts: Vec<u32>,
    subs: Vec<PixelRect>,
    facing: Vec<bool>,
    batch: Batch,
}

impl BlockPoints {
    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.places)
            + held_bytes(&self.seen)
            + held_bytes(&self.starts)
            + held_bytes(&self.subs)
            + held_bytes(&self.facing)
    }

    /// Lists the points of the surface that lie before the photo, in its frame and on the right side of their face;
    /// until a face is found before it, each counts as seen. `rays` receives the points.
    ///
    /// # Panics
    /// If the tile has 2³² pixels or more.
    pub fn start(&mut self, sight: &Sight<'_>, rays: &mut RayPoints) {
        self.places.clear();
        self.seen.clear();
        self.starts.clear();
        self.subs.clear();
        rays.clear();
        let (surface, centre) = (sight.surface, sight.photo.pose.centre);
        self.facing.clear();
        self.facing.extend(surface.faces.iter().map(|f| {
            let [a, ..] = surface.corners(f);
            f.normal.dot(centre - a) > 0.0
        }));
        let mut origin = None;
        for sub in surface.rect.blocks(SUB_BLOCK) {
            self.starts.push(self.count());
            self.subs.push(sub);
            for y in sub.y0..sub.y1 {
                self.row(sight, sub, y, &mut origin, rays);
            }
        }
        rays.origin = origin.unwrap_or_default();
        self.starts.push(self.count());
        self.seen.resize(self.places.len(), true);
    }

    /// Lists the points of row `y` of a sub-block.
    fn row(
        &mut self,
        sight: &Sight<'_>,
        sub: PixelRect,
        y: i64,
        origin: &mut Option<DVec2>,
        rays: &mut RayPoints,
    ) {
        let surface = sight.surface;
        let (first, count) = (pixel_at(surface, sub.x0, y), sub.width());
        let photo = sight.photo;
        self.batch.take(surface, first, count);
        self.batch.sight(photo, count);
        photo.lens.photos_from_rays(&mut self.batch.rays, count);
        let (batch, faces_at) = (&self.batch, &surface.faces_at[first..first + count]);
        let focal = photo.lens.focal_px();
        let row = usize::try_from(y - sub.y0).expect("inside the sub-block") * SIDE;
        for (k, &face) in faces_at.iter().enumerate() {
            let position = DVec2::new(batch.rays.photo_x[k], batch.rays.photo_y[k]);
            let depth = batch.depth[k];
            // Not a number, where there is no surface, is not in front.
            let is_before =
                depth > 0.0 && photo.lens.contains(position) && self.facing[face as usize];
            if !is_before {
                continue;
            }
            let ray = DVec2::new(batch.rays.x[k], batch.rays.y[k]);
            let at = ((ray - *origin.get_or_insert(ray)) * focal).as_vec2();
            rays.x.push(at.x);
            rays.y.push(at.y);
            #[expect(
                clippy::cast_possible_truncation,
                reason = "more than made good by the slack"
            )]
            rays.limit.push(depth as f32 * LIMIT_SLACK);
            rays.face.push(surface.faces[face as usize].id.0);
            self.places.push(u16::try_from(row + k).expect("a sub-block has 2¹² pixels"));
        }
    }

    fn count(&self) -> u32 {
        u32::try_from(self.places.len()).expect("a tile has fewer than 2³² pixels")
    }

    /// Whether the photo may see nothing of the block.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Takes a point out of sight.
    #[inline]
    pub(super) fn hide(&mut self, index: usize) {
        self.seen[index] = false;
    }

    /// The pixel of the surface tile of a point.
    pub(super) fn pixel(&self, surface: &SurfaceTile, index: usize) -> usize {
        let sub = self.starts.partition_point(|&start| start as usize <= index) - 1;
        let place = usize::from(self.places[index]);
        let sub = self.subs[sub];
        pixel_at(surface, sub.x0, sub.y0) + place / SIDE * surface.rect.width() + place % SIDE
    }

    /// The places in sub-block `k` (in the order of [`PixelRect::blocks`](crate::geom::PixelRect::blocks)) that the
    /// photo sees, row × [`SUB_BLOCK`] + column, ascending.
    pub fn seen_in(&self, k: usize) -> impl Iterator<Item = u16> + '_ {
        let range = self.starts[k] as usize..self.starts[k + 1] as usize;
        let seen = &self.seen[range.clone()];
        self.places[range].iter().zip(seen).filter(|(_, seen)| **seen).map(|(&place, _)| place)
    }
}

/// The pixel of the surface tile at a mosaic pixel of it.
fn pixel_at(surface: &SurfaceTile, x: i64, y: i64) -> usize {
    let rect = surface.rect;
    let inside = |v: i64| usize::try_from(v).expect("inside the tile");
    inside(y - rect.y0) * rect.width() + inside(x - rect.x0)
}
