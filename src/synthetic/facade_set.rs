//! [`FacadeSet`]: the façade with its photos and its mosaic, as the demo and the paper-sized job take them.

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;

use super::facade::{FACADE_SIZE, facade};
use super::files::{names, write_colmap, write_picture, write_project};
use super::photograph::{Sampling, photograph, write};
use super::{
    CameraSpec, Caster, Depth, Placement, PlaneSpec, PlyOptions, Refinement, Scene, Shot, Texture,
    photos, write_ply,
};
use crate::Result;
use crate::camera::LensModel;
use crate::geom::Size;
use crate::image::{Image, Samples};

/// A job on the façade: how many faces, which photos, which mosaic.
#[derive(Debug, Clone, PartialEq)]
pub struct FacadeSet {
    /// Faces of the mesh, at least.
    pub faces: u64,
    /// Width and height of each of the seven photos; 4 : 3.
    pub photo: Size,
    /// Mosaic pixel, metres.
    pub pixel_size: f64,
    /// Extent of the mosaic, metres.
    pub extent: [f64; 4],
    /// Shortest wavelength of the texture, metres; four photo pixels or more.
    pub finest_m: f64,
    /// Where the façade stands.
    pub placement: Placement,
    /// Layers that the project file asks for.
    pub layers: Vec<&'static str>,
}

/// What writing a set did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written {
    /// Faces of the mesh.
    pub faces: u64,
    /// Photos.
    pub photos: usize,
}

/// Perspective centre, target (scene coordinates, metres) and roll (radians) of each photo: five along the
/// façade at eye level, the middle one upright; two from a scaffold.
const VIEWS: [([f64; 3], [f64; 3], f64); 7] = [
    ([0.3, 1.7, 5.3], [2.0, 2.15, -0.5], 0.012),
    ([2.1, 1.6, 5.4], [2.5, 2.45, -0.5], -0.021),
    ([3.9, 1.8, 5.6], [3.7, 2.70, -0.5], 1.560),
    ([5.5, 1.6, 5.3], [4.9, 2.45, -0.5], 0.017),
    ([7.2, 1.7, 5.2], [5.4, 2.15, -0.5], -0.010),
    ([1.6, 4.2, 5.7], [2.5, 3.35, -0.5], 0.015),
    ([6.0, 4.4, 5.6], [5.0, 3.35, -0.5], -0.014),
];

impl FacadeSet {
    /// The demo: about 300,000 faces, seven photos of 1296 × 972, 4 mm pixels, all layers.
    pub fn demo() -> Self {
        Self {
            faces: 300_000,
            photo: Size::new(1296, 972),
            pixel_size: 0.004,
            // No edge of the façade, on multiples of a millimetre, passes through the centre of a pixel.
            extent: [-0.1207, -0.0411, 7.5193, 5.5589],
            finest_m: 0.026,
            placement: Placement::upright(DVec3::new(120.0, 350.0, 61.5), 0.35),
            layers: vec!["elevation", "face", "count", "used", "coverage", "best"],
        }
    }

    /// The paper's size: about 3 million faces, seven photos of 2592 × 1944, a mosaic of 3720 × 2775 pixels of 2 mm.
    pub fn paper() -> Self {
        Self {
            faces: 3_000_000,
            photo: Size::new(2592, 1944),
            pixel_size: 0.002,
            extent: [-0.02, -0.02, 7.42, 5.53],
            finest_m: 0.013,
            layers: Vec::new(),
            ..Self::demo()
        }
    }

    /// The scene.
    pub fn scene(&self) -> Scene {
        facade(self.placement, Texture::new(self.finest_m))
    }

    /// The mosaic's frame: elevation 0 is the front of the arcade.
    pub fn plane(&self) -> PlaneSpec {
        PlaneSpec::of_scene(&self.placement, self.pixel_size, self.extent)
    }

    /// The camera of all photos: one lens with the distortion of a common wide-angle.
    pub fn camera(&self) -> CameraSpec {
        let (width, height) = (f64::from(self.photo.width), f64::from(self.photo.height));
        let focal = 0.83 * width;
        let params = vec![
            focal,
            focal * 1.0006,
            width * 0.5038,
            height * 0.4951,
            -0.118,
            0.062,
            0.000_9,
            -0.000_7,
        ];
        CameraSpec { model: LensModel::OpenCv, size: self.photo, params }
    }

    /// The seven shots.
    pub fn shots(&self) -> Vec<Shot> {
        let camera = self.camera();
        let views = VIEWS.iter().zip(1..);
        views
            .map(|((centre, target, roll), k)| {
                let ends = [DVec3::from(*centre), DVec3::from(*target)];
                Shot::towards(&format!("IMG_{k:04}.jpg"), &camera, &self.placement, ends, *roll)
            })
            .collect()
    }

    /// Writes mesh, photos, cameras, frame and project file into `folder`, which is made.
    ///
    /// # Errors
    /// [`crate::Error::Io`] if a file cannot be written; [`crate::Error::Limit`] for a mesh beyond 2³¹ faces.
    pub fn write(&self, folder: &Path) -> Result<Written> {
        let (scene, shots) = (self.scene(), self.shots());
        write_colmap(&folder.join(names::CAMERAS), &shots)?;
        write_project(folder, &self.plane(), &self.layers)?;
        let mesh = Refinement::by_face_count(&scene, self.faces)?;
        write_ply(&folder.join(names::MESH), &mesh, &PlyOptions::default())?;
        let caster = Caster::of_scene(&scene);
        for photo in photos(&shots)?.photos {
            let picture = Samples::U8(photograph(&caster, &photo, Sampling::Edges(3), 3));
            write_picture(&folder.join(names::PHOTOS).join(&photo.name), &picture)?;
        }
        Ok(Written { faces: mesh.face_count(), photos: shots.len() })
    }

    /// The mosaic as it should be, `height × width × 3`: the texture at the point that each pixel's centre shows;
    /// and its mask, 255 where there is a surface.
    pub fn expected(&self) -> (Image<u8>, Image<u8>) {
        let (caster, plane) = (Caster::of_scene(&self.scene()), self.plane());
        let (size, n) = (plane.size(), plane.n());
        let mut colours = Image::filled(size, 3, 0_u8);
        let mut mask = Image::filled(size, 1, 0_u8);
        let width = size.width as usize;
        let rows =
            colours.data_mut().par_chunks_mut(3 * width).zip(mask.data_mut().par_chunks_mut(width));
        rows.zip(0_u32..size.height).for_each(|((colours, mask), y)| {
            let mut near = None;
            for ((pixel, mask), x) in colours.chunks_exact_mut(3).zip(mask).zip(0_u32..) {
                let centre = glam::DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let at = plane.plane_from_pixel(centre);
                let front = plane.origin + plane.u_axis * at.x + plane.v_axis * at.y + n * FRONT;
                if let Some(hit) = caster.cast(front, -n, near.as_ref()) {
                    write(pixel, caster.colour(&hit));
                    *mask = u8::of_unit(1.0);
                    near = Some(hit);
                }
            }
        });
        (colours, mask)
    }

    /// Width and height of the façade, metres.
    pub fn facade_size() -> [f64; 2] {
        FACADE_SIZE
    }
}

/// An elevation before all of the façade, metres.
const FRONT: f64 = 5.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::likeness;

    #[test]
    fn the_paper_s_mosaic_is_3720_by_2775_pixels() {
        assert_eq!(FacadeSet::paper().plane().size(), Size::new(3720, 2775));
    }

    #[test]
    fn almost_all_of_the_facade_is_seen_by_some_photo_and_most_by_three() {
        let set = FacadeSet::demo();
        let caster = Caster::of_scene(&set.scene());
        let photos = photos(&set.shots()).unwrap().photos;
        let (mut points, mut once, mut thrice) = (0, 0, 0);
        for y in 1..110 {
            for x in 1..148 {
                let from = DVec3::new(f64::from(x) * 0.05, f64::from(y) * 0.05, 5.0);
                let from = set.placement.ground_from_scene(from);
                let hit = caster.cast(from, -set.placement.n(), None).unwrap();
                let sees = |photo: &&crate::camera::Photo| {
                    let c = photo.pose.camera_from_ground(hit.ground);
                    let at = photo.lens.photo_from_ray(c.truncate() / c.z);
                    let along = hit.ground - photo.pose.centre_ground;
                    let first = caster.cast(photo.pose.centre_ground, along, None);
                    c.z > 0.0
                        && at.is_some_and(|at| photo.lens.contains(at))
                        && first.is_some_and(|f| f.ground.distance(hit.ground) < 1e-3)
                };
                let count = photos.iter().filter(sees).count();
                points += 1;
                once += u32::from(count >= 1);
                thrice += u32::from(count >= 3);
            }
        }
        assert!(once * 100 > points * 96, "{once} of {points}");
        assert!(thrice * 100 > points * 80, "{thrice} of {points}");
    }

    #[test]
    fn a_small_set_is_written_and_its_expected_mosaic_covers_the_facade() {
        let set = FacadeSet {
            faces: 5_000,
            photo: Size::new(64, 48),
            pixel_size: 0.05,
            finest_m: 0.5,
            ..FacadeSet::demo()
        };
        let folder = tempfile::tempdir().unwrap();
        let written = set.write(folder.path()).unwrap();
        assert!(written.faces >= 5_000 && written.photos == 7);
        for k in 1..=7 {
            let photo =
                ::image::open(folder.path().join(format!("photos/IMG_{k:04}.jpg"))).unwrap();
            assert_eq!((photo.width(), photo.height()), (64, 48));
        }
        let (colours, mask) = set.expected();
        assert_eq!(colours.size(), set.plane().size());
        let found = likeness(colours.view(), colours.view(), mask.view());
        assert!(
            found.pixels * 100 > set.plane().size().area() * 90
                && found.pixels < set.plane().size().area()
        );
    }
}
