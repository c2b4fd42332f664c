//! The pixel size by the scale of a print.

use super::args::OrthoArgs;
use crate::{Error, Result};

/// `args`, merged with the project file, whose scale has become a pixel size.
///
/// # Errors
/// [`Error::Usage`] for a scale with a pixel size, or without dots per inch.
pub(super) fn resolved(args: OrthoArgs) -> Result<OrthoArgs> {
    let Some(denominator) = args.scale else { return Ok(args) };
    if args.pixel_size.is_some() {
        let message = "--scale does not go with --pixel-size: each says how large a pixel is";
        return Err(Error::usage(format!("{message} (in a project file: `scale`, `pixel_size`)")));
    }
    let Some(resolution) = args.dpi else {
        return Err(Error::usage("--scale needs --dpi (in a project file: `dpi`)"));
    };
    Ok(OrthoArgs { pixel_size: Some(resolution.pixel_size_m(denominator)), ..args })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::PrintResolution;

    #[test]
    fn a_scale_and_dots_per_inch_are_a_pixel_size() {
        let dpi = PrintResolution::new(254.0);
        let args = OrthoArgs { scale: Some(100.0), dpi, ..Default::default() };
        let found = resolved(args.clone()).unwrap();
        assert_eq!(found.pixel_size, Some(0.01));
        let both = OrthoArgs { pixel_size: Some(0.01), ..args.clone() };
        let error = resolved(both).unwrap_err();
        assert!(error.to_string().starts_with("--scale does not go with --pixel-size"), "{error}");
        let alone = resolved(OrthoArgs { dpi: None, ..args }).unwrap_err();
        assert!(alone.to_string().starts_with("--scale needs --dpi"), "{alone}");
        let only_dpi = OrthoArgs { pixel_size: Some(0.5), dpi, ..Default::default() };
        assert_eq!(resolved(only_dpi.clone()).unwrap(), only_dpi);
    }
}
