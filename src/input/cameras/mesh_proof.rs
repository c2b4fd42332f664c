//! [`MeshProof`]: whether cameras look at the mesh, the proof that needs no tie points.
//!
//! In: cameras and the bounds of the mesh, ground. Out: how many have the mesh in front of them and in their picture;
//! for a plain table, whether its angles would bring the mesh nearer to the pictures' centres in the other unit: photos
//! are taken of something. That is a hint, not a proof: photos that look straight along an axis are alike in both.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, DVec3};

use super::{AngleUnit, CameraFormat, CameraOptions, Draft, DraftPhoto};
use crate::Result;
use crate::camera::Photo;
use crate::geom::Bounds3;
use crate::input::table;

/// Rays a side of each photo that are tried.
const RAYS: u32 = 15;
/// Another unit is better if it brings the mesh so many times nearer to the pictures' centres…
const CLEARLY: f64 = 2.0;
/// …and by at least this part of the way from the centre to the corner.
const MATTERS: f64 = 0.02;

/// Whether cameras look at the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshProof {
    /// How many photos were tried.
    pub photos: usize,
    /// How many have at least half of the corners of the mesh's bounds in front of them.
    pub in_front: usize,
    /// How many have the bounds in their picture, by 15 × 15 rays.
    pub inside: usize,
    /// The unit of angles in which a table's photos have the mesh clearly nearer to their centres.
    pub better: Option<AngleUnit>,
}

impl MeshProof {
    /// Tries `photos`, which were read from `path` in `format` with `options`, on the bounds of the mesh.
    ///
    /// # Errors
    /// What reading a table once more gives.
    pub fn of(
        (path, format, options): (&Path, CameraFormat, &CameraOptions),
        photos: &[Photo],
        bounds_ground: &Bounds3,
    ) -> Result<Self> {
        let grid = grid();
        let offsets: Vec<f64> = photos.iter().map(|p| offset(p, bounds_ground, &grid)).collect();
        let is_in_front = |photo: &&Photo| {
            let ahead = corners(bounds_ground)
                .filter(|&corner| photo.pose.camera_from_ground(corner).z > 0.0);
            ahead.count() >= 4
        };
        let mut proof = Self {
            photos: photos.len(),
            in_front: photos.iter().filter(is_in_front).count(),
            inside: offsets.iter().filter(|&&offset| offset < NOWHERE).count(),
            better: None,
        };
        if let (CameraFormat::Table, Some(other)) = (format, options.angle_unit.and_then(other)) {
            let options = CameraOptions { angle_unit: Some(other), ..options.clone() };
            let others = table::read(path, &options)?;
            let mean = |sum: f64| sum / photos.len().max(1) as f64;
            let declared = mean(offsets.iter().sum());
            let found = mean(offset_of(&others, photos, bounds_ground, &grid));
            if CLEARLY * found < declared && declared - found > MATTERS {
                proof.better = Some(other);
            }
        }
        Ok(proof)
    }

    /// The warnings that it gives rise to.
    pub fn warnings(&self) -> Vec<String> {
        let Self { photos, in_front, inside, better } = self;
        let mut warnings = Vec::new();
        if 2 * in_front.min(inside) <= *photos && *photos > 0 {
            warnings.push(format!(
                "the mesh lies in front of {in_front} and in the picture of {inside} of {photos} photos: \
                 do mesh and cameras belong together?"
            ));
        }
        if let Some(unit) = better {
            let word = unit.word();
            warnings.push(format!(
                "the cameras look at the mesh more squarely if their angles are in {word} (--angle-unit {word})"
            ));
        }
        warnings
    }
}

/// The unit that is mistaken for `unit`.
fn other(unit: AngleUnit) -> Option<AngleUnit> {
    match unit {
        AngleUnit::Degrees => Some(AngleUnit::Gon),
        AngleUnit::Gon => Some(AngleUnit::Degrees),
        AngleUnit::Radians => None,
    }
}

/// The sum of the offsets of `photos`, with the orientations that `draft` has for them.
fn offset_of(draft: &Draft, photos: &[Photo], bounds: &Bounds3, grid: &[DVec2]) -> f64 {
    let name = |p: &DraftPhoto| p.name.replace('\\', "/");
    let others: BTreeMap<String, &DraftPhoto> = draft.photos.iter().map(|p| (name(p), p)).collect();
    let of = |photo: &Photo| {
        let (lens, pose) = others.get(&photo.name)?.orientation.clone().ok()?;
        Some(offset(&Photo { lens, pose, ..photo.clone() }, bounds, grid))
    };
    photos.iter().map(|photo| of(photo).unwrap_or(NOWHERE)).sum()
}

/// The offset of a photo without the mesh in its picture.
const NOWHERE: f64 = 1.0;

/// Places in a picture from −1 to 1 along both sides, those near the centre first.
fn grid() -> Vec<DVec2> {
    let at = |k: u32| (2.0 * f64::from(k) + 1.0) / f64::from(RAYS) - 1.0;
    let mut grid: Vec<_> =
        (0..RAYS * RAYS).map(|k| DVec2::new(at(k % RAYS), at(k / RAYS))).collect();
    grid.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    grid
}

/// How far from the picture's centre the nearest ray of the grid is that meets the box, the corner being at 1.
fn offset(photo: &Photo, bounds: &Bounds3, grid: &[DVec2]) -> f64 {
    let size = photo.lens.size();
    let half = 0.5 * DVec2::new(f64::from(size.width), f64::from(size.height));
    let meets = |at: &&DVec2| {
        photo.lens.ray_from_photo(half + half * **at).is_some_and(|ray| {
            let direction = photo.pose.rotation.transpose() * ray.extend(1.0);
            ray_meets(photo.pose.centre_ground, direction, bounds)
        })
    };
    grid.iter().find(meets).map_or(NOWHERE, |at| at.length() * std::f64::consts::FRAC_1_SQRT_2)
}

/// Whether the ray from `origin` meets the closed box: the slab test of Kay and Kajiya (1986).
fn ray_meets(origin: DVec3, direction: DVec3, bounds: &Bounds3) -> bool {
    let (mut near, mut far) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let (o, d) = (origin[axis], direction[axis]);
        let (min, max) = (bounds.min[axis] - o, bounds.max[axis] - o);
        if d == 0.0 {
            if min > 0.0 || max < 0.0 {
                return false;
            }
        } else {
            let (a, b) = (min / d, max / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
    }
    near <= far
}

fn corners(bounds: &Bounds3) -> impl Iterator<Item = DVec3> {
    let Bounds3 { min, max } = *bounds;
    let pick = move |k: u8, bit: u8, axis: usize| if k & bit == 0 { min[axis] } else { max[axis] };
    (0..8).map(move |k| DVec3::new(pick(k, 1, 0), pick(k, 2, 1), pick(k, 4, 2)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_meets_a_box_ahead_and_around_but_not_behind_or_beside() {
        let unit = Bounds3 { min: DVec3::ZERO, max: DVec3::ONE };
        let meets = |o: [f64; 3], d: [f64; 3]| ray_meets(DVec3::from(o), DVec3::from(d), &unit);
        assert!(meets([0.5, 0.5, -2.0], [0.0, 0.0, 1.0]));
        assert!(meets([0.5, 0.5, 0.5], [0.3, -0.2, 1.0]));
        assert!(meets([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]));
        assert!(!meets([0.5, 0.5, -2.0], [0.0, 0.0, -1.0]));
        assert!(!meets([0.5, 1.5, -2.0], [0.0, 0.0, 1.0]));
        assert!(!meets([-1.0, 0.5, 0.5], [1.0, 2.0, 0.0]));
        assert_eq!(corners(&unit).filter(|c| c.length_squared() <= 1.0).count(), 4);
    }
}
