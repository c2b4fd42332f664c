//! [`Settings`] of the blend.

use crate::image::{Colour, Depth};
use crate::{Error, Result};

/// How a sample is found to be an outlier.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    Default,
    serde::Serialize,
    serde::Deserialize,
    clap::ValueEnum,
)]
pub enum Outliers {
    /// No sample is dropped.
    None,
    /// A sample too many standard deviations from the mean is dropped.
    ///
    /// When a pixel has more than two samples: μ is their unweighted mean, dᵢ the Euclidean distance of sample i to μ
    /// over the channels, σ² the mean of dᵢ²; sample i is dropped if dᵢ > β·σ·(1 + 1e-6). All are kept if
    /// σ < 0.5/255 of the range. Should none be left (β < 1), the nearest to μ stays, of equals the lowest id.
    #[default]
    Sigma,
    /// Each sample weighs the less the farther it is from where most samples agree.
    Robust,
}

/// What a sample weighs.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    Default,
    serde::Serialize,
    serde::Deserialize,
    clap::ValueEnum,
)]
pub enum Weights {
    /// The area of the pixel's face in the photo, photo pixels.
    #[default]
    Area,
    /// As much as any other.
    Equal,
    /// By how well the photo resolves the surface, to the fourth power.
    ///
    /// That is by the photo pixels that the mosaic pixel covers, times cos⁴ of the angle between the photo's ray and the
    /// mosaic's line of sight.
    Sharp,
}

/// What a sample weighs near the border of what its photo sees.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    Default,
    serde::Serialize,
    serde::Deserialize,
    clap::ValueEnum,
)]
pub enum Edges {
    /// As much as elsewhere.
    #[default]
    None,
    /// Less and less, to almost nothing.
    Guard,
}

/// What becomes of the samples that are kept.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    Default,
    serde::Serialize,
    serde::Deserialize,
    clap::ValueEnum,
)]
pub enum Blend {
    /// Their weighted mean; the plain mean if all weights are zero.
    #[default]
    Mean,
    /// The heaviest alone; of equals the lowest id.
    Best,
}

/// How samples become a pixel. The default is the paper's method, for 8-bit RGB.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Settings {
    /// The outlier test.
    pub outliers: Outliers,
    /// Its β: how many σ from the mean are still kept; finite, not negative.
    pub beta: f64,
    /// What a sample weighs.
    pub weights: Weights,
    /// What it weighs near the border of what its photo sees.
    pub edges: Edges,
    /// What becomes of the kept samples.
    pub blend: Blend,
    /// Channels of the output. Grey takes channel 0 of the samples, everywhere.
    pub colour: Colour,
    /// Depth of the output, and range of the samples.
    pub depth: Depth,
    /// Colour under pixels without alpha, in the output's range; grey takes the first.
    pub undefined: [u16; 3],
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            outliers: Outliers::Sigma,
            beta: 1.0,
            weights: Weights::Area,
            edges: Edges::None,
            blend: Blend::Mean,
            colour: Colour::Rgb,
            depth: Depth::Eight,
            undefined: [0; 3],
        }
    }
}

impl Settings {
    /// Checks what a user can get wrong.
    ///
    /// # Errors
    /// [`Error::Usage`] if `beta` is negative or not finite, or `undefined` is beyond the output's range.
    pub fn check(&self) -> Result<()> {
        if !(self.beta.is_finite() && self.beta >= 0.0) {
            let found = self.beta;
            return Err(Error::usage(format!(
                "--beta: expected a number from 0 on, found {found}"
            )));
        }
        let max = self.depth.max();
        match self.undefined.into_iter().find(|v| *v > max) {
            Some(v) => Err(Error::usage(format!(
                "--undefined: expected values from 0 to {max}, the range of the mosaic, found {v}"
            ))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_beta_or_colour_is_named_with_what_was_found() {
        let bad = |s: Settings| s.check().unwrap_err().to_string();
        let ok = Settings::default();
        assert!(ok.check().is_ok());
        assert!(bad(Settings { beta: f64::NAN, ..ok }).contains("NaN"));
        assert!(bad(Settings { beta: -0.5, ..ok }).contains("-0.5"));
        assert!(bad(Settings { undefined: [0, 256, 0], ..ok }).contains("256"));
        assert!(Settings { undefined: [0, 256, 0], depth: Depth::Sixteen, ..ok }.check().is_ok());
    }
}
