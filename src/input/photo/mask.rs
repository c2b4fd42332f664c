//! Masks: PNG files that say which pixels of a photo are used.

use std::path::Path;

use super::{PhotoFormat, PhotoHeader, Rows, decode_photo, read_photo_header};
use crate::{Error, Result};

/// Value of a used pixel of a mask, decoded.
const USED: u8 = 255;

/// Reads the header of the mask at `path`: a PNG of any kind.
///
/// # Errors
/// Those of [`read_photo_header`]; [`Error::Corrupt`] for a picture of another format.
pub fn read_mask_header(path: &Path) -> Result<PhotoHeader> {
    let header = read_photo_header(path)?;
    match header.format {
        PhotoFormat::Png { .. } => Ok(header),
        _ => Err(Error::corrupt(path, "byte 0", "a PNG mask", "a picture of another format")),
    }
}

/// Decodes the mask at `path` and hands its rows to `sink` as [`Rows::U8`] of one channel: 0 where all channels are 0,
/// else 255. Alpha plays no part. A palette is looked up.
///
/// # Errors
/// Those of [`decode_photo`].
pub fn decode_mask(
    path: &Path,
    header: &PhotoHeader,
    sink: &mut dyn FnMut(Rows<'_>) -> Result<()>,
) -> Result<()> {
    let mut used = Vec::new();
    decode_photo(path, header, &mut |rows| {
        used.clear();
        match rows {
            Rows::U8(rows) => used.extend(rows.chunks_exact(header.channels).map(is_used)),
            Rows::U16(rows) => used.extend(rows.chunks_exact(header.channels).map(is_used)),
        }
        sink(Rows::U8(&used))
    })
}

fn is_used<S: Copy + Default + PartialEq>(pixel: &[S]) -> u8 {
    if pixel.iter().any(|s| *s != S::default()) { USED } else { 0 }
}

#[cfg(test)]
mod tests {
    use png::{BitDepth, ColorType};

    use super::*;

    fn mask(colour: ColorType, depth: BitDepth, data: &[u8]) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.png");
        let file = std::fs::File::create(&path).unwrap();
        let mut encoder = png::Encoder::new(file, 3, 1);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        if colour == ColorType::Indexed {
            encoder.set_palette(vec![0, 0, 1, 0, 0, 0]);
        }
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        let header = read_mask_header(&path).unwrap();
        let mut all = Vec::new();
        decode_mask(&path, &header, &mut |rows| {
            if let Rows::U8(rows) = rows {
                all.extend_from_slice(rows);
            }
            Ok(())
        })
        .unwrap();
        all
    }

    #[test]
    fn every_kind_of_png_is_a_mask_and_alpha_means_nothing() {
        let grey = |depth, data: &[u8]| mask(ColorType::Grayscale, depth, data);
        assert_eq!(grey(BitDepth::One, &[0b1010_0000]), [255, 0, 255]);
        assert_eq!(grey(BitDepth::Two, &[0b0100_1100]), [255, 0, 255]);
        assert_eq!(grey(BitDepth::Four, &[0x01, 0xF0]), [0, 255, 255]);
        assert_eq!(grey(BitDepth::Eight, &[0, 1, 255]), [0, 255, 255]);
        assert_eq!(grey(BitDepth::Sixteen, &[0, 0, 0, 1, 1, 0]), [0, 255, 255]);
        let rgb = mask(ColorType::Rgb, BitDepth::Eight, &[0, 0, 0, 0, 0, 1, 1, 0, 0]);
        assert_eq!(rgb, [0, 255, 255]);
        let alpha = mask(ColorType::GrayscaleAlpha, BitDepth::Eight, &[0, 255, 1, 0, 0, 0]);
        assert_eq!(alpha, [0, 255, 0]);
        let palette = mask(ColorType::Indexed, BitDepth::Eight, &[0, 1, 0]);
        assert_eq!(palette, [255, 0, 255]);
    }

    #[test]
    fn a_mask_of_another_format_is_refused() {
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/photo/grey.jpg");
        let e = read_mask_header(&data).unwrap_err();
        assert!(
            e.to_string()
                .ends_with("byte 0: expected a PNG mask, found a picture of another format")
        );
    }
}
