//! The words of the command line as the settings of the stages.

use super::super::settings as typed;
use crate::render;

pub(super) fn interpolation(typed: typed::Interpolation) -> render::Interpolation {
    match typed {
        typed::Interpolation::Nearest => render::Interpolation::Nearest,
        typed::Interpolation::Bilinear => render::Interpolation::Bilinear,
        typed::Interpolation::Bicubic => render::Interpolation::Bicubic,
    }
}

pub(super) fn outliers(typed: typed::Outliers) -> render::Outliers {
    match typed {
        typed::Outliers::None => render::Outliers::None,
        typed::Outliers::Sigma => render::Outliers::Sigma,
    }
}

pub(super) fn weights(typed: typed::Weights) -> render::Weights {
    match typed {
        typed::Weights::Area => render::Weights::Area,
        typed::Weights::Equal => render::Weights::Equal,
    }
}

pub(super) fn blend(typed: typed::BlendRule) -> render::Blend {
    match typed {
        typed::BlendRule::Mean => render::Blend::Mean,
        typed::BlendRule::Best => render::Blend::Best,
    }
}
