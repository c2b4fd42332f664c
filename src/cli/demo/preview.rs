//! PNG pictures of the mosaic and its layers, to look at.

use std::path::Path;

use ::image::{ExtendedColorType, save_buffer};
use tiff::decoder::DecodingResult;

use super::super::picture::Picture;
use crate::output::{Meaning, NO_FACE, NO_PHOTO, NO_SURFACE};
use crate::{Error, Result};

/// Red, green, blue, alpha.
type Rgba = [u8; 4];

/// What is not defined.
const CLEAR: Rgba = [0; 4];
/// Colours of the layer `coverage`: no photo, one, two, more.
const COVERAGE: [Rgba; 4] =
    [[204, 51, 51, 255], [51, 160, 51, 255], [51, 85, 204, 255], [150, 150, 150, 255]];
/// Photos that a count is drawn as full brightness from.
const BRIGHT_COUNT: u32 = 10;

/// Draws a layer as the PNG file `to`, from its TIFF file `from`; `coverage` from that of `count`, because the `tiff`
/// crate reads no palettes.
///
/// # Errors
/// What reading the file gives, [`Error::Unsupported`] for samples that no layer has, or a failed write.
pub(super) fn draw(from: &Path, layer: Meaning, to: &Path) -> Result<()> {
    let picture = Picture::read(from)?;
    let pixels = pixels(&picture, layer)
        .ok_or_else(|| Error::unsupported(from, format!("{} samples", layer.name())))?;
    let bytes = pixels.concat();
    save_buffer(to, &bytes, picture.size.width, picture.size.height, ExtendedColorType::Rgba8)
        .map_err(|e| Error::io(to, std::io::Error::other(e)))
}

fn pixels(picture: &Picture, layer: Meaning) -> Option<Vec<Rgba>> {
    match (layer, &picture.samples) {
        (Meaning::Mosaic, DecodingResult::U8(samples)) => Some(colours(samples, picture.channels)),
        (Meaning::Mosaic, DecodingResult::U16(samples)) => {
            let high: Vec<u8> = samples.iter().map(|sample| sample.to_be_bytes()[0]).collect();
            Some(colours(&high, picture.channels))
        }
        (Meaning::Elevation, DecodingResult::F32(samples)) => Some(elevations(samples)),
        (Meaning::Face, DecodingResult::U32(ids)) => {
            Some(ids.iter().map(|id| if *id == NO_FACE { CLEAR } else { of_number(*id) }).collect())
        }
        (Meaning::Best, DecodingResult::U16(ids)) => {
            let of = |id: &u16| if *id == NO_PHOTO { CLEAR } else { of_number(u32::from(*id)) };
            Some(ids.iter().map(of).collect())
        }
        (Meaning::Count | Meaning::Used, DecodingResult::U8(counts)) => {
            Some(counts.iter().map(|count| of_count(*count)).collect())
        }
        (Meaning::Coverage, DecodingResult::U8(counts)) => {
            let of = |count: &u8| match *count {
                NO_SURFACE => CLEAR,
                count => COVERAGE[usize::from(count).min(3)],
            };
            Some(counts.iter().map(of).collect())
        }
        _ => None,
    }
}

/// Grey + alpha or red, green, blue + alpha.
fn colours(samples: &[u8], channels: usize) -> Vec<Rgba> {
    let of = |pixel: &[u8]| match pixel {
        [grey, alpha] => [*grey, *grey, *grey, *alpha],
        [r, g, b, alpha] => [*r, *g, *b, *alpha],
        _ => CLEAR,
    };
    samples.chunks_exact(channels.max(1)).map(of).collect()
}

/// Dark at the least elevation, bright at the greatest.
fn elevations(samples: &[f32]) -> Vec<Rgba> {
    let finite = || samples.iter().copied().filter(|sample| sample.is_finite());
    let min = finite().fold(f32::INFINITY, f32::min);
    let max = finite().fold(f32::NEG_INFINITY, f32::max);
    let range = (max - min).max(f32::MIN_POSITIVE);
    let of = |sample: &f32| {
        if !sample.is_finite() {
            return CLEAR;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "30 to 230")]
        let grey = ((sample - min) / range * 200.0 + 30.0) as u8;
        [grey, grey, grey, 255]
    };
    samples.iter().map(of).collect()
}

/// Brighter with every photo, red where there is none.
fn of_count(count: u8) -> Rgba {
    match count {
        NO_SURFACE => CLEAR,
        0 => COVERAGE[0],
        _ => {
            let share = u32::from(count).min(BRIGHT_COUNT);
            let grey = u8::try_from(55 + 200 * share / BRIGHT_COUNT).unwrap_or(u8::MAX);
            [grey, grey, grey, 255]
        }
    }
}

/// A colour that differs from those of the numbers beside it.
fn of_number(number: u32) -> Rgba {
    // Multiplication by an odd constant (2^32 over the golden ratio) spreads neighbours.
    let [a, b, c, _] = number.wrapping_add(1).wrapping_mul(0x9E37_79B9).to_be_bytes();
    [a | 0x30, b | 0x30, c | 0x30, 255]
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use tiff::encoder::{TiffEncoder, colortype};

    use super::*;

    #[test]
    fn elevations_are_drawn_from_dark_to_bright_and_nothing_is_clear() {
        let folder = tempfile::tempdir().unwrap();
        let (tif, png) = (folder.path().join("e.tif"), folder.path().join("e.png"));
        let mut encoder = TiffEncoder::new(File::create(&tif).unwrap()).unwrap();
        encoder.write_image::<colortype::Gray32Float>(3, 1, &[-1.0, f32::NAN, 3.0]).unwrap();
        draw(&tif, Meaning::Elevation, &png).unwrap();
        let drawn = ::image::open(&png).unwrap().to_rgba8();
        assert_eq!(drawn.get_pixel(0, 0).0, [30, 30, 30, 255]);
        assert_eq!(drawn.get_pixel(1, 0).0, CLEAR);
        assert_eq!(drawn.get_pixel(2, 0).0, [230, 230, 230, 255]);
        assert!(draw(&tif, Meaning::Face, &png).is_err());
    }

    #[test]
    fn categories_have_their_colours() {
        let picture =
            |samples| Picture { size: crate::geom::Size::new(2, 1), channels: 1, samples };
        let coverage = picture(DecodingResult::U8(vec![3, NO_SURFACE]));
        assert_eq!(pixels(&coverage, Meaning::Coverage).unwrap(), [COVERAGE[3], CLEAR]);
        let count = picture(DecodingResult::U8(vec![0, 200]));
        assert_eq!(pixels(&count, Meaning::Count).unwrap(), [COVERAGE[0], [255; 4]]);
        let face = pixels(&picture(DecodingResult::U32(vec![7, NO_FACE])), Meaning::Face).unwrap();
        assert!(face[0] != of_number(8) && face[1] == CLEAR);
        let mosaic = Picture { channels: 2, ..picture(DecodingResult::U8(vec![9, 255, 5, 0])) };
        assert_eq!(pixels(&mosaic, Meaning::Mosaic).unwrap(), [[9, 9, 9, 255], [5, 5, 5, 0]]);
    }
}
