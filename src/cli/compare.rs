//! `groundel compare`: how near one picture comes to another.

use std::path::Path;

use ::image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use tiff::decoder::DecodingResult;

use super::picture::Picture;
use crate::geom::Size;
use crate::image::{Image, ImageView};
use crate::input::photo::{PhotoFormat, Rows, decode_photo, read_photo_header};
use crate::output::write_atomically;
use crate::synthetic::likeness;
use crate::{Error, Result};

/// Both pictures and what is computed of them are held in memory.
const MOST_PIXELS: u64 = 200_000_000;
/// Differences are drawn this much greater than they are, around a middle grey.
const AMPLIFIED: i32 = 4;

/// A picture of 8-bit samples: colour, and where it is defined.
struct Colours {
    /// `height × width × 3`.
    rgb: Vec<u8>,
    /// One a pixel, 0 where it is not defined.
    mask: Vec<u8>,
    size: Size,
}

/// The likeness of picture `a` to `b` where both are defined, a line each; if `to` is given, draws the difference.
///
/// # Errors
/// [`Error::Usage`] if the sizes differ or nothing is defined in both; [`Error::Limit`] for pictures too large; what
/// reading and writing gives.
pub(super) fn answer(a: &Path, b: &Path, to: Option<&Path>) -> Result<String> {
    let (first, second) = (read(a)?, read(b)?);
    let size = first.size;
    if size != second.size {
        return Err(Error::usage(format!(
            "pictures of one size can be compared: {} has {} × {} pixels, {} has {} × {}",
            a.display(),
            size.width,
            size.height,
            b.display(),
            second.size.width,
            second.size.height
        )));
    }
    let both = first.mask.iter().zip(&second.mask);
    let mask: Vec<u8> = both.map(|(a, b)| if *a != 0 && *b != 0 { 255 } else { 0 }).collect();
    if mask.iter().all(|&m| m == 0) {
        return Err(Error::usage("no pixel is defined in both pictures"));
    }
    let found = likeness(
        ImageView::new(size, 3, &first.rgb),
        ImageView::new(size, 3, &second.rgb),
        ImageView::new(size, 1, &mask),
    );
    if let Some(to) = to {
        write_atomically(to, &difference(&first, &second, &mask, to)?)?;
    }
    let shift = match found.shift {
        Some(shift) => format!("{:.3} pixels right, {:.3} pixels down", shift.x, shift.y),
        None => "too little in common to tell".into(),
    };
    Ok(format!(
        "pixels compared: {} of {}\nPSNR: {:.2} dB\nSSIM: {:.4}\nshift of the first: {shift}\n",
        found.pixels,
        size.area(),
        found.psnr_db,
        found.ssim
    ))
}

/// Reads a mosaic or a photo; 16-bit samples are brought to 8.
fn read(path: &Path) -> Result<Colours> {
    let header = read_photo_header(path);
    match header {
        Ok(header) if !matches!(header.format, PhotoFormat::Tiff { .. }) => {
            limit(path, header.size)?;
            let mut samples = Vec::new();
            decode_photo(path, &header, &mut |rows| {
                match rows {
                    Rows::U8(row) => samples.extend_from_slice(row),
                    Rows::U16(row) => samples.extend(row.iter().map(|v| v.to_be_bytes()[0])),
                }
                Ok(())
            })?;
            Ok(colours(&samples, header.channels, header.size, false))
        }
        _ => {
            let picture = Picture::read_at_most(path, MOST_PIXELS)?;
            let samples = match picture.samples {
                DecodingResult::U8(samples) => samples,
                DecodingResult::U16(samples) => {
                    samples.into_iter().map(|v| v.to_be_bytes()[0]).collect()
                }
                _ => return Err(Error::unsupported(path, "samples that are no colours")),
            };
            let has_alpha = matches!(picture.channels, 2 | 4);
            Ok(colours(&samples, picture.channels, picture.size, has_alpha))
        }
    }
}

fn limit(path: &Path, size: Size) -> Result<()> {
    if size.area() <= MOST_PIXELS {
        return Ok(());
    }
    let what = format!("{}: pixels of a picture to be compared", path.display());
    Err(Error::Limit { what, limit: MOST_PIXELS, found: size.area() })
}

fn colours(samples: &[u8], channels: usize, size: Size, has_alpha: bool) -> Colours {
    let of = channels.max(1);
    let rgb = samples.chunks_exact(of).flat_map(|pixel| match pixel {
        [r, g, b, ..] => [*r, *g, *b],
        [grey, ..] => [*grey; 3],
        [] => [0; 3],
    });
    let mask = samples
        .chunks_exact(of)
        .map(|pixel| if has_alpha { *pixel.last().unwrap_or(&0) } else { 255 });
    Colours { rgb: rgb.collect(), mask: mask.collect(), size }
}

/// A PNG: middle grey where the pictures are equal, clear where one is not defined.
fn difference(a: &Colours, b: &Colours, mask: &[u8], to: &Path) -> Result<Vec<u8>> {
    let mut picture = Image::filled(a.size, 4, 0_u8);
    let pixels = a.rgb.chunks_exact(3).zip(b.rgb.chunks_exact(3)).zip(mask);
    for (to, ((a, b), &m)) in picture.data_mut().chunks_exact_mut(4).zip(pixels) {
        for c in 0..3 {
            let off = AMPLIFIED * (i32::from(a[c]) - i32::from(b[c]));
            to[c] = u8::try_from((128 + off).clamp(0, 255)).expect("clamped");
        }
        to[3] = m;
    }
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(picture.data(), a.size.width, a.size.height, ExtendedColorType::Rgba8)
        .map_err(|e| Error::io(to, std::io::Error::other(e)))?;
    Ok(bytes)
}
