//! The settings that are one word of a few.

use clap::ValueEnum;

/// A frame without a frame file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum View {
    /// From above: u = x, v = y.
    Top,
    /// On a plane fitted to the mesh.
    Fit,
}

/// How photos are sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Interpolation {
    /// The nearest pixel.
    Nearest,
    /// Between four pixels.
    Bilinear,
    /// Cubic convolution over sixteen pixels.
    #[default]
    Bicubic,
}

/// Rejection of outlying colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Outliers {
    /// All colours are kept.
    None,
    /// Colours too many standard deviations from the mean are rejected.
    #[default]
    Sigma,
}

/// Weight of a photo in the mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Weights {
    /// Area of the face in photo pixels.
    #[default]
    Area,
    /// All alike.
    Equal,
}

/// How many colours become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BlendRule {
    /// Weighted mean of the kept photos.
    #[default]
    Mean,
    /// The heaviest kept photo alone.
    Best,
}

/// A drawing beside the mosaic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Cad {
    /// As text, of the year 2000.
    Dxf,
}

/// The value that `text` names; else an error with those allowed.
pub(super) fn word<T: ValueEnum>(text: &str) -> std::result::Result<T, String> {
    let names = || -> Vec<String> {
        let words = T::value_variants().iter().filter_map(ValueEnum::to_possible_value);
        words.map(|word| word.get_name().to_string()).collect()
    };
    T::from_str(text, false)
        .map_err(|_unnamed| format!("expected one of {}, found {text:?}", names().join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_word_is_answered_with_those_allowed() {
        assert_eq!(word::<Interpolation>("nearest"), Ok(Interpolation::Nearest));
        let error = word::<Interpolation>("cubic").unwrap_err();
        assert_eq!(error, "expected one of nearest, bilinear, bicubic, found \"cubic\"");
    }
}
