//! [`ToneGrid`]: a tone as multipliers, ready for samples.

use glam::DVec2;

use super::PhotoTone;
use crate::geom::{Kernel, Size, held_bytes, run_widest};

/// Cells along each side of the frame: within one, vignetting differs from a bilinear surface by some 1e-4.
const CELLS: usize = 32;

/// Above this part of the range a channel may be clipped, and is for certain at the second: what colour it had is not
/// known, so that all channels are multiplied alike there.
const CLIPPING: [f32; 2] = [0.94, 0.99];

/// What the samples of a photo are multiplied by, all over its frame: 1 over what its tone says.
#[derive(Debug, Clone)]
pub struct ToneGrid {
    /// (CELLS + 1)² nodes, row by row: three channels and their mean.
    nodes: Vec<[f32; 4]>,
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
            let [r, g, b] = tone.at(at, width / height).map(|log| libm::exp(-log) as f32);
            [r, g, b, (r + g + b) / 3.0]
        };
        let nodes = (0..side * side).map(node).collect();
        Self { nodes, scale: CELLS as f64 / DVec2::new(width, height) }
    }

    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.nodes)
    }

    /// Levels the colours that were sampled at some positions, pixels, in each list; `range` is the greatest value that
    /// the photo can hold.
    ///
    /// Where a channel is clipped all are multiplied by the mean of the multipliers: a white highlight stays neutral.
    ///
    /// # Panics
    /// If a list has not a colour for each position.
    pub fn apply<const N: usize>(
        &self,
        positions: &[DVec2],
        lists: [&mut [[f32; 3]]; N],
        range: f32,
    ) {
        assert!(lists.iter().all(|of| of.len() == positions.len()), "a colour for each position");
        run_widest(Apply { grid: self, positions, lists, range });
    }
}

struct Apply<'a, const N: usize> {
    grid: &'a ToneGrid,
    positions: &'a [DVec2],
    lists: [&'a mut [[f32; 3]]; N],
    range: f32,
}

impl<const N: usize> Kernel for Apply<'_, N> {
    type Output = ();

    #[inline(always)]
    #[expect(
        clippy::inline_always,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a kernel; clamped to the grid; multipliers are f32"
    )]
    fn run(self) {
        let Self { grid, positions, mut lists, range } = self;
        let [from, to] = CLIPPING.map(|part| part * range);
        let nodes = &grid.nodes[..];
        for (k, position) in positions.iter().enumerate() {
            let at = *position * grid.scale;
            let (x, y) = (at.x.clamp(0.0, CELLS as f64), at.y.clamp(0.0, CELLS as f64));
            let (i, j) = ((x as u32).min(CELLS as u32 - 1), (y as u32).min(CELLS as u32 - 1));
            let (fx, fy) = ((x - f64::from(i)) as f32, (y - f64::from(j)) as f32);
            let first = j as usize * (CELLS + 1) + i as usize;
            let (above, below) = (&nodes[first..first + 2], &nodes[first + CELLS + 1..][..2]);
            let mut by = [0.0; 4];
            for c in 0..4 {
                let a = above[0][c] + fx * (above[1][c] - above[0][c]);
                let b = below[0][c] + fx * (below[1][c] - below[0][c]);
                by[c] = a + fy * (b - a);
            }
            for colours in &mut lists {
                let colour = &mut colours[k];
                let most = colour[0].max(colour[1]).max(colour[2]);
                let clipped = if most > from {
                    let t = ((most - from) / (to - from)).min(1.0);
                    t * t * (3.0 - 2.0 * t)
                } else {
                    0.0
                };
                for c in 0..3 {
                    colour[c] *= by[c] + clipped * (by[3] - by[c]);
                }
            }
        }
    }
}
