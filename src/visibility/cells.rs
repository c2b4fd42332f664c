//! The irregular z-buffer: a block's points in cells of rays, and the faces that take them out of sight.
//!
//! 1. The points are sorted by cell, row by row, so that those of neighbouring cells of a row lie side by side.
//! 2. For each face, [`Candidates`] tests whole rows of points in its bounds, in f32 with bounds of the rounding, and
//!    finds those that it hides, and the few
//!    where f32 cannot tell.
//! 3. These are decided by [`FaceTest`] in f64.

use glam::{DVec2, DVec3};

use super::candidates::{Candidates, Found, Grid};
use super::face_test::FaceTest;
use super::photo::Shaft;
use super::points::{BlockPoints, RayPoints};
use super::sight::Sight;
use crate::geom::{Bounds2, Bounds3, FaceBlock, Kernel, LANES, held_bytes, run_widest};

/// Width and height of a cell, photo pixels. A typical face is two or three pixels wide: few, longer rows of points.
const CELL_PX: [f32; 2] = [1.0, 3.0];

/// Most cells of a block and photo, as a multiple of its points: beyond it cells grow.
const CELLS_PER_POINT: f32 = 1.0;

/// The points of one block and photo, by cells of rays.
#[derive(Debug, Default)]
pub struct PointCells {
    shaft: Option<Shaft>,
    grid: Grid,
    /// First point of each cell, row by row, and the number of points at the end.
    starts: Vec<u32>,
    points: SortedPoints,
    in_sight: usize,
    /// Greatest tolerance of any point, metres.
    greatest_tolerance_m: f64,
    /// Cell of each point, in the order in which they came.
    cells: Vec<u32>,
}

/// Points in the order of their cells, one entry a point in each array, then [`LANES`] entries that no face hides.
#[derive(Debug, Default)]
pub(super) struct SortedPoints {
    /// Place in the grid, cells.
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    /// See [`RayPoints::limit`]; 0 once the point is out of sight.
    pub(super) limit: Vec<f32>,
    /// Id of the point's own face.
    pub(super) face: Vec<u32>,
    /// Position in [`BlockPoints`].
    index: Vec<u32>,
}

/// Memory reused from face block to face block.
#[derive(Debug, Default)]
pub struct OcclusionScratch {
    /// Each vertex in the grid: column, row, depth.
    vertices: [Vec<f32>; 3],
    found: Found,
}

impl OcclusionScratch {
    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        self.vertices.iter().map(held_bytes).sum::<u64>()
            + held_bytes(&self.found.hidden)
            + held_bytes(&self.found.pairs)
            + held_bytes(&self.found.anywhere)
    }
}

impl PointCells {
    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        let p = &self.points;
        held_bytes(&self.starts)
            + [&p.x, &p.y, &p.limit].into_iter().map(held_bytes).sum::<u64>()
            + held_bytes(&p.face)
            + held_bytes(&p.index)
            + held_bytes(&self.cells)
    }

    /// Bins the points of one photo in cells of a few photo pixels; the coordinates of `points` become places in the
    /// grid.
    pub fn start(&mut self, sight: &Sight<'_>, points: &mut RayPoints) {
        let photo = sight.photo;
        let count = points.x.len();
        self.in_sight = count;
        self.starts.clear();
        if count == 0 {
            self.shaft = None;
            return;
        }
        self.greatest_tolerance_m = sight.tolerance.greatest(sight.surface);
        let far = greatest(&points.limit);
        let (min_x, max_x) = (-greatest_of(&points.x, |v| -v), greatest(&points.x));
        let (min_y, max_y) = (-greatest_of(&points.y, |v| -v), greatest(&points.y));
        let focal = photo.lens.focal_px();
        let ray = |x: f32, y: f32| points.origin + DVec2::new(x.into(), y.into()) / focal;
        // Room for what rounding to f32 has moved.
        let rays = Bounds2 { min: ray(min_x, min_y), max: ray(max_x, max_y) };
        let slack = (rays.max - rays.min).max_element() * 1e-6;
        let rays = Bounds2 { min: rays.min - slack, max: rays.max + slack };
        self.shaft = Some(Shaft::new(photo, &rays, far.into()));
        let [scale_x, scale_y] = cells_per_px([max_x - min_x, max_y - min_y], count);
        let (columns, rows) =
            (index((max_x - min_x) * scale_x) + 1, index((max_y - min_y) * scale_y) + 1);
        let least = points.origin + DVec2::new(min_x.into(), min_y.into()) / focal;
        let scale = focal * DVec2::new(scale_x.into(), scale_y.into());
        self.grid = Grid::new(least, rays, scale, [columns, rows], far);
        self.sort(points, [min_x, min_y], [scale_x, scale_y]);
    }

    /// A counting sort by cell: sizes, starts, then each point to its place.
    fn sort(&mut self, points: &mut RayPoints, least: [f32; 2], scale: [f32; 2]) {
        let [columns, rows] = self.grid.size();
        run_widest(Placement {
            points,
            cells: &mut self.cells,
            least,
            scale,
            size: [columns, rows],
        });
        // Two places to the right, so that starts become the ends of the cells before while points find their places.
        self.starts.resize(columns * rows + 2, 0);
        let counts = &mut self.starts[2..];
        for &cell in &self.cells {
            if let Some(count) = counts.get_mut(cell as usize) {
                *count += 1;
            }
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.points.resize(points.x.len());
        let SortedPoints { x, y, limit, face, index } = &mut self.points;
        let (x, y, limit) = (x.as_mut_slice(), y.as_mut_slice(), limit.as_mut_slice());
        let (face, index) = (face.as_mut_slice(), index.as_mut_slice());
        let starts = self.starts.as_mut_slice();
        let from = points.x.iter().zip(&points.y).zip(&points.limit).zip(&points.face);
        for ((k, &cell), (((&px, &py), &plimit), &pface)) in (0..).zip(&self.cells).zip(from) {
            let next = &mut starts[cell as usize + 1];
            let to = *next as usize;
            *next += 1;
            (x[to], y[to], limit[to], face[to], index[to]) = (px, py, plimit, pface, k);
        }
    }

    /// Whether a face within `bounds` (local frame) might take a point out of sight; `false` is proven.
    pub fn may_be_hidden_by(&self, bounds: &Bounds3) -> bool {
        self.in_sight > 0 && self.shaft.is_some_and(|s| s.may_meet(bounds))
    }

    /// Takes out of sight every point before which a face of `block` lies. `sight` and `points` are those that the
    /// cells were started with.
    pub fn occlude(
        &mut self,
        sight: &Sight<'_>,
        block: &FaceBlock<'_>,
        points: &mut BlockPoints,
        scratch: &mut OcclusionScratch,
    ) {
        if self.in_sight == 0 {
            return;
        }
        let OcclusionScratch { vertices, found } = scratch;
        found.hidden.clear();
        found.pairs.clear();
        found.anywhere.clear();
        run_widest(Candidates {
            photo: sight.photo,
            grid: &self.grid,
            starts: &self.starts,
            points: &mut self.points,
            tolerance_m: self.greatest_tolerance_m,
            block,
            vertices,
            found,
        });
        for &k in &found.hidden {
            points.hide(self.points.index[k as usize] as usize);
        }
        self.in_sight -= found.hidden.len();
        for of_face in found.pairs.chunk_by(|a, b| a.0 == b.0) {
            let face = of_face[0].0 as usize;
            self.decide(sight, block, face, points, of_face.iter().map(|pair| pair.1 as usize));
        }
        for &face in &found.anywhere {
            let all = 0..self.points.index.len();
            self.decide(sight, block, face as usize, points, all);
        }
    }

    /// Tests each of the points `chosen` against one face.
    fn decide(
        &mut self,
        sight: &Sight<'_>,
        block: &FaceBlock<'_>,
        face: usize,
        points: &mut BlockPoints,
        chosen: impl Iterator<Item = usize>,
    ) {
        let corners: [DVec3; 3] = block.corners(face).map(|p| sight.photo.camera_from_local(p));
        let (test, id) = (FaceTest::new(corners), block.ids[face].0);
        for k in chosen {
            let sorted = &mut self.points;
            if sorted.limit[k] == 0.0 || sorted.face[k] == id {
                continue;
            }
            let at = sorted.index[k] as usize;
            let (ray, limit) = sight.ray_and_limit(points.pixel(sight.surface, at));
            if test.cuts(ray.x, ray.y, limit) {
                points.hide(at);
                sorted.limit[k] = 0.0;
                self.in_sight -= 1;
            }
        }
    }
}

/// Turns rays into places in the grid and finds their cells.
struct Placement<'a> {
    points: &'a mut RayPoints,
    cells: &'a mut Vec<u32>,
    least: [f32; 2],
    scale: [f32; 2],
    size: [usize; 2],
}

impl Kernel for Placement<'_> {
    type Output = ();

    #[inline(always)]
    #[expect(
        clippy::inline_always,
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        reason = "a kernel; a grid has fewer than 2³¹ cells"
    )]
    fn run(self) {
        let Self { points, cells, least, scale, size: [columns, rows] } = self;
        let (columns, last_column, last_row) =
            (columns as i32, columns as i32 - 1, rows as i32 - 1);
        let count = points.x.len();
        cells.resize(count, 0);
        let (xs, ys, cells) = (&mut points.x[..count], &mut points.y[..count], &mut cells[..count]);
        for k in 0..count {
            let (x, y) = ((xs[k] - least[0]) * scale[0], (ys[k] - least[1]) * scale[1]);
            (xs[k], ys[k]) = (x, y);
            let (column, row) = (x as i32, y as i32);
            let column = if column < last_column { column } else { last_column };
            let row = if row < last_row { row } else { last_row };
            cells[k] = row.wrapping_mul(columns).wrapping_add(column) as u32;
        }
    }
}

impl SortedPoints {
    /// Room for `count` points; what they are is left open.
    fn resize(&mut self, count: usize) {
        for of in [&mut self.x, &mut self.y, &mut self.limit] {
            of.resize(count + LANES, 0.0);
            of[count..].fill(0.0);
        }
        self.face.resize(count + LANES, 0);
        self.index.resize(count, 0);
    }
}

/// Cells a photo pixel, along x and y: the finest, unless a rectangle of this size would have too many.
fn cells_per_px([width, height]: [f32; 2], points: usize) -> [f32; 2] {
    let budget = CELLS_PER_POINT * points as f32;
    let [fine_x, fine_y] = CELL_PX.map(|px| 1.0 / px);
    let (columns, rows) = (width * fine_x, height * fine_y);
    // By area, and also for a row of points, whose rectangle has no area.
    let shrink = (budget / (columns * rows)).sqrt().min(budget / columns.max(rows)).min(1.0);
    let shrink = if shrink.is_finite() && shrink > 0.0 { shrink } else { 1.0 };
    [fine_x * shrink, fine_y * shrink]
}

fn greatest(values: &[f32]) -> f32 {
    greatest_of(values, |v| v)
}

/// The greatest of `f` over values that are numbers; −∞ for none.
fn greatest_of(values: &[f32], f: impl Fn(f32) -> f32) -> f32 {
    let mut lanes = [f32::NEG_INFINITY; LANES];
    let chunks = values.chunks_exact(LANES);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (lane, &v) in lanes.iter_mut().zip(chunk) {
            let v = f(v);
            *lane = if v > *lane { v } else { *lane };
        }
    }
    rest.iter().map(|&v| f(v)).chain(lanes).fold(f32::NEG_INFINITY, f32::max)
}

/// A non-negative coordinate's whole part; negative ones and NaN give 0, huge ones saturate.
#[inline]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturating by intent")]
fn index(v: f32) -> usize {
    v as u32 as usize
}
