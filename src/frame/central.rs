//! [`LocalCentral`]: the grid of pixels of a perspective view, in local coordinates.
//!
//! The ray of a pixel is that of its centre through the lens, whose distortion is undone pixel by pixel: straight edges
//! of faces stay what they are, whatever the picture makes of them. The elevation is the depth along the viewing axis.

use glam::{DVec2, DVec3};

use super::local::PixelRay;
use crate::camera::{Lens, LocalPose};
use crate::geom::{Bounds2, Bounds3, Coordinates, PixelRect, held_bytes};

/// Room for rounding, relative to the rays' coordinates.
const ROUNDING: f64 = 1e-9;

/// A perspective view, related to local coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalCentral {
    lens: Lens,
    pose: LocalPose,
    slab: [f64; 2],
}

impl LocalCentral {
    pub(super) fn new(lens: &Lens, pose: LocalPose, slab: [f64; 2]) -> Self {
        Self { lens: *lens, pose, slab }
    }

    /// `[min, max]` of the depths shown, metres.
    pub fn slab(&self) -> [f64; 2] {
        self.slab
    }

    /// The perspective centre.
    pub fn centre(&self) -> DVec3 {
        self.pose.centre
    }

    /// The viewing axis, a unit vector.
    pub fn axis(&self) -> DVec3 {
        self.pose.rotation.row(2)
    }

    /// Mean focal length, pixels.
    pub fn focal_px(&self) -> f64 {
        let focal = self.lens.focal_px();
        (focal.x * focal.y).sqrt()
    }

    /// The point in camera axes, metres.
    #[inline]
    pub fn camera_from_local(&self, point: DVec3) -> DVec3 {
        self.pose.camera_from_local(point)
    }

    /// The ray through a place of the picture, if the lens has one.
    pub fn ray(&self, x: f64, y: f64) -> Option<PixelRay> {
        let ray = self.lens.ray_from_photo(DVec2::new(x, y))?;
        let direction = self.pose.rotation.transpose() * DVec3::new(ray.x, ray.y, 1.0);
        Some(PixelRay { origin: self.pose.centre, direction })
    }

    pub(super) fn project(&self, point: DVec3) -> DVec3 {
        let q = self.camera_from_local(point);
        let at = if q.z > 0.0 { self.lens.photo_from_ray(q.truncate() / q.z) } else { None };
        at.map_or(DVec3::NAN, |at| at.extend(q.z))
    }

    pub(super) fn pixel_area(&self, point: DVec3) -> f64 {
        let q = self.camera_from_local(point);
        let slope = self.lens.photo_from_ray_jacobian(q.truncate() / q.z);
        slope.map_or(f64::NAN, |(_, slope)| q.z * q.z / slope.determinant().abs())
    }

    pub(super) fn box_range(&self, bounds: &Bounds3) -> Option<Bounds3> {
        let size = self.lens.size();
        let end = DVec2::new(size.width.into(), size.height.into());
        let corners = bounds.corners().map(|c| self.camera_from_local(c));
        let depths = corners.map(|q| q.z);
        let near = depths.iter().copied().fold(f64::INFINITY, f64::min);
        let far = depths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if bounds.is_empty() || far <= 0.0 {
            return None;
        }
        let at = corners
            .map(|q| (q.z > 0.0).then(|| self.lens.photo_from_ray(q.truncate() / q.z)).flatten());
        let [min, max] = if at.iter().all(Option::is_some) {
            let found = Bounds2::of(at.into_iter().flatten());
            [found.min, found.max]
        } else {
            [DVec2::ZERO, end]
        };
        (min.x <= end.x && min.y <= end.y && max.x >= 0.0 && max.y >= 0.0)
            .then(|| Bounds3 { min: min.extend(near), max: max.extend(far) })
    }
}

/// The rays of a rectangle of pixels, in cells.
#[derive(Debug, Clone, Default)]
pub struct CentralBlock {
    /// The direction of each pixel's ray, row by row; not numbers where the lens has none.
    directions: Coordinates,
    /// Photo pixels a unit of ray and square, at each pixel.
    densities: Vec<f64>,
    /// Rays (x/z, y/z) of all pixels; empty if there are none.
    rays: Bounds2,
    columns: usize,
    rows: usize,
    /// First pixel of each cell in `pixels`, and their number at the end.
    starts: Vec<u32>,
    /// Pixels by the cell of their ray.
    pixels: Vec<u32>,
    cells: Vec<u32>,
}

impl CentralBlock {
    pub(super) fn set(&mut self, central: &LocalCentral, rect: PixelRect) {
        self.directions.clear();
        self.densities.clear();
        let mut rays = Vec::with_capacity(rect.area());
        let back = central.pose.rotation.transpose();
        for y in rect.y0..rect.y1 {
            for x in rect.x0..rect.x1 {
                let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let ray = central.lens.ray_from_photo(at);
                let slope = ray.and_then(|ray| central.lens.photo_from_ray_jacobian(ray));
                let (direction, density) = match (ray, slope) {
                    (Some(ray), Some((_, slope))) => {
                        (back * DVec3::new(ray.x, ray.y, 1.0), slope.determinant().abs())
                    }
                    _ => (DVec3::NAN, f64::NAN),
                };
                self.directions.push(direction);
                self.densities.push(density);
                rays.push(ray.filter(|_| density.is_finite()));
            }
        }
        self.rays = Bounds2::of(rays.iter().flatten().copied());
        (self.columns, self.rows) = (rect.width().max(1), rect.height().max(1));
        self.sort(&rays);
    }

    /// A counting sort of the pixels by the cell of their ray.
    fn sort(&mut self, rays: &[Option<DVec2>]) {
        self.starts.clear();
        self.starts.resize(self.columns * self.rows + 1, 0);
        self.cells.clear();
        for ray in rays {
            let cell = ray.map(|ray| {
                let [column, row] = self.cell(ray);
                row * self.columns + column
            });
            self.cells.push(cell.map_or(u32::MAX, |c| u32::try_from(c).expect("a small block")));
        }
        for &cell in self.cells.iter().filter(|c| **c != u32::MAX) {
            self.starts[cell as usize] += 1;
        }
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.pixels.clear();
        self.pixels.resize(sum as usize, 0);
        for (pixel, &cell) in self.cells.iter().enumerate().rev().filter(|(_, c)| **c != u32::MAX) {
            let at = &mut self.starts[cell as usize];
            *at -= 1;
            self.pixels[*at as usize] = u32::try_from(pixel).expect("a small block");
        }
    }

    /// The cell of a ray, or the nearest at the border.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped; what is not a number gives 0"
    )]
    fn cell(&self, ray: DVec2) -> [usize; 2] {
        let size = self.rays.max - self.rays.min;
        let along = |v: f64, min: f64, size: f64, count: usize| {
            let at = if size > 0.0 { (v - min) / size * count as f64 } else { 0.0 };
            at.clamp(0.0, (count - 1) as f64) as usize
        };
        [
            along(ray.x, self.rays.min.x, size.x, self.columns),
            along(ray.y, self.rays.min.y, size.y, self.rows),
        ]
    }

    /// The direction of the ray of pixel `k`, row by row: of unit depth; not numbers if it has none.
    ///
    /// # Panics
    /// If there is no such pixel.
    #[inline]
    pub fn direction(&self, k: usize) -> DVec3 {
        self.directions.at(k)
    }

    /// Area of pixel `k` at a depth, square to the viewing axis, m².
    ///
    /// # Panics
    /// If there is no such pixel.
    #[inline]
    pub fn area_at(&self, k: usize, depth: f64) -> f64 {
        depth * depth / self.densities[k]
    }

    /// Calls `visit` with each pixel whose ray a triangle may meet; its corners in camera axes.
    pub fn pixels_of(&self, corners: [DVec3; 3], mut visit: impl FnMut(usize)) {
        if self.pixels.is_empty() || corners.iter().all(|q| q.z <= 0.0) || self.misses(corners) {
            return;
        }
        let (from, to) = if corners.iter().all(|q| q.z > 0.0) {
            let met = Bounds2::of(corners.map(|q| q.truncate() / q.z));
            let room = ROUNDING * (1.0 + met.min.abs().max(met.max.abs()).max_element());
            (self.cell(met.min - room), self.cell(met.max + room))
        } else {
            ([0, 0], [self.columns - 1, self.rows - 1])
        };
        for row in from[1]..=to[1] {
            let first = row * self.columns;
            let range = self.starts[first + from[0]]..self.starts[first + to[0] + 1];
            for &pixel in &self.pixels[range.start as usize..range.end as usize] {
                visit(pixel as usize);
            }
        }
    }

    /// Whether a triangle lies beyond one side of the rays, by more than rounding can explain.
    fn misses(&self, corners: [DVec3; 3]) -> bool {
        let Bounds2 { min, max } = self.rays;
        let beyond = |side: &dyn Fn(DVec3) -> f64, slope: f64| {
            corners.iter().all(|&q| side(q) < -ROUNDING * (1.0 + slope.abs()) * q.length())
        };
        beyond(&|q| q.x - min.x * q.z, min.x)
            || beyond(&|q| max.x * q.z - q.x, max.x)
            || beyond(&|q| q.y - min.y * q.z, min.y)
            || beyond(&|q| max.y * q.z - q.y, max.y)
    }

    pub(super) fn may_show(&self, central: &LocalCentral, bounds: &Bounds3) -> bool {
        if self.pixels.is_empty() || bounds.is_empty() {
            return false;
        }
        let pose = &central.pose;
        let back = pose.rotation.transpose();
        let Bounds2 { min, max } = self.rays;
        let [low, high] = central.slab;
        let planes = [
            (DVec3::new(1.0, 0.0, -min.x), 0.0),
            (DVec3::new(-1.0, 0.0, max.x), 0.0),
            (DVec3::new(0.0, 1.0, -min.y), 0.0),
            (DVec3::new(0.0, -1.0, max.y), 0.0),
            (DVec3::Z, -low.max(0.0)),
            (DVec3::NEG_Z, high),
        ];
        let reach = (bounds.min - pose.centre).abs().max((bounds.max - pose.centre).abs());
        planes.iter().filter(|(_, offset)| offset.is_finite()).all(|&(normal, offset)| {
            let normal = back * normal;
            let (_, greatest) = bounds.linear_range(normal, offset - normal.dot(pose.centre));
            greatest >= -ROUNDING * (normal.length() * reach.element_sum() + offset.abs())
        })
    }

    pub(super) fn memory_bytes(&self) -> u64 {
        self.directions.memory_bytes()
            + held_bytes(&self.densities)
            + held_bytes(&self.starts)
            + held_bytes(&self.pixels)
            + held_bytes(&self.cells)
    }
}
