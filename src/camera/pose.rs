//! [`Pose`]: the exterior orientation of a photograph.

use glam::{DMat3, DVec3};

/// Where a photo was taken: `X_camera = rotation · (X_ground − centre)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// `camera_from_ground`, orthonormal.
    pub rotation: DMat3,
    /// The perspective centre, ground, metres.
    pub centre_ground: DVec3,
}

/// A pose in the local frame of a mesh store.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalPose {
    /// `camera_from_local`, orthonormal.
    pub rotation: DMat3,
    /// The perspective centre, local, metres.
    pub centre: DVec3,
}

/// Why numbers do not make a pose: what was expected and what was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("expected {expected}, found {found}")]
pub struct PoseError {
    /// What a pose demands.
    pub expected: String,
    /// What was given.
    pub found: String,
}

impl Pose {
    /// The pose of COLMAP's quaternion `[qw, qx, qy, qz]` (Hamilton, `camera_from_ground`; normalised here) and
    /// translation `t` (metres): `X_camera = R X_ground + t`, so the centre is `−Rᵀ t`.
    ///
    /// # Errors
    /// If a number is not finite, or the quaternion's length is zero or not finite.
    pub fn from_colmap(quaternion: [f64; 4], translation: DVec3) -> Result<Self, PoseError> {
        let [w, x, y, z] = quaternion;
        let norm = (w * w + x * x + y * y + z * z).sqrt();
        if !(norm > 0.0 && norm.is_finite()) {
            return Err(PoseError {
                expected: "a rotation quaternion of finite length above 0".into(),
                found: format!("{quaternion:?}"),
            });
        }
        if !translation.is_finite() {
            return Err(PoseError {
                expected: "a finite translation".into(),
                found: format!("{:?}", translation.to_array()),
            });
        }
        let rotation = rotation(quaternion.map(|q| q / norm));
        Ok(Self { rotation, centre_ground: -(rotation.transpose() * translation) })
    }

    /// The point in camera axes, metres.
    #[inline]
    pub fn camera_from_ground(&self, point_ground: DVec3) -> DVec3 {
        self.rotation * (point_ground - self.centre_ground)
    }

    /// The same pose in the frame whose origin is `origin_ground`.
    pub fn relative_to(&self, origin_ground: DVec3) -> LocalPose {
        LocalPose { rotation: self.rotation, centre: self.centre_ground - origin_ground }
    }

    /// COLMAP's translation `t = −R C`, metres.
    pub fn translation(&self) -> DVec3 {
        -(self.rotation * self.centre_ground)
    }
}

impl LocalPose {
    /// The point in camera axes, metres: `rotation · (point − centre)`.
    #[inline]
    pub fn camera_from_local(&self, point: DVec3) -> DVec3 {
        self.rotation * (point - self.centre)
    }
}

/// The rotation matrix of a unit quaternion `[w, x, y, z]`.
fn rotation([w, x, y, z]: [f64; 4]) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        DVec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        DVec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_about_x_sends_ground_up_to_the_cameras_up() {
        // A camera that looks along ground y, upright: x right stays x, y down is −z, z forward is y.
        let half = 0.5_f64.sqrt();
        let pose = Pose::from_colmap([half, half, 0.0, 0.0], DVec3::new(0.0, 0.0, 5.0)).unwrap();
        let up = pose.rotation * DVec3::Z;
        assert!((up - DVec3::NEG_Y).length() < 1e-15);
        assert!((pose.centre_ground - DVec3::new(0.0, -5.0, 0.0)).length() < 1e-14);
        assert!(pose.camera_from_ground(pose.centre_ground).length() < 1e-14);
        assert!((pose.translation() - DVec3::new(0.0, 0.0, 5.0)).length() < 1e-14);
    }

    #[test]
    fn any_quaternion_gives_an_orthonormal_right_handed_matrix() {
        let pose = Pose::from_colmap([3.0, -2.0, 0.5, 7.0], DVec3::ONE).unwrap();
        let off = pose.rotation * pose.rotation.transpose() - DMat3::IDENTITY;
        assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-15));
        assert!((pose.rotation.determinant() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_quaternion_without_direction_is_refused() {
        for q in [[0.0; 4], [f64::NAN, 0.0, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0, 0.0]] {
            assert!(Pose::from_colmap(q, DVec3::ZERO).is_err());
        }
        let t = DVec3::new(0.0, f64::NAN, 0.0);
        assert!(Pose::from_colmap([1.0, 0.0, 0.0, 0.0], t).is_err());
    }

    #[test]
    fn a_local_pose_sees_the_same_point_at_the_same_place() {
        let t = DVec3::new(1.0, 2.0, 3.0);
        let pose = Pose::from_colmap([0.9, 0.1, -0.2, 0.3], t).unwrap();
        let origin = DVec3::new(512.0, -256.0, 64.0);
        let p = DVec3::new(500.0, -250.0, 70.0);
        let local = pose.relative_to(origin).camera_from_local(p - origin);
        assert!((local - pose.camera_from_ground(p)).length() < 1e-12);
    }
}
