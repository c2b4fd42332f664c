//! What sampling and blending need of the points that a photo sees.

use glam::{DVec2, DVec3};

use super::photo::{ViewPhoto, ray_of};
use super::points::SUB_BLOCK;
use super::sight::Batch;
use crate::camera::RAYS;
use crate::frame::LocalMosaic;
use crate::geom::{PixelRect, held_bytes, orient2d};
use crate::surface::{SurfaceFace, SurfaceTile};

/// A vertex in one photo.
#[derive(Debug, Clone, Copy)]
enum Projection {
    Unknown,
    /// Behind the camera or beyond the lens.
    Nowhere,
    At(DVec2),
}

/// A face in one photo.
#[derive(Debug, Clone, Copy)]
struct FaceView {
    /// Its area in photo pixels; NaN if a corner has no projection, [`UNKNOWN`] before the face was met.
    area: f64,
    /// Photo pixels that a mosaic pixel's part of the face's plane covers at a point, by the magnification there over
    /// the depth cubed; where lines are not parallel, still to be divided by the face's normal along [`SurfaceTile::lines`].
    pixel_spread: f64,
}

/// No area.
const UNKNOWN: f64 = -1.0;

/// The pixels of a part of a surface tile that one photo sees, in the order given; one entry a pixel in each array.
#[derive(Debug, Default)]
pub struct ViewTile {
    /// Index in the sub-block, row-major.
    pub pixels: Vec<u32>,
    /// Photo position, pixels, distorted.
    pub positions: Vec<DVec2>,
    /// Photo pixels that the mosaic pixel covers: the determinant of the Jacobian of the distorted projection on the
    /// face at the point.
    pub footprints_squared: Vec<f64>,
    /// The face's area in photo pixels.
    pub weights: Vec<f64>,
    /// Square of the cosine of the angle between the photo's ray and the mosaic's line through the point; empty unless
    /// they are asked for.
    pub slants: Vec<f32>,
    has_slants: bool,
    faces: Vec<FaceView>,
    projections: Vec<Projection>,
    batch: Batch,
}

impl ViewTile {
    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.pixels)
            + held_bytes(&self.positions)
            + held_bytes(&self.footprints_squared)
            + held_bytes(&self.weights)
            + held_bytes(&self.slants)
            + held_bytes(&self.faces)
            + held_bytes(&self.projections)
    }

    /// Whether the photo sees none of the pixels.
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }

    /// Keeps the pixels for which `is_kept` says so, in order.
    ///
    /// # Panics
    /// If there are not as many.
    pub fn retain(&mut self, is_kept: &[bool]) {
        fn keep<T>(of: &mut Vec<T>, is_kept: &[bool]) {
            assert_eq!(of.len(), is_kept.len(), "one answer a pixel");
            let mut is_kept = is_kept.iter();
            of.retain(|_| is_kept.next().is_some_and(|kept| *kept));
        }
        keep(&mut self.pixels, is_kept);
        keep(&mut self.positions, is_kept);
        keep(&mut self.footprints_squared, is_kept);
        keep(&mut self.weights, is_kept);
        if self.has_slants {
            keep(&mut self.slants, is_kept);
        }
    }

    /// Starts a block: no face is known. Whether slants are asked for.
    pub fn start_block(&mut self, surface: &SurfaceTile, has_slants: bool) {
        self.has_slants = has_slants;
        self.faces.clear();
        let unknown = FaceView { area: UNKNOWN, pixel_spread: 0.0 };
        self.faces.resize(surface.faces.len(), unknown);
        self.projections.clear();
        self.projections.resize(surface.vertices.len(), Projection::Unknown);
    }

    /// Computes the view of those pixels of the sub-block `sub` of the surface tile that the photo sees; `places` are
    /// row × [`SUB_BLOCK`] + column.
    ///
    /// # Panics
    /// If a pixel shows no surface or is outside the tile.
    pub fn view(
        &mut self,
        surface: &SurfaceTile,
        mosaic: &LocalMosaic,
        photo: &ViewPhoto,
        sub: PixelRect,
        places: impl Iterator<Item = u16>,
    ) {
        self.pixels.clear();
        self.positions.clear();
        self.footprints_squared.clear();
        self.weights.clear();
        self.slants.clear();
        let stride = surface.rect.width();
        let first = surface.pixel_at(sub.x0, sub.y0);
        let side = usize::try_from(SUB_BLOCK).expect("positive");
        let (mut at, mut in_sub) = ([0_usize; RAYS], [0_u32; RAYS]);
        let mut places = places;
        loop {
            let mut count = 0;
            for ((at, in_sub), place) in at.iter_mut().zip(&mut in_sub).zip(&mut places) {
                let (row, column) = (usize::from(place) / side, usize::from(place) % side);
                *at = first + row * stride + column;
                *in_sub = u32::try_from(row * sub.width() + column).expect("a small block");
                count += 1;
            }
            if count == 0 {
                return;
            }
            let ([mut x, mut y, mut z], points) = ([[0.0; RAYS]; 3], &surface.points);
            for (k, &pixel) in at[..count].iter().enumerate() {
                (x[k], y[k], z[k]) = (points.x[pixel], points.y[pixel], points.z[pixel]);
            }
            self.batch.sight(photo, [&x[..count], &y[..count], &z[..count]]);
            photo.lens.photos_from_rays_jacobian(&mut self.batch.rays, count);
            self.pixels.extend_from_slice(&in_sub[..count]);
            self.push(surface, mosaic, photo, &at[..count]);
            if self.has_slants {
                self.push_slants(surface, mosaic, photo, &at[..count]);
            }
        }
    }

    /// Enters the slants of the points of the batch, which are the pixels `at` of the surface tile.
    #[expect(clippy::cast_possible_truncation, reason = "a weight is made of it")]
    fn push_slants(
        &mut self,
        surface: &SurfaceTile,
        mosaic: &LocalMosaic,
        photo: &ViewPhoto,
        at: &[usize],
    ) {
        let turn = photo.pose.rotation;
        let parallel = mosaic.is_parallel().then(|| turn * mosaic.towards_viewer(DVec3::ZERO));
        let rays = &self.batch.rays;
        self.slants.extend(at.iter().zip(rays.x).zip(rays.y).map(|((&pixel, x), y)| {
            let line = parallel.unwrap_or_else(|| turn * surface.lines.at(pixel));
            let along = line.x * x + line.y * y + line.z;
            let slant = along * along / ((x * x + y * y + 1.0) * line.length_squared());
            slant as f32
        }));
    }

    /// Enters the first points of the batch, which are the pixels `at` of the surface tile.
    fn push(
        &mut self,
        surface: &SurfaceTile,
        mosaic: &LocalMosaic,
        photo: &ViewPhoto,
        at: &[usize],
    ) {
        let (mut footprints, mut weights) = ([0.0; RAYS], [0.0; RAYS]);
        let mut positions = [DVec2::ZERO; RAYS];
        for (k, &pixel) in at.iter().enumerate() {
            let face = surface.faces_at[pixel] as usize;
            if self.faces[face].area == UNKNOWN {
                self.faces[face] = self.face_view(surface, mosaic, photo, &surface.faces[face]);
            }
            let FaceView { area, pixel_spread } = self.faces[face];
            let depth = self.batch.depth[k];
            let magnification = self.batch.rays.magnification[k] / (depth * depth * depth);
            footprints[k] = pixel_spread * magnification;
            if !surface.lines.is_empty() {
                // Here `pixel_spread` is for an area of 1 square to a line of length 1.
                let slope = surface.faces[face].normal.dot(surface.lines.at(pixel)).abs();
                footprints[k] /= slope;
            }
            weights[k] = area;
            if area.is_nan() {
                // A vertex is behind the camera or beyond the lens: the Jacobian at the point stands in.
                weights[k] = 0.5 * spread(surface, photo, &surface.faces[face]) * magnification;
            }
            positions[k] = DVec2::new(self.batch.rays.photo_x[k], self.batch.rays.photo_y[k]);
        }
        let count = at.len();
        self.positions.extend_from_slice(&positions[..count]);
        self.footprints_squared.extend_from_slice(&footprints[..count]);
        self.weights.extend_from_slice(&weights[..count]);
    }

    fn face_view(
        &mut self,
        surface: &SurfaceTile,
        mosaic: &LocalMosaic,
        photo: &ViewPhoto,
        face: &SurfaceFace,
    ) -> FaceView {
        let pixel_spread = match mosaic {
            LocalMosaic::Plane(plane) => {
                let pixel_area = plane.pixel_size() * plane.pixel_size();
                let slope = face.normal.dot(plane.towards_viewer()).abs();
                pixel_area * spread(surface, photo, face) / slope
            }
            _ => spread(surface, photo, face),
        };
        let area = self.projected_area(surface, photo, face).unwrap_or(f64::NAN);
        FaceView { area, pixel_spread }
    }

    /// Area of a face in photo pixels, its corners projected with distortion; `None` if one has no projection.
    fn projected_area(
        &mut self,
        surface: &SurfaceTile,
        photo: &ViewPhoto,
        face: &SurfaceFace,
    ) -> Option<f64> {
        let mut corners = [DVec2::ZERO; 3];
        for (corner, &vertex) in corners.iter_mut().zip(&face.corners) {
            let known = &mut self.projections[vertex as usize];
            if matches!(known, Projection::Unknown) {
                *known = project(photo, surface.vertices[vertex as usize]);
            }
            match *known {
                Projection::At(position) => *corner = position,
                _ => return None,
            }
        }
        let [a, b, c] = corners;
        Some(0.5 * orient2d(a, b, c).abs())
    }
}

/// Six times the volume that a face spans with the perspective centre: by the magnification on a ray over the depth
/// cubed, twice the face's area in photo pixels if all of it were at that point.
fn spread(surface: &SurfaceTile, photo: &ViewPhoto, face: &SurfaceFace) -> f64 {
    let [a, ..] = surface.corners(face);
    face.normal.dot(a - photo.pose.centre).abs()
}

fn project(photo: &ViewPhoto, p: DVec3) -> Projection {
    let q = photo.camera_from_local(p);
    let position = if q.z > 0.0 { photo.lens.photo_from_ray(ray_of(q)) } else { None };
    position.map_or(Projection::Nowhere, Projection::At)
}
