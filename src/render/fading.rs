//! [`Fading`]: what the samples of a view weigh, and how far they are trusted near the borders of what their photo sees.

use glam::DVec2;

use super::tile::View;
use super::{Scene, ScenePhoto};
use crate::blend::{Edges, Outliers, Weights};
use crate::geom::{PixelRect, Size, held_bytes};
use crate::visibility::EdgeMap;

/// A sample fades towards its photo's frame within this part of the frame's shorter side. Lenses and poses are worst
/// there, and a wide fade hides what levelling leaves.
const FRAME_PART: f64 = 0.10;

/// What is left of a weight at a border: enough to give a pixel its colour where nothing else does, too little to show
/// where something does.
const LEAST_GUARD: f32 = 1e-3;

/// Weights of the samples of one view after another, reusing its memory; one entry a sample in each list.
#[derive(Debug, Default)]
pub(super) struct Fading {
    /// How well the photo resolves the surface.
    pub(super) quality: Vec<f64>,
    /// Whether samples weigh what they came with.
    is_plain: bool,
    weights: Vec<f64>,
    /// Towards borders of what the photo sees of the surface.
    pub(super) guards: Vec<f32>,
    /// The same, and towards the photo's frame.
    pub(super) fades: Vec<f32>,
    /// The guard by the square of the distance to the border.
    by_square: Vec<f32>,
}

impl Fading {
    /// Memory held, bytes.
    pub(super) fn memory_bytes(&self) -> u64 {
        held_bytes(&self.quality)
            + held_bytes(&self.weights)
            + held_bytes(&self.guards)
            + held_bytes(&self.fades)
    }

    /// Weighs the samples of a view of the sub-block `sub`.
    pub(super) fn weigh(&mut self, scene: &Scene, photo: &ScenePhoto, sub: PixelRect, view: &View) {
        let (points, settings) = (&view.tile, &scene.blend);
        self.is_plain = settings.edges == Edges::None
            && settings.weights != Weights::Sharp
            && settings.outliers != Outliers::Robust;
        if self.is_plain {
            return;
        }
        self.guards.clear();
        self.fades.clear();
        match settings.edges {
            Edges::None => {
                self.guards.resize(points.pixels.len(), 1.0);
                self.fades.resize(points.pixels.len(), 1.0);
            }
            Edges::Guard => self.fade(photo, sub, view),
        }
        self.quality.clear();
        match settings.weights {
            Weights::Area => self.quality.extend_from_slice(&points.weights),
            Weights::Equal => self.quality.resize(points.pixels.len(), 1.0),
            Weights::Sharp => {
                let both = points.footprints_squared.iter().zip(&points.slants);
                self.quality.extend(both.map(|(&footprint, &slant)| {
                    let slant = f64::from(slant);
                    footprint * (slant * slant)
                }));
            }
        }
        self.weights.clear();
        let is_sharp = settings.weights == Weights::Sharp;
        self.weights.extend(self.quality.iter().zip(&self.fades).map(|(&q, &fade)| {
            let weight = if is_sharp { (q * q) * (q * q) } else { q };
            weight * f64::from(fade)
        }));
    }

    /// What the samples of the view that was weighed last weigh, all counted.
    pub(super) fn weights<'a>(&'a self, view: &'a View) -> &'a [f64] {
        if self.is_plain { &view.tile.weights } else { &self.weights }
    }

    /// How far the samples lie from the borders of what their photo sees, and from its frame.
    fn fade(&mut self, photo: &ScenePhoto, sub: PixelRect, view: &View) {
        if self.by_square.is_empty() {
            self.by_square = by_square();
        }
        let (points, size) = (&view.tile, photo.view.lens.size());
        let width = u32::try_from(sub.width()).expect("a small block");
        let mut row = (u32::MAX, None);
        for (&pixel, &position) in points.pixels.iter().zip(&points.positions) {
            let (y, column) = (pixel / width, (pixel % width) as usize);
            if row.0 != y {
                row = (y, view.edges.row(sub.x0, sub.y0 + i64::from(y), sub.width()));
            }
            let square = row.1.map_or(EdgeMap::FAR, |squares| squares[column]);
            let guard = self.by_square[usize::from(square)];
            self.guards.push(guard);
            self.fades.push(guard * towards_frame(position, size));
        }
    }
}

/// 0 at a photo's frame, 1 well inside.
#[expect(clippy::cast_possible_truncation, reason = "a weight")]
fn towards_frame(position: DVec2, size: Size) -> f32 {
    let (width, height) = (f64::from(size.width), f64::from(size.height));
    let margin = position.min(DVec2::new(width, height) - position).min_element();
    let fade = smooth_step((margin / (FRAME_PART * width.min(height))) as f32);
    fade.max(LEAST_GUARD)
}

/// The guard by the square of the distance to the border of what is seen: 0 at half a pixel, where the border runs, 1 as
/// far as borders are looked for.
fn by_square() -> Vec<f32> {
    const REACH: f32 = EdgeMap::REACH as f32;
    let guard = |square: u16| {
        let distance = f32::from(square).sqrt();
        smooth_step((distance - 0.5) / (REACH - 0.5)).max(LEAST_GUARD)
    };
    (0..=u16::from(EdgeMap::FAR)).map(guard).collect()
}

/// 3 t² − 2 t³ within 0 and 1.
fn smooth_step(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fall_without_a_jump_from_far_inside_to_the_border() {
        let guards = by_square();
        assert_eq!(guards[0].to_bits(), LEAST_GUARD.to_bits());
        assert_eq!(guards[64].to_bits(), 1.0_f32.to_bits());
        assert!(guards.windows(2).all(|g| g[0] <= g[1] && g[1] - g[0] < 0.1), "{guards:?}");
        let size = Size::new(400, 300);
        let at = |x: f64, y: f64| towards_frame(DVec2::new(x, y), size);
        assert!(at(0.0, 150.0) <= LEAST_GUARD && at(399.999, 150.0) <= LEAST_GUARD);
        assert!(at(200.0, 0.01) < 2e-3 && at(30.0, 31.0) >= 1.0 && at(370.0, 100.0) >= 1.0);
        assert!((at(15.0, 100.0) - 0.5).abs() < 1e-6);
    }
}
