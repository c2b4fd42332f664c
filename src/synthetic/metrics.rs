//! How near one picture comes to another: PSNR, SSIM and the shift between them.
//!
//! In: two pictures of the same shape, and a mask. Out: a [`Likeness`]. Only pixels of the mask count, and for SSIM
//! and the shift only those whose whole neighbourhood is in the mask.

use super::shift::{Shift, shift};
use crate::geom::Size;
use crate::image::ImageView;

/// How near a picture comes to a reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Likeness {
    /// Pixels compared.
    pub pixels: u64,
    /// Peak signal-to-noise ratio over all channels, decibels; infinite for equal pictures.
    pub psnr_db: f64,
    /// Mean structural similarity of the luma, at most 1.
    pub ssim: f64,
    /// How far the picture lies from the reference; `None` if it holds too little to tell.
    pub shift: Option<Shift>,
}

/// Compares a picture of 8-bit samples with a reference, where `mask` (one channel) is not 0.
///
/// # Panics
/// If the pictures' shapes or the mask's size differ.
pub fn likeness(
    picture: ImageView<'_, u8>,
    reference: ImageView<'_, u8>,
    mask: ImageView<'_, u8>,
) -> Likeness {
    assert!(
        picture.size() == reference.size() && picture.channels() == reference.channels(),
        "pictures of one shape"
    );
    assert!(mask.size() == picture.size() && mask.channels() == 1, "a mask of one channel");
    let mask: Vec<bool> = mask.data().iter().map(|&m| m != 0).collect();
    let (a, b) = (Plane::luma(picture), Plane::luma(reference));
    Likeness {
        pixels: mask.iter().filter(|&&m| m).count() as u64,
        psnr_db: psnr_db(picture, reference, &mask),
        ssim: ssim(&a, &b, &mask),
        shift: shift(&a, &b, &mask),
    }
}

/// A picture of one f64 channel, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `height × width` values.
    pub values: Vec<f64>,
}

impl Plane {
    /// The luma (ITU-R BT.601) of a picture of three channels, or the one channel it has; 0 to 255.
    pub fn luma(image: ImageView<'_, u8>) -> Self {
        let Size { width, height } = image.size();
        let of = |pixel: &[u8]| match pixel {
            [r, g, b, ..] => 0.299 * f64::from(*r) + 0.587 * f64::from(*g) + 0.114 * f64::from(*b),
            _ => f64::from(pixel[0]),
        };
        let values = image.data().chunks_exact(image.channels()).map(of).collect();
        Self { width: width as usize, height: height as usize, values }
    }

    /// The value at column `x`, row `y`.
    pub fn at(&self, x: usize, y: usize) -> f64 {
        self.values[y * self.width + x]
    }
}

/// Peak signal-to-noise ratio, peak 255, mean square over the mask's pixels and all channels.
fn psnr_db(picture: ImageView<'_, u8>, reference: ImageView<'_, u8>, mask: &[bool]) -> f64 {
    let channels = picture.channels();
    let (mut squares, mut count) = (0_u64, 0_u64);
    let pixels = picture.data().chunks_exact(channels).zip(reference.data().chunks_exact(channels));
    for ((p, r), _) in pixels.zip(mask).filter(|(_, m)| **m) {
        for (a, b) in p.iter().zip(r) {
            squares += u64::from(a.abs_diff(*b)).pow(2);
            count += 1;
        }
    }
    let mean = squares as f64 / count as f64;
    10.0 * libm::log10(255.0 * 255.0 / mean)
}

/// Half the side of SSIM's window.
const REACH: usize = 5;

/// Mean structural similarity over the pixels whose 11 × 11 window lies within the mask; NaN if there is none.
///
/// Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli (2004), "Image quality assessment: from error visibility to
/// structural similarity", IEEE Transactions on Image Processing 13 (4), 600–612, doi:10.1109/TIP.2003.819861:
/// Gaussian window of σ = 1.5, K1 = 0.01, K2 = 0.03, L = 255. Departure: the mask.
pub fn ssim(a: &Plane, b: &Plane, mask: &[bool]) -> f64 {
    let c1 = (0.01 * 255.0_f64).powi(2);
    let c2 = (0.03 * 255.0_f64).powi(2);
    let product = |p: &Plane, q: &Plane| -> Vec<f64> {
        p.values.iter().zip(&q.values).map(|(x, y)| x * y).collect()
    };
    let smooth = |values: &[f64]| smooth(values, a.width, a.height);
    let (mean_a, mean_b) = (smooth(&a.values), smooth(&b.values));
    let (aa, bb, ab) = (smooth(&product(a, a)), smooth(&product(b, b)), smooth(&product(a, b)));
    let whole = within(mask, a.width, a.height, REACH);
    let (mut sum, mut count) = (0.0, 0_u64);
    for k in (0..whole.len()).filter(|&k| whole[k]) {
        let (ma, mb) = (mean_a[k], mean_b[k]);
        let (va, vb, cov) = (aa[k] - ma * ma, bb[k] - mb * mb, ab[k] - ma * mb);
        sum +=
            ((2.0 * ma * mb + c1) * (2.0 * cov + c2)) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
        count += 1;
    }
    sum / count as f64
}

/// SSIM's Gaussian mean over 11 × 11 pixels; only meant where the window lies inside.
fn smooth(values: &[f64], width: usize, height: usize) -> Vec<f64> {
    let weights: [f64; 2 * REACH + 1] = std::array::from_fn(|k| {
        let d = k as f64 - REACH as f64;
        libm::exp(-0.5 * d * d / (1.5 * 1.5))
    });
    let total: f64 = weights.iter().sum();
    let weights = weights.map(|w| w / total);
    let pass = |from: &[f64], step: usize, length: usize, position: fn(usize, usize) -> usize| {
        let mut to = vec![0.0; from.len()];
        for (k, value) in to.iter_mut().enumerate() {
            let at = position(k, width);
            if at >= REACH && at + REACH < length {
                let first = k - REACH * step;
                *value = weights.iter().zip(0..).map(|(w, j)| w * from[first + j * step]).sum();
            }
        }
        to
    };
    let rows = pass(values, 1, width, |k, width| k % width);
    pass(&rows, width, height, |k, width| k / width)
}

/// The pixels whose square of `2 · reach + 1` pixels lies within the picture and the mask.
pub(super) fn within(mask: &[bool], width: usize, height: usize, reach: usize) -> Vec<bool> {
    // Runs of set pixels along rows, then along columns.
    let erode = |from: &[bool], count: usize, length: usize, at: &dyn Fn(usize, usize) -> usize| {
        let mut to = vec![false; from.len()];
        for line in 0..count {
            let mut run = 0;
            for k in 0..length {
                run = if from[at(line, k)] { run + 1 } else { 0 };
                if run > 2 * reach {
                    to[at(line, k - reach)] = true;
                }
            }
        }
        to
    };
    let rows = erode(mask, height, width, &|line, k| line * width + k);
    erode(&rows, width, height, &|line, k| k * width + line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::synthetic::Random;

    fn noise(size: Size, seed: u64) -> Image<u8> {
        let mut r = Random::new(seed);
        let samples = (0..size.area()).map(|_| (r.bits() >> 56).try_into().unwrap()).collect();
        Image::from_data(size, 1, samples)
    }

    #[test]
    fn an_error_of_one_step_everywhere_is_48_decibels() {
        let size = Size::new(40, 30);
        let a = Image::from_data(size, 1, vec![100_u8; 1200]);
        let b = Image::from_data(size, 1, vec![101_u8; 1200]);
        let mask = Image::filled(size, 1, 255_u8);
        let found = likeness(a.view(), b.view(), mask.view());
        assert!((found.psnr_db - 48.130_803_608_679_1).abs() < 1e-9, "{}", found.psnr_db);
        assert_eq!(found.pixels, 1200);
        assert!(found.shift.is_none());
        assert!(likeness(a.view(), a.view(), mask.view()).psnr_db.is_infinite());
    }

    #[test]
    fn ssim_is_that_of_the_formula_summed_directly() {
        let size = Size::new(23, 19);
        let (a, b) = (Plane::luma(noise(size, 1).view()), Plane::luma(noise(size, 2).view()));
        let mut mixed = b.clone();
        for (m, v) in mixed.values.iter_mut().zip(&a.values) {
            *m = 0.7 * v + 0.3 * *m;
        }
        let found = ssim(&a, &mixed, &vec![true; 23 * 19]);
        // The same by the definition, window by window.
        let (mut sum, mut count) = (0.0, 0.0);
        for y in 5..14 {
            for x in 5..18 {
                let mut s = [0.0; 6];
                for j in 0..11_u32 {
                    for i in 0..11_u32 {
                        let d = (f64::from(i) - 5.0).powi(2) + (f64::from(j) - 5.0).powi(2);
                        let w = (-d / 4.5).exp();
                        let at = |p: &Plane| p.at(x + i as usize - 5, y + j as usize - 5);
                        let (p, q) = (at(&a), at(&mixed));
                        for (t, v) in s.iter_mut().zip([1.0, p, q, p * p, q * q, p * q]) {
                            *t += w * v;
                        }
                    }
                }
                let [w, p, q, pp, qq, pq] = s;
                let (p, q, pp, qq, pq) = (p / w, q / w, pp / w, qq / w, pq / w);
                sum += (2.0 * p * q + 6.5025) * (2.0 * (pq - p * q) + 58.5225)
                    / ((p * p + q * q + 6.5025) * (pp - p * p + qq - q * q + 58.5225));
                count += 1.0;
            }
        }
        assert!((found - sum / count).abs() < 1e-9, "{found} {}", sum / count);
        assert!(found < 0.95 && (ssim(&a, &a, &vec![true; 23 * 19]) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_the_mask_leaves_out_changes_nothing() {
        let size = Size::new(60, 50);
        let (a, b) = (noise(size, 1), noise(size, 2));
        let mut mask = Image::filled(size, 1, 1_u8);
        let mut spoilt = b.clone();
        for y in 20..50 {
            for x in 30..60 {
                mask.pixel_mut(x, y)[0] = 0;
                spoilt.pixel_mut(x, y)[0] = 255;
            }
        }
        let (one, two) = (
            likeness(a.view(), b.view(), mask.view()),
            likeness(a.view(), spoilt.view(), mask.view()),
        );
        assert_eq!((one.psnr_db, one.ssim), (two.psnr_db, two.ssim));
        assert_eq!(one.pixels, 60 * 50 - 900);
    }
}
