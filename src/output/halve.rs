//! The rule of the overviews: 2 × 2 pixels of a level become one of the next.
//!
//! - Mosaic: the mean of the defined pixels (alpha not 0), channel by channel, rounded half up; alpha is full if any
//!   is defined. If none is, the upper-left pixel stands, so that the colour of undefined pixels is kept.
//! - Elevation: the mean of the numbers, summed in f64 row by row, rounded to f32; NaN if there is none.
//! - All others: the upper-left pixel, because a mean of ids or counts is none.
//!
//! At an odd right or lower edge a pixel of the next level has two parts or one; they count as above.

use super::{Layer, Meaning, Raster};
use crate::image::{Image, ImageView};

/// The next coarser level of a raster: half its size, rounded up.
///
/// # Panics
/// If the raster's samples are not the layer's.
pub fn halve(layer: &Layer, raster: &Raster) -> Raster {
    assert!(layer.fits(raster), "the raster has the layer's samples");
    match raster {
        Raster::U8(i) if layer.meaning() == Meaning::Mosaic => {
            Raster::U8(mean_colour(i.view(), u8::MAX, |v| {
                u8::try_from(v).expect("a mean of 8-bit samples has 8 bits")
            }))
        }
        Raster::U16(i) if layer.meaning() == Meaning::Mosaic => {
            Raster::U16(mean_colour(i.view(), u16::MAX, |v| {
                u16::try_from(v).expect("a mean of 16-bit samples has 16 bits")
            }))
        }
        Raster::F32(i) => Raster::F32(mean_elevation(i.view())),
        Raster::U8(i) => Raster::U8(upper_left(i.view())),
        Raster::U16(i) => Raster::U16(upper_left(i.view())),
        Raster::U32(i) => Raster::U32(upper_left(i.view())),
    }
}

/// Calls `make` with the two rows of each row of the result; at an odd lower edge both are the last.
fn by_rows<T: Copy>(
    image: ImageView<'_, T>,
    mut make: impl FnMut(&[T], Option<&[T]>, &mut Vec<T>),
) -> Image<T> {
    let size = image.size().halved();
    let mut out = Vec::with_capacity(size.width as usize * size.height as usize * image.channels());
    for y in 0..size.height as usize {
        let lower = (2 * y + 1 < image.size().height as usize).then(|| image.row(2 * y + 1));
        make(image.row(2 * y), lower, &mut out);
    }
    Image::from_data(size, image.channels(), out)
}

fn upper_left<T: Copy>(image: ImageView<'_, T>) -> Image<T> {
    let channels = image.channels();
    by_rows(image, |upper, _, out| {
        for pair in upper.chunks(2 * channels) {
            out.extend_from_slice(&pair[..channels]);
        }
    })
}

fn mean_elevation(image: ImageView<'_, f32>) -> Image<f32> {
    by_rows(image, |upper, lower, out| {
        let mut lower = lower.map(|l| l.chunks(2));
        for pair in upper.chunks(2) {
            let below = lower.as_mut().and_then(Iterator::next).unwrap_or_default();
            let (mut sum, mut n) = (0.0_f64, 0.0_f64);
            for v in pair.iter().chain(below).filter(|v| !v.is_nan()) {
                sum += f64::from(*v);
                n += 1.0;
            }
            #[expect(clippy::cast_possible_truncation, reason = "rounding to the stored type")]
            out.push(if n > 0.0 { (sum / n) as f32 } else { f32::NAN });
        }
    })
}

fn mean_colour<T: Copy + Into<u32>>(
    image: ImageView<'_, T>,
    full: T,
    narrow: impl Fn(u32) -> T,
) -> Image<T> {
    let channels = image.channels();
    by_rows(image, |upper, lower, out| {
        let mut lower = lower.map(|l| l.chunks(2 * channels));
        for pair in upper.chunks(2 * channels) {
            let below = lower.as_mut().and_then(Iterator::next).unwrap_or_default();
            let (mut sum, mut n) = ([0_u32; 4], 0_u32);
            for pixel in pair.chunks_exact(channels).chain(below.chunks_exact(channels)) {
                if pixel[channels - 1].into() != 0 {
                    n += 1;
                    for (s, v) in sum.iter_mut().zip(pixel) {
                        *s += (*v).into();
                    }
                }
            }
            if n == 0 {
                out.extend_from_slice(&pair[..channels]);
            } else {
                // Half up: (2 s + n) / 2 n.
                out.extend(sum[..channels - 1].iter().map(|s| narrow((2 * s + n) / (2 * n))));
                out.push(full);
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Colour, Depth};
    use super::*;
    use crate::geom::Size;

    #[test]
    fn a_mean_takes_the_defined_pixels_alone_and_rounds_half_up() {
        let layer = Layer::mosaic(Colour::Grey, Depth::Eight);
        let image = vec![
            10, 255, 11, 255, 99, 0, //
            77, 0, 13, 255, 98, 0, //
            5, 0, 6, 255, 254, 255,
        ];
        let half = halve(&layer, &Raster::U8(Image::from_data(Size::new(3, 3), 2, image)));
        // (10 + 11 + 13) / 3 = 11.33; none defined: the upper-left's colour; one; one.
        let want = vec![11, 255, 99, 0, 6, 255, 254, 255];
        assert_eq!(half, Raster::U8(Image::from_data(Size::new(2, 2), 2, want)));
        let two = vec![10, 255, 11, 255];
        let half = halve(&layer, &Raster::U8(Image::from_data(Size::new(2, 1), 2, two)));
        assert_eq!(half, Raster::U8(Image::from_data(Size::new(1, 1), 2, vec![11, 255])));
    }

    #[test]
    fn four_full_sixteen_bit_samples_do_not_overflow() {
        let layer = Layer::mosaic(Colour::Rgb, Depth::Sixteen);
        let full = Image::filled(Size::new(2, 2), 4, u16::MAX);
        let want = Image::filled(Size::new(1, 1), 4, u16::MAX);
        assert_eq!(halve(&layer, &Raster::U16(full)), Raster::U16(want));
    }

    #[test]
    fn elevations_are_averaged_without_the_holes_and_ids_never() {
        let layer = Layer::of(Meaning::Elevation).unwrap();
        let nan = f32::NAN;
        let image = Image::from_data(Size::new(3, 2), 1, vec![1.0, nan, nan, 2.0, nan, nan]);
        let Raster::F32(half) = halve(&layer, &Raster::F32(image)) else { panic!() };
        assert_eq!(half.data()[0].to_bits(), 1.5_f32.to_bits());
        assert!(half.data()[1].is_nan());
        let ids = Layer::of(Meaning::Face).unwrap();
        let image = Image::from_data(Size::new(2, 2), 1, vec![7_u32, 1, 1, 1]);
        let half = Image::from_data(Size::new(1, 1), 1, vec![7_u32]);
        assert_eq!(halve(&ids, &Raster::U32(image)), Raster::U32(half));
    }
}
