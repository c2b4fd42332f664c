//! [`Lens`]: the interior orientation of a photograph.

use glam::{DMat2, DVec2};

use super::brown::Brown;
use super::distortion::Distortion;
use super::model::LensModel;
use super::opencv::{OpenCv, Tangential};
use super::radial::Radial;
use super::rational::Rational;
use super::ray_bounds::ray_bounds;
use super::wide::Wide;
use crate::geom::{Bounds2, Size};

/// The greatest magnitude of a distortion coefficient: far beyond any lens, and no product of a few overflows.
const MAX_COEFFICIENT: f64 = 1e12;

/// A lens: which photo position shows which ray.
///
/// A *ray* is (x/z, y/z) in camera axes, for points with z > 0; a photo position is in pixels, the top-left pixel's
/// centre at (0.5, 0.5). The model holds up to the [valid radius](Self::valid_radius).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    model: LensModel,
    size: Size,
    /// As they were given; those that the model has not are 0.
    params: [f64; LensModel::MAX_PARAMS],
    pub(super) focal_px: DVec2,
    pub(super) principal_px: DVec2,
    pub(super) distortion: Distortion,
    pub(super) valid_square: f64,
    ray_bounds: Option<Bounds2>,
}

/// Why parameters do not make a lens.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LensError {
    /// A model that is known by name only.
    #[error("camera model {} is not supported", .0.name())]
    Unsupported(LensModel),
    /// Parameters that no lens has.
    #[error("expected {expected}, found {found}")]
    Invalid {
        /// What a lens demands.
        expected: String,
        /// What was given.
        found: String,
    },
}

impl Lens {
    /// A lens from a model's parameters in the order of [`LensModel`], in pixels where COLMAP has pixels.
    ///
    /// # Errors
    /// [`LensError::Unsupported`] for a model that is only known by name; [`LensError::Invalid`] for a wrong number of
    /// parameters, one that is not finite, a focal length that is not positive, a distortion coefficient beyond
    /// ±10¹², a skew of a focal length or more, an `omega` of π or more, or a size of zero.
    pub fn new(model: LensModel, size: Size, params: &[f64]) -> Result<Self, LensError> {
        check(model, size, params)?;
        let (focal_px, rest) = if model.has_one_focal_length() {
            (DVec2::splat(params[0]), &params[1..])
        } else {
            (DVec2::new(params[0], params[1]), &params[2..])
        };
        let (principal_px, k) = (DVec2::new(rest[0], rest[1]), &rest[2..]);
        if !(focal_px.x > 0.0 && focal_px.y > 0.0) {
            return Err(invalid("a positive focal length", format!("{}", focal_px.min_element())));
        }
        if let Some(k) = k.iter().find(|k| k.abs() > MAX_COEFFICIENT) {
            return Err(invalid("distortion coefficients within ±1e12", format!("{k:e}")));
        }
        let (focal_px, distortion) = match model {
            LensModel::Fov => fov(focal_px, k[0])?,
            LensModel::Brown => (focal_px, Distortion::Brown(brown(focal_px, k)?)),
            LensModel::BrownOffCentre => {
                let centre = DVec2::new(k[7], k[8]) / focal_px;
                (focal_px, Distortion::Brown(brown(focal_px, k)?.about(centre)))
            }
            LensModel::BrownFisheye => {
                (focal_px, Distortion::Wide(Wide::fisheye(brown(focal_px, k)?)))
            }
            _ => (focal_px, distortion(model, k)),
        };
        let mut given = [0.0; LensModel::MAX_PARAMS];
        given[..params.len()].copy_from_slice(params);
        let (focal, principal) = (focal_px, principal_px);
        Ok(Self::assemble((model, given), size, [focal, principal], distortion))
    }

    fn assemble(
        (model, params): (LensModel, [f64; LensModel::MAX_PARAMS]),
        size: Size,
        [focal_px, principal_px]: [DVec2; 2],
        distortion: Distortion,
    ) -> Self {
        let extent = DVec2::new(f64::from(size.width), f64::from(size.height));
        let frame =
            Bounds2 { min: -principal_px / focal_px, max: (extent - principal_px) / focal_px };
        let valid_square = distortion.valid_square();
        let ray_bounds = ray_bounds(&distortion, frame, valid_square);
        Self { model, size, params, focal_px, principal_px, distortion, valid_square, ray_bounds }
    }

    /// The same lens drawn without distortion: a pinhole of the same focal length and principal point, for a fisheye
    /// too, whose own image is another one then.
    #[must_use]
    pub fn without_distortion(&self) -> Self {
        let (focal, principal) = (self.focal_px, self.principal_px);
        let mut params = [0.0; LensModel::MAX_PARAMS];
        let model = if self.model.has_one_focal_length() {
            params[..3].copy_from_slice(&[focal.x, principal.x, principal.y]);
            LensModel::SimplePinhole
        } else {
            params[..4].copy_from_slice(&[focal.x, focal.y, principal.x, principal.y]);
            LensModel::Pinhole
        };
        Self::assemble((model, params), self.size, [focal, principal], Distortion::None)
    }

    /// The photo position of a ray, pixels; `None` at or beyond the valid radius, or for NaN.
    ///
    /// The position may lie outside the frame: see [`Self::contains`].
    #[inline]
    pub fn photo_from_ray(&self, ray: DVec2) -> Option<DVec2> {
        (ray.length_squared() < self.valid_square)
            .then(|| self.focal_px * self.distortion.distort(ray) + self.principal_px)
    }

    /// The photo position of a ray and its derivative by the ray, pixels a unit of x/z (first column) and of y/z
    /// (second column); `None` as for [`Self::photo_from_ray`], whose position it repeats bit for bit.
    #[inline]
    pub fn photo_from_ray_jacobian(&self, ray: DVec2) -> Option<(DVec2, DMat2)> {
        (ray.length_squared() < self.valid_square).then(|| {
            let (at, slope) = self.distortion.distort_jacobian(ray);
            let slope =
                DMat2::from_cols(self.focal_px * slope.x_axis, self.focal_px * slope.y_axis);
            (self.focal_px * at + self.principal_px, slope)
        })
    }

    /// The ray within the valid radius that is shown at a photo position (pixels; inside the frame or not), to 1e-12;
    /// `None` if the lens shows none there.
    pub fn ray_from_photo(&self, position_px: DVec2) -> Option<DVec2> {
        let target = (position_px - self.principal_px) / self.focal_px;
        self.distortion.undistort(target, self.valid_square)
    }

    /// Whether a photo position lies in the frame: 0 ≤ x < width and 0 ≤ y < height.
    #[inline]
    #[expect(clippy::needless_bitwise_bool, reason = "without branches, for loops over many")]
    pub fn contains(&self, position_px: DVec2) -> bool {
        (position_px.x >= 0.0)
            & (position_px.y >= 0.0)
            & (position_px.x < f64::from(self.size.width))
            & (position_px.y < f64::from(self.size.height))
    }

    /// The radius |(x/z, y/z)| below which the model holds: the *first* positive root of the derivative of the
    /// distorted radius, or of the denominator; infinity if there is none. Tangential terms play no part. For fisheyes
    /// and `FOV` at most tan 85°.
    pub fn valid_radius(&self) -> f64 {
        self.valid_square.sqrt()
    }

    /// A closed rectangle that holds every ray within the valid radius whose photo position lies in the frame, with
    /// room for rounding; `None` if the model shows rays of any radius there.
    pub fn ray_bounds(&self) -> Option<Bounds2> {
        self.ray_bounds
    }

    /// The model.
    pub fn model(&self) -> LensModel {
        self.model
    }

    /// The parameters that [`Lens::new`] makes the same lens of, in the order of [`LensModel`].
    pub fn params(&self) -> &[f64] {
        &self.params[..self.model.param_count()]
    }

    /// Width and height of the photo, pixels.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Focal lengths along x and y, pixels.
    pub fn focal_px(&self) -> DVec2 {
        self.focal_px
    }

    /// The principal point, pixels.
    pub fn principal_px(&self) -> DVec2 {
        self.principal_px
    }
}

/// Number of parameters, finiteness, size.
fn check(model: LensModel, size: Size, params: &[f64]) -> Result<(), LensError> {
    if !model.is_supported() {
        return Err(LensError::Unsupported(model));
    }
    if params.len() != model.param_count() {
        let expected = format!("{} parameters for {}", model.param_count(), model.name());
        return Err(invalid(expected, params.len().to_string()));
    }
    if let Some(p) = params.iter().find(|p| !p.is_finite()) {
        return Err(invalid("finite camera parameters", p.to_string()));
    }
    if size.area() == 0 {
        return Err(invalid(
            "a photo of at least one pixel",
            format!("{} x {}", size.width, size.height),
        ));
    }
    Ok(())
}

/// The distortion of a supported model, `k` the parameters after focal length and principal point.
fn distortion(model: LensModel, k: &[f64]) -> Distortion {
    match model {
        LensModel::SimpleRadial => Distortion::Radial(Radial { k1: k[0], k2: 0.0 }),
        LensModel::Radial => Distortion::Radial(Radial { k1: k[0], k2: k[1] }),
        LensModel::OpenCv => Distortion::OpenCv(OpenCv {
            radial: Radial { k1: k[0], k2: k[1] },
            tangential: Tangential::new(k[2], k[3]),
        }),
        LensModel::FullOpenCv => Distortion::Rational(Rational {
            numerator: [k[0], k[1], k[4]],
            denominator: [k[5], k[6], k[7]],
            tangential: Tangential::new(k[2], k[3]),
        }),
        LensModel::SimpleFisheye | LensModel::Fisheye => fisheye(Brown::NONE),
        LensModel::SimpleRadialFisheye => fisheye(Brown::radial([k[0], 0.0, 0.0, 0.0])),
        LensModel::RadialFisheye => fisheye(Brown::radial([k[0], k[1], 0.0, 0.0])),
        LensModel::OpenCvFisheye => fisheye(Brown::radial([k[0], k[1], k[2], k[3]])),
        LensModel::ThinPrismFisheye => fisheye(
            Brown::radial([k[0], k[1], k[4], k[5]]).decentered(k[2], k[3]).with_prism(k[6], k[7]),
        ),
        _ => Distortion::None,
    }
}

fn fisheye(brown: Brown) -> Distortion {
    Distortion::Wide(Wide::fisheye(brown))
}

/// The polynomial of the Brown models, `k` = skew, k1 … k4, p1, p2.
fn brown(focal_px: DVec2, k: &[f64]) -> Result<Brown, LensError> {
    let shear = k[0] / focal_px.x;
    if shear.abs() < 1.0 {
        Ok(Brown::radial([k[1], k[2], k[3], k[4]]).decentered(k[5], k[6]).sheared(shear))
    } else {
        Err(invalid("a skew below the focal length", k[0].to_string()))
    }
}

/// The `FOV` model, with the focal length that goes with it.
///
/// For |omega| below 0.01 COLMAP computes not the model but `q (1 − omega²/12 + omega² r²/3)`, which has the signs of the
/// inverse's series; what it has adjusted must be computed likewise. The constant is taken into the focal length.
fn fov(focal_px: DVec2, omega: f64) -> Result<(DVec2, Distortion), LensError> {
    let square = omega * omega;
    if square < 1e-4 {
        let scale = 1.0 - square / 12.0;
        let k1 = square / 3.0 / scale;
        return Ok((focal_px * scale, Distortion::Radial(Radial { k1, k2: 0.0 })));
    }
    if omega.abs() < std::f64::consts::PI {
        Ok((focal_px, Distortion::Wide(Wide::fov(omega.abs()))))
    } else {
        Err(invalid("an omega between −π and π", omega.to_string()))
    }
}

fn invalid(expected: impl Into<String>, found: String) -> LensError {
    LensError::Invalid { expected: expected.into(), found }
}
