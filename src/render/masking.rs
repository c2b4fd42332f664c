//! [`Masking`]: the points of a photo that its mask hides.
//!
//! A point is hidden or not by the one pixel of the mask that holds its position. A point that is not hidden is sampled
//! as ever: its kernel may reach over the mask's border, and a coarser level's pixels are means of both sides.

use glam::DVec2;

use crate::Result;
use crate::geom::{PixelRect, Size};
use crate::image::{Image, Samples, Window};
use crate::store::photo::PhotoStore;
use crate::visibility::ViewTile;

/// Largest window, pixels: points that lie farther apart are looked up in parts.
const WINDOW_AREA: usize = 4 * 256 * 256;

/// Drops hidden points, reusing its memory.
#[derive(Debug)]
pub(super) struct Masking {
    window: Window,
    is_used: Vec<bool>,
}

impl Default for Masking {
    fn default() -> Self {
        let samples = Samples::U8(Image::filled(Size::new(0, 0), 1, 0));
        let window = Window { level: 0, rect: PixelRect::default(), samples };
        Self { window, is_used: Vec::new() }
    }
}

impl Masking {
    /// Keeps those points of `view` for which the mask of photo `k` is not 0 in the pixel that holds their position:
    /// ⌊x⌋, ⌊y⌋. All stay if the photo has no mask.
    ///
    /// # Errors
    /// Those of reading the masks.
    pub(super) fn apply(
        &mut self,
        masks: &PhotoStore,
        k: usize,
        view: &mut ViewTile,
    ) -> Result<()> {
        if !masks.has(k) {
            return Ok(());
        }
        self.is_used.clear();
        self.look_up(masks, k, &view.positions)?;
        view.retain(&self.is_used);
        Ok(())
    }

    /// Appends whether each of `points` is used: from one window, or by halves where that would be too large.
    fn look_up(&mut self, masks: &PhotoStore, k: usize, points: &[DVec2]) -> Result<()> {
        let size = masks.level_size(k, 0);
        let Some(rect) = bounds(points, size) else { return Ok(()) };
        if rect.area() > WINDOW_AREA && points.len() > 1 {
            let (first, second) = points.split_at(points.len() / 2);
            self.look_up(masks, k, first)?;
            return self.look_up(masks, k, second);
        }
        masks.window_into(k, 0, rect, &mut self.window)?;
        // A mask has one channel of 8 bits.
        let Samples::U8(mask) = &self.window.samples else { return Ok(()) };
        let width = rect.width();
        self.is_used.extend(points.iter().map(|point| {
            let [x, y] = pixel_of(*point, size);
            let at = |v: i64, from: i64| usize::try_from(v - from).unwrap_or(0);
            mask.data()[at(y, rect.y0) * width + at(x, rect.x0)] != 0
        }));
        Ok(())
    }
}

/// The rectangle of the pixels that hold the points; `None` without points.
fn bounds(points: &[DVec2], size: Size) -> Option<PixelRect> {
    let mut pixels = points.iter().map(|point| pixel_of(*point, size));
    let [x, y] = pixels.next()?;
    let first = PixelRect::new(x, y, x + 1, y + 1);
    Some(pixels.fold(first, |r, [x, y]| {
        PixelRect::new(r.x0.min(x), r.y0.min(y), r.x1.max(x + 1), r.y1.max(y + 1))
    }))
}

/// The pixel that holds a point's position. Rounding may have moved the position to the frame's edge; it stays inside.
#[expect(clippy::cast_possible_truncation, reason = "positions lie in the frame")]
fn pixel_of(position: DVec2, size: Size) -> [i64; 2] {
    let inside = |v: f64, side: u32| (v.floor() as i64).clamp(0, i64::from(side) - 1);
    [inside(position.x, size.width), inside(position.y, size.height)]
}
