//! How near the demo's mosaic comes to the known answer.

use std::path::Path;

use glam::DVec2;
use rayon::prelude::*;
use tiff::decoder::DecodingResult;

use super::super::picture::Picture;
use crate::image::Image;
use crate::synthetic::{Caster, FacadeSet, Likeness, PlaneSpec, Shift, likeness};
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
    /// Share of the pixels with surface whose elevation is right to a thousandth of a pixel, 0 to 1.
    pub(super) elevations: f64,
}

/// Compares mosaic and elevation layer with what rays through the scene itself give.
///
/// # Errors
/// What reading the files gives, [`Error::Corrupt`] if they are not the demo's.
pub(super) fn compare(mosaic: &Path, elevation: &Path, set: &FacadeSet) -> Result<Answer> {
    let size = set.plane().size();
    let (picture, heights) = (Picture::read(mosaic)?, Picture::read(elevation)?);
    let foreign = |path| Error::corrupt(path, "samples", "a layer of the demo", "something else");
    let DecodingResult::U8(samples) = &picture.samples else { return Err(foreign(mosaic)) };
    let DecodingResult::F32(elevations) = &heights.samples else { return Err(foreign(elevation)) };
    if picture.size != size || picture.channels != 4 || heights.size != size {
        return Err(foreign(mosaic));
    }
    let (expected, mut mask) = set.expected();
    let surface = mask.data().iter().filter(|surface| **surface != 0).count().max(1) as f64;
    let rgb = samples.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    for (mask, pixel) in mask.data_mut().iter_mut().zip(samples.chunks_exact(4)) {
        *mask = (*mask).min(pixel[3]);
    }
    let colours = likeness(Image::from_data(size, 3, rgb).view(), expected.view(), mask.view());
    Ok(Answer {
        coloured: colours.pixels as f64 / surface,
        colours,
        elevations: right_elevations(elevations, set) as f64 / surface,
    })
}

/// Pixels whose elevation is that of the first point along their ray.
fn right_elevations(elevations: &[f32], set: &FacadeSet) -> usize {
    let (caster, plane) = (Caster::of_scene(&set.scene()), set.plane());
    let tolerance_m = ELEVATION_PX * plane.pixel_size;
    let rows = elevations.par_chunks(plane.size().width as usize).zip(0_u32..plane.size().height);
    let right_in_row = |(row, y): (&[f32], u32)| {
        let right = |(found, x): &(&f32, u32)| {
            let known = elevation_at(&plane, &caster, [*x, y]);
            known.is_some_and(|known| (f64::from(**found) - known).abs() <= tolerance_m)
        };
        row.iter().zip(0..).filter(right).count()
    };
    rows.map(right_in_row).sum()
}

fn elevation_at(plane: &PlaneSpec, caster: &Caster, [x, y]: [u32; 2]) -> Option<f64> {
    let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
    let (at, n) = (plane.plane_from_pixel(centre), plane.n());
    let before = plane.origin + plane.u_axis * at.x + plane.v_axis * at.y + n * BEFORE_M;
    let hit = caster.cast(before, -n, None)?;
    Some((hit.ground - plane.origin).dot(n))
}

impl Answer {
    /// Lines to read, each ending in a newline.
    pub(super) fn text(&self) -> String {
        let shift = self.colours.shift.as_ref().map_or(f64::NAN, Shift::length);
        format!(
            "against the known answer: {:.2} % of the surface coloured, {:.3} % of the elevations right to \
             1/1000 pixel;\ncolours: PSNR {:.1} dB, SSIM {:.4}, shifted by {shift:.3} pixel\n",
            100.0 * self.coloured,
            100.0 * self.elevations,
            self.colours.psnr_db,
            self.colours.ssim,
        )
    }
}
