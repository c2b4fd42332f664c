//! [`MeshProof`]: whether cameras look at the mesh, the proof that needs no tie points.
//!
//! In: cameras and the bounds of the mesh, ground. Out: how many have the mesh in front of them and in their picture;
//! for a plain table, whether its photos would look more squarely at the middle of the mesh if its angles were in the other
//! unit. That is a hint, not a proof: photos of parts of a large mesh look past its middle in either.

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
/// Another unit is better if the photos look so many times more squarely at the mesh…
const CLEARLY: f64 = 1.5;
/// …and by at least this angle: two degrees.
const MATTERS_RAD: f64 = 0.035;

/// Whether cameras look at the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshProof {
    /// How many photos were tried.
    pub photos: usize,
    /// How many have at least half of the corners of the mesh's bounds in front of them.
    pub in_front: usize,
    /// How many have the bounds in their picture, by 15 × 15 rays.
    pub inside: usize,
    /// The unit of angles in which a table's photos look clearly more squarely at the mesh.
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
        let is_in_front = |photo: &&Photo| {
            let ahead = corners(bounds_ground)
                .filter(|&corner| photo.pose.camera_from_ground(corner).z > 0.0);
            ahead.count() >= 4
        };
        let mut proof = Self {
            photos: photos.len(),
            in_front: photos.iter().filter(is_in_front).count(),
            inside: photos.iter().filter(|p| is_inside(p, bounds_ground)).count(),
            better: None,
        };
        if let (CameraFormat::Table, Some(other)) = (format, options.angle_unit.and_then(other)) {
            let options = CameraOptions { angle_unit: Some(other), ..options.clone() };
            let others = table::read(path, &options)?;
            let declared = squint(photos, bounds_ground);
            let found = squint(&reoriented(photos, &others), bounds_ground);
            if CLEARLY * found < declared && declared - found > MATTERS_RAD {
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

/// The photos with the orientations that `draft` has for them.
fn reoriented(photos: &[Photo], draft: &Draft) -> Vec<Photo> {
    let name = |p: &DraftPhoto| p.name.replace('\\', "/");
    let others: BTreeMap<String, &DraftPhoto> = draft.photos.iter().map(|p| (name(p), p)).collect();
    let of = |photo: &Photo| {
        let (lens, pose) = others.get(&photo.name)?.orientation.clone().ok()?;
        Some(Photo { lens, pose, ..photo.clone() })
    };
    photos.iter().filter_map(of).collect()
}

/// The mean angle between the viewing axes and the directions to the middle of the box, radians.
fn squint(photos: &[Photo], bounds: &Bounds3) -> f64 {
    let middle = 0.5 * (bounds.min + bounds.max);
    let angle = |photo: &Photo| {
        let p = photo.pose.camera_from_ground(middle);
        libm::atan2(p.truncate().length(), p.z)
    };
    photos.iter().map(angle).sum::<f64>() / photos.len().max(1) as f64
}

/// Whether a ray of a grid over the photo meets the box.
fn is_inside(photo: &Photo, bounds: &Bounds3) -> bool {
    let size = photo.lens.size();
    let size = DVec2::new(f64::from(size.width), f64::from(size.height));
    let meets = |k: u32| {
        let at = DVec2::new(f64::from(k % RAYS), f64::from(k / RAYS)) + 0.5;
        photo.lens.ray_from_photo(size * at / f64::from(RAYS)).is_some_and(|ray| {
            let direction = photo.pose.rotation.transpose() * ray.extend(1.0);
            ray_meets(photo.pose.centre_ground, direction, bounds)
        })
    };
    // Of the middle first, where most photos have it.
    (RAYS * RAYS / 2..RAYS * RAYS).chain(0..RAYS * RAYS / 2).any(meets)
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
