//! What photos show of the same surface points, for levelling: [`Renderer::observe`].

use glam::DVec2;

use super::colour::{COARSE, Sampler};
use super::tile::View;
use super::{Renderer, Scene};
use crate::Result;
use crate::geom::{HaloRect, PixelRect, Size};
use crate::tone::Observation;
use crate::visibility::SUB_BLOCK;

/// Side of a block in which points are observed, mosaic pixels, and the distance between its points: a colour is a mean
/// over about as much.
const BLOCK_SIDE: i64 = 24;
const STEP: i64 = 4;
/// A point lies at least as far from the border of what a photo sees, pixels: its colour shall not be another surface's.
const FROM_BORDER: u8 = 5;
/// Blocks at least, and as many for each photo: some 36 points each.
const LEAST_BLOCKS: u64 = 192;
const BLOCKS_PER_PHOTO: u64 = 24;
const MOST_BLOCKS: u64 = 4096;
/// The part of a large mosaic that blocks with what is around them cover: a levelling takes a small part of a job.
const PART: f64 = 0.03;
/// A channel tells of the surface between these parts of the range: not near black, where noise is, nor near white, where
/// it may be clipped.
const TELLING: [f32; 2] = [8.0 / 255.0, 245.0 / 255.0];

/// The blocks of a mosaic in which points are observed: spread evenly, each at a place of its own in its share.
///
/// # Panics
/// Never: a mosaic's pixels are numbered in 32 bits.
pub fn observed_blocks(size: Size, photos: usize) -> Vec<PixelRect> {
    let side = u64::try_from(BLOCK_SIDE + 2 * i64::from(FROM_BORDER)).expect("positive");
    let wanted = LEAST_BLOCKS.max(BLOCKS_PER_PHOTO * photos as u64).min(MOST_BLOCKS);
    let affordable = size.area() as f64 * PART / (side * side) as f64;
    let count = (wanted as f64).min(affordable).max(LEAST_BLOCKS as f64);
    // Shares as square as can be.
    let (width, height) = (f64::from(size.width), f64::from(size.height));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small and positive"
    )]
    let along = |side: f64, other: f64| {
        let shares = (count * side / other).sqrt().ceil();
        shares.clamp(1.0, (side / BLOCK_SIDE as f64).ceil()) as u64
    };
    let (columns, rows) = (along(width, height), along(height, width));
    let whole = size.rect();
    let block = |(column, row): (u64, u64)| {
        let start = |k: u64, shares: u64, pixels: u32, salt: u64| {
            let (from, to) = (k * u64::from(pixels) / shares, (k + 1) * u64::from(pixels) / shares);
            let room = (to - from).saturating_sub(BLOCK_SIDE.unsigned_abs()) + 1;
            i64::try_from(from + scattered(column, row, salt) % room).expect("a mosaic's pixel")
        };
        let (x, y) = (start(column, columns, size.width, 0), start(row, rows, size.height, 1));
        PixelRect::new(x, y, x + BLOCK_SIDE, y + BLOCK_SIDE).intersection(&whole)
    };
    (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row))).map(block).collect()
}

/// A number that looks like chance, the same everywhere (the finaliser of `SplitMix64`: G. Steele, D. Lea, C. Flood (2014),
/// doi:10.1145/2660193.2660195).
fn scattered(column: u64, row: u64, salt: u64) -> u64 {
    let mut z = (column << 33 ^ row << 1 ^ salt).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Observations of the points of one block: those of a point one after the other, photos in order.
#[derive(Debug, Clone, Default)]
pub struct Observed {
    /// [`Observation::photo`] is an index of [`Scene::photos`].
    pub observations: Vec<Observation>,
    /// First observation of each point.
    pub points: Vec<usize>,
}

impl Observed {
    /// Adds those of another block.
    pub fn extend(&mut self, other: &Self) {
        let before = self.observations.len();
        self.observations.extend_from_slice(&other.observations);
        self.points.extend(other.points.iter().map(|start| start + before));
    }
}

impl Renderer<'_> {
    /// What photos show of the points of a block, as they are: those that at least two see by the exact test, well inside of
    /// what they see, in colours that tell of the surface. Several sections: of the highest.
    ///
    /// # Errors
    /// Those of reading the stores.
    pub fn observe(&mut self, block: PixelRect) -> Result<Observed> {
        let views = self.look(HaloRect::around(block, FROM_BORDER.into()))?;
        let scene = self.scene;
        let mut found: Vec<(u32, Observation)> = Vec::new();
        let mut sampler = std::mem::take(&mut self.observer);
        for k in 0..views {
            self.take_points(block, k)?;
            let view = &self.views[k];
            sampler.sample(scene, scene.photos[view.photo].index.into(), &view.tile, COARSE)?;
            found.extend(observations(scene, view, &sampler));
        }
        self.observer = sampler;
        found.sort_by_key(|(pixel, observation)| (*pixel, observation.photo));
        let mut observed = Observed::default();
        for of in found.chunk_by(|a, b| a.0 == b.0).filter(|of| of.len() > 1) {
            observed.points.push(observed.observations.len());
            observed.observations.extend(of.iter().map(|(_, observation)| *observation));
        }
        Ok(observed)
    }

    /// Leaves in a view the points of a block that are observed.
    fn take_points(&mut self, block: PixelRect, k: usize) -> Result<()> {
        debug_assert!(block.x1 - block.x0 <= SUB_BLOCK, "one sub-block");
        self.find_edges(k)?;
        self.take_view(k, block)?;
        let width = block.width();
        let step = usize::try_from(STEP).expect("positive");
        let View { edges, tile, .. } = &mut self.views[k];
        let is_taken = |&pixel: &u32| {
            let (x, y) = (pixel as usize % width, pixel as usize / width);
            let from_corner = |v: usize| i64::try_from(v).expect("a small block");
            let square =
                edges.row(block.x0, block.y0 + from_corner(y), width).map(|squares| squares[x]);
            let is_inside = square.is_none_or(|square| square >= FROM_BORDER * FROM_BORDER);
            is_inside && x % step == step / 2 && y % step == step / 2
        };
        let is_taken: Vec<bool> = tile.pixels.iter().map(is_taken).collect();
        tile.retain(&is_taken);
        Ok(())
    }
}

/// The samples of a view that tell of the surface, each with its pixel.
fn observations<'a>(
    scene: &'a Scene,
    view: &'a View,
    sampler: &'a Sampler,
) -> impl Iterator<Item = (u32, Observation)> + 'a {
    let photo = &scene.photos[view.photo];
    let number = u32::try_from(view.photo).expect("fewer than 2³² photos");
    let size = photo.view.lens.size();
    let frame = DVec2::new(size.width.into(), size.height.into());
    let range = scene.range_of(photo.index.into());
    let [dark, light] = TELLING.map(|part| part * range);
    let points = view.tile.pixels.iter().zip(&view.tile.positions).zip(sampler.colours());
    points.filter_map(move |((&pixel, &position), colour)| {
        let is_telling = colour.iter().all(|v| (dark..=light).contains(v));
        let log = colour.map(|v| libm::log(f64::from(v / range)));
        let observation = Observation { photo: number, at: position / frame, log };
        is_telling.then_some((pixel, observation))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_spread_over_all_of_a_mosaic_whatever_its_shape() {
        for (size, photos) in [
            (Size::new(3720, 2775), 7),
            (Size::new(40_000, 90_000), 1000),
            (Size::new(10, 7), 3),
            (Size::new(100_000, 30), 5),
        ] {
            let blocks = observed_blocks(size, photos);
            assert!(!blocks.is_empty() && blocks.len() < 9000, "{size:?}: {}", blocks.len());
            assert!(blocks.iter().all(|b| !b.is_empty() && size.rect().contains(b)));
            for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let (w, h) = (i64::from(size.width) / 2, i64::from(size.height) / 2);
                let quarter = PixelRect::new(x * w, y * h, (x + 1) * w, (y + 1) * h);
                let meets = |b: &&PixelRect| !b.intersection(&quarter).is_empty();
                assert!(blocks.iter().filter(meets).count() * 6 >= blocks.len(), "{size:?}");
            }
        }
    }
}
