//! [`SampleTile`]: the samples of a block of mosaic pixels.

use crate::geom::{PixelRect, held_bytes};

/// One photo's colour for one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    /// Not negative, finite.
    pub(super) weight: f64,
    /// In the output's range.
    pub(super) colour: [f32; 3],
    /// Index in the whole camera set.
    pub(super) photo: u16,
    /// Index in the block, row-major.
    pub(super) pixel: u16,
}

impl Sample {
    /// The first `C` channels.
    #[inline]
    pub(super) fn channels<const C: usize>(&self) -> [f64; C] {
        std::array::from_fn(|c| f64::from(self.colour[c]))
    }
}

/// Weights beyond are cut, so that no sum of them overflows. No face covers 1e100 photo pixels.
const GREATEST_WEIGHT: f64 = 1e100;

/// The samples of a block of at most 65,536 mosaic pixels, put in photo by photo, taken out pixel by pixel.
///
/// It takes [`Self::BYTES_A_SAMPLE`] for each sample that there is, whatever the number of photos, and
/// [`Self::BYTES_A_PIXEL`] for each pixel. Made once a thread and used again for each block: after the first blocks
/// nothing is allocated any more.
#[derive(Debug, Default)]
pub struct SampleTile {
    rect: Option<PixelRect>,
    /// As they came: photos ascending.
    samples: Vec<Sample>,
    /// Where a pixel's samples begin in `order`; one more than pixels.
    starts: Vec<u32>,
    /// Indices of `samples`, pixels ascending, then photos ascending.
    order: Vec<u32>,
    /// The samples of one pixel, together.
    gathered: Vec<Sample>,
    /// Which of them the outlier test keeps: memory of the blend, kept here so that it is allocated once.
    pub(super) kept: Vec<bool>,
}

impl SampleTile {
    /// Memory of one sample.
    pub const BYTES_A_SAMPLE: usize = size_of::<Sample>() + size_of::<u32>();
    /// Memory of one pixel, samples not counted.
    pub const BYTES_A_PIXEL: usize = size_of::<u32>();
    /// The greatest number of pixels in a block.
    pub const MAX_PIXELS: usize = 1 << 16;

    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.samples) + held_bytes(&self.starts) + held_bytes(&self.order)
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
        self.samples.clear();
    }

    /// The block, in mosaic pixels; empty before the first was begun.
    pub fn rect(&self) -> PixelRect {
        self.rect.unwrap_or(PixelRect::new(0, 0, 0, 0))
    }

    /// Number of samples in the block.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether the block has no sample.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Adds samples of photo `photo` (its index in the whole camera set); no pixel twice for a photo.
    ///
    /// `pixels` are row-major indices in the block, in any order; `colours` are as
    /// [`sample_into`](crate::sample::sample_into) gives them and are multiplied by `gain`, which brings the photo's
    /// range to the output's ([`Depth::gain`](crate::image::Depth::gain)); `weights` are areas in photo pixels: what
    /// is not greater than 0 counts as 0, what is beyond 1e100 as 1e100. A photo may come in several parts.
    ///
    /// # Panics
    /// If the lengths differ, a pixel is outside the block, or a photo comes after one with a greater index.
    pub fn push(
        &mut self,
        photo: u16,
        gain: f32,
        pixels: &[u32],
        colours: &[[f32; 3]],
        weights: &[f64],
    ) {
        assert!(pixels.len() == colours.len() && pixels.len() == weights.len(), "equal lengths");
        assert!(self.samples.last().is_none_or(|s| s.photo <= photo), "photos come in id order");
        let area = self.rect().area();
        self.samples.extend(pixels.iter().zip(colours).zip(weights).map(|((&k, colour), &w)| {
            assert!((k as usize) < area, "pixel {k} is outside the block of {area}");
            Sample {
                // Not a number is not greater than 0.
                weight: if w > 0.0 { w.min(GREATEST_WEIGHT) } else { 0.0 },
                colour: colour.map(|v| v * gain),
                photo,
                pixel: u16::try_from(k).expect("below the block's area"),
            }
        }));
    }

    /// Calls `f(k, samples)` for each pixel `k` of the block that has samples, pixels ascending, photos ascending.
    pub(super) fn for_each_pixel(&mut self, mut f: impl FnMut(usize, &[Sample])) {
        self.sort();
        for (k, range) in self.starts.windows(2).enumerate() {
            let order = &self.order[range[0] as usize..range[1] as usize];
            if !order.is_empty() {
                self.gathered.clear();
                self.gathered.extend(order.iter().map(|&i| self.samples[i as usize]));
                debug_assert!(
                    self.gathered.is_sorted_by(|a, b| a.photo < b.photo),
                    "no pixel twice for a photo"
                );
                f(k, &self.gathered);
            }
        }
    }

    /// Orders the samples by pixel, keeping that of the photos: a counting sort.
    fn sort(&mut self) {
        let pixels = self.rect().area();
        self.starts.clear();
        self.starts.resize(pixels + 1, 0);
        for s in &self.samples {
            self.starts[usize::from(s.pixel) + 1] += 1;
        }
        for k in 0..pixels {
            self.starts[k + 1] += self.starts[k];
        }
        self.order.clear();
        self.order.resize(self.samples.len(), 0);
        // Each pixel's start moves on to the next one's as its samples find their places …
        for (i, s) in (0..).zip(&self.samples) {
            let next = &mut self.starts[usize::from(s.pixel)];
            self.order[*next as usize] = i;
            *next += 1;
        }
        // … so that all must be moved back by one pixel.
        self.starts.rotate_right(1);
        self.starts[0] = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_come_out_by_pixel_with_photos_ascending() {
        let mut tile = SampleTile::new();
        for round in 0..2_u8 {
            tile.begin(PixelRect::new(10, 20, 13, 22));
            assert!(tile.is_empty());
            let c = |v: f32| [v + f32::from(round); 3];
            tile.push(3, 1.0, &[5, 0], &[c(1.0), c(2.0)], &[0.5, 0.25]);
            tile.push(3, 1.0, &[1], &[c(3.0)], &[4.0]);
            tile.push(9, 2.0, &[0, 5], &[c(4.0), c(5.0)], &[8.0, f64::NAN]);
            let mut found = Vec::new();
            tile.for_each_pixel(|k, samples| {
                found.push((k, samples.iter().map(|s| (s.photo, s.weight)).collect::<Vec<_>>()));
            });
            let want = vec![
                (0, vec![(3, 0.25), (9, 8.0)]),
                (1, vec![(3, 4.0)]),
                (5, vec![(3, 0.5), (9, 0.0)]),
            ];
            assert_eq!(found, want);
        }
    }

    #[test]
    fn a_full_block_has_its_last_pixel() {
        let mut tile = SampleTile::new();
        tile.begin(PixelRect::new(0, 0, 256, 256));
        tile.push(0, 257.0, &[65_535], &[[255.0; 3]], &[f64::INFINITY]);
        let mut found = None;
        tile.for_each_pixel(|k, s| found = Some((k, s[0].colour, s[0].weight)));
        assert_eq!(found, Some((65_535, [65_535.0; 3], 1e100)));
    }

    #[test]
    #[should_panic(expected = "id order")]
    fn a_photo_out_of_order_is_refused() {
        let mut tile = SampleTile::new();
        tile.begin(PixelRect::new(0, 0, 2, 2));
        tile.push(3, 1.0, &[0], &[[0.0; 3]], &[1.0]);
        tile.push(2, 1.0, &[1], &[[0.0; 3]], &[1.0]);
    }

    #[test]
    fn a_sample_takes_28_bytes() {
        assert_eq!(SampleTile::BYTES_A_SAMPLE, 28);
    }
}
