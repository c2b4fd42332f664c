//! [`Survey`]: how much work lies where in a mosaic, estimated before it is rendered.

use glam::DVec3;
use serde::Serialize;

use super::Partitions;
use crate::Result;
use crate::camera::{LocalPose, Photo};
use crate::frame::Mosaic;
use crate::geom::{FaceBlock, PixelRect, Size};

/// Cells along the longer side of a mosaic, at most.
const CELLS: u32 = 128;
/// Side of the squares of cells that lend one another their views.
const SQUARE: usize = 6;
/// Partitions that are looked into: at most these …
const MOST_SAMPLES: usize = 2048;
/// … and at least these, …
const LEAST_SAMPLES: usize = 128;
/// … so that pairs of a face and a photo stay this few: a tenth of a second.
const MOST_PAIRS: usize = 1 << 20;
/// Cosine of the slant from which a face counts as on edge.
const ON_EDGE: f64 = 0.1;
/// Faces of a partition that are looked at.
const FACES: usize = 2;

/// The work of a mosaic, by cells of equal size; see [`Survey::of`].
#[derive(Debug, Clone)]
pub struct Survey {
    size: Size,
    cell_px: u32,
    columns: usize,
    cells: Vec<Cell>,
}

/// What a part of the mosaic holds; all estimates, hence not whole numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct WorkAmount {
    /// Pixels that show a surface.
    pub surface_pixels: f64,
    /// Pairs of such a pixel and a photo in whose frame it lies and which is on its side of the surface.
    pub samples: f64,
    /// Faces of the partitions in the column.
    pub faces: f64,
    /// Pairs of such a face and such a photo.
    pub face_views: f64,
    /// Photo pixels that the samples cover, all together.
    pub photo_pixels: f64,
}

impl WorkAmount {
    /// Photo pixels that a sample covers, on average.
    pub fn footprint(&self) -> f64 {
        self.photo_pixels / self.samples.max(1.0)
    }

    /// Photo pixels at the pyramid level that samples of the average footprint are taken at.
    pub fn sampled_photo_pixels(&self) -> f64 {
        // Each level has a quarter of the pixels of the finer one; a sample covers less than four of its level.
        let of_level = |level: i32| self.photo_pixels / 4_f64.powi(level);
        let is_too_fine = |&level: &i32| of_level(level) >= 4.0 * self.samples.max(1.0);
        of_level((0..32).find(|level| !is_too_fine(level)).unwrap_or(32))
    }

    fn add(&mut self, other: &Self, share: f64) {
        self.surface_pixels += share * other.surface_pixels;
        self.samples += share * other.samples;
        self.faces += share * other.faces;
        self.face_views += share * other.face_views;
        self.photo_pixels += share * other.photo_pixels;
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    faces: f64,
    covered_px: f64,
    /// Photos that see a point of it, on average.
    views: f64,
    /// Photo pixels that one of its pixels covers in all of these together.
    photo_px: f64,
}

/// Faces that were looked at, by how much they face the viewer, and the photos that see them.
#[derive(Debug, Clone, Copy, Default)]
struct Looked {
    faces: f64,
    seen: f64,
    photo_px: f64,
}

impl Looked {
    fn plus(self, other: Self) -> Self {
        Self {
            faces: self.faces + other.faces,
            seen: self.seen + other.seen,
            photo_px: self.photo_px + other.photo_px,
        }
    }

    /// Photos that see a face, and photo pixels that a mosaic pixel covers in them, on average.
    fn means(self) -> Option<[f64; 2]> {
        (self.faces > 0.0).then(|| [self.seen / self.faces, self.photo_px / self.faces])
    }
}

impl Survey {
    /// Surveys what `mosaic` shows of `mesh`, and how many of `photos` see it.
    ///
    /// 1. The box of each partition in the slab adds its faces to the cells that it covers, by area.
    /// 2. Some partitions, evenly spread over the mesh's curve, are read; of each some faces. A photo sees such a face
    ///    if its middle lies before it and in its frame, and it is on the face's side of the mosaic's viewer. What
    ///    hides what is not looked at.
    /// 3. A cell in which no face was looked at takes the views of the cells near it, or of all.
    ///
    /// # Errors
    /// If a partition cannot be read.
    pub fn of(mesh: &impl Partitions, mosaic: &Mosaic, photos: &[Photo]) -> Result<Self> {
        let longer = mosaic.size.width.max(mosaic.size.height);
        let cell_px = longer.div_ceil(CELLS).max(1);
        let columns = mosaic.size.width.div_ceil(cell_px) as usize;
        let rows = mosaic.size.height.div_ceil(cell_px) as usize;
        let cells = vec![Cell::default(); columns * rows];
        let mut survey = Self { size: mosaic.size, cell_px, columns, cells };
        let shown = survey.cover(mesh, mosaic);
        let looked = survey.look(mesh, mosaic, photos, &shown)?;
        survey.lend(&looked);
        Ok(survey)
    }

    /// Step 1; the partitions that are shown.
    fn cover(&mut self, mesh: &impl Partitions, mosaic: &Mosaic) -> Vec<usize> {
        let local = mosaic.local(mesh.origin());
        let [low, high] = mosaic.slab;
        let mut shown = Vec::new();
        for partition in 0..mesh.count() {
            let Some(range) = local.box_range(&mesh.bounds(partition)) else { continue };
            if range.is_empty() || range.max.z < low || range.min.z > high {
                continue;
            }
            let faces = mesh.faces(partition) as f64;
            let (x, y) = ([range.min.x, range.max.x], [range.min.y, range.max.y]);
            if self.spread(x, y, faces) {
                shown.push(partition);
            }
        }
        shown
    }

    /// Adds a box of `faces` to the cells that it meets, by area; false if it meets none.
    fn spread(&mut self, x: [f64; 2], y: [f64; 2], faces: f64) -> bool {
        let (width, height) = (f64::from(self.size.width), f64::from(self.size.height));
        let (x0, x1) = (x[0].clamp(0.0, width), x[1].clamp(0.0, width));
        let (y0, y1) = (y[0].clamp(0.0, height), y[1].clamp(0.0, height));
        // An upright wall's box has no width; a pixel of it counts.
        let area = ((x[1] - x[0]).max(1.0) * (y[1] - y[0]).max(1.0)).max(1.0);
        if x[1] < 0.0 || x[0] > width || y[1] < 0.0 || y[0] > height {
            return false;
        }
        let side = f64::from(self.cell_px);
        let cells = |from: f64, to: f64, count: usize| {
            let at = |p: f64| index(p / side).min(count - 1);
            at(from)..=at(to)
        };
        let rows = self.cells.len() / self.columns;
        for row in cells(y0, y1, rows) {
            let (top, bottom) = (y0.max(row as f64 * side), y1.min((row + 1) as f64 * side));
            for column in cells(x0, x1, self.columns) {
                let left = x0.max(column as f64 * side);
                let right = x1.min((column + 1) as f64 * side);
                let part = (right - left).max(1.0) * (bottom - top).max(1.0);
                let cell = &mut self.cells[row * self.columns + column];
                cell.faces += faces * (part / area).min(1.0);
                cell.covered_px += part;
            }
        }
        true
    }

    /// Step 2; what was looked at in each cell.
    fn look(
        &self,
        mesh: &impl Partitions,
        mosaic: &Mosaic,
        photos: &[Photo],
        shown: &[usize],
    ) -> Result<Vec<Looked>> {
        let most = (MOST_PAIRS / FACES / photos.len().max(1)).clamp(LEAST_SAMPLES, MOST_SAMPLES);
        let views: Vec<View> = photos.iter().map(|p| View::new(p, mesh.origin())).collect();
        let local = mosaic.local(mesh.origin());
        let mut looked = vec![Looked::default(); self.cells.len()];
        for &partition in shown.iter().step_by(shown.len().div_ceil(most).max(1)) {
            mesh.visit(partition, &mut |block| {
                for [a, b, c] in some_faces(block) {
                    let (middle, normal) = ((a + b + c) / 3.0, (b - a).cross(c - a));
                    let axis = local.towards_viewer(middle).normalize_or_zero();
                    let normal = if normal.dot(axis) < 0.0 { -normal } else { normal };
                    let at = local.project(middle);
                    // A face on edge shows in few pixels.
                    let faces = normal.dot(axis) / normal.length();
                    if faces > ON_EDGE
                        && let Some(cell) = self.cell_at(at.x, at.y)
                    {
                        let mut found = Looked { faces, ..Looked::default() };
                        for area in views.iter().filter_map(|v| v.area(middle, normal)) {
                            found.seen += faces;
                            // The face's area by that of its projection cancels its slant.
                            found.photo_px += area * local.pixel_area(middle);
                        }
                        looked[cell] = looked[cell].plus(found);
                    }
                }
            })?;
        }
        Ok(looked)
    }

    /// Step 3.
    fn lend(&mut self, looked: &[Looked]) {
        let squares = self.columns.div_ceil(SQUARE);
        let columns = self.columns;
        let square =
            move |cell: usize| (cell / columns / SQUARE) * squares + cell % columns / SQUARE;
        let mut near = vec![Looked::default(); square(self.cells.len() - 1).max(squares) + squares];
        let mut all = Looked::default();
        for (cell, found) in looked.iter().enumerate() {
            near[square(cell)] = near[square(cell)].plus(*found);
            all = all.plus(*found);
        }
        for (k, (cell, own)) in self.cells.iter_mut().zip(looked).enumerate() {
            let means = own.means().or(near[square(k)].means()).or(all.means());
            [cell.views, cell.photo_px] = means.unwrap_or_default();
        }
    }

    /// The cell of a mosaic position.
    fn cell_at(&self, x: f64, y: f64) -> Option<usize> {
        let inside = |p: f64, side: u32| p >= 0.0 && p < f64::from(side);
        let side = f64::from(self.cell_px);
        (inside(x, self.size.width) && inside(y, self.size.height))
            .then(|| index(y / side) * self.columns + index(x / side))
    }

    /// The work in a rectangle of the mosaic.
    pub fn within(&self, rect: PixelRect) -> WorkAmount {
        let side = i64::from(self.cell_px);
        let rect = rect.intersection(&self.size.rect());
        let mut sum = WorkAmount::default();
        if rect.is_empty() {
            return sum;
        }
        let range = |from: i64, to: i64| from / side..=(to - 1) / side;
        for row in range(rect.y0, rect.y1) {
            for column in range(rect.x0, rect.x1) {
                let (x, y) = (column * side, row * side);
                let whole = PixelRect::new(x, y, x + side, y + side);
                let whole = whole.intersection(&self.size.rect());
                let share = rect.intersection(&whole).area() as f64 / whole.area() as f64;
                let at = usize::try_from(row).unwrap_or(0) * self.columns
                    + usize::try_from(column).unwrap_or(0);
                sum.add(&self.cells[at].amount(whole.area() as f64), share);
            }
        }
        sum
    }

    /// The work of the whole mosaic.
    pub fn total(&self) -> WorkAmount {
        self.within(self.size.rect())
    }
}

impl Cell {
    /// Its work, `area` being its pixels.
    fn amount(&self, area: f64) -> WorkAmount {
        let surface_pixels = self.covered_px.min(area);
        WorkAmount {
            surface_pixels,
            samples: surface_pixels * self.views,
            faces: self.faces,
            face_views: self.faces * self.views,
            photo_pixels: surface_pixels * self.photo_px,
        }
    }
}

/// Some faces of a block, evenly spread: their corners.
fn some_faces<'a>(block: &'a FaceBlock<'_>) -> impl Iterator<Item = [DVec3; 3]> + 'a {
    let step = (block.triangles.len() / FACES).max(1);
    let faces = block.triangles.iter().skip(step / 2).step_by(step).take(FACES);
    faces.map(|t| t.map(|k| block.positions[usize::from(k)]))
}

/// A photo in the mesh's local frame.
struct View<'a> {
    photo: &'a Photo,
    pose: LocalPose,
}

impl<'a> View<'a> {
    fn new(photo: &'a Photo, origin: DVec3) -> Self {
        Self { photo, pose: photo.pose.relative_to(origin) }
    }

    /// Photo pixels that a square metre of a face covers, without distortion; `None` if the photo does not see it.
    fn area(&self, point: DVec3, normal: DVec3) -> Option<f64> {
        let q = self.pose.camera_from_local(point);
        let towards = self.pose.centre - point;
        let facing = normal.dot(towards);
        if q.z <= 0.0 || facing <= 0.0 {
            return None;
        }
        let lens = &self.photo.lens;
        lens.photo_from_ray(q.truncate() / q.z).filter(|at| lens.contains(*at))?;
        let focal = lens.focal_px();
        Some(focal.x * focal.y * facing / normal.length() / (q.z * q.z * q.z))
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn index(position: f64) -> usize {
    position as usize
}

#[cfg(test)]
mod tests {
    use super::super::partitions::soup::Soup;
    use super::*;
    use crate::camera::{Lens, LensModel, PhotoId, Pose};
    use crate::frame::Plane;

    /// A square of 10 m × 10 m at z = 0 in 20 × 20 squares of two faces, 8 faces a partition.
    fn floor() -> Soup {
        let mut faces = Vec::new();
        for k in 0..400 {
            let (x, y) = (0.5 * f64::from(k % 20), 0.5 * f64::from(k / 20));
            let p = |i: f64, j: f64| DVec3::new(x + 0.5 * i, y + 0.5 * j, 0.0);
            faces.push([p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0)]);
            faces.push([p(0.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)]);
        }
        Soup::new(DVec3::ZERO, &faces, 8)
    }

    /// Looks straight down from `height` above (x, y), 90° wide and high; or up from below for a negative height.
    fn photo(x: f64, y: f64, height: f64) -> Photo {
        let pinhole = [500.0, 500.0, 500.0, 500.0];
        let lens = Lens::new(LensModel::Pinhole, Size::new(1000, 1000), &pinhole).unwrap();
        let down = if height > 0.0 { [0.0, 1.0, 0.0, 0.0] } else { [1.0, 0.0, 0.0, 0.0] };
        let mut pose = Pose::from_colmap(down, DVec3::ZERO).unwrap();
        pose.centre_ground = DVec3::new(x, y, height);
        Photo { id: PhotoId(0), name: "a".into(), lens, pose }
    }

    fn survey(extent: [f64; 4], photos: &[Photo]) -> Survey {
        let slab = [f64::NEG_INFINITY, f64::INFINITY];
        let mosaic = Mosaic::new(Plane::top(), 0.01, extent, slab).unwrap();
        Survey::of(&floor(), &mosaic, photos).unwrap()
    }

    #[test]
    fn a_covered_mosaic_has_all_its_pixels_and_faces_and_each_photo_that_sees_all() {
        let all = [photo(5.0, 5.0, 20.0), photo(4.0, 6.0, 30.0), photo(5.0, 5.0, -20.0)];
        let total = survey([0.0, 0.0, 10.0, 10.0], &all).total();
        assert!((total.surface_pixels - 1e6).abs() < 1.0, "{total:?}");
        assert!((total.samples - 2e6).abs() < 1.0, "the one below sees nothing: {total:?}");
        assert!((total.faces - 800.0).abs() < 40.0 && (total.face_views - 1600.0).abs() < 80.0);
    }

    #[test]
    fn what_lies_beside_the_mesh_or_the_photos_is_no_work() {
        // Half of the mosaic is beside the floor; the photo sees 4 m × 4 m of it.
        let survey = survey([0.0, 0.0, 20.0, 10.0], &[photo(2.0, 2.0, 2.0)]);
        let total = survey.total();
        assert!((total.surface_pixels / 1e6 - 1.0).abs() < 0.05, "{total:?}");
        assert!((total.samples / 1.6e5 - 1.0).abs() < 0.6, "{total:?}");
        let beside = survey.within(PixelRect::new(1100, 0, 2000, 1000));
        assert_eq!(beside, WorkAmount::default());
        // Rows run from the greatest y.
        let unseen = survey.within(PixelRect::new(600, 0, 1000, 400));
        assert!(unseen.samples < 0.05 * unseen.surface_pixels, "{unseen:?}");
    }

    #[test]
    fn the_parts_of_a_mosaic_add_up_to_the_whole() {
        let survey = survey([1.0, -3.0, 9.7, 8.0], &[photo(5.0, 5.0, 9.0), photo(1.0, 1.0, 2.0)]);
        let mut sum = WorkAmount::default();
        for rect in survey.size.rect().blocks(70) {
            sum.add(&survey.within(rect), 1.0);
        }
        let total = survey.total();
        assert!((sum.samples / total.samples - 1.0).abs() < 1e-9);
        assert!((sum.faces / total.faces - 1.0).abs() < 1e-9);
        assert_eq!(survey.within(PixelRect::new(-9, 0, 0, 9)), WorkAmount::default());
    }
    #[test]
    fn photo_pixels_are_counted_at_the_level_whose_pixels_are_just_finer_than_the_samples() {
        let pixels =
            |photo_pixels| WorkAmount { samples: 100.0, photo_pixels, ..WorkAmount::default() };
        let at = |photo_pixels| pixels(photo_pixels).sampled_photo_pixels();
        let is = |photo_pixels, expected: f64| (at(photo_pixels) - expected).abs() < 1e-9;
        assert!(is(0.0, 0.0) && is(50.0, 50.0) && is(399.0, 399.0));
        assert!(is(400.0, 100.0) && is(1599.0, 399.75) && is(1600.0, 100.0));
        assert!(at(f64::INFINITY).is_infinite() && at(f64::NAN).is_nan());
    }
}
