//! [`Proof`]: how well cameras see their own tie points, and whether another reading of the file would do better.
//!
//! In: cameras in groundel's convention with a sample of tie points. Out: the residual under the convention that the
//! format declares, and the best of the readings that files and tools are known to mix up: half a pixel, p1 and p2
//! exchanged, y upwards, rotations transposed. The residual is the root mean square over the nine tenths of the points
//! that fit best: tie points hold mismatches, which say nothing about conventions. Angles in another unit cannot be
//! told from tie points, since no format with angles has any: see [`MeshProof`](super::MeshProof).

use std::fmt;
use std::path::Path;

use glam::{DMat3, DVec2, DVec3};

use super::{Draft, Tie};
use crate::camera::{Lens, Pose};
use crate::{Error, Result};

/// A reading is better if its residual is below this part of the declared one's: half a pixel beside a residual of
/// 0.8 pixel makes 0.77 of it.
const CLEARLY: f64 = 0.8;
/// …and less by at least so much, pixels: what matters less is not worth a warning.
const MATTERS_PX: f64 = 0.1;

/// How well cameras see their own tie points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proof {
    /// How many points were tried.
    pub ties: usize,
    /// Root mean square residual of the best nine tenths of them, pixels; a point that a photo cannot see counts as
    /// one that is missed by the photo's diagonal.
    pub error_px: f64,
    /// The reading that fits clearly better than the declared one, and its residual, pixels.
    pub better: Option<(Reading, f64)>,
}

/// A way to read a camera file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reading {
    /// As the format says.
    Declared,
    /// Photo positions half a pixel further right and down.
    HalfPixelMore,
    /// Photo positions half a pixel further left and up.
    HalfPixelLess,
    /// The tangential coefficients p1 and p2 exchanged.
    TangentialExchanged,
    /// Photo positions with y upwards from the lower edge.
    YUpwards,
    /// Camera axes with y upwards and z backwards.
    AxesUpBackwards,
    /// Rotations transposed, centres as they are.
    Transposed,
    /// Rotations transposed, translations as they are.
    TransposedKeepingTranslation,
    /// Rotation and translation from the camera to the ground.
    Inverse,
}

impl Reading {
    const OTHERS: [Self; 8] = [
        Self::HalfPixelMore,
        Self::HalfPixelLess,
        Self::TangentialExchanged,
        Self::YUpwards,
        Self::AxesUpBackwards,
        Self::Transposed,
        Self::TransposedKeepingTranslation,
        Self::Inverse,
    ];

    fn pose(self, pose: &Pose) -> Pose {
        let transposed =
            |centre_ground| Pose { rotation: pose.rotation.transpose(), centre_ground };
        match self {
            Self::Transposed => transposed(pose.centre_ground),
            Self::TransposedKeepingTranslation => transposed(-(pose.rotation * pose.translation())),
            Self::Inverse => transposed(pose.translation()),
            Self::AxesUpBackwards => {
                let turn = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
                Pose { rotation: turn * pose.rotation, centre_ground: pose.centre_ground }
            }
            _ => *pose,
        }
    }

    /// Where the photo shows a point, pixels.
    fn photo_from_ground(self, lens: &Lens, pose: &Pose, point: DVec3) -> Option<DVec2> {
        let point = self.pose(pose).camera_from_ground(point);
        if point.z <= 0.0 {
            return None;
        }
        let ray = point.truncate() / point.z;
        let at = match self {
            // The tangential terms with p1 and p2 exchanged are those of a lens whose x and y are.
            Self::TangentialExchanged => {
                let at = lens.photo_from_ray(DVec2::new(ray.y, ray.x))?;
                let at = (at - lens.principal_px()) / lens.focal_px();
                lens.focal_px() * DVec2::new(at.y, at.x) + lens.principal_px()
            }
            _ => lens.photo_from_ray(ray)?,
        };
        Some(match self {
            Self::HalfPixelMore => at + 0.5,
            Self::HalfPixelLess => at - 0.5,
            Self::YUpwards => DVec2::new(at.x, f64::from(lens.size().height) - at.y),
            _ => at,
        })
    }
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Declared => "the format's convention",
            Self::HalfPixelMore => "photo positions half a pixel further right and down",
            Self::HalfPixelLess => "photo positions half a pixel further left and up",
            Self::TangentialExchanged => "p1 and p2 exchanged",
            Self::YUpwards => "photo positions with y upwards",
            Self::AxesUpBackwards => "camera axes with y upwards and z backwards",
            Self::Transposed => "rotations transposed",
            Self::TransposedKeepingTranslation => "rotations transposed, translations kept",
            Self::Inverse => "rotations and translations from the camera to the ground",
        })
    }
}

impl Proof {
    /// The greatest residual of cameras that can be used, pixels.
    pub const MOST_PX: f64 = 5.0;

    /// What the tie points say; `None` without any in a photo that can be used.
    pub(super) fn of(draft: &Draft) -> Option<Self> {
        let seen: Vec<Seen> = draft.ties.iter().filter_map(|tie| Seen::of(draft, tie)).collect();
        if seen.is_empty() {
            return None;
        }
        let declared = error_px(&seen, Reading::Declared);
        let readings = Reading::OTHERS.iter().map(|&reading| (reading, error_px(&seen, reading)));
        let best = readings.min_by(|a, b| a.1.total_cmp(&b.1));
        let is_better = |(_, error): &(Reading, f64)| {
            *error < CLEARLY * declared && declared - error > MATTERS_PX
        };
        Some(Self { ties: seen.len(), error_px: declared, better: best.filter(is_better) })
    }

    /// Refuses cameras that miss their tie points.
    pub(super) fn check(&self, path: &Path) -> Result<()> {
        if self.error_px <= Self::MOST_PX {
            return Ok(());
        }
        let expected = format!(
            "photos that see their tie points within {} pixels (--force takes others)",
            Self::MOST_PX
        );
        let found = match self.better {
            Some((reading, error)) => {
                format!("{:.1}; {error:.2} with {reading}", self.error_px)
            }
            None => format!("{:.1}", self.error_px),
        };
        Err(Error::corrupt(path, format!("{} tie points", self.ties), expected, found))
    }

    /// The warning that a reading other than the declared one fits better, or that none fits.
    pub fn warning(&self) -> Option<String> {
        let error = self.error_px;
        match self.better {
            Some((reading, better)) => Some(format!(
                "the cameras see their tie points within {error:.2} px, but within {better:.2} px with {reading}: \
                 the file may not follow its format's convention"
            )),
            None if error > Self::MOST_PX => {
                Some(format!("the cameras see their tie points only within {error:.1} px"))
            }
            None => None,
        }
    }
}

/// A tie point with the photo that saw it.
struct Seen<'a> {
    tie: &'a Tie,
    lens: &'a Lens,
    pose: &'a Pose,
}

impl<'a> Seen<'a> {
    fn of(draft: &'a Draft, tie: &'a Tie) -> Option<Self> {
        let (lens, pose) = draft.photos.get(tie.photo)?.orientation.as_ref().ok()?;
        let is_finite = tie.position_px.is_finite() && tie.point_ground.is_finite();
        is_finite.then_some(Self { tie, lens, pose })
    }
}

/// The root mean square residual of the best nine tenths, pixels, in one reading.
fn error_px(seen: &[Seen], reading: Reading) -> f64 {
    let square = |s: &Seen| {
        let size = s.lens.size();
        let most = DVec2::new(f64::from(size.width), f64::from(size.height)).length_squared();
        let at = reading.photo_from_ground(s.lens, s.pose, s.tie.point_ground);
        let missed = at.map_or(most, |at| (at - s.tie.position_px).length_squared());
        if missed < most { missed } else { most }
    };
    let mut squares: Vec<f64> = seen.iter().map(square).collect();
    squares.sort_by(f64::total_cmp);
    squares.truncate((squares.len() * 9).div_ceil(10));
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}
