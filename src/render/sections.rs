//! Several sections of one mosaic: what one of them takes over from the one above it, and what is found in each.
//!
//! Sections have one lower end and each its own upper end of the slab. Of the faces over a pixel the highest within the
//! slab is shown; so a section shows what the one above it shows wherever that does not lie beyond its own upper end:
//! the same point of the same face. And a pixel's colour and layers depend on the point and the face that it shows, not
//! on the slab: what occludes is the whole mesh. So they are the same, and need not be found again.

use super::colour::Section;
use super::{Canvas, Scene};
use crate::blend::{
    OrthoTile, Parts, PhotoStats, SampleTile, Statistics, blend_into, blend_parts_into,
};
use crate::geom::{HaloRect, PixelRect, held_bytes};
use crate::surface::SurfaceTile;

/// What a block shows in the section that was rendered last.
#[derive(Debug, Default)]
pub(super) struct Above {
    rect: PixelRect,
    /// For each pixel the greatest elevation in its halo, metres; NaN where there is no surface. What lies above the end
    /// of a lower section is another surface there, and a pixel's colour may depend on all of its halo.
    elevations: Vec<f64>,
}

/// For each pixel of the inner rectangle of `surface`, row-major, the greatest elevation in its halo, metres; NaN where
/// there is none. Without a halo these are the elevations.
pub(super) fn greatest_around(surface: &SurfaceTile) -> Vec<f64> {
    let HaloRect { inner, outer } = surface.halo();
    let halo = usize::try_from(inner.x0 - outer.x0).expect("inside");
    let width = outer.width();
    let rows = surface.elevations.chunks(width.max(1)).flat_map(|row| {
        (0..inner.width()).map(|x| row[x..=x + 2 * halo].iter().copied().fold(f64::NAN, f64::max))
    });
    let along: Vec<f64> = rows.collect();
    let width = inner.width();
    let of = |k: usize| (0..=2 * halo).map(|dy| along[k + dy * width]).fold(f64::NAN, f64::max);
    (0..inner.area()).map(of).collect()
}

impl Above {
    /// Memory held, bytes.
    pub(super) fn memory_bytes(&self) -> u64 {
        held_bytes(&self.elevations)
    }

    /// Begins a block with its highest section: its inner rectangle, and what [`greatest_around`] says of it.
    pub(super) fn start(&mut self, rect: PixelRect, around: &[f64]) {
        self.rect = rect;
        self.elevations.clear();
        self.elevations.extend_from_slice(around);
    }

    /// The block.
    pub(super) fn rect(&self) -> PixelRect {
        self.rect
    }

    /// Whether the halo of pixel `k` of the block shows something above `greatest`, so that a section which ends there
    /// shows something else, or nothing.
    pub(super) fn is_open(&self, k: usize, greatest: f64) -> bool {
        self.elevations[k] > greatest
    }

    /// The bounds of the open pixels; none if there is none.
    pub(super) fn open_bounds(&self, greatest: f64) -> Option<PixelRect> {
        let (rect, width) = (self.rect, self.rect.width());
        let mut bounds: Option<[usize; 4]> = None;
        for (y, row) in self.elevations.chunks(width.max(1)).enumerate() {
            let is_open = |e: &f64| *e > greatest;
            let Some(first) = row.iter().position(is_open) else { continue };
            let last = row.iter().rposition(is_open).unwrap_or(first);
            let [x0, y0, x1, _] = bounds.unwrap_or([first, y, last, y]);
            bounds = Some([x0.min(first), y0, x1.max(last), y]);
        }
        let at = |from: i64, by: usize| from + i64::try_from(by).expect("inside the block");
        bounds.map(|[x0, y0, x1, y1]| {
            let (x0, y0) = (at(rect.x0, x0), at(rect.y0, y0));
            PixelRect::new(x0, y0, at(rect.x0, x1) + 1, at(rect.y0, y1) + 1)
        })
    }

    /// The pixel of the block that is pixel `k` of `part`, which lies in it.
    pub(super) fn pixel(&self, part: PixelRect, k: usize) -> usize {
        let inside = |v: i64| usize::try_from(v).expect("inside the block");
        let (x, y) = (k % part.width(), k / part.width());
        (inside(part.y0 - self.rect.y0) + y) * self.rect.width()
            + inside(part.x0 - self.rect.x0)
            + x
    }

    /// Which pixels of `part`, row-major, are open.
    pub(super) fn open_pixels(&self, part: PixelRect, greatest: f64) -> Vec<bool> {
        (0..part.area()).map(|k| self.is_open(self.pixel(part, k), greatest)).collect()
    }

    /// Enters what the next section shows in its open pixels: `around` is of `part`.
    pub(super) fn enter(&mut self, part: PixelRect, around: &[f64], greatest: f64) {
        for (k, &elevation) in around.iter().enumerate() {
            let at = self.pixel(part, k);
            if self.is_open(at, greatest) {
                self.elevations[at] = elevation;
            }
        }
    }
}

/// What was found, section by section.
///
/// A pixel's samples are counted once, where they are taken: for the section that they are taken for, and for the
/// lowest that shows the same point. They belong to these two and to all between.
#[derive(Debug)]
pub(super) struct Findings {
    photos: usize,
    taken_for: Vec<Statistics>,
    /// Empty where there is but one section.
    shown_from: Vec<Statistics>,
    part_of: Vec<u16>,
}

impl Findings {
    pub(super) fn new(scene: &Scene, canvas: &Canvas) -> Self {
        let (photos, sections) = (scene.names, canvas.sections());
        let none = || vec![Statistics::new(photos); sections];
        let shown_from = if sections > 1 { none() } else { Vec::new() };
        Self { photos, taken_for: none(), shown_from, part_of: Vec::new() }
    }

    /// Memory held, bytes.
    pub(super) fn memory_bytes(&self) -> u64 {
        let all = (self.taken_for.len() + self.shown_from.len()) * self.photos;
        (all * size_of::<PhotoStats>()) as u64 + held_bytes(&self.part_of)
    }

    /// Blends a sub-block of a section into its tile and counts its samples. The block's pixels are `rect`.
    pub(super) fn blend(
        &mut self,
        to: &Section<'_>,
        rect: PixelRect,
        samples: &mut SampleTile,
        tile: &mut OrthoTile,
    ) {
        let (scene, canvas) = (to.scene, to.canvas);
        let statistics = &mut self.taken_for[to.number];
        if self.shown_from.is_empty() {
            return blend_into(&scene.blend, samples, tile, statistics);
        }
        let sub = samples.rect();
        let inside = |v: i64| usize::try_from(v).expect("inside the block");
        self.part_of.clear();
        for y in sub.y0..sub.y1 {
            let first = inside(y - rect.y0) * rect.width() + inside(sub.x0 - rect.x0);
            let row = &to.around[first..first + sub.width()];
            self.part_of.extend(row.iter().map(|&elevation| canvas.lowest_section(elevation)));
        }
        let parts = Parts { part_of: &self.part_of, statistics: &mut self.shown_from };
        blend_parts_into(&scene.blend, samples, tile, statistics, parts);
    }

    /// Counts the pixels of finished tiles, one a section.
    pub(super) fn count_tiles(&mut self, tiles: &[OrthoTile]) {
        for (statistics, tile) in self.taken_for.iter_mut().zip(tiles) {
            statistics.count_tile(tile);
        }
    }

    /// What was found since the last call, one a section.
    pub(super) fn take(&mut self, scene: &Scene, canvas: &Canvas) -> Vec<Statistics> {
        let Self { taken_for, shown_from, .. } = std::mem::replace(self, Self::new(scene, canvas));
        if shown_from.is_empty() {
            return taken_for;
        }
        let mut shown = vec![PhotoStats::default(); self.photos];
        let each = taken_for.into_iter().zip(shown_from).map(|(taken, from)| {
            for (photo, from) in shown.iter_mut().zip(&from.photos) {
                photo.merge(from);
            }
            let found = Statistics { photos: shown.clone(), counts: taken.counts };
            for (photo, taken) in shown.iter_mut().zip(&taken.photos) {
                photo.take_away(taken);
            }
            found
        });
        each.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_open_pixels_are_those_above_the_end_and_the_next_section_fills_them_alone() {
        let rect = PixelRect::new(10, 20, 14, 23);
        let nan = f64::NAN;
        let elevations = vec![0.0, 1.0, nan, 0.5, 1.0, 2.0, 3.0, 0.0, nan, 1.5, 0.0, 0.0];
        let mut above = Above::default();
        above.start(rect, &elevations);
        assert_eq!(above.open_bounds(3.0), None);
        assert_eq!(above.open_bounds(1.0), Some(PixelRect::new(11, 21, 13, 23)));
        let part = PixelRect::new(11, 21, 13, 23);
        assert_eq!([0, 1, 2, 3].map(|k| above.pixel(part, k)), [5, 6, 9, 10]);
        let elevations = vec![0.25, nan, 0.75, nan];
        above.enter(part, &elevations, 1.0);
        let left = [0.0, 1.0, nan, 0.5, 1.0, 0.25, nan, 0.0, nan, 0.75, 0.0, 0.0];
        assert_eq!(
            above.elevations.iter().map(|e| e.to_bits()).collect::<Vec<_>>(),
            left.map(f64::to_bits)
        );
        assert_eq!(above.open_bounds(0.9), Some(PixelRect::new(10, 20, 12, 22)));
    }
}
