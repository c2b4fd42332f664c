//! The irregular z-buffer: a block's points in cells of rays, and the faces that take them out of sight.

use glam::{DVec2, DVec3};

use super::face_test::FaceTest;
use super::photo::{Shaft, ViewPhoto, ray_of};
use super::points::{BlockPoint, BlockPoints, RayPoints};
use crate::geom::{Bounds2, Bounds3, FaceBlock, held_bytes};

/// A face's ray bounds are widened by this part of a cell before cells are chosen; rounding of rays and of the
/// predicate is some 10⁻⁹ of that.
const CELL_MARGIN: f64 = 1e-3;

/// Most cells of a block and photo, as a multiple of its points: beyond it cells grow.
const CELLS_PER_POINT: f64 = 1.0;

/// The points of one block and photo that are still in sight, by cells of rays.
#[derive(Debug, Default)]
pub struct PointCells {
    rays: Option<Bounds2>,
    shaft: Option<Shaft>,
    /// Greatest limit of any point.
    far: f64,
    cells_per_ray: f64,
    columns: usize,
    rows: usize,
    cells: Vec<Cell>,
    points: Vec<BlockPoint>,
    in_sight: usize,
}

#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    start: u32,
    end: u32,
    /// At least the greatest limit of the points in the cell; 0 when there are none.
    limit: f32,
}

/// Memory reused from face block to face block.
#[derive(Debug, Default)]
pub struct OcclusionScratch {
    camera: Vec<DVec3>,
    cell: Vec<DVec2>,
}

impl PointCells {
    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.cells) + held_bytes(&self.points)
    }

    /// Bins the points of one photo in cells of about one photo pixel.
    pub fn start(&mut self, photo: &ViewPhoto, points: &RayPoints) {
        let points = &points.0;
        let rays = Bounds2::of(points.iter().map(|p| DVec2::new(p.x, p.y)));
        self.in_sight = points.len();
        self.far = points.iter().fold(0.0, |far, p| p.limit.max(far));
        self.cells.clear();
        self.points.clear();
        if points.is_empty() {
            (self.rays, self.shaft) = (None, None);
            return;
        }
        (self.rays, self.shaft) = (Some(rays), Some(Shaft::new(photo, &rays, self.far)));
        self.choose_cells(photo, &rays, points.len());
        self.cells.resize(self.columns * self.rows, Cell::default());
        // Counting sort: sizes, starts, then each point to its place.
        for p in points {
            let cell = self.cell_of(p, rays.min);
            self.cells[cell].end += 1;
        }
        let mut start = 0;
        for cell in &mut self.cells {
            let count = cell.end;
            (cell.start, cell.end) = (start, start);
            start += count;
        }
        if let Some(&first) = points.first() {
            self.points.resize(points.len(), first);
        }
        for p in points {
            let cell = self.cell_of(p, rays.min);
            let cell = &mut self.cells[cell];
            self.points[cell.end as usize] = *p;
            cell.end += 1;
            cell.limit = cell.limit.max(up(p.limit));
        }
    }

    fn choose_cells(&mut self, photo: &ViewPhoto, rays: &Bounds2, points: usize) {
        let size = rays.max - rays.min;
        let budget = CELLS_PER_POINT * points as f64;
        // One photo pixel, unless that makes too many cells; also for a row of points, whose rectangle has no area.
        let finest = photo.lens.focal_px().max_element();
        let by_area = (budget / (size.x * size.y)).sqrt();
        let by_side = budget / size.max_element();
        self.cells_per_ray = finest.min(by_area).min(by_side);
        if !(self.cells_per_ray.is_finite() && self.cells_per_ray > 0.0) {
            self.cells_per_ray = 1.0;
        }
        self.columns = index(size.x * self.cells_per_ray) + 1;
        self.rows = index(size.y * self.cells_per_ray) + 1;
    }

    #[inline]
    fn cell_of(&self, p: &BlockPoint, origin: DVec2) -> usize {
        let column = index((p.x - origin.x) * self.cells_per_ray).min(self.columns - 1);
        let row = index((p.y - origin.y) * self.cells_per_ray).min(self.rows - 1);
        row * self.columns + column
    }

    /// Whether a face within `bounds` (local frame) might take a point out of sight; `false` is proven.
    pub fn may_be_hidden_by(&self, bounds: &Bounds3) -> bool {
        self.in_sight > 0 && self.shaft.is_some_and(|s| s.may_meet(bounds))
    }

    /// Takes out of sight every point before which a face of `block` lies.
    pub fn occlude(
        &mut self,
        photo: &ViewPhoto,
        block: &FaceBlock<'_>,
        points: &mut BlockPoints,
        scratch: &mut OcclusionScratch,
    ) {
        let Some(rays) = self.rays else { return };
        scratch.camera.clear();
        scratch.camera.extend(block.positions.iter().map(|&p| photo.camera_from_local(p)));
        scratch.cell.clear();
        scratch
            .cell
            .extend(scratch.camera.iter().map(|&q| (ray_of(q) - rays.min) * self.cells_per_ray));
        for (corners, &id) in block.triangles.iter().zip(block.ids) {
            let [a, b, c] = corners.map(|i| scratch.camera[usize::from(i)]);
            let near = a.z.min(b.z).min(c.z);
            if near >= self.far || a.z.max(b.z).max(c.z) <= 0.0 {
                continue;
            }
            let range = if near > 0.0 {
                self.cells_between(corners.map(|i| scratch.cell[usize::from(i)]))
            } else if Shaft::rays_may_meet(&rays, [a, b, c]) {
                Some([0, 0, self.columns - 1, self.rows - 1])
            } else {
                None
            };
            let Some([x0, y0, x1, y1]) = range else { continue };
            let mut test = None;
            for row in y0..=y1 {
                for cell in row * self.columns + x0..=row * self.columns + x1 {
                    if near < f64::from(self.cells[cell].limit) {
                        let test = test.get_or_insert_with(|| FaceTest::new([a, b, c]));
                        self.test_cell(cell, test, id.0, points);
                    }
                }
            }
        }
    }

    /// First and last column and row of the cells that a face with these corners (in cells) may touch.
    #[inline]
    fn cells_between(&self, [a, b, c]: [DVec2; 3]) -> Option<[usize; 4]> {
        let lo = a.min(b).min(c) - CELL_MARGIN;
        let hi = a.max(b).max(c) + CELL_MARGIN;
        if hi.x < 0.0 || hi.y < 0.0 || lo.x >= self.columns as f64 || lo.y >= self.rows as f64 {
            return None;
        }
        Some([
            index(lo.x),
            index(lo.y),
            index(hi.x).min(self.columns - 1),
            index(hi.y).min(self.rows - 1),
        ])
    }

    fn test_cell(&mut self, cell: usize, test: &FaceTest, face: u32, points: &mut BlockPoints) {
        let cell = &mut self.cells[cell];
        let mut k = cell.start as usize;
        while k < cell.end as usize {
            let p = self.points[k];
            if test.cuts(p.x, p.y, p.limit) && p.face.0 != face {
                points.hide(p.index);
                cell.end -= 1;
                self.points.swap(k, cell.end as usize);
                self.in_sight -= 1;
            } else {
                k += 1;
            }
        }
        if cell.start == cell.end {
            cell.limit = 0.0;
        }
    }
}

/// The least f32 that is not below `v`.
#[expect(clippy::cast_possible_truncation, reason = "rounded up again")]
fn up(v: f64) -> f32 {
    let near = v as f32;
    if f64::from(near) < v { near.next_up() } else { near }
}

/// A non-negative coordinate's whole part; negative ones and NaN give 0, huge ones saturate.
#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturating by intent")]
fn index(v: f64) -> usize {
    v as usize
}
