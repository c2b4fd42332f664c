//! [`ToneGrid`]: a tone as multipliers, ready for samples.

use glam::DVec2;

use super::PhotoTone;
use crate::geom::{Size, held_bytes};

/// Cells along each side of the frame: within one, vignetting differs from a bilinear surface by some 1e-4.
const CELLS: usize = 32;

/// Above this part of the range a channel may be clipped, and is for certain at the second: what colour it had is not
/// known, so that all channels are multiplied alike there.
const CLIPPING: [f32; 2] = [0.94, 0.99];

/// What the samples of a photo are multiplied by, all over its frame: 1 over what its tone says.
#[derive(Debug, Clone)]
pub struct ToneGrid {
    /// (CELLS + 1)² nodes, row by row.
    nodes: Vec<[f32; 3]>,
    /// Cells a pixel.
    scale: DVec2,
}

impl ToneGrid {
    /// That of a photo of so many pixels.
    #[expect(clippy::cast_possible_truncation, reason = "a multiplier")]
    pub fn new(tone: &PhotoTone, size: Size) -> Self {
        let (width, height) = (f64::from(size.width), f64::from(size.height));
        let side = CELLS + 1;
        let node = |k: usize| {
            let at = DVec2::new((k % side) as f64, (k / side) as f64) / CELLS as f64;
            tone.at(at, width / height).map(|log| libm::exp(-log) as f32)
        };
        let nodes = (0..side * side).map(node).collect();
        Self { nodes, scale: CELLS as f64 / DVec2::new(width, height) }
    }

    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.nodes)
    }

    /// The multipliers at a photo position, pixels.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the grid; multipliers are f32"
    )]
    pub fn at(&self, position: DVec2) -> [f32; 3] {
        let at = position * self.scale;
        let (x, y) = (at.x.clamp(0.0, CELLS as f64), at.y.clamp(0.0, CELLS as f64));
        let (i, j) = ((x as usize).min(CELLS - 1), (y as usize).min(CELLS - 1));
        let (fx, fy) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let first = j * (CELLS + 1) + i;
        let (above, below) = (&self.nodes[first..first + 2], &self.nodes[first + CELLS + 1..][..2]);
        std::array::from_fn(|c| {
            let a = above[0][c] + fx * (above[1][c] - above[0][c]);
            let b = below[0][c] + fx * (below[1][c] - below[0][c]);
            a + fy * (b - a)
        })
    }

    /// Levels the colours that were sampled at some positions; `range` is the greatest value that the photo can hold.
    ///
    /// Where a channel is clipped all are multiplied by the mean of the multipliers: a white highlight stays neutral.
    ///
    /// # Panics
    /// If there is not a colour for each position.
    pub fn apply(&self, positions: &[DVec2], colours: &mut [[f32; 3]], range: f32) {
        assert_eq!(positions.len(), colours.len(), "a colour for each position");
        let [from, to] = CLIPPING.map(|part| part * range);
        for (position, colour) in positions.iter().zip(colours) {
            let mut by = self.at(*position);
            let most = colour[0].max(colour[1]).max(colour[2]);
            if most > from {
                let t = ((most - from) / (to - from)).min(1.0);
                let clipped = t * t * (3.0 - 2.0 * t);
                let mean = (by[0] + by[1] + by[2]) / 3.0;
                by = by.map(|by| by + clipped * (mean - by));
            }
            for (v, by) in colour.iter_mut().zip(by) {
                *v *= by;
            }
        }
    }
}
