//! [`SampleTile`]: the samples of a block of mosaic pixels.

use super::counting::Scratch;
use crate::geom::{PixelRect, held_bytes};

/// Weights beyond are cut, so that no sum of them overflows. No face covers 1e100 photo pixels.
const GREATEST_WEIGHT: f64 = 1e100;

/// Qualities lie between: their ratios and powers are finite in f32.
const LEAST_QUALITY: f64 = 1e-12;
const GREATEST_QUALITY: f64 = 1e12;

/// Pixels that are blended at once.
pub(super) const STRIP: usize = 64;

/// The weight of a photo that does not see the pixel.
const UNSEEN: f64 = -1.0;

/// One photo's samples, an entry for each pixel of the block, row-major, up to a whole number of
/// strips.
#[derive(Debug, Default)]
pub(super) struct Plane {
    /// Index in the whole camera set.
    pub(super) photo: u16,
    /// In the output's range; a channel after the other.
    pub(super) colours: [Vec<f32>; 3],
    /// Not negative, finite; below 0 where the photo does not see the pixel.
    pub(super) weights: Vec<f64>,
    /// Empty unless the photo's samples came with them; where it sees nothing they mean nothing.
    pub(super) soft: SoftPlane,
}

/// As [`SoftSamples`], an entry for each pixel.
#[derive(Debug, Default)]
pub(super) struct SoftPlane {
    pub(super) coarse: [Vec<f32>; 3],
    pub(super) quality: Vec<f32>,
    pub(super) guards: Vec<f32>,
    pub(super) fades: Vec<f32>,
}

/// Samples of one photo; one entry a sample in each list.
#[derive(Debug, Clone, Copy)]
pub struct PhotoSamples<'a> {
    /// Its index in the whole camera set.
    pub photo: u16,
    /// What colours are multiplied by to reach the output's range ([`Depth::gain`](crate::image::Depth::gain)).
    pub gain: f32,
    /// Row-major indices in the block, in any order.
    pub pixels: &'a [u32],
    /// As [`sample_into`](crate::sample::sample_into) gives them.
    pub colours: &'a [[f32; 3]],
    /// Areas in photo pixels, or whatever else samples weigh: what is not greater than 0 counts as 0, what is beyond
    /// 1e100 as 1e100.
    pub weights: &'a [f64],
    /// What [`Outliers::Robust`](super::Outliers::Robust) needs.
    pub soft: Option<SoftSamples<'a>>,
}

/// What soft outlier weights need of the samples of one photo; one entry a sample in each list.
#[derive(Debug, Clone, Copy)]
pub struct SoftSamples<'a> {
    /// Colours of the surroundings, from a coarser level of the photo.
    pub coarse: &'a [[f32; 3]],
    /// How well the photo resolves the surface, in any unit that is the same for all photos.
    pub quality: &'a [f64],
    /// How far inside what its photo sees it lies: 0 to 1, more than 0.
    pub guards: &'a [f32],
    /// The same, its photo's frame counted as a border.
    pub fades: &'a [f32],
}

/// The samples of a block of at most 65,536 mosaic pixels, put in photo by photo.
///
/// It takes [`Self::BYTES_A_SAMPLE`] for each pixel of each photo that sees any. Made once a thread and used again for
/// each block: after the first blocks nothing is allocated any more.
#[derive(Debug, Default)]
pub struct SampleTile {
    rect: Option<PixelRect>,
    /// As they came: photos ascending; those beyond `used` are kept for their memory.
    planes: Vec<Plane>,
    used: usize,
    /// Memory of the blend, kept here so that it is allocated once.
    scratch: Vec<Scratch>,
}

impl SampleTile {
    /// Memory of one sample.
    pub const BYTES_A_SAMPLE: usize = 3 * size_of::<f32>() + size_of::<f64>();
    /// Memory of one sample with what soft outlier weights need.
    pub const BYTES_A_SOFT_SAMPLE: usize = Self::BYTES_A_SAMPLE + 6 * size_of::<f32>();
    /// The greatest number of pixels in a block.
    pub const MAX_PIXELS: usize = 1 << 16;

    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        let plane = |p: &Plane| {
            let SoftPlane { coarse, quality, guards, fades } = &p.soft;
            let channels = p.colours.iter().chain(coarse).map(held_bytes).sum::<u64>();
            held_bytes(&p.weights)
                + channels
                + held_bytes(quality)
                + held_bytes(guards)
                + held_bytes(fades)
        };
        self.planes.iter().map(plane).sum::<u64>() + held_bytes(&self.scratch)
    }

    /// An empty one.
    pub fn new() -> Self {
        Self::default()
    }

    /// Begins the block `rect`, in mosaic pixels: all samples are forgotten, the memory is kept.
    ///
    /// # Panics
    /// If the block has more than [`Self::MAX_PIXELS`].
    pub fn begin(&mut self, rect: PixelRect) {
        assert!(rect.area() <= Self::MAX_PIXELS, "a block has at most 65,536 pixels: {rect:?}");
        self.rect = Some(rect);
        self.used = 0;
    }

    /// The block, in mosaic pixels; empty before the first was begun.
    pub fn rect(&self) -> PixelRect {
        self.rect.unwrap_or(PixelRect::new(0, 0, 0, 0))
    }

    /// Whether the block has no sample.
    pub fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Adds samples of a photo; no pixel twice for a photo. A photo may come in several parts.
    ///
    /// # Panics
    /// If the lengths differ, a pixel is outside the block, or a photo comes after one with a greater index.
    pub fn push(&mut self, samples: &PhotoSamples<'_>) {
        let PhotoSamples { photo, gain, pixels, colours, weights, soft } = *samples;
        assert!(pixels.len() == colours.len() && pixels.len() == weights.len(), "equal lengths");
        let area = self.rect().area();
        let plane = self.plane(photo);
        scatter_colours(&mut plane.colours, area, pixels, colours, gain);
        let of = &mut plane.weights[..area];
        for (&k, &w) in pixels.iter().zip(weights) {
            debug_assert!(of[k as usize] < 0.0, "no pixel twice for a photo");
            // Not a number is not greater than 0.
            of[k as usize] = if w > 0.0 { w.min(GREATEST_WEIGHT) } else { 0.0 };
        }
        if let Some(soft) = soft {
            let all = [soft.coarse.len(), soft.quality.len(), soft.guards.len(), soft.fades.len()];
            assert!(all.iter().all(|&len| len == pixels.len()), "equal lengths");
            plane.soft.set(area, pixels, &soft, gain);
        }
    }

    /// The plane of a photo: the last one, or a new one in which it sees nothing.
    fn plane(&mut self, photo: u16) -> &mut Plane {
        let last = self.planes[..self.used].last().map(|plane| plane.photo);
        assert!(last.is_none_or(|last| last <= photo), "photos come in id order");
        if last != Some(photo) {
            if self.planes.len() == self.used {
                self.planes.push(Plane::default());
            }
            let len = self.rect().area().next_multiple_of(STRIP);
            let plane = &mut self.planes[self.used];
            plane.photo = photo;
            plane.weights.clear();
            plane.weights.resize(len, UNSEEN);
            // Colours of pixels that the photo does not see mean nothing.
            for of in &mut plane.colours {
                of.resize(len, 0.0);
            }
            self.used += 1;
        }
        &mut self.planes[self.used - 1]
    }

    /// The photos that see any pixel, by ascending id.
    #[cfg(test)]
    fn planes(&self) -> &[Plane] {
        &self.planes[..self.used]
    }

    /// The photos that see any pixel, by ascending id, and memory for the blend.
    pub(super) fn planes_and_scratch(&mut self) -> (&[Plane], &mut Vec<Scratch>) {
        (&self.planes[..self.used], &mut self.scratch)
    }
}

/// Puts colours where their pixels are, a channel after the other.
fn scatter_colours(
    to: &mut [Vec<f32>; 3],
    area: usize,
    pixels: &[u32],
    colours: &[[f32; 3]],
    gain: f32,
) {
    let [red, green, blue] = to;
    let (red, green, blue) = (&mut red[..area], &mut green[..area], &mut blue[..area]);
    for (&k, colour) in pixels.iter().zip(colours) {
        let k = k as usize;
        let [r, g, b] = *colour;
        (red[k], green[k], blue[k]) = (r * gain, g * gain, b * gain);
    }
}

impl SoftPlane {
    fn set(&mut self, area: usize, pixels: &[u32], samples: &SoftSamples<'_>, gain: f32) {
        let len = area.next_multiple_of(STRIP);
        let Self { coarse, quality, guards, fades } = self;
        for of in coarse.iter_mut().chain([&mut *quality, &mut *guards, &mut *fades]) {
            of.resize(len, 0.0);
        }
        scatter_colours(coarse, area, pixels, samples.coarse, gain);
        let (quality, guards, fades) =
            (&mut quality[..area], &mut guards[..area], &mut fades[..area]);
        let both = samples.guards.iter().zip(samples.fades);
        for ((&k, &q), (&guard, &fade)) in pixels.iter().zip(samples.quality).zip(both) {
            let k = k as usize;
            #[expect(clippy::cast_possible_truncation, reason = "a weight")]
            let narrow = q.clamp(LEAST_QUALITY, GREATEST_QUALITY) as f32;
            (quality[k], guards[k], fades[k]) = (narrow, guard, fade);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn push(
        tile: &mut SampleTile,
        (photo, gain): (u16, f32),
        pixels: &[u32],
        colours: &[[f32; 3]],
        weights: &[f64],
    ) {
        tile.push(&PhotoSamples { photo, gain, pixels, colours, weights, soft: None });
    }

    /// Photo, weight and first channel of each sample of pixel `k`.
    fn samples(tile: &SampleTile, k: usize) -> Vec<(u16, f64, f32)> {
        let seen = tile.planes().iter().filter(|p| p.weights[k] >= 0.0);
        seen.map(|p| (p.photo, p.weights[k], p.colours[0][k])).collect()
    }

    #[test]
    fn samples_lie_by_photo_and_pixel() {
        let mut tile = SampleTile::new();
        for round in 0..2_u8 {
            tile.begin(PixelRect::new(10, 20, 13, 22));
            assert!(tile.is_empty());
            let c = |v: f32| [v + f32::from(round); 3];
            push(&mut tile, (3, 1.0), &[5, 0], &[c(1.0), c(2.0)], &[0.5, 0.25]);
            push(&mut tile, (3, 1.0), &[1], &[c(3.0)], &[4.0]);
            push(&mut tile, (9, 2.0), &[0, 5], &[c(4.0), c(5.0)], &[8.0, f64::NAN]);
            let v = f32::from(round);
            assert_eq!(samples(&tile, 0), [(3, 0.25, 2.0 + v), (9, 8.0, 2.0 * (4.0 + v))]);
            assert_eq!(samples(&tile, 1), [(3, 4.0, 3.0 + v)]);
            assert_eq!(samples(&tile, 2), []);
            assert_eq!(samples(&tile, 5), [(3, 0.5, 1.0 + v), (9, 0.0, 2.0 * (5.0 + v))]);
        }
    }

    #[test]
    fn a_full_block_has_its_last_pixel() {
        let mut tile = SampleTile::new();
        tile.begin(PixelRect::new(0, 0, 256, 256));
        push(&mut tile, (0, 257.0), &[65_535], &[[255.0; 3]], &[f64::INFINITY]);
        assert_eq!(samples(&tile, 65_535), [(0, 1e100, 65_535.0)]);
    }

    #[test]
    #[should_panic(expected = "id order")]
    fn a_photo_out_of_order_is_refused() {
        let mut tile = SampleTile::new();
        tile.begin(PixelRect::new(0, 0, 2, 2));
        push(&mut tile, (3, 1.0), &[0], &[[0.0; 3]], &[1.0]);
        push(&mut tile, (2, 1.0), &[1], &[[0.0; 3]], &[1.0]);
    }

    #[test]
    fn a_sample_takes_20_bytes() {
        assert_eq!(SampleTile::BYTES_A_SAMPLE, 20);
        assert_eq!(SampleTile::BYTES_A_SOFT_SAMPLE, 44);
    }
}
