//! [`CameraOptions`]: what a camera file does not say itself.

use std::path::PathBuf;

use glam::DVec3;

/// A format of camera files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CameraFormat {
    /// COLMAP: a folder with `cameras` and `images`, binary or text.
    Colmap,
    /// The plain table: CSV with the header `name,X0,Y0,Z0,omega,phi,kappa,c,x0,y0,k1,k2,k3,p1,p2`.
    Table,
    /// Bundler: `bundle.out`, its image list `list.txt` beside it.
    Bundler,
    /// OpenSfM and ODM: `reconstruction.json`.
    OpenSfm,
    /// OpenMVG: `sfm_data.json`.
    OpenMvg,
    /// `AliceVision` and Meshroom: `.sfm`, as JSON.
    AliceVision,
    /// Agisoft Metashape: the XML of "Export cameras".
    Metashape,
    /// `Pix4D`: `…_calibrated_camera_parameters.txt`, its offset beside it.
    Pix4d,
    /// `RealityCapture`, `RealityScan`: a folder of XMP files, or its table of camera parameters.
    RealityCapture,
    /// `MicMac`: a folder of `Orientation-*.xml`.
    MicMac,
}

/// Every format with the word that chooses it and the name of its tool.
const FORMATS: &[(CameraFormat, &str, &str)] = &[
    (CameraFormat::Colmap, "colmap", "COLMAP model"),
    (CameraFormat::Table, "table", "plain table"),
    (CameraFormat::Bundler, "bundler", "Bundler file"),
    (CameraFormat::OpenSfm, "opensfm", "OpenSfM reconstruction"),
    (CameraFormat::OpenMvg, "openmvg", "OpenMVG scene"),
    (CameraFormat::AliceVision, "alicevision", "AliceVision scene"),
    (CameraFormat::Metashape, "metashape", "Metashape cameras"),
    (CameraFormat::Pix4d, "pix4d", "Pix4D cameras"),
    (CameraFormat::RealityCapture, "realitycapture", "RealityCapture cameras"),
    (CameraFormat::MicMac, "micmac", "MicMac orientations"),
];

impl CameraFormat {
    /// The format chosen by `word`, such as `colmap`.
    pub fn from_word(word: &str) -> Option<Self> {
        FORMATS.iter().find(|format| format.1 == word).map(|format| format.0)
    }

    /// The words that choose a format.
    pub fn words() -> Vec<&'static str> {
        FORMATS.iter().map(|format| format.1).collect()
    }

    /// The word that chooses it.
    pub fn word(self) -> &'static str {
        self.entry().1
    }

    /// What such a file is called, for people.
    pub fn title(self) -> &'static str {
        self.entry().2
    }

    fn entry(self) -> &'static (Self, &'static str, &'static str) {
        FORMATS.iter().find(|format| format.0 == self).expect("every format stands in the list")
    }
}

/// The unit of a table's angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AngleUnit {
    /// Degrees: 360 a turn.
    Degrees,
    /// Gon: 400 a turn.
    Gon,
    /// Radians.
    Radians,
}

impl AngleUnit {
    /// The unit chosen by `word`: `deg`, `gon` or `rad`.
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::Degrees, Self::Gon, Self::Radians].into_iter().find(|unit| unit.word() == word)
    }

    /// The word that chooses it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Degrees => "deg",
            Self::Gon => "gon",
            Self::Radians => "rad",
        }
    }

    /// One unit in radians.
    pub(in crate::input) fn radians(self) -> f64 {
        match self {
            Self::Degrees => std::f64::consts::PI / 180.0,
            Self::Gon => std::f64::consts::PI / 200.0,
            Self::Radians => 1.0,
        }
    }
}

/// What a plain table's lens coefficients mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TableLens {
    /// As COLMAP's `OPENCV`, on positions divided by the focal length: no units.
    #[default]
    OpenCv,
    /// On positions in the unit of `c`: `k1` in px⁻² (or mm⁻²), `k2` in px⁻⁴, `k3` in px⁻⁶, `p1` and `p2` in px⁻¹.
    /// `x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)`, `x` and `y` from the principal point, y down,
    /// without distortion, `x'` with it.
    Classical,
    /// Corrections of measured positions, as certificates of calibration state them, in the unit of `c` too, `y` up:
    /// `x = x' (1 + k1 r'² + k2 r'⁴ + k3 r'⁶) + p1 (r'² + 2 x'²) + 2 p2 x' y'`,
    /// `y = y' (1 + k1 r'² + k2 r'⁴ + k3 r'⁶) + p2 (r'² + 2 y'²) + 2 p1 x' y'`, `x'` and `y'` measured from the
    /// principal point. The lens that distorts so is found to a hundredth of a pixel; where none is, photos are left out.
    Corrections,
}

impl TableLens {
    /// The convention chosen by `word`: `opencv`, `classical` or `corrections`.
    pub fn from_word(word: &str) -> Option<Self> {
        [Self::OpenCv, Self::Classical, Self::Corrections]
            .into_iter()
            .find(|lens| lens.word() == word)
    }

    /// The word that chooses it.
    pub fn word(self) -> &'static str {
        match self {
            Self::OpenCv => "opencv",
            Self::Classical => "classical",
            Self::Corrections => "corrections",
        }
    }
}

/// What a camera file does not say itself. Every format takes what it needs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CameraOptions {
    /// The format; `None`: found from the content.
    pub format: Option<CameraFormat>,
    /// Unit of the angles of a plain table.
    pub angle_unit: Option<AngleUnit>,
    /// Side of a photo pixel, millimetres, where a table's `c`, `x0` and `y0` are in millimetres.
    pub pixel_pitch_mm: Option<f64>,
    /// What a plain table's lens coefficients mean.
    pub lens: TableLens,
    /// Bundler's list of images; `None`: `list.txt` beside the file.
    pub image_list: Option<PathBuf>,
    /// Folder of the photos, for formats that do not state the photos' sizes or only whole paths.
    pub photos: Option<PathBuf>,
    /// Added to the cameras of an OpenSfM reconstruction, which ODM reduces as it does its meshes, metres.
    pub odm_offset: Option<DVec3>,
    /// Take cameras that contradict their own tie points.
    pub force: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_is_chosen_by_its_own_word() {
        for word in CameraFormat::words() {
            assert_eq!(CameraFormat::from_word(word).unwrap().word(), word);
        }
        assert_eq!(CameraFormat::from_word("COLMAP"), None);
    }
}
