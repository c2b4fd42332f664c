//! How far inside what a photo sees a pixel lies.
//!
//! In: a surface tile and what one photo sees of it, halo included. Out: for each inner pixel the square of its distance
//! to the nearest pixel that shows a surface which the photo does *not* see: because it is occluded, turned away, masked
//! or out of the frame. A pixel without a surface is no border: nothing there can be mistaken for something else.
//!
//! Promises: exact Euclidean distances of pixel centres within [`EdgeMap::REACH`] columns and rows, none beyond; so with
//! a halo of that width a pixel's answer does not depend on the tile.

use super::points::{BlockPoints, SUB_BLOCK};
use crate::geom::{HaloRect, Kernel, PixelRect, held_bytes, run_widest};
use crate::surface::SurfaceTile;

/// Squares of distances to the border of what one photo sees, for the inner pixels of a tile.
#[derive(Debug, Default)]
pub struct EdgeMap {
    area: HaloRect,
    /// 255 for a pixel of the outer rectangle that is seen or shows no surface, else 0; then the squared distance along
    /// its row to the nearest 0.
    rows: Vec<u8>,
    /// For each pixel of the inner rectangle; 255: no border within reach.
    squares: Vec<u8>,
    is_all_seen: bool,
}

impl EdgeMap {
    /// Borders farther away than this along a column or a row are not looked for, pixels.
    pub const REACH: i64 = 8;
    /// Stands for no border within reach.
    pub const FAR: u8 = u8::MAX;

    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.rows) + held_bytes(&self.squares)
    }

    /// Starts a tile: nothing of its surface is seen.
    pub fn start(&mut self, surface: &SurfaceTile) {
        self.area = surface.halo();
        self.rows.clear();
        self.rows.extend(
            surface.faces_at.iter().map(
                |&face| {
                    if face == SurfaceTile::NO_FACE { Self::FAR } else { 0 }
                },
            ),
        );
    }

    /// Marks what the photo sees.
    pub fn see(&mut self, surface: &SurfaceTile, points: &BlockPoints) {
        for (k, part) in self.area.blocks(SUB_BLOCK).enumerate() {
            self.see_places(surface, part, points.seen_in(k));
        }
    }

    /// Marks places of a part of the tile, row × [`SUB_BLOCK`] + column, as seen.
    fn see_places(
        &mut self,
        surface: &SurfaceTile,
        part: PixelRect,
        places: impl Iterator<Item = u16>,
    ) {
        let side = usize::try_from(SUB_BLOCK).expect("positive");
        let (first, stride) = (surface.pixel_at(part.x0, part.y0), surface.rect.width());
        for place in places.map(usize::from) {
            self.rows[first + place / side * stride + place % side] = Self::FAR;
        }
    }

    /// Marks pixels of a part of the tile, row-major in it, as seen.
    pub fn see_pixels(&mut self, surface: &SurfaceTile, part: PixelRect, pixels: &[u32]) {
        let (first, stride) = (surface.pixel_at(part.x0, part.y0), surface.rect.width());
        for pixel in pixels.iter().map(|&pixel| pixel as usize) {
            let (row, column) = (pixel / part.width(), pixel % part.width());
            self.rows[first + row * stride + column] = Self::FAR;
        }
    }

    /// Finds the distances.
    pub fn finish(&mut self) {
        self.is_all_seen = self.rows.iter().all(|&v| v == Self::FAR);
        if !self.is_all_seen {
            self.squares.clear();
            self.squares.resize(self.area.inner.area(), Self::FAR);
            run_widest(Distances { map: self });
        }
    }

    /// The squared distance of a row's pixels, columns from `x` on, to the border, px²; `None`: far from it.
    ///
    /// # Panics
    /// If they are not inner pixels.
    pub fn row(&self, x: i64, y: i64, count: usize) -> Option<&[u8]> {
        let inner = self.area.inner;
        let inside = |v: i64| usize::try_from(v).expect("an inner pixel");
        let first = inside(y - inner.y0) * inner.width() + inside(x - inner.x0);
        (!self.is_all_seen).then(|| &self.squares[first..first + count])
    }
}

struct Distances<'a> {
    map: &'a mut EdgeMap,
}

impl Kernel for Distances<'_> {
    type Output = ();

    /// Along the rows, then along the columns of what that leaves: the exact transform, since the square of a distance is
    /// a sum (A. Meijster, J. Roerdink, W. Hesselink (2000), "A general algorithm for computing distance transforms in
    /// linear time", doi:10.1007/0-306-47025-X_36). Departure: within so short a reach every offset is tried, in vectors.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "a kernel")]
    fn run(self) {
        let EdgeMap { area: HaloRect { inner, outer }, rows, squares, .. } = self.map;
        let reach = usize::try_from(EdgeMap::REACH).expect("positive");
        let inside = |v: i64| usize::try_from(v).expect("the inner rectangle lies in the outer");
        let (width, height) = (outer.width(), outer.height());
        let (left, top) = (inside(inner.x0 - outer.x0), inside(inner.y0 - outer.y0));
        let mut before = vec![0_u8; width];
        for row in rows.chunks_exact_mut(width.max(1)) {
            before.copy_from_slice(row);
            if before.iter().all(|&v| v == EdgeMap::FAR) {
                continue;
            }
            for by in 1..=reach.min(width - 1) {
                let square = square_of(by);
                for (at, &v) in row[by..].iter_mut().zip(&before) {
                    *at = (*at).min(v | square);
                }
                for (at, &v) in row.iter_mut().zip(&before[by..]) {
                    *at = (*at).min(v | square);
                }
            }
        }
        for (y, out) in squares.chunks_exact_mut(inner.width().max(1)).enumerate() {
            let y = y + top;
            for other in y.saturating_sub(reach)..(y + reach + 1).min(height) {
                let square = square_of(y.abs_diff(other));
                let first = other * width + left;
                let from = &rows[first..first + out.len()];
                for (out, &v) in out.iter_mut().zip(from) {
                    *out = (*out).min(v.saturating_add(square));
                }
            }
        }
    }
}

/// The square of a distance within reach.
#[inline(always)]
#[expect(
    clippy::inline_always,
    clippy::cast_possible_truncation,
    reason = "of a kernel; at most 8²"
)]
fn square_of(distance: usize) -> u8 {
    (distance * distance) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::Random;

    fn brute(seen: &[bool], outer: PixelRect, x: i64, y: i64) -> u8 {
        let mut least = 255_i64;
        for v in outer.y0.max(y - 8)..outer.y1.min(y + 9) {
            for u in outer.x0.max(x - 8)..outer.x1.min(x + 9) {
                let k = usize::try_from((v - outer.y0) * 60 + u - outer.x0).unwrap();
                if !seen[k] {
                    least = least.min((u - x).pow(2) + (v - y).pow(2));
                }
            }
        }
        u8::try_from(least).unwrap()
    }

    #[test]
    fn distances_are_those_of_brute_force_and_what_shows_nothing_is_no_border() {
        let area = HaloRect::around(PixelRect::new(100, 50, 144, 80), 8);
        let mut random = Random::new(5);
        for density in [0, 1, 4, 40] {
            let count = area.outer.area();
            let seen: Vec<bool> = (0..count).map(|_| random.below(1000) >= density).collect();
            let surface = SurfaceTile {
                rect: area.outer,
                inner: area.inner,
                faces_at: seen.iter().map(|_| 0).collect(),
                ..SurfaceTile::default()
            };
            let mut map = EdgeMap::default();
            map.start(&surface);
            let pixels: Vec<u32> = (0..).zip(&seen).filter(|(_, s)| **s).map(|(k, _)| k).collect();
            map.see_pixels(&surface, area.outer, &pixels);
            map.finish();
            for y in area.inner.y0..area.inner.y1 {
                let row = map.row(area.inner.x0, y, area.inner.width());
                for x in area.inner.x0..area.inner.x1 {
                    let k = usize::try_from(x - area.inner.x0).unwrap();
                    let found = row.map_or(EdgeMap::FAR, |row| row[k]);
                    assert_eq!(found, brute(&seen, area.outer, x, y), "{x} {y} {density}");
                }
            }
        }
        let surface = SurfaceTile {
            rect: area.outer,
            inner: area.inner,
            faces_at: vec![SurfaceTile::NO_FACE; area.outer.area()],
            ..SurfaceTile::default()
        };
        let mut map = EdgeMap::default();
        map.start(&surface);
        map.finish();
        assert!(map.row(100, 50, 44).is_none());
    }
}
