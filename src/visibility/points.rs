//! The points of a block that one photo may see: everything but occlusion.

use glam::DVec2;

use super::photo::ViewPhoto;
use super::sight::{Batch, Sight};
use crate::camera::RAYS;
use crate::geom::{Bounds2, Kernel, PixelRect, held_bytes, run_widest};
use crate::surface::SurfaceTile;

/// Side of a sub-block, mosaic pixels: the points of a block are listed sub-block by sub-block, so that sampling and
/// blending can run on small pieces. 64² samples of seven photos fit a second-level cache.
pub const SUB_BLOCK: i64 = 64;

/// A row of a sub-block is one batch.
const SIDE: usize = RAYS;
const _: () = assert!(SIDE as u64 == SUB_BLOCK.unsigned_abs());

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
pub(super) const LIMIT_SLACK: f32 = 1.0 + 8.0 * f32::EPSILON;

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
    entries: Entries,
    /// Bounds of the photo positions, pixels.
    photo_bounds: Option<Bounds2>,
}

/// What [`RayPoints`] and [`BlockPoints`] take of one row of a sub-block.
#[derive(Debug)]
struct Entries {
    x: [f32; SIDE],
    y: [f32; SIDE],
    /// 0 for a point that is not before the photo, or not in its frame.
    limit: [f32; SIDE],
    /// Index of the face in the surface tile.
    face: [u32; SIDE],
    place: [u16; SIDE],
}

impl Default for Entries {
    fn default() -> Self {
        let zero = [0.0; SIDE];
        Self { x: zero, y: zero, limit: zero, face: [0; SIDE], place: [0; SIDE] }
    }
}

/// Enters the points of a batch that are before the photo and in its frame.
struct Enter<'a> {
    photo: &'a ViewPhoto,
    batch: &'a Batch,
    /// The ray of the first such point of the block.
    origin: &'a mut Option<DVec2>,
    entries: &'a mut Entries,
    count: usize,
}

impl Kernel for Enter<'_> {
    type Output = ();

    #[inline(always)]
    #[expect(
        clippy::inline_always,
        clippy::cast_possible_truncation,
        reason = "a kernel; what rounding takes is more than made good by the slack"
    )]
    fn run(self) {
        let Self { photo, batch, origin: found, entries, count } = self;
        let (lens, focal) = (&photo.lens, photo.lens.focal_px());
        let (px, py) = (&batch.rays.photo_x[..count], &batch.rays.photo_y[..count]);
        let (depth, limit) = (&batch.depth[..count], &mut entries.limit[..count]);
        for k in 0..count {
            // Not a number, where there is no surface, is not in front.
            let is_before = (depth[k] > 0.0) & lens.contains(DVec2::new(px[k], py[k]));
            limit[k] = if is_before { depth[k] as f32 * LIMIT_SLACK } else { 0.0 };
        }
        let (ray_x, ray_y) = (&batch.rays.x[..count], &batch.rays.y[..count]);
        let Some(origin) = found.or_else(|| {
            let first = limit.iter().position(|&limit| limit > 0.0)?;
            Some(DVec2::new(ray_x[first], ray_y[first]))
        }) else {
            return;
        };
        *found = Some(origin);
        let (x, y) = (&mut entries.x[..count], &mut entries.y[..count]);
        for k in 0..count {
            x[k] = ((ray_x[k] - origin.x) * focal.x) as f32;
            y[k] = ((ray_y[k] - origin.y) * focal.y) as f32;
        }
    }
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
        self.photo_bounds = None;
        for sub in surface.halo().blocks(SUB_BLOCK) {
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
        let (first, count) = (surface.pixel_at(sub.x0, y), sub.width());
        let photo = sight.photo;
        self.batch.sight(photo, surface.points.range(first..first + count));
        photo.lens.photos_from_rays(&mut self.batch.rays, count);
        let entries = &mut self.entries;
        run_widest(Enter { photo, batch: &self.batch, origin, entries, count });
        // Those that are before the photo move up, without a branch: which they are cannot be foretold.
        let row = usize::try_from(y - sub.y0).expect("inside the sub-block") * SIDE;
        let mut kept = 0;
        for (k, &face) in surface.faces_at[first..first + count].iter().enumerate() {
            // A pixel without a face has no point either, so its limit is 0.
            let is_facing = self.facing.get(face as usize).copied().unwrap_or(false);
            let is_before = entries.limit[k] > 0.0;
            entries.x[kept] = entries.x[k];
            entries.y[kept] = entries.y[k];
            entries.limit[kept] = entries.limit[k];
            entries.face[kept] = face;
            entries.place[kept] = u16::try_from(row + k).expect("a sub-block has 2¹² pixels");
            kept += usize::from(is_facing) & usize::from(is_before);
        }
        if kept > 0 {
            // Neighbours in a row are neighbours in the photo: its ends tell enough.
            let (from, to) = (entries.place[0], entries.place[kept - 1]);
            for k in [from, to].map(|place| usize::from(place) - row) {
                let at = DVec2::new(self.batch.rays.photo_x[k], self.batch.rays.photo_y[k]);
                let bounds = self.photo_bounds.unwrap_or(Bounds2::EMPTY);
                self.photo_bounds = Some(bounds.including(at));
            }
        }
        rays.x.extend_from_slice(&entries.x[..kept]);
        rays.y.extend_from_slice(&entries.y[..kept]);
        rays.limit.extend_from_slice(&entries.limit[..kept]);
        let ids = entries.face[..kept].iter().map(|&f| surface.faces[f as usize].id.0);
        rays.face.extend(ids);
        self.places.extend_from_slice(&entries.place[..kept]);
    }

    fn count(&self) -> u32 {
        u32::try_from(self.places.len()).expect("a tile has fewer than 2³² pixels")
    }

    /// About the bounds of the photo positions of the points, pixels; `None` if there are none. They serve to fetch
    /// photos ahead: nothing is decided by them.
    pub fn photo_bounds(&self) -> Option<Bounds2> {
        self.photo_bounds
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
        surface.pixel_at(sub.x0, sub.y0) + place / SIDE * surface.rect.width() + place % SIDE
    }

    /// The places in sub-block `k` (in the order of [`HaloRect::blocks`](crate::geom::HaloRect::blocks)) that the
    /// photo sees, row × [`SUB_BLOCK`] + column, ascending.
    pub fn seen_in(&self, k: usize) -> impl Iterator<Item = u16> + '_ {
        let range = self.starts[k] as usize..self.starts[k + 1] as usize;
        let seen = &self.seen[range.clone()];
        self.places[range].iter().zip(seen).filter(|(_, seen)| **seen).map(|(&place, _)| place)
    }
}
