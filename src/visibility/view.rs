//! What sampling and blending need of the points that a photo sees.

use glam::{DVec2, DVec3};

use super::photo::{ViewPhoto, ray_of};
use crate::frame::LocalMosaic;
use crate::geom::{held_bytes, orient2d};
use crate::surface::{SurfaceFace, SurfaceTile};

/// A pixel that the photo sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewPoint {
    /// Pixel of the surface tile.
    pub pixel: u32,
    /// Photo position, pixels, distorted.
    pub position: DVec2,
    /// Photo pixels that the mosaic pixel covers: the determinant of the Jacobian of the distorted projection on the
    /// face at the point.
    pub footprint_squared: f64,
    /// The face's area in photo pixels.
    pub weight: f64,
}

/// A vertex in one photo.
#[derive(Debug, Clone, Copy)]
enum Projection {
    Unknown,
    /// Behind the camera or beyond the lens.
    Nowhere,
    At(DVec2),
}

/// The pixels of a part of a surface tile that one photo sees, in the order given.
#[derive(Debug, Default)]
pub struct ViewTile {
    /// The pixels.
    pub points: Vec<ViewPoint>,
    /// Weight of each face of the surface tile that was met; NaN: not yet computed.
    face_weights: Vec<f64>,
    projections: Vec<Projection>,
}

impl ViewTile {
    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.points) + held_bytes(&self.face_weights) + held_bytes(&self.projections)
    }

    /// Starts a block: no face's weight is known.
    pub fn start_block(&mut self, surface: &SurfaceTile) {
        self.face_weights.clear();
        self.face_weights.resize(surface.faces.len(), f64::NAN);
        self.projections.clear();
        self.projections.resize(surface.vertices.len(), Projection::Unknown);
    }

    /// Computes the view of `pixels` of the surface tile, which the photo sees.
    ///
    /// # Panics
    /// If a pixel shows no surface or is outside the tile.
    pub fn view(
        &mut self,
        surface: &SurfaceTile,
        mosaic: &LocalMosaic,
        photo: &ViewPhoto,
        pixels: impl Iterator<Item = usize>,
    ) {
        self.points.clear();
        let axis = mosaic.towards_viewer();
        let pixel_area = mosaic.pixel_size() * mosaic.pixel_size();
        for pixel in pixels {
            let face_index = surface.faces_at[pixel] as usize;
            let face = &surface.faces[face_index];
            let point = surface.points[pixel];
            let q = photo.camera_from_local(point);
            // Inside the valid radius, or the point would not be listed; a refusal here is rounding at the radius.
            let Some((position, lens)) = photo.lens.photo_from_ray_jacobian(ray_of(q)) else {
                continue;
            };
            // Photo pixels per square metre on the face, times twice the face's area.
            let magnification = lens.determinant().abs() / (q.z * q.z * q.z);
            let spread = face.normal.dot(point - photo.pose.centre).abs() * magnification;
            // The same over the mosaic pixel's part of the face's plane.
            let footprint_squared = pixel_area * spread / face.normal.dot(axis).abs();
            let mut weight = self.face_weights[face_index];
            if weight.is_nan() {
                match self.projected_area(surface, photo, face) {
                    Some(area) => {
                        weight = area;
                        self.face_weights[face_index] = area;
                    }
                    // A vertex is behind the camera or beyond the lens: the Jacobian at the point stands in.
                    None => weight = 0.5 * spread,
                }
            }
            let pixel = u32::try_from(pixel).expect("a tile has fewer than 2³² pixels");
            self.points.push(ViewPoint { pixel, position, footprint_squared, weight });
        }
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

fn project(photo: &ViewPhoto, p: DVec3) -> Projection {
    let q = photo.camera_from_local(p);
    let position = if q.z > 0.0 { photo.lens.photo_from_ray(ray_of(q)) } else { None };
    position.map_or(Projection::Nowhere, Projection::At)
}
