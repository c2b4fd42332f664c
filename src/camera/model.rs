//! [`LensModel`]: the camera models that COLMAP knows, by its names and numbers, and some that it does not.

/// A camera model of COLMAP (`src/colmap/sensor/models.h`, version 4), computed by groundel or not; or one of
/// groundel's own for the lenses of other programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LensModel {
    /// `f, cx, cy`.
    SimplePinhole,
    /// `fx, fy, cx, cy`.
    Pinhole,
    /// `f, cx, cy, k`.
    SimpleRadial,
    /// `f, cx, cy, k1, k2`.
    Radial,
    /// `fx, fy, cx, cy, k1, k2, p1, p2`.
    OpenCv,
    /// `fx, fy, cx, cy, k1, k2, k3, k4`.
    OpenCvFisheye,
    /// `fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6`.
    FullOpenCv,
    /// `fx, fy, cx, cy, omega`.
    Fov,
    /// `f, cx, cy, k`.
    SimpleRadialFisheye,
    /// `f, cx, cy, k1, k2`.
    RadialFisheye,
    /// `fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1`.
    ThinPrismFisheye,
    /// `fx, fy, cx, cy, k0 … k5, p0, p1, s0 … s3`; named only.
    RadTanThinPrismFisheye,
    /// `f, cx, cy, k`; named only.
    SimpleDivision,
    /// `fx, fy, cx, cy, k`; named only.
    Division,
    /// `f, cx, cy`.
    SimpleFisheye,
    /// `fx, fy, cx, cy`.
    Fisheye,
    /// `fx, fy, cx, cy, alpha, beta`; named only.
    Eucm,
    /// `w, h`; named only.
    Equirectangular,
    /// `fx, fy, cx, cy, skew, k1, k2, k3, k4, p1, p2`: as `OPENCV` with two more radial terms, and
    /// `u = cx + fx x' + skew y'`. groundel's own.
    Brown,
    /// The same after a fisheye: in the plane of angles, as the models of COLMAP. groundel's own.
    BrownFisheye,
    /// `fx, fy, cx, cy, skew, k1, k2, k3, k4, p1, p2, dx, dy`: as [`LensModel::Brown`], its distortion about the point
    /// (dx, dy), pixels from the principal point. groundel's own.
    BrownOffCentre,
}

/// The first so many models are COLMAP's.
const COLMAP: usize = 18;

/// Every model with its name and its number of parameters; the index of COLMAP's is its id.
const MODELS: [(LensModel, &str, usize); COLMAP + 3] = [
    (LensModel::SimplePinhole, "SIMPLE_PINHOLE", 3),
    (LensModel::Pinhole, "PINHOLE", 4),
    (LensModel::SimpleRadial, "SIMPLE_RADIAL", 4),
    (LensModel::Radial, "RADIAL", 5),
    (LensModel::OpenCv, "OPENCV", 8),
    (LensModel::OpenCvFisheye, "OPENCV_FISHEYE", 8),
    (LensModel::FullOpenCv, "FULL_OPENCV", 12),
    (LensModel::Fov, "FOV", 5),
    (LensModel::SimpleRadialFisheye, "SIMPLE_RADIAL_FISHEYE", 4),
    (LensModel::RadialFisheye, "RADIAL_FISHEYE", 5),
    (LensModel::ThinPrismFisheye, "THIN_PRISM_FISHEYE", 12),
    (LensModel::RadTanThinPrismFisheye, "RAD_TAN_THIN_PRISM_FISHEYE", 16),
    (LensModel::SimpleDivision, "SIMPLE_DIVISION", 4),
    (LensModel::Division, "DIVISION", 5),
    (LensModel::SimpleFisheye, "SIMPLE_FISHEYE", 3),
    (LensModel::Fisheye, "FISHEYE", 4),
    (LensModel::Eucm, "EUCM", 6),
    (LensModel::Equirectangular, "EQUIRECTANGULAR", 2),
    (LensModel::Brown, "BROWN", 11),
    (LensModel::BrownFisheye, "BROWN_FISHEYE", 11),
    (LensModel::BrownOffCentre, "BROWN_OFF_CENTRE", 13),
];

impl LensModel {
    /// The greatest number of parameters of any model.
    pub const MAX_PARAMS: usize = 16;

    /// The model with COLMAP's number `id`, as binary files hold it.
    pub fn from_id(id: i32) -> Option<Self> {
        MODELS[..COLMAP].get(usize::try_from(id).ok()?).map(|m| m.0)
    }

    /// The model with COLMAP's name `name`, as text files hold it.
    pub fn from_name(name: &str) -> Option<Self> {
        MODELS[..COLMAP].iter().find(|m| m.1 == name).map(|m| m.0)
    }

    /// The model with that name, groundel's own counted.
    pub fn from_any_name(name: &str) -> Option<Self> {
        MODELS.iter().find(|m| m.1 == name).map(|m| m.0)
    }

    /// COLMAP's number of the model; `None` for groundel's own.
    pub fn id(self) -> Option<i32> {
        let index = self as usize;
        i32::try_from(index).ok().filter(|_| index < COLMAP)
    }

    /// COLMAP's name of the model, or our own.
    pub fn name(self) -> &'static str {
        MODELS[self as usize].1
    }

    /// Number of parameters.
    pub fn param_count(self) -> usize {
        MODELS[self as usize].2
    }

    /// Whether its first parameter is the focal length along both axes.
    pub(super) fn has_one_focal_length(self) -> bool {
        matches!(
            self,
            Self::SimplePinhole
                | Self::SimpleRadial
                | Self::Radial
                | Self::SimpleFisheye
                | Self::SimpleRadialFisheye
                | Self::RadialFisheye
        )
    }

    /// Whether groundel computes it, or only knows its name.
    pub fn is_supported(self) -> bool {
        !matches!(
            self,
            Self::RadTanThinPrismFisheye
                | Self::SimpleDivision
                | Self::Division
                | Self::Eucm
                | Self::Equirectangular
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_of_colmap_is_found_by_its_name_and_number_and_no_other() {
        for (index, (model, name, count)) in MODELS.into_iter().enumerate() {
            let id = i32::try_from(index).unwrap();
            let known = (index < COLMAP).then_some(model);
            assert_eq!(model.id(), known.map(|_| id));
            assert_eq!(LensModel::from_id(id), known);
            assert_eq!(LensModel::from_name(name), known);
            assert_eq!(LensModel::from_any_name(name), Some(model));
            assert_eq!((model.name(), model.param_count()), (name, count));
            assert!(count <= LensModel::MAX_PARAMS);
        }
        assert_eq!((LensModel::from_id(-1), LensModel::from_id(18)), (None, None));
        assert_eq!(LensModel::from_name("pinhole"), None);
    }
}
