//! [`PhotoTone`]: what a photo makes of the surface's colours.

use glam::DVec2;
use serde::{Deserialize, Serialize};

/// What is levelled.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, clap::ValueEnum,
)]
#[serde(rename_all = "snake_case")]
pub enum Levelling {
    /// Nothing: photos are taken as they are.
    #[default]
    None,
    /// Exposure and white balance: a gain for each photo and channel.
    Gain,
    /// Also vignetting, for each camera, and a gentle field for each photo and channel.
    Full,
}

/// Nodes of a field along each side of the frame.
pub(super) const FIELD_SIDE: usize = 4;
/// Nodes of a field.
pub(super) const FIELD: usize = FIELD_SIDE * FIELD_SIDE;

/// Means of ρ² and ρ⁴ over a frame of 3 : 2, so that vignetting alone does not change a photo's mean tone.
const MEANS: [f64; 2] = [1.0 / 3.0, 0.162];

/// Natural logarithms of what the surface's colours are multiplied by in a photo: positive where the photo is too bright.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhotoTone {
    /// For each channel.
    pub gain: [f64; 3],
    /// By ρ² and ρ⁴, each less its mean over the frame; ρ is the distance to the frame's middle, 1 at its corners.
    #[serde(default, skip_serializing_if = "is_none")]
    pub vignetting: [f64; 2],
    /// For each channel 4 × 4 nodes over the frame, row by row from the top left, the outer ones at its corners, bilinear
    /// between; empty: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub field: Vec<[f64; 3]>,
}

fn is_none(vignetting: &[f64; 2]) -> bool {
    vignetting.iter().all(|v| v.to_bits() == 0)
}

impl PhotoTone {
    /// Whether every number is finite and small enough to be a tone, and a field is whole.
    pub fn is_sound(&self) -> bool {
        let numbers = self.gain.iter().chain(&self.vignetting).chain(self.field.iter().flatten());
        let mut numbers = numbers;
        [0, FIELD].contains(&self.field.len()) && numbers.all(|v| v.abs() <= 10.0)
    }

    /// The logarithms at a position in the frame, both coordinates 0 to 1, of a frame `aspect` times as wide as high.
    pub fn at(&self, position: DVec2, aspect: f64) -> [f64; 3] {
        let [a, b] = vignetting_basis(position, aspect);
        let common = self.vignetting[0] * a + self.vignetting[1] * b;
        let mut of = self.gain.map(|gain| gain + common);
        if !self.field.is_empty() {
            for (node, weight) in field_basis(position) {
                for (of, field) in of.iter_mut().zip(self.field[node]) {
                    *of += weight * field;
                }
            }
        }
        of
    }
}

/// ρ² and ρ⁴ less their means.
pub(super) fn vignetting_basis(position: DVec2, aspect: f64) -> [f64; 2] {
    let from_middle = (position - 0.5) * DVec2::new(2.0 * aspect, 2.0);
    let square = from_middle.length_squared() / (aspect * aspect + 1.0);
    [square - MEANS[0], square * square - MEANS[1]]
}

/// The four nodes around a position and their weights.
pub(super) fn field_basis(position: DVec2) -> [(usize, f64); 4] {
    let last = (FIELD_SIDE - 1) as f64;
    let at = position.clamp(DVec2::ZERO, DVec2::ONE) * last;
    let cell = at.floor().min(DVec2::splat(last - 1.0));
    let f = at - cell;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 2")]
    let first = cell.y as usize * FIELD_SIDE + cell.x as usize;
    let (g, below) = (DVec2::ONE - f, first + FIELD_SIDE);
    [(first, g.x * g.y), (first + 1, f.x * g.y), (below, g.x * f.y), (below + 1, f.x * f.y)]
}
