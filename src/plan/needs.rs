//! What the mosaic needs of each photo, before anything is rendered.

use glam::{DVec2, DVec3};

use super::Partitions;
use super::partitions::SlabFrame;
use super::{Base, Slab};
use crate::camera::{LocalPose, Photo};
use crate::frame::{Block, Mosaic};
use crate::geom::{Bounds2, Bounds3, PixelRect, Size};

/// Most boxes that stand for the mesh where the photos are few …
const MOST_BOXES: usize = 1 << 16;
/// … and where they are many …
const LEAST_BOXES: usize = 1 << 12;
/// … so that pairs of a box and a photo stay this few: about a second, were every photo to see every box.
const MOST_PAIRS: usize = 1 << 23;
/// Boxes, in the order of the mesh's curve, that are looked at together first.
const GROUP: usize = 32;
/// Side of the squares in which a photo's pixels are counted: that of the photo store's tiles.
const CELL_PX: u32 = 256;
/// Photo pixels added around what a box shows: taps of the interpolation, and the bend of distorted edges between samples.
const MARGIN_PX: f64 = 4.0;
/// Rays are sampled on a grid of so many steps a side to find what distortion makes of their rectangle.
const STEPS: u32 = 4;
/// Room for rounding, relative.
const ROUNDING: f64 = 1e-9;

/// What the mosaic needs of a photo, estimated from the bounds of the mesh's partitions. It chooses how a photo is
/// read and forecasts what that costs; no pixel depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PhotoNeed {
    /// The pixels of level 0 that may be sampled, a margin included, within the photo; perhaps none.
    pub rect: PixelRect,
    /// The finest pyramid level that is likely to be sampled.
    pub level: u32,
    /// Pixels of level 0 in the squares of 256 that may be touched, within the photo.
    pub pixels: u64,
}

/// What `rect` of the mosaic needs of each of `photos`, in their order; `None` where it is proven that nothing is.
///
/// 1. The boxes of the partitions are cut to the rectangle and to the mosaic's slab; in a large mesh several that follow one another
///    on its curve are merged.
/// 2. Each box is seen through the rectangle of rays (x/z, y/z) of its corners, cut to the lens's own. A photo needs
///    nothing if no box lies before it and meets that.
/// 3. What distortion makes of the rectangle, sampled, is counted in squares of 256 pixels.
/// 4. The level is that of the middle of the nearest box, as if its surface faced the photo.
///
/// Occlusion and the direction of faces are not looked at.
pub fn photo_needs(
    mesh: &impl Partitions,
    mosaic: &Mosaic,
    rect: &PixelRect,
    photos: &[Photo],
) -> Vec<Option<PhotoNeed>> {
    let limit = (MOST_PAIRS / photos.len().max(1)).clamp(LEAST_BOXES, MOST_BOXES);
    let boxes = boxes(mesh, mosaic, rect, limit);
    let groups: Vec<_> = boxes.chunks(GROUP).map(|g| (Hull::around(g), g)).collect();
    let need = |photo: &Photo| {
        let view = View::new(photo, mesh.origin());
        let mut count = Count::new(photo.lens.size());
        for (around, members) in &groups {
            if view.rays(around).is_some() {
                members.iter().for_each(|hull| view.add(hull, mosaic.pixel_size, &mut count));
            }
        }
        count.need()
    };
    photos.iter().map(need).collect()
}

/// The corners of a part of the mesh, local frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hull {
    pub(super) corners: [DVec3; 8],
}

impl Hull {
    /// The axis-aligned box that holds some hulls.
    fn around(hulls: &[Self]) -> Self {
        let all = Bounds3::of(hulls.iter().flat_map(|h| h.corners));
        Self { corners: all.corners() }
    }
}

/// At most about `limit` boxes that hold all of the mesh that `rect` of the mosaic may show.
fn boxes(mesh: &impl Partitions, mosaic: &Mosaic, rect: &PixelRect, limit: usize) -> Vec<Hull> {
    let Some(plane) = mosaic.plane() else { return boxes_of_rays(mesh, mosaic, rect, limit) };
    let base = Base::Plane(plane);
    let frame = SlabFrame::new(Slab { base, elevation: mosaic.slab }, mesh.origin());
    // Pixels around: room for rounding.
    let [left, _, _, top] = mosaic.extent;
    let [x0, x1, y0, y1] =
        [rect.x0, rect.x1, rect.y0, rect.y1].map(|p| p as f64 * mosaic.pixel_size);
    let [u0, v0, u1, v1] = [left + x0, top - y1, left + x1, top - y0];
    let [low, high] = mosaic.slab;
    let room = DVec3::splat(2.0 * mosaic.pixel_size);
    let shown =
        Bounds3 { min: DVec3::new(u0, v0, low) - room, max: DVec3::new(u1, v1, high) + room };
    let merged = mesh.count().div_ceil(limit).max(1);
    let starts = (0..mesh.count()).step_by(merged);
    let hulls = starts.filter_map(|first| {
        let members = (first..mesh.count().min(first + merged)).map(|k| mesh.bounds(k));
        let meets = |b: &Bounds3| frame.project_box(b).intersects(&shown);
        let all = members.filter(meets).fold(Bounds3::EMPTY, Bounds3::union);
        let projected = frame.project_box(&all);
        if all.is_empty() {
            None
        } else if shown.union(projected) == shown {
            Some(Hull { corners: all.corners() })
        } else {
            let (min, max) = (projected.min.max(shown.min), projected.max.min(shown.max));
            Some(Hull { corners: Bounds3 { min, max }.corners().map(|c| frame.lift(c)) })
        }
    });
    hulls.collect()
}

/// The same for a cylinder or a perspective view: whole boxes.
fn boxes_of_rays(
    mesh: &impl Partitions,
    mosaic: &Mosaic,
    rect: &PixelRect,
    limit: usize,
) -> Vec<Hull> {
    let local = mosaic.local(mesh.origin());
    let whole = Block::outline(*rect);
    let merged = mesh.count().div_ceil(limit).max(1);
    let starts = (0..mesh.count()).step_by(merged);
    let hulls = starts.filter_map(|first| {
        let members = (first..mesh.count().min(first + merged)).map(|k| mesh.bounds(k));
        let shown = members.filter(|b| whole.may_be_shown(&local, b));
        let all = shown.fold(Bounds3::EMPTY, Bounds3::union);
        (!all.is_empty()).then(|| Hull { corners: all.corners() })
    });
    hulls.collect()
}

/// A photo in the mesh's local frame.
pub(super) struct View<'a> {
    photo: &'a Photo,
    pose: LocalPose,
}

impl<'a> View<'a> {
    pub(super) fn new(photo: &'a Photo, origin: DVec3) -> Self {
        Self { photo, pose: photo.pose.relative_to(origin) }
    }

    /// Bounds of the rays under which the hull may be seen within the photo; `None`: it is proven that it is not.
    pub(super) fn rays(&self, hull: &Hull) -> Option<Bounds2> {
        let all = Bounds2 { min: DVec2::NEG_INFINITY, max: DVec2::INFINITY };
        let frame = self.photo.lens.ray_bounds().unwrap_or(all);
        let corners = hull.corners.map(|c| self.pose.camera_from_local(c));
        let size = corners.iter().map(|q| q.abs().max_element()).fold(0.0, f64::max);
        let room = ROUNDING * size;
        if corners.iter().all(|q| q.z <= -room) {
            return None;
        }
        let beyond = |side: &dyn Fn(DVec3) -> f64| {
            corners.iter().all(|&q| side(q) < -room * (1.0 + frame.max.abs().max_element()))
        };
        let sides: [&dyn Fn(DVec3) -> f64; 4] = [
            &|q| q.x - frame.min.x * q.z,
            &|q| frame.max.x * q.z - q.x,
            &|q| q.y - frame.min.y * q.z,
            &|q| frame.max.y * q.z - q.y,
        ];
        if self.photo.lens.ray_bounds().is_some() && sides.into_iter().any(beyond) {
            return None;
        }
        if corners.iter().any(|q| q.z <= room) {
            return Some(frame);
        }
        let seen = Bounds2::of(corners.map(|q| q.truncate() / q.z));
        let grown =
            DVec2::splat(ROUNDING * (1.0 + seen.min.abs().max(seen.max.abs()).max_element()));
        let cut = Bounds2 {
            min: (seen.min - grown).max(frame.min),
            max: (seen.max + grown).min(frame.max),
        };
        (!cut.is_empty()).then_some(cut)
    }

    /// Counts what the photo shows of a hull.
    fn add(&self, hull: &Hull, pixel_size: f64, count: &mut Count) {
        let Some(rays) = self.rays(hull) else { return };
        let middle = hull.corners.iter().sum::<DVec3>() / 8.0;
        let depth = self.pose.camera_from_local(middle).z;
        let focal_px = self.photo.lens.focal_px();
        let footprint =
            if depth > 0.0 { pixel_size * (focal_px.x * focal_px.y).sqrt() / depth } else { 0.0 };
        count.add(self.positions(rays), level(footprint));
    }

    /// Bounds of the photo positions of a rectangle of rays; the whole photo where they cannot be told.
    fn positions(&self, rays: Bounds2) -> Bounds2 {
        let lens = &self.photo.lens;
        let size = DVec2::new(lens.size().width.into(), lens.size().height.into());
        let whole = Bounds2 { min: DVec2::ZERO, max: size };
        if !(rays.min.is_finite() && rays.max.is_finite()) {
            return whole;
        }
        let at = |i: u32, j: u32| {
            let t = DVec2::new(f64::from(i), f64::from(j)) / f64::from(STEPS);
            lens.photo_from_ray(rays.min + t * (rays.max - rays.min))
        };
        let steps = (0..=STEPS).flat_map(|i| (0..=STEPS).map(move |j| (i, j)));
        let found = Bounds2::of(steps.filter_map(|(i, j)| at(i, j)));
        if found.is_empty() { whole } else { found }
    }
}

/// ⌊log₂⌋ of a footprint in photo pixels, at least 0.
fn level(footprint: f64) -> u32 {
    (0..32).take_while(|&l| footprint >= 2_f64.powi(l + 1)).count().try_into().unwrap_or(0)
}

/// What was found of one photo.
struct Count {
    size: Size,
    found: bool,
    level: u32,
    rect: PixelRect,
    /// Whether a square is touched, row by row.
    cells: Vec<bool>,
}

impl Count {
    fn new(size: Size) -> Self {
        let cells =
            u64::from(size.width.div_ceil(CELL_PX)) * u64::from(size.height.div_ceil(CELL_PX));
        let cells = vec![false; usize::try_from(cells).unwrap_or(0)];
        Self { size, found: false, level: u32::MAX, rect: PixelRect::default(), cells }
    }

    #[expect(clippy::cast_possible_truncation, reason = "a photo position, clamped to the photo")]
    fn add(&mut self, positions: Bounds2, level: u32) {
        self.found = true;
        let Size { width, height } = self.size;
        let end = DVec2::new(width.into(), height.into());
        let min = (positions.min - MARGIN_PX).floor().clamp(DVec2::ZERO, end);
        let max = (positions.max + MARGIN_PX).ceil().clamp(DVec2::ZERO, end);
        let rect = PixelRect::new(min.x as i64, min.y as i64, max.x as i64, max.y as i64);
        if rect.is_empty() {
            return;
        }
        self.level = self.level.min(level);
        let old = if self.rect.is_empty() { rect } else { self.rect };
        self.rect = PixelRect::new(
            rect.x0.min(old.x0),
            rect.y0.min(old.y0),
            rect.x1.max(old.x1),
            rect.y1.max(old.y1),
        );
        let columns = width.div_ceil(CELL_PX) as usize;
        let cell = |at: i64| usize::try_from(at / i64::from(CELL_PX)).unwrap_or(0);
        for row in self.cells.chunks_mut(columns).take(cell(rect.y1 - 1) + 1).skip(cell(rect.y0)) {
            row[cell(rect.x0)..=cell(rect.x1 - 1)].fill(true);
        }
    }

    fn need(&self) -> Option<PhotoNeed> {
        let side = i64::from(CELL_PX);
        let squares = self.size.rect().blocks(side).zip(&self.cells);
        let pixels = squares.filter(|(_, touched)| **touched).map(|(cell, _)| cell.area() as u64);
        let level = if self.level == u32::MAX { 0 } else { self.level };
        self.found.then(|| PhotoNeed { rect: self.rect, level, pixels: pixels.sum() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::partitions::soup::Soup;
    use super::*;
    use crate::camera::{Lens, LensModel, PhotoId, Pose};
    use crate::frame::Plane;

    const ORIGIN: DVec3 = DVec3::new(5e5, 4e6, 100.0);

    /// Looks straight down on the local point (x, y, 0) from 10 m, f = 1000 px, 2000 × 1000 px: 20 m × 10 m of ground.
    fn nadir(x: f64, y: f64, k1: f64) -> Photo {
        let params = [1000.0, 1000.0, 500.0, k1];
        let lens = Lens::new(LensModel::SimpleRadial, Size::new(2000, 1000), &params).unwrap();
        let mut pose = Pose::from_colmap([0.0, 1.0, 0.0, 0.0], DVec3::ZERO).unwrap();
        pose.centre_ground = ORIGIN + DVec3::new(x, y, 10.0);
        Photo { id: PhotoId(0), name: "a.jpg".into(), lens, pose }
    }

    /// Level ground, 100 m × 100 m about the origin, in faces of 1 m, one partition each.
    fn ground() -> Soup {
        let p = |i: i32, j: i32| DVec3::new(f64::from(i), f64::from(j), 0.0);
        let cells = (-50..50).flat_map(|i| (-50..50).map(move |j| (i, j)));
        let faces: Vec<_> = cells
            .flat_map(|(i, j)| {
                [[p(i, j), p(i + 1, j), p(i + 1, j + 1)], [p(i, j), p(i + 1, j + 1), p(i, j + 1)]]
            })
            .collect();
        Soup::new(ORIGIN, &faces, 2)
    }

    fn mosaic(extent: [f64; 4], pixel_size: f64) -> Mosaic {
        let [u0, v0, u1, v1] = extent;
        let extent = [u0 + 5e5, v0 + 4e6, u1 + 5e5, v1 + 4e6];
        let slab = [f64::NEG_INFINITY, f64::INFINITY];
        Mosaic::new(Plane::top(), pixel_size, extent, slab).unwrap()
    }

    fn need(extent: [f64; 4], photo: &Photo) -> Option<PhotoNeed> {
        let mosaic = mosaic(extent, 0.01);
        let whole = mosaic.size.rect();
        photo_needs(&ground(), &mosaic, &whole, std::slice::from_ref(photo)).remove(0)
    }

    #[test]
    fn a_mosaic_around_the_photo_needs_all_of_it() {
        let all = PixelRect::new(0, 0, 2000, 1000);
        let whole = PhotoNeed { rect: all, level: 0, pixels: 2_000_000 };
        assert_eq!(need([-50.0, -50.0, 50.0, 50.0], &nadir(0.0, 0.0, 0.0)), Some(whole));
    }

    #[test]
    fn a_small_mosaic_needs_the_part_that_shows_it_with_a_margin() {
        // 1 m × 1 m at (3, 2): columns 1000 + 300 to 400, rows 500 − 300 to 200.
        let found = need([3.0, 2.0, 4.0, 3.0], &nadir(0.0, 0.0, 0.0)).unwrap();
        let shown = PixelRect::new(1300, 200, 1400, 300);
        assert!(found.rect.contains(&shown), "{found:?}");
        assert!(PixelRect::new(1290, 190, 1410, 310).contains(&found.rect), "{found:?}");
        // Cells 5 of 8 across, 0 and 1 of 4 down.
        assert_eq!(found.pixels, 256 * 512);
    }

    #[test]
    fn a_photo_elsewhere_behind_or_looking_away_is_not_needed() {
        let extent = [0.0, 0.0, 20.0, 20.0];
        assert!(need(extent, &nadir(29.0, 10.0, 0.0)).is_some());
        assert_eq!(need(extent, &nadir(31.0, 10.0, 0.0)), None);
        assert_eq!(need(extent, &nadir(10.0, -6.0, 0.0)), None);
        let mut away = nadir(10.0, 10.0, 0.0);
        away.pose = Pose::from_colmap([1.0, 0.0, 0.0, 0.0], DVec3::ZERO).unwrap();
        away.pose.centre_ground = ORIGIN + DVec3::new(10.0, 10.0, 10.0);
        assert_eq!(need(extent, &away), None);
    }

    #[test]
    fn every_position_that_shows_the_mosaic_is_in_the_rectangle_whatever_the_distortion() {
        for k1 in [-0.3, -0.1, 0.0, 0.2] {
            for (x, y) in [(0.0, 0.0), (7.0, -3.0), (-12.0, 5.5)] {
                let photo = nadir(x, y, k1);
                let found = need([-4.0, -4.0, 6.0, 5.0], &photo);
                let pose = photo.pose.relative_to(ORIGIN);
                for (i, j) in (0..=50).flat_map(|i| (0..=45).map(move |j| (i, j))) {
                    let point = DVec3::new(f64::from(i) * 0.2 - 4.0, f64::from(j) * 0.2 - 4.0, 0.0);
                    let q = pose.camera_from_local(point);
                    let Some(at) = photo.lens.photo_from_ray(q.truncate() / q.z) else { continue };
                    if photo.lens.contains(at) {
                        let r = found.unwrap().rect;
                        let (low, high) = (
                            DVec2::new(r.x0 as f64, r.y0 as f64),
                            DVec2::new(r.x1 as f64, r.y1 as f64),
                        );
                        assert!(at.cmpge(low).all() && at.cmple(high).all(), "{k1} {at} {r:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_coarse_mosaic_samples_a_coarse_level() {
        // A photo pixel covers 1 cm.
        let of = |size| {
            let mosaic = mosaic([-5.0, -5.0, 5.0, 5.0], size);
            photo_needs(&ground(), &mosaic, &mosaic.size.rect(), &[nadir(0.0, 0.0, 0.0)])
        };
        let levels = [0.005, 0.0199, 0.021, 0.041, 0.1].map(|size| of(size)[0].unwrap().level);
        assert_eq!(levels, [0, 0, 1, 2, 3]);
    }

    #[test]
    fn a_part_of_the_mosaic_needs_what_a_mosaic_of_that_part_needs() {
        let photo = nadir(0.0, 0.0, -0.1);
        let whole = mosaic([-20.0, -20.0, 20.0, 20.0], 0.01);
        // u 3 to 4, v 2 to 3.
        let part = PixelRect::new(2300, 1700, 2400, 1800);
        let found = photo_needs(&ground(), &whole, &part, std::slice::from_ref(&photo)).remove(0);
        assert_eq!(found, need([3.0, 2.0, 4.0, 3.0], &photo));
        let beside = PixelRect::new(0, 0, 500, 500);
        assert_eq!(photo_needs(&ground(), &whole, &beside, &[photo]), [None]);
    }

    #[test]
    fn merged_boxes_need_no_less() {
        let (mesh, photo) = (ground(), nadir(3.0, 2.0, 0.0));
        let mosaic = mosaic([-4.0, -4.0, 6.0, 5.0], 0.01);
        let whole = mosaic.size.rect();
        let one = photo_needs(&mesh, &mosaic, &whole, std::slice::from_ref(&photo))[0].unwrap();
        let view = View::new(&photo, ORIGIN);
        let mut count = Count::new(photo.lens.size());
        let few = boxes(&mesh, &mosaic, &whole, 100);
        assert!(few.len() <= 100);
        for hull in &few {
            view.add(hull, 0.01, &mut count);
        }
        let merged = count.need().unwrap();
        assert!(merged.rect.contains(&one.rect) && merged.pixels >= one.pixels);
    }
}
