//! The settings that are one word of a few.

use clap::ValueEnum;

pub use crate::render::{Blend as BlendRule, Edges, Interpolation, Outliers, Weights};
pub use crate::tone::Levelling;

/// A frame without a frame file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum View {
    /// From above: u = x, v = y.
    Top,
    /// On a plane fitted to the mesh.
    Fit,
}

/// Which rule colours the mosaic: a preset of the single settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ColourRule {
    /// Levelled photos, soft robust weights that fade at edges, detail of the sharpest.
    #[default]
    Even,
    /// Grammatikopoulos et al. (2004): outliers by σ, mean by the faces' areas.
    Paper,
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
