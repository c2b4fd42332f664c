//! [`Placement`]: where a scene stands in the ground frame.

use glam::DVec3;

/// A rigid placement of scene coordinates in the ground frame, metres.
///
/// Scene coordinates are those of a façade: x runs along it, y up, z out of it towards the viewer. The axes are
/// orthonormal and right-handed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Ground position of the scene's origin.
    pub origin: DVec3,
    /// The scene's x in the ground frame.
    pub u: DVec3,
    /// The scene's y in the ground frame.
    pub v: DVec3,
}

impl Placement {
    /// Scene coordinates are ground coordinates.
    pub const IDENTITY: Self = Self { origin: DVec3::ZERO, u: DVec3::X, v: DVec3::Y };

    /// A façade upright in the ground frame (z up), `origin` at its lower left, facing south turned by
    /// `bearing_rad` counter-clockwise as seen from above.
    pub fn upright(origin: DVec3, bearing_rad: f64) -> Self {
        let u = DVec3::new(libm::cos(bearing_rad), libm::sin(bearing_rad), 0.0);
        Self { origin, u, v: DVec3::Z }
    }

    /// A placement in general position: `u` along `direction`, `v` as near to `up` as it may be.
    ///
    /// The two directions must not be parallel.
    pub fn oblique(origin: DVec3, direction: DVec3, up: DVec3) -> Self {
        let u = direction.normalize();
        let v = (up - u * u.dot(up)).normalize();
        Self { origin, u, v }
    }

    /// The scene's z in the ground frame.
    pub fn n(&self) -> DVec3 {
        self.u.cross(self.v)
    }

    /// Ground position of a scene point.
    pub fn ground_from_scene(&self, p: DVec3) -> DVec3 {
        self.origin + self.direction(p)
    }

    /// A scene direction in the ground frame.
    pub fn direction(&self, d: DVec3) -> DVec3 {
        self.u * d.x + self.v * d.y + self.n() * d.z
    }

    /// Scene coordinates of a ground point.
    pub fn scene_from_ground(&self, p: DVec3) -> DVec3 {
        let d = p - self.origin;
        DVec3::new(d.dot(self.u), d.dot(self.v), d.dot(self.n()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ground_and_scene_are_inverse_in_general_position() {
        let p = Placement::oblique(
            DVec3::new(500_000.0, 4_200_000.0, 100.0),
            DVec3::new(0.6, 0.7, 0.1),
            DVec3::new(-0.1, 0.2, 1.0),
        );
        let q = DVec3::new(3.2, -1.5, 0.7);
        assert!((p.scene_from_ground(p.ground_from_scene(q)) - q).length() < 4e-9);
        assert!((p.n().length() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn an_upright_facade_has_z_up_and_faces_south() {
        let p = Placement::upright(DVec3::ZERO, 0.0);
        assert_eq!(p.v, DVec3::Z);
        assert_eq!(p.n(), DVec3::NEG_Y);
    }
}
