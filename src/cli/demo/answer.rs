//! How near the demo's mosaic comes to the known answer.

use std::path::Path;

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use tiff::decoder::DecodingResult;

use super::picture::Picture;
use crate::image::Image;
use crate::synthetic::{Caster, Likeness, PlaneSpec, likeness};
use crate::{Error, Result};

/// From where the rays of the known answer start, metres before the frame's plane: before everything.
const BEFORE_M: f64 = 100.0;
/// Elevations should be right to this part of a pixel.
const ELEVATION_PX: f64 = 1e-3;

/// What the comparison found.
#[derive(Debug, PartialEq)]
pub(super) struct Answer {
    /// Share of the pixels with surface that have a colour, 0 to 1.
    pub(super) coloured: f64,
    /// The mosaic against the texture, over the coloured pixels.
    pub(super) colours: Likeness,
    /// Share of the pixels whose elevation is right to a thousandth of a pixel, 0 to 1: pixels at an edge may show
    /// either side of it.
    pub(super) elevations: f64,
}

/// The known answer of one mosaic pixel: elevation and colour, where a ray meets the scene.
type Truth = Option<(f64, [f64; 3])>;

/// Compares mosaic and elevation layer with what rays through the scene itself give.
///
/// # Errors
/// What reading the files gives.
pub(super) fn compare(
    mosaic: &Path,
    elevation: &Path,
    frame: &PlaneSpec,
    caster: &Caster,
) -> Result<Answer> {
    let size = frame.size();
    let picture = Picture::read(mosaic)?;
    let heights = Picture::read(elevation)?;
    let (DecodingResult::U8(samples), DecodingResult::F32(heights)) =
        (&picture.samples, &heights.samples)
    else {
        return Err(Error::unsupported(mosaic, "anything but 8-bit colour and 32-bit elevation"));
    };
    let count = size.area();
    if picture.size != size || picture.channels != 4 || heights.len() as u64 != count {
        return Err(Error::corrupt(
            mosaic,
            "size",
            format!("{size:?}"),
            format!("{:?}", picture.size),
        ));
    }
    let truth: Vec<Truth> = (0..size.height)
        .into_par_iter()
        .flat_map_iter(|y| (0..size.width).map(move |x| truth_at(frame, caster, [x, y])))
        .collect();
    let pixels = || samples.chunks_exact(4).zip(&truth);
    let shown = |(pixel, truth): (&[u8], &Truth)| truth.is_some() && pixel[3] == u8::MAX;
    let surface = truth.iter().flatten().count().max(1);
    let right = |(height, truth): (&f32, &Truth)| {
        let tolerance_m = ELEVATION_PX * frame.pixel_size;
        truth.is_some_and(|(known, _)| (f64::from(*height) - known).abs() <= tolerance_m)
    };
    let mask =
        Image::from_data(size, 1, pixels().map(|pair| 255 * u8::from(shown(pair))).collect());
    let rgb = samples.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    let known = truth.iter().flat_map(|truth| truth.map_or([0; 3], |(_, rgb)| rgb.map(byte)));
    let known = Image::from_data(size, 3, known.collect());
    Ok(Answer {
        coloured: pixels().filter(|pair| shown(*pair)).count() as f64 / surface as f64,
        colours: likeness(Image::from_data(size, 3, rgb).view(), known.view(), mask.view()),
        elevations: heights.iter().zip(&truth).filter(|pair| right(*pair)).count() as f64
            / surface as f64,
    })
}

fn truth_at(frame: &PlaneSpec, caster: &Caster, [x, y]: [u32; 2]) -> Truth {
    let n = frame.n();
    let uv = frame.plane_from_pixel(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
    let from: DVec3 = frame.origin + frame.u_axis * uv.x + frame.v_axis * uv.y + n * BEFORE_M;
    let hit = caster.cast(from, -n, None)?;
    Some(((hit.ground - frame.origin).dot(n), caster.colour(&hit)))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
fn byte(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5).floor() as u8
}

impl Answer {
    /// Lines to read, each ending in a newline.
    pub(super) fn text(&self) -> String {
        let shift = self.colours.shift.as_ref().map_or(f64::NAN, crate::synthetic::Shift::length);
        format!(
            "against the known answer: {:.2} % of the surface coloured; PSNR {:.1} dB, SSIM {:.4}, shift {:.3} pixel; \
             {:.3} % of the elevations right to 1/1000 pixel\n",
            100.0 * self.coloured,
            self.colours.psnr_db,
            self.colours.ssim,
            shift,
            100.0 * self.elevations,
        )
    }
}
