//! Which faces of a block might hide a point: a test in f32 that errs on one side only.
//!
//! Places in the grid of cells are f32: with m the greatest coordinate of the grid or of a face's corners, a point or
//! corner is off by at most [`PLACE_ROUNDING`] · m cells. An edge function a·x + b·y + c of places is off by at most
//! [`EDGE_ROUNDING`] · m · (|a| + |b|), and the exact test's own tolerance is added; a point counts as inside up to
//! that. A face that is turned edge-on by as much, or reaches behind the camera, might hide any point in its bounds.

#![expect(
    clippy::inline_always,
    clippy::needless_bitwise_bool,
    reason = "compiled for the widest vectors where it is inlined into the kernel"
)]

use glam::{DVec2, DVec3};

use super::photo::{Shaft, ViewPhoto, ray_of, to_camera};
use crate::geom::{Bounds2, FaceBlock, Kernel, LANES};
use crate::raster::RayTriangle;

use super::cells::SortedPoints;
use super::points::LIMIT_SLACK;

/// Rounding of a place, in units of the greatest coordinate: five roundings at most, of 2⁻²⁴ each; room left.
const PLACE_ROUNDING: f32 = 8.0 / 16_777_216.0;
/// Rounding of an edge function: that of its three places and of six operations; room left.
const EDGE_ROUNDING: f32 = 48.0 / 16_777_216.0;
/// Bounds of a face are widened by this part of a cell at least; rounding of rays and of the exact test is some 10⁻⁹.
const CELL_MARGIN: f32 = 1e-3;

/// Cells of rays.
#[derive(Debug, Default)]
pub(super) struct Grid {
    /// Ray of the grid's corner.
    least: DVec2,
    /// Rays of all points.
    rays: Option<Bounds2>,
    /// Cells a unit of ray.
    scale: DVec2,
    columns: usize,
    rows: usize,
    /// Greatest limit of any point.
    far: f32,
}

/// Cells that a face may touch, first and last included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Range {
    x0: u32,
    x1: u32,
    y0: u32,
    y1: u32,
}

impl Range {
    pub(super) fn rows(self) -> impl Iterator<Item = usize> {
        self.y0 as usize..=self.y1 as usize
    }
}

impl Grid {
    pub(super) fn new(
        least: DVec2,
        rays: Bounds2,
        scale: DVec2,
        [columns, rows]: [usize; 2],
        far: f32,
    ) -> Self {
        Self { least, rays: Some(rays), scale, columns, rows, far }
    }

    /// Columns and rows.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    /// The points of one row of a range.
    #[inline]
    pub(super) fn points_of(
        &self,
        starts: &[u32],
        range: Range,
        row: usize,
    ) -> std::ops::Range<usize> {
        let first = row * self.columns;
        let starts = &starts[first + range.x0 as usize..=first + range.x1 as usize + 1];
        starts[0] as usize..starts[starts.len() - 1] as usize
    }

    /// Whether there is a point in a range of cells.
    #[inline]
    fn holds_points(&self, starts: &[u32], range: Range) -> bool {
        range.rows().any(|row| !self.points_of(starts, range, row).is_empty())
    }

    /// All cells.
    fn all(&self) -> Range {
        let last = |n: usize| u32::try_from(n - 1).expect("fewer cells than points");
        Range { x0: 0, x1: last(self.columns), y0: 0, y1: last(self.rows) }
    }
}

/// Finds the points that triangles of a block might hide.
pub(super) struct Candidates<'a> {
    pub(super) photo: &'a ViewPhoto,
    pub(super) grid: &'a Grid,
    pub(super) starts: &'a [u32],
    pub(super) points: &'a mut SortedPoints,
    pub(super) tolerance_m: f64,
    pub(super) block: &'a FaceBlock<'a>,
    /// Memory for the vertices: column, row, depth.
    pub(super) vertices: &'a mut [Vec<f32>; 3],
    pub(super) found: &'a mut Found,
}

/// What might be hidden by what.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Points, in sorted order, that certainly are hidden: so far that f32 can tell. They have lost their limit.
    pub(super) hidden: Vec<u32>,
    /// Triangle of the block, and point in sorted order, where f32 cannot tell.
    pub(super) pairs: Vec<(u32, u32)>,
    /// Triangles that reach behind the camera: they might hide any point.
    pub(super) anywhere: Vec<u32>,
}

impl Kernel for Candidates<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { photo, grid, starts, points, tolerance_m, block, vertices, found } = self;
        place_vertices(photo, grid, block, vertices);
        let [xs, ys, zs] = vertices.each_ref().map(Vec::as_slice);
        let limits = Limits::new(grid);
        #[expect(clippy::cast_possible_truncation, reason = "the slack makes more than good")]
        let tolerance = tolerance_m as f32;
        for (k, (corners, id)) in (0_u32..).zip(block.triangles.iter().zip(block.ids)) {
            let corner = corners.map(usize::from);
            let (x, y, z) = (corner.map(|i| xs[i]), corner.map(|i| ys[i]), corner.map(|i| zs[i]));
            let near = least(z);
            // A corner behind the camera has depth 0 here.
            if near > 0.0 {
                if let Some((range, m)) = limits.range(x, y, near)
                    && grid.holds_points(starts, range)
                {
                    let edges = limits.edges(x, y, z, m);
                    let wanted = Wanted { edges, near, id: id.0 };
                    if might_hide(grid, starts, range, &points.slices(), &wanted) {
                        let beyond = (greatest(z) + tolerance) * LIMIT_SLACK * LIMIT_SLACK;
                        collect(grid, starts, range, points, (&wanted, beyond, k), found);
                    }
                }
            } else if reaches_in(photo, grid, block.corners(k as usize)) {
                found.anywhere.push(k);
            }
        }
    }
}

/// Places every vertex of a block in the grid; depth 0 stands for one that is not before the camera.
#[inline(always)]
fn place_vertices(
    photo: &ViewPhoto,
    grid: &Grid,
    block: &FaceBlock<'_>,
    vertices: &mut [Vec<f32>; 3],
) {
    let count = block.positions.len();
    for of in &mut *vertices {
        of.clear();
        of.resize(count, 0.0);
    }
    let [xs, ys, zs] = vertices.each_mut().map(|of| &mut of[..count]);
    let (pose, least, scale) = (photo.pose, grid.least, grid.scale);
    for (k, &p) in block.positions.iter().enumerate() {
        let q = to_camera(&pose, p);
        let at = (ray_of(q) - least) * scale;
        #[expect(clippy::cast_possible_truncation, reason = "its rounding is bounded")]
        let [x, y, z] = [at.x as f32, at.y as f32, q.z as f32];
        (xs[k], ys[k]) = (x, y);
        zs[k] = if z > 0.0 { z } else { 0.0 };
    }
}

/// Edge functions `a x + b y + c` of places, not negative inside a face or so near that f32 cannot tell.
#[derive(Debug, Clone, Copy)]
struct Edges {
    a: [f32; 3],
    b: [f32; 3],
    c: [f32; 3],
    /// Not below the greatest value of an edge function at which f32 cannot tell the side.
    unsure: f32,
}

/// Those of a face that may be anywhere in its bounds.
const ANYWHERE: Edges = Edges { a: [0.0; 3], b: [0.0; 3], c: [0.0; 3], unsure: f32::INFINITY };

impl Edges {
    /// Whether the face holds a place, whatever rounding has done.
    fn certainly_hold(&self, (x, y): (f32, f32)) -> bool {
        let Self { a, b, c, unsure } = self;
        (0..3).all(|k| a[k] * x + b[k] * y + c[k] > *unsure)
    }
}

/// Greatest place that f32 arithmetic is trusted with: products of two stay far from overflow.
const GREATEST_PLACE: f32 = 1e9;

/// What the bounds of every face of a block are compared with.
#[derive(Debug, Clone, Copy)]
struct Limits {
    all: Range,
    columns: f32,
    rows: f32,
    far: f32,
    /// Rays are within `least_reach` + `ray_a_cell` · m, in |x| + |y| + 1, where m is the greatest coordinate in cells.
    least_reach: f32,
    ray_a_cell: f32,
    /// Tolerance of the exact test for corners at one depth and a reach of 1, cells².
    exact: f32,
}

impl Limits {
    #[expect(clippy::cast_possible_truncation, reason = "bounds with room for rounding")]
    fn new(grid: &Grid) -> Self {
        Self {
            all: grid.all(),
            columns: grid.columns as f32,
            rows: grid.rows as f32,
            far: grid.far,
            least_reach: (1.001 + grid.least.abs().element_sum()) as f32,
            ray_a_cell: (2.001 / grid.scale.min_element()) as f32,
            exact: (1.001 * RayTriangle::ROUNDING * grid.scale.x * grid.scale.y) as f32,
        }
    }

    /// The cells that a face in front of the camera may touch, and the greatest coordinate, which is not a number or
    /// too great if f32 is not to be trusted; `None` if it can hide nothing.
    #[inline(always)]
    fn range(&self, x: [f32; 3], y: [f32; 3], near: f32) -> Option<(Range, f32)> {
        let (x0, x1, y0, y1) = (least(x), greatest(x), least(y), greatest(y));
        let size = greatest([self.columns, self.rows, 0.0]);
        let m = greatest([greatest([-x0, x1, -y0]), y1, size]);
        if m.is_nan() || m >= GREATEST_PLACE {
            return Some((self.all, m));
        }
        let margin = CELL_MARGIN + PLACE_ROUNDING * m;
        let (x0, x1, y0, y1) = (x0 - margin, x1 + margin, y0 - margin, y1 + margin);
        let misses = x1 < 0.0 || y1 < 0.0 || x0 >= self.columns || y0 >= self.rows;
        if misses || near >= self.far {
            return None;
        }
        let range = Range {
            x0: index(x0),
            x1: index(x1).min(self.all.x1),
            y0: index(y0),
            y1: index(y1).min(self.all.y1),
        };
        Some((range, m))
    }

    /// The edges of a face with the greatest coordinate `m`.
    #[inline(always)]
    fn edges(&self, x: [f32; 3], y: [f32; 3], z: [f32; 3], m: f32) -> Edges {
        if m.is_nan() || m >= GREATEST_PLACE {
            return ANYWHERE;
        }
        let (x0, x1, y0, y1) = (least(x), greatest(x), least(y), greatest(y));
        let doubled_area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
        let margin = CELL_MARGIN + PLACE_ROUNDING * m;
        let across = (x1 - x0) + (y1 - y0) + 4.0 * margin;
        if doubled_area.abs() <= 2.0 * EDGE_ROUNDING * m * across {
            return ANYWHERE;
        }
        let side = if doubled_area < 0.0 { -1.0 } else { 1.0 };
        let reach = self.least_reach + self.ray_a_cell * m;
        let steepness = greatest(z) / least(z);
        let exact = self.exact * steepness * steepness * (reach * reach * reach);
        let mut edges = Edges { unsure: 0.0, ..ANYWHERE };
        for (k, (p, q)) in [(0, 1), (1, 2), (2, 0)].into_iter().enumerate() {
            let (a, b) = ((y[p] - y[q]) * side, (x[q] - x[p]) * side);
            let room = EDGE_ROUNDING * m * (a.abs() + b.abs()) + exact;
            (edges.a[k], edges.b[k], edges.c[k]) = (a, b, room - (a * x[p] + b * y[p]));
            // The room that was added, and as much again.
            let unsure = 2.0 * room;
            edges.unsure = if unsure > edges.unsure { unsure } else { edges.unsure };
        }
        edges
    }
}

/// What points are compared with for one face.
struct Wanted {
    edges: Edges,
    near: f32,
    id: u32,
}

impl Wanted {
    /// Whether the face might hide a point.
    #[inline(always)]
    fn hits(&self, (x, y): (f32, f32), limit: f32, face: u32) -> bool {
        let Edges { a, b, c, .. } = &self.edges;
        (a[0] * x + b[0] * y + c[0] >= 0.0)
            & (a[1] * x + b[1] * y + c[1] >= 0.0)
            & (a[2] * x + b[2] * y + c[2] >= 0.0)
            & (self.near < limit)
            & (face != self.id)
    }
}

/// Whether a face might hide a point of another face in a range of cells. Points beyond the range's ends are tested
/// along with the last ones, which does no harm.
#[inline(always)]
fn might_hide(
    grid: &Grid,
    starts: &[u32],
    range: Range,
    points: &Slices<'_>,
    wanted: &Wanted,
) -> bool {
    // All bits of a lane where there is a hit.
    let mut hits = [0_u32; LANES];
    for row in range.rows() {
        let of_row = grid.points_of(starts, range, row);
        let mut k = of_row.start;
        while k < of_row.end {
            let (x, y) = (lanes(points.x, k), lanes(points.y, k));
            let (limit, face) = (lanes(points.limit, k), lanes(points.face, k));
            for lane in 0..LANES {
                let is_hit = wanted.hits((x[lane], y[lane]), limit[lane], face[lane]);
                hits[lane] |= u32::from(is_hit).wrapping_neg();
            }
            k = k.wrapping_add(LANES);
        }
    }
    hits.iter().any(|&hit| hit != 0)
}

/// Finds the points that a face might hide, and hides those that it certainly does: the point lies within the edges by
/// more than the rounding on either side, and has a limit of more than `beyond`, past all of the face.
///
/// A limit is the point's depth z, less at most ε, and `beyond` is the face's greatest depth, plus ε, both with slack:
/// so the exact limit is past the face. A face that has edges here is not edge-on, so the exact test finds its depth.
fn collect(
    grid: &Grid,
    starts: &[u32],
    range: Range,
    points: &mut SortedPoints,
    (wanted, beyond, triangle): (&Wanted, f32, u32),
    found: &mut Found,
) {
    for row in range.rows() {
        for k in grid.points_of(starts, range, row) {
            let (at, limit) = ((points.x[k], points.y[k]), points.limit[k]);
            if !wanted.hits(at, limit, points.face[k]) {
                continue;
            }
            let point = u32::try_from(k).expect("a tile has fewer than 2³² pixels");
            if limit > beyond && wanted.edges.certainly_hold(at) {
                points.limit[k] = 0.0;
                found.hidden.push(point);
            } else {
                found.pairs.push((triangle, point));
            }
        }
    }
}

/// [`SortedPoints`] as slices of one length, so that one check serves them all.
struct Slices<'a> {
    x: &'a [f32],
    y: &'a [f32],
    limit: &'a [f32],
    face: &'a [u32],
}

impl SortedPoints {
    #[inline(always)]
    fn slices(&self) -> Slices<'_> {
        let count = self.x.len();
        Slices {
            x: &self.x[..count],
            y: &self.y[..count],
            limit: &self.limit[..count],
            face: &self.face[..count],
        }
    }
}

#[inline(always)]
fn lanes<T>(of: &[T], from: usize) -> &[T; LANES] {
    of[from..from.wrapping_add(LANES)].first_chunk().expect("so many")
}

/// Whether a face with a corner behind the camera may reach into the rays of the points, nearer than any limit.
fn reaches_in(photo: &ViewPhoto, grid: &Grid, corners: [DVec3; 3]) -> bool {
    let corners = corners.map(|p| photo.camera_from_local(p));
    corners.iter().any(|q| q.z > 0.0)
        && grid.rays.is_some_and(|rays| Shaft::rays_may_meet(&rays, corners))
}

/// The least; what is not a number counts as nothing or as itself.
#[inline(always)]
fn least([a, b, c]: [f32; 3]) -> f32 {
    let ab = if a < b { a } else { b };
    if ab < c { ab } else { c }
}

/// The greatest.
#[inline(always)]
fn greatest([a, b, c]: [f32; 3]) -> f32 {
    let ab = if a > b { a } else { b };
    if ab > c { ab } else { c }
}

/// A coordinate's whole part; negative ones and NaN give 0.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturating by intent")]
fn index(v: f32) -> u32 {
    v as u32
}
