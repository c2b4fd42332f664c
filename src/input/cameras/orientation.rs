//! Poses and lenses from what files state, checked.

use std::path::Path;

use glam::{DMat3, DVec3};

use crate::camera::{Lens, LensError, LensModel, Pose, PoseError};
use crate::geom::Size;
use crate::{Error, Result};

/// How far a rotation's rows may be from orthonormal: files round to five or six digits.
const ROUNDING: f64 = 1e-3;

/// The pose of a rotation `camera_from_ground` (x right, y down, z forward) and a centre, metres.
///
/// The rotation is the nearest to the matrix, by Newton's iteration for the polar decomposition (Higham 1986,
/// *Computing the polar decomposition*, 10.1137/0907079): files round their numbers.
pub(in crate::input) fn pose(
    camera_from_ground: DMat3,
    centre_ground: DVec3,
) -> std::result::Result<Pose, PoseError> {
    let mut rotation = camera_from_ground;
    let off = rotation * rotation.transpose() - DMat3::IDENTITY;
    let off = off
        .to_cols_array()
        .iter()
        .fold(0.0_f64, |most, v| if v.is_nan() { f64::INFINITY } else { most.max(v.abs()) });
    if off > ROUNDING || rotation.determinant() < 0.0 {
        return Err(PoseError {
            expected: "a rotation matrix".into(),
            found: format!("the rows {:?}", rotation.transpose().to_cols_array_2d()),
        });
    }
    if !centre_ground.is_finite() {
        return Err(PoseError {
            expected: "a finite projection centre".into(),
            found: format!("{:?}", centre_ground.to_array()),
        });
    }
    // The error is squared at every step.
    for _ in 0..4 {
        rotation = (rotation + rotation.transpose().inverse()) * 0.5;
    }
    Ok(Pose { rotation, centre_ground })
}

/// The rotation matrix whose rows are given.
pub(in crate::input) fn rotation_of_rows([a, b, c]: [[f64; 3]; 3]) -> DMat3 {
    DMat3::from_cols_array_2d(&[a, b, c]).transpose()
}

/// The lens of COLMAP's `model` with `params` in its order; inside, the reason why such photos are left out.
///
/// # Errors
/// [`Error::Corrupt`] at `place` for parameters that make no lens.
pub(in crate::input) fn lens(
    (path, place): (&Path, &str),
    model: LensModel,
    size: Size,
    params: &[f64],
) -> Result<std::result::Result<Lens, String>> {
    match Lens::new(model, size, params) {
        Ok(lens) => Ok(Ok(lens)),
        Err(LensError::Unsupported(model)) => {
            Ok(Err(format!("camera model {} is not supported", model.name())))
        }
        Err(LensError::Invalid { expected, found }) => {
            Err(Error::corrupt(path, place, expected, found))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_rotation_becomes_orthonormal_and_stays_near() {
        let exact = Pose::from_colmap([0.8, 0.1, -0.5, 0.3], DVec3::ZERO).unwrap().rotation;
        let rounded =
            DMat3::from_cols_array(&exact.to_cols_array().map(|v| (v * 1e5).round() / 1e5));
        let pose = pose(rounded, DVec3::ONE).unwrap();
        let off = pose.rotation * pose.rotation.transpose() - DMat3::IDENTITY;
        assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-15));
        assert!((pose.rotation - exact).to_cols_array().iter().all(|v| v.abs() < 1e-5));
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        let nan = DMat3::from_cols_array(&[f64::NAN, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        let mirror = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
        for wrong in [DMat3::ZERO, DMat3::IDENTITY * 1.01, mirror, nan] {
            assert!(pose(wrong, DVec3::ZERO).is_err());
        }
        assert!(pose(DMat3::IDENTITY, DVec3::NAN).is_err());
    }
}
