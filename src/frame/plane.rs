//! [`Plane`]: a mosaic by parallel projection on a plane in any attitude.

use glam::DVec3;

use super::check::{self, FrameError};

/// A plane frame. Columns run along +u, rows along −v; the viewer looks down −n.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// The ground point of frame coordinates u = v = 0 and elevation 0, metres.
    pub origin: DVec3,
    /// Unit vector along the columns, ground.
    pub u: DVec3,
    /// Unit vector against the rows, ground, square to `u`.
    pub v: DVec3,
    /// `u × v`: elevation grows along it, towards the viewer.
    pub n: DVec3,
    /// Side of a pixel, metres, if the frame states it.
    pub pixel_size: Option<f64>,
    /// `[u_min, v_min, u_max, v_max]`, metres, if the frame states it.
    pub extent: Option<[f64; 4]>,
    /// `[min, max]` of the elevations shown, metres, perhaps infinite, if the frame states it.
    pub elevation: Option<[f64; 2]>,
    /// `EPSG:n`, if the frame states it; whether the code exists and is projected is not checked here.
    pub crs: Option<String>,
}

impl Plane {
    /// The plane through `origin` along `u` and `v`, without pixel size, extent, slab or reference system.
    ///
    /// # Errors
    /// If a coordinate is not finite, or the axes are not orthonormal within 1e-6. Axes within that but not within
    /// 1e-12 are made orthonormal: u normalised, v turned.
    pub fn new(origin: [f64; 3], u_axis: [f64; 3], v_axis: [f64; 3]) -> Result<Self, FrameError> {
        let origin = check::finite("origin", origin)?;
        let (u, v) = (check::finite("u_axis", u_axis)?, check::finite("v_axis", v_axis)?);
        let [u, v] = check::orthonormal(["u_axis", "v_axis"], u, v)?;
        let n = u.cross(v);
        Ok(Self { origin, u, v, n, pixel_size: None, extent: None, elevation: None, crs: None })
    }

    /// The plane through three ground points: the origin, one on the positive u axis, one on the side of +v.
    ///
    /// # Errors
    /// If a coordinate is not finite, or the points lie on one line, within a millionth of their distances.
    pub fn through(points: [[f64; 3]; 3]) -> Result<Self, FrameError> {
        let key = "plane_points";
        for point in points {
            check::finite(key, point)?;
        }
        let [a, b, c] = points.map(DVec3::from);
        let (along, aside) = (b - a, c - a);
        let found = || format!("{points:?}");
        let expected = "three points that are not on one line";
        let Some(u) = along.try_normalize() else {
            return Err(FrameError::new(key, expected, found()));
        };
        let v = aside - u * aside.dot(u);
        if v.length() <= 1e-6 * aside.length() {
            return Err(FrameError::new(key, expected, found()));
        }
        let v = v.normalize();
        // Once more: the first may have lost digits where the angle is small.
        let v = (v - u * v.dot(u)).normalize();
        // `+ 0.0` turns −0 into 0.
        Self::new(points[0], (u + 0.0).to_array(), (v + 0.0).to_array())
    }

    /// The view from above, u = x, v = y, elevation = z: `--view top`.
    pub fn top() -> Self {
        let (origin, u, v, n) = (DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z);
        Self { origin, u, v, n, pixel_size: None, extent: None, elevation: None, crs: None }
    }

    /// The same plane in the reference system `crs`, `EPSG:n`.
    ///
    /// # Errors
    /// If `crs` is not of that form, or the plane's coordinates are not those of the ground: u = (1, 0, 0),
    /// v = (0, 1, 0), origin x = y = 0.
    pub fn with_crs(self, crs: &str) -> Result<Self, FrameError> {
        if epsg(crs).is_none() {
            return Err(FrameError::new("crs", "EPSG:n", format!("{crs:?}")));
        }
        let needs = |key, expected, v: DVec3| {
            Err(FrameError::new(
                key,
                format!("{expected} with a crs"),
                format!("{:?}", v.to_array()),
            ))
        };
        if self.u != DVec3::X {
            return needs("u_axis", "[1.0, 0.0, 0.0]", self.u);
        }
        if self.v != DVec3::Y {
            return needs("v_axis", "[0.0, 1.0, 0.0]", self.v);
        }
        if self.origin.x != 0.0 || self.origin.y != 0.0 {
            return needs("origin", "x = y = 0", self.origin);
        }
        Ok(Self { crs: Some(crs.to_owned()), ..self })
    }

    /// The EPSG code, if the frame states one.
    pub fn epsg(&self) -> Option<u32> {
        self.crs.as_deref().and_then(epsg)
    }
}

/// The code of `EPSG:n`, n a decimal number above 0 without leading zeros.
fn epsg(crs: &str) -> Option<u32> {
    let digits = crs.strip_prefix("EPSG:")?;
    let code = digits.parse().ok().filter(|&code: &u32| code > 0)?;
    (code.to_string() == digits).then_some(code)
}

#[cfg(test)]
mod tests {
    use super::*;

    const O: [f64; 3] = [0.0; 3];
    const X: [f64; 3] = [1.0, 0.0, 0.0];
    const Y: [f64; 3] = [0.0, 1.0, 0.0];

    #[test]
    fn axes_off_by_more_than_a_millionth_are_refused_with_the_angle() {
        let e = Plane::new(O, X, [0.01, 0.999_95, 0.0]).unwrap_err();
        assert_eq!(e.key, "v_axis");
        assert!(e.to_string().contains("89.427"), "{e}");
        let e = Plane::new(O, [1.000_01, 0.0, 0.0], Y).unwrap_err();
        assert!(e.key == "u_axis" && e.found.contains("1.00001"), "{e}");
        let e = Plane::new(O, X, [0.0, f64::NAN, 0.0]).unwrap_err();
        assert!(e.key == "v_axis" && e.found.contains("NaN"), "{e}");
        assert!(Plane::new(O, X, X).is_err());
    }

    #[test]
    fn axes_within_a_millionth_are_squared_keeping_the_direction_of_u() {
        let p = Plane::new(O, [0.999_999_5, 0.0, 0.0], [5e-7, 1.0, 0.0]).unwrap();
        assert_eq!(p.u, DVec3::X);
        assert!(p.u.dot(p.v).abs() < 1e-16 && (p.v.length() - 1.0).abs() < 1e-15);
        // What came out goes in again unchanged.
        let again = Plane::new(O, p.u.into(), p.v.into()).unwrap();
        assert_eq!(again, p);
    }

    #[test]
    fn axes_that_are_orthonormal_to_1e_12_keep_their_bits() {
        let (u, v) = ([0.679_064_334_075_875_6, 0.734_078_762_930_850_5, 0.0], [0.0, 0.0, -1.0]);
        let p = Plane::new(O, u, v).unwrap();
        assert_eq!((p.u.to_array(), p.v.to_array()), (u, v));
    }

    #[test]
    fn a_reference_system_demands_ground_axes() {
        assert_eq!(Plane::top().with_crs("EPSG:32634").unwrap().epsg(), Some(32634));
        for bad in ["EPSG:", "32634", "epsg:32634", "EPSG:032634", "EPSG:0", "EPSG:-1", "EPSG:1 "] {
            assert_eq!(Plane::top().with_crs(bad).unwrap_err().key, "crs", "{bad}");
        }
        let crs = |o, u, v| Plane::new(o, u, v).unwrap().with_crs("EPSG:32634").unwrap_err().key;
        assert_eq!(crs(O, Y, X), "u_axis");
        assert_eq!(crs(O, X, [0.0, 0.0, 1.0]), "v_axis");
        assert_eq!(crs([1.0, 0.0, 0.0], X, Y), "origin");
        assert!(Plane::new([0.0, 0.0, 9.0], X, Y).unwrap().with_crs("EPSG:32634").is_ok());
    }
}
