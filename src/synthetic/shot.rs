//! [`Shot`]: a photograph of a scene, as a COLMAP model states it.

use glam::{DMat3, DVec3};

use super::Placement;
use crate::camera::{CameraSet, Lens, LensModel, Photo, PhotoId, Pose};
use crate::geom::Size;
use crate::{Error, Result};

/// The interior orientation of a shot: a line of `cameras.txt`.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraSpec {
    /// The model.
    pub model: LensModel,
    /// Width and height, pixels.
    pub size: Size,
    /// Parameters in COLMAP's order.
    pub params: Vec<f64>,
}

/// A photograph to be taken: a line of `images.txt` and its camera.
///
/// These numbers, not the [`Photo`] made of them, are the truth: a reader of the written model comes to the same
/// photo bit by bit.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// Its name: the path below the photo folder.
    pub name: String,
    /// The camera.
    pub camera: CameraSpec,
    /// `[qw, qx, qy, qz]`, `camera_from_ground`.
    pub quaternion: [f64; 4],
    /// `X_camera = R X_ground + t`, metres.
    pub translation: DVec3,
}

impl Shot {
    /// A shot from `centre` towards `target`, both in scene coordinates, its picture's top towards the scene's y,
    /// then turned clockwise about the viewing axis by `roll_rad`.
    pub fn towards(
        name: &str,
        camera: &CameraSpec,
        placement: &Placement,
        [centre, target]: [DVec3; 2],
        roll_rad: f64,
    ) -> Self {
        let forward = placement.direction(target - centre).normalize();
        let level = forward.cross(placement.v).normalize();
        let below = forward.cross(level);
        let (sin, cos) = (libm::sin(roll_rad), libm::cos(roll_rad));
        let (right, down) = (level * cos + below * sin, below * cos - level * sin);
        let rotation = DMat3::from_cols(right, down, forward).transpose();
        let quaternion = quaternion(&rotation);
        // The rotation that readers make of the quaternion, not the one it was made of.
        let rotation = Pose::from_colmap(quaternion, DVec3::ZERO).map_or(rotation, |p| p.rotation);
        let translation = -(rotation * placement.ground_from_scene(centre));
        Self { name: name.into(), camera: camera.clone(), quaternion, translation }
    }

    /// The photo with the number `id`.
    ///
    /// # Errors
    /// [`Error::Usage`] if the numbers make no lens or no pose.
    pub fn photo(&self, id: PhotoId) -> Result<Photo> {
        let wrong = |e: &dyn std::fmt::Display| Error::usage(format!("shot {}: {e}", self.name));
        let CameraSpec { model, size, params } = &self.camera;
        Ok(Photo {
            id,
            name: self.name.clone(),
            lens: Lens::new(*model, *size, params).map_err(|e| wrong(&e))?,
            pose: Pose::from_colmap(self.quaternion, self.translation).map_err(|e| wrong(&e))?,
        })
    }
}

/// The photos of some shots, numbered by bytewise name.
///
/// # Errors
/// As [`Shot::photo`].
pub fn photos(shots: &[Shot]) -> Result<CameraSet> {
    let mut sorted: Vec<&Shot> = shots.iter().collect();
    sorted.sort_by(|a, b| a.name.cmp(&b.name));
    let names = sorted.iter().map(|s| s.name.clone()).collect();
    let photos = sorted.iter().zip(0..).map(|(s, k)| s.photo(PhotoId(k))).collect::<Result<_>>()?;
    Ok(CameraSet { photos, names, left_out: Vec::new() })
}

/// The unit quaternion `[w, x, y, z]` of a rotation matrix, by its greatest component.
///
/// S. W. Shepperd (1978), "Quaternion from rotation matrix", Journal of Guidance and Control 1 (3), 223–224,
/// doi:10.2514/3.55767b.
fn quaternion(r: &DMat3) -> [f64; 4] {
    let at = |row: usize, column: usize| r.col(column)[row];
    let (xx, yy, zz) = (at(0, 0), at(1, 1), at(2, 2));
    // Four times the squares of the components.
    let squares = [1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz];
    let (wx, wy, wz) = (at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1));
    let (xy, xz, yz) = (at(0, 1) + at(1, 0), at(0, 2) + at(2, 0), at(1, 2) + at(2, 1));
    let rows = [
        [squares[0], wx, wy, wz],
        [wx, squares[1], xy, xz],
        [wy, xy, squares[2], yz],
        [wz, xz, yz, squares[3]],
    ];
    let greatest = (1..4).fold(0, |best, k| if squares[k] > squares[best] { k } else { best });
    let row = rows[greatest];
    let norm = row.iter().map(|c| c * c).sum::<f64>().sqrt();
    row.map(|c| c / norm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::Random;

    fn camera() -> CameraSpec {
        let size = Size::new(640, 480);
        CameraSpec { model: LensModel::Pinhole, size, params: vec![600.0, 600.0, 320.0, 240.0] }
    }

    #[test]
    fn a_shot_shows_its_target_in_the_middle_and_up_at_the_top() {
        let placement = Placement::upright(DVec3::new(500_000.0, 4_200_000.0, 100.0), 0.8);
        let ends = [DVec3::new(1.0, 2.0, 8.0), DVec3::new(3.0, 1.0, -1.0)];
        let photo = Shot::towards("a", &camera(), &placement, ends, 0.0).photo(PhotoId(0)).unwrap();
        let look = |scene: DVec3| {
            let p = photo.pose.camera_from_ground(placement.ground_from_scene(scene));
            photo.lens.photo_from_ray(p.truncate() / p.z).unwrap()
        };
        let middle = look(ends[1]);
        assert!((middle - glam::DVec2::new(320.0, 240.0)).length() < 1e-5, "{middle}");
        let (up, right) = (look(ends[1] + DVec3::Y) - middle, look(ends[1] + DVec3::X) - middle);
        assert!(up.y < -30.0 && up.x.abs() < 1e-5 && right.x > 30.0);
    }

    #[test]
    fn a_quaternion_gives_back_its_rotation() {
        let mut r = Random::new(5);
        for _ in 0..200 {
            let q: [f64; 4] = std::array::from_fn(|_| r.between(-1.0, 1.0));
            let rotation = Pose::from_colmap(q, DVec3::ZERO).unwrap().rotation;
            let again = Pose::from_colmap(quaternion(&rotation), DVec3::ZERO).unwrap().rotation;
            assert!((rotation - again).to_cols_array().iter().all(|d| d.abs() < 1e-14));
        }
    }

    #[test]
    fn photos_are_numbered_by_name() {
        let ends = [DVec3::Z * 5.0, DVec3::ZERO];
        let shots: Vec<Shot> = ["b", "c", "a"]
            .map(|n| Shot::towards(n, &camera(), &Placement::IDENTITY, ends, 0.1))
            .into();
        let set = photos(&shots).unwrap();
        assert_eq!(set.names, ["a", "b", "c"]);
        assert!(
            set.photos
                .iter()
                .zip(0..)
                .all(|(p, k)| p.id == PhotoId(k) && p.name == set.names[k as usize])
        );
    }
}
