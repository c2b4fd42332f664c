//! [`StreetSet`]: a street of façades with many photos, for jobs that are large in every direction.
//!
//! In: how many façades, faces and photos. Out: a project's folder, as [`FacadeSet`] writes it. Every façade has
//! geometry of its own, and every photo a pose of its own, [`PHOTOS_PER_HOUSE`] to a façade; but only
//! [`PICTURES`] of the photos have pictures of their own, the others are further names (hard links) of the same
//! files: reading and decoding them costs what their own would, but for the disk. What such a mosaic shows is
//! therefore no known answer.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::facade::{FACADE_SIZE, HOUSE_STEP_M, facade, row_of_facades};
use super::files::{names, write_colmap, write_picture, write_project};
use super::random::hash_unit;
use super::{
    CameraSpec, Caster, FacadeSet, PlaneSpec, PlyOptions, Refinement, Sampling, Scene, Shot,
    Texture, Written, photograph, photos, write_ply,
};
use crate::image::Samples;
use crate::{Error, Result};

/// Photos that are taken before each façade.
pub const PHOTOS_PER_HOUSE: u32 = 10;

/// Different pictures; all photos beyond have one of these.
pub const PICTURES: u32 = 4;

/// A job on a street of façades.
#[derive(Debug, Clone, PartialEq)]
pub struct StreetSet {
    /// Façades side by side.
    pub houses: u32,
    /// Photos, from the first façade on; those beyond the last show nothing of the street.
    pub photos: u32,
    /// Faces (of the whole street), mosaic pixel, picture size, texture and placement; its extent and views do not
    /// count.
    pub set: FacadeSet,
}

impl StreetSet {
    /// The scene.
    pub fn scene(&self) -> Scene {
        row_of_facades(self.houses, self.set.placement, Texture::new(self.set.finest_m))
    }

    /// The mosaic's frame: that of the first façade, over all of them.
    pub fn plane(&self) -> PlaneSpec {
        let beyond = HOUSE_STEP_M * f64::from(self.houses.max(1) - 1);
        let [u0, v0, u1, v1] = [-0.02, -0.02, FACADE_SIZE[0] + 0.02, FACADE_SIZE[1] + 0.03];
        let extent = [u0, v0, u1 + beyond, v1];
        PlaneSpec::of_scene(&self.set.placement, self.set.pixel_size, extent)
    }

    /// The shots, in two rows along the street, each looking about straight at it.
    pub fn shots(&self) -> Vec<Shot> {
        let camera = self.set.camera();
        (0..self.photos).map(|k| self.shot(k, &camera)).collect()
    }

    fn shot(&self, k: u32, camera: &CameraSpec) -> Shot {
        let step = HOUSE_STEP_M / f64::from(PHOTOS_PER_HOUSE);
        let by = |n: u64, reach: f64| (2.0 * hash_unit(4 * u64::from(k) + n) - 1.0) * reach;
        let x = step * (f64::from(k) + 0.5);
        let y = if k.is_multiple_of(2) { 1.8 } else { 3.7 };
        let centre = DVec3::new(x, y + by(0, 0.2), 5.2 + by(1, 0.4));
        let target = DVec3::new(x + by(2, 0.6), y + 0.3, -0.5);
        let name = format!("IMG_{:05}.jpg", k + 1);
        Shot::towards(&name, camera, &self.set.placement, [centre, target], by(3, 0.03))
    }

    /// Writes mesh, photos, cameras, frame and project file into `folder`, which is made.
    ///
    /// # Errors
    /// As [`FacadeSet::write`].
    pub fn write(&self, folder: &Path) -> Result<Written> {
        let (scene, shots) = (self.scene(), self.shots());
        write_colmap(&folder.join(names::CAMERAS), &shots)?;
        write_project(folder, &self.plane(), &self.set.layers)?;
        let mesh = Refinement::by_face_count(&scene, self.set.faces)?;
        write_ply(&folder.join(names::MESH), &mesh, &PlyOptions::default())?;
        self.write_pictures(&folder.join(names::PHOTOS), &shots)?;
        Ok(Written { faces: mesh.face_count(), photos: shots.len() })
    }

    fn write_pictures(&self, folder: &Path, shots: &[Shot]) -> Result<()> {
        // The first photos see the first façade alone, or little of the next.
        let scene = facade(self.set.placement, Texture::new(self.set.finest_m));
        let caster = Caster::of_scene(&scene);
        let mut pictures: Vec<PathBuf> = Vec::new();
        for photo in photos(shots)?.photos {
            let path = folder.join(&photo.name);
            remove_if_there(&path)?;
            if pictures.len() < PICTURES as usize {
                let picture = Samples::U8(photograph(&caster, &photo, Sampling::Edges(2), 3));
                write_picture(&path, &picture)?;
                pictures.push(path);
            } else {
                link(&pictures[photo.id.0 as usize % pictures.len()], &path)?;
            }
        }
        Ok(())
    }
}

fn remove_if_there(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(path, e)),
        _ => Ok(()),
    }
}

/// Another name for a file; a copy where the file system has no links.
fn link(file: &Path, name: &Path) -> Result<()> {
    if fs::hard_link(file, name).is_ok() {
        return Ok(());
    }
    fs::copy(file, name).map(|_| ()).map_err(|e| Error::io(name, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Size;

    fn small(houses: u32, photos: u32) -> StreetSet {
        let set = FacadeSet {
            faces: 12_000,
            photo: Size::new(60, 40),
            pixel_size: 0.05,
            finest_m: 0.6,
            ..FacadeSet::paper()
        };
        StreetSet { houses, photos, set }
    }

    #[test]
    fn the_houses_of_a_street_do_not_touch_and_have_their_own_vertices() {
        let street = small(3, 0);
        let (one, all) = (small(1, 0).scene(), street.scene());
        assert_eq!(all.vertices().len(), 3 * one.vertices().len());
        assert_eq!(all.patches().len(), 3 * one.patches().len());
        let width = |scene: &Scene| {
            let along =
                scene.vertices().iter().map(|&p| street.set.placement.scene_from_ground(p).x);
            let (low, high) = along.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        assert!(width(&one) < HOUSE_STEP_M);
        assert!((width(&all) - width(&one) - 2.0 * HOUSE_STEP_M).abs() < 1e-9);
    }

    #[test]
    fn photos_beyond_the_pictures_are_names_of_the_same_files_with_other_poses() {
        let (street, folder) = (small(2, 9), tempfile::tempdir().unwrap());
        // Twice: what is there is replaced.
        for _ in 0..2 {
            let written = street.write(folder.path()).unwrap();
            assert!(written.photos == 9 && written.faces >= 12_000);
        }
        let photo =
            |k: u32| fs::read(folder.path().join(format!("photos/IMG_{k:05}.jpg"))).unwrap();
        for k in PICTURES + 1..=9 {
            assert_eq!(photo(k), photo((k - 1) % PICTURES + 1), "photo {k}");
        }
        assert_ne!(photo(1), photo(2));
        let shots = street.shots();
        for (k, shot) in shots.iter().enumerate() {
            assert!(
                shots[..k].iter().all(|s| s.translation != shot.translation && s.name < shot.name)
            );
        }
    }

    #[test]
    fn every_point_of_a_house_lies_in_some_photos_before_it_and_in_none_far_away() {
        let street = small(4, 40);
        let photos = photos(&street.shots()).unwrap().photos;
        for (x, y) in [(0.1, 0.1), (3.7, 2.5), (11.0, 5.4), (25.0, 1.0)] {
            let ground = street.set.placement.ground_from_scene(DVec3::new(x, y, 0.0));
            let sees = |photo: &&crate::camera::Photo| {
                let c = photo.pose.camera_from_ground(ground);
                let at = photo.lens.photo_from_ray(c.truncate() / c.z);
                c.z > 0.0 && at.is_some_and(|at| photo.lens.contains(at))
            };
            let count = photos.iter().filter(sees).count();
            assert!((2..=12).contains(&count), "{count} at {x}, {y}");
        }
    }
}
