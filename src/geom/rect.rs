//! Half-open rectangles of pixels.

/// Width and height in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Size {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Size {
    /// The size `width × height`.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height }
    }

    /// Number of pixels.
    pub fn area(self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// The rectangle from (0, 0) to this size.
    pub fn rect(self) -> PixelRect {
        PixelRect { x0: 0, y0: 0, x1: i64::from(self.width), y1: i64::from(self.height) }
    }

    /// The next coarser level of a 2 × 2 pyramid: each side halved, rounded up.
    #[must_use]
    pub fn halved(self) -> Self {
        Self { width: self.width.div_ceil(2), height: self.height.div_ceil(2) }
    }
}

/// A half-open rectangle of pixels, `x0 ≤ x < x1`, `y0 ≤ y < y1`; empty when `x0 ≥ x1` or `y0 ≥ y1`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct PixelRect {
    /// First column.
    pub x0: i64,
    /// First row.
    pub y0: i64,
    /// Column past the last.
    pub x1: i64,
    /// Row past the last.
    pub y1: i64,
}

impl PixelRect {
    /// The rectangle `[x0, x1) × [y0, y1)`.
    pub fn new(x0: i64, y0: i64, x1: i64, y1: i64) -> Self {
        Self { x0, y0, x1, y1 }
    }

    /// Whether it holds no pixel.
    pub fn is_empty(&self) -> bool {
        self.x0 >= self.x1 || self.y0 >= self.y1
    }

    /// Columns; 0 when empty.
    pub fn width(&self) -> usize {
        usize::try_from(self.x1 - self.x0).unwrap_or(0)
    }

    /// Rows; 0 when empty.
    pub fn height(&self) -> usize {
        usize::try_from(self.y1 - self.y0).unwrap_or(0)
    }

    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width() * self.height()
    }

    /// The pixels in both.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            x0: self.x0.max(other.x0),
            y0: self.y0.max(other.y0),
            x1: self.x1.min(other.x1),
            y1: self.y1.min(other.y1),
        }
    }

    /// Whether every pixel of `other` is in this one.
    pub fn contains(&self, other: &Self) -> bool {
        other.is_empty()
            || (self.x0 <= other.x0
                && self.y0 <= other.y0
                && other.x1 <= self.x1
                && other.y1 <= self.y1)
    }

    /// This rectangle cut into squares of `side` from its upper-left corner, row by row; the last of a row or
    /// column may be smaller.
    ///
    /// # Panics
    /// If `side` is not positive.
    pub fn blocks(self, side: i64) -> impl Iterator<Item = Self> {
        assert!(side > 0, "a block has a positive side");
        let step = usize::try_from(side).expect("positive");
        (self.y0..self.y1).step_by(step).flat_map(move |y| {
            (self.x0..self.x1).step_by(step).map(move |x| Self {
                x0: x,
                y0: y,
                x1: (x + side).min(self.x1),
                y1: (y + side).min(self.y1),
            })
        })
    }
}

/// A rectangle of pixels that are written, and the larger one of those that are computed for their sake.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct HaloRect {
    /// What is written.
    pub inner: PixelRect,
    /// `inner` and what lies around it.
    pub outer: PixelRect,
}

impl From<PixelRect> for HaloRect {
    /// A rectangle with nothing around it.
    fn from(rect: PixelRect) -> Self {
        Self { inner: rect, outer: rect }
    }
}

impl HaloRect {
    /// `inner` with `halo` pixels on each side.
    pub fn around(inner: PixelRect, halo: i64) -> Self {
        let PixelRect { x0, y0, x1, y1 } = inner;
        Self { inner, outer: PixelRect::new(x0 - halo, y0 - halo, x1 + halo, y1 + halo) }
    }

    /// `outer` in pieces of at most `side`: first those of `inner`, as [`PixelRect::blocks`] gives them, then what lies
    /// above, below, left and right of it.
    ///
    /// # Panics
    /// If `side` is not positive.
    pub fn blocks(self, side: i64) -> impl Iterator<Item = PixelRect> {
        let Self { inner: i, outer: o } = self;
        [
            i,
            PixelRect::new(o.x0, o.y0, o.x1, i.y0),
            PixelRect::new(o.x0, i.y1, o.x1, o.y1),
            PixelRect::new(o.x0, i.y0, i.x0, i.y1),
            PixelRect::new(i.x1, i.y0, o.x1, i.y1),
        ]
        .into_iter()
        .flat_map(move |part| part.blocks(side))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_and_its_halo_are_cut_so_that_every_pixel_comes_once_and_the_inner_ones_first() {
        let halo = HaloRect::around(PixelRect::new(-3, 5, 130, 77), 8);
        let mut hits = vec![0; halo.outer.area()];
        for b in halo.blocks(32) {
            assert!(halo.outer.contains(&b) && !b.is_empty());
            for y in b.y0..b.y1 {
                for x in b.x0..b.x1 {
                    hits[usize::try_from((y + 3) * 149 + x + 11).unwrap()] += 1;
                }
            }
        }
        assert!(hits.iter().all(|&h| h == 1));
        let inner = halo.inner.blocks(32).count();
        assert!(halo.blocks(32).take(inner).eq(halo.inner.blocks(32)));
        assert!(HaloRect::from(halo.inner).blocks(32).eq(halo.inner.blocks(32)));
    }

    #[test]
    fn blocks_cover_every_pixel_exactly_once() {
        let r = PixelRect::new(-3, 5, 130, 77);
        let mut hits = vec![0; r.area()];
        for b in r.blocks(32) {
            assert!(r.contains(&b) && !b.is_empty());
            for y in b.y0..b.y1 {
                for x in b.x0..b.x1 {
                    hits[usize::try_from((y - r.y0) * 133 + x - r.x0).unwrap()] += 1;
                }
            }
        }
        assert!(hits.iter().all(|&h| h == 1));
    }

    #[test]
    fn an_empty_intersection_has_no_area() {
        let a = PixelRect::new(0, 0, 4, 4).intersection(&PixelRect::new(5, 1, 9, 2));
        assert!(a.is_empty());
        assert_eq!((a.width(), a.area()), (0, 0));
    }
}
