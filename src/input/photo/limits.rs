//! Limits on what the header of a photo may state.

use std::path::Path;

use crate::geom::Size;
use crate::{Error, Result};

/// Most pixels of a PNG or TIFF: 2³⁰, a square of 32,768.
const MAX_PIXELS: u64 = 1 << 30;
/// Longest side of a PNG or TIFF: rows are buffered, 256 at a time.
const MAX_SIDE: u32 = 1 << 20;

/// Checks a size that stands at `place` of a file.
///
/// # Errors
/// [`Error::Corrupt`] for no pixels, [`Error::Limit`] for too many.
pub(super) fn check_size(path: &Path, place: &str, size: Size) -> Result<()> {
    if size.width == 0 || size.height == 0 {
        let found = format!("{} × {}", size.width, size.height);
        return Err(Error::corrupt(path, place, "a size in pixels", found));
    }
    let side = size.width.max(size.height);
    if side > MAX_SIDE {
        let what = format!("{}: longest side in pixels", path.display());
        return Err(Error::Limit { what, limit: MAX_SIDE.into(), found: side.into() });
    }
    if size.area() > MAX_PIXELS {
        let what = format!("{}: number of pixels", path.display());
        return Err(Error::Limit { what, limit: MAX_PIXELS, found: size.area() });
    }
    Ok(())
}
