//! [`Window`]: a part of one level of one photograph.

use super::Samples;
use crate::geom::PixelRect;

/// A rectangle of one pyramid level of one photo, with its samples.
///
/// The rectangle may hang over the level's edge: there the samples repeat the edge. Pixel `(x, y)` of the level,
/// `rect.x0 ≤ x < rect.x1`, is pixel `(x − rect.x0, y − rect.y0)` of `samples`.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// Pyramid level: 0 is the photo as stored, each next one the mean of 2 × 2 pixels of the one before.
    pub level: u32,
    /// The rectangle, in pixels of that level.
    pub rect: PixelRect,
    /// `rect.height() × rect.width() × channels`, channels 1 (grey) or 3 (RGB).
    pub samples: Samples,
}
