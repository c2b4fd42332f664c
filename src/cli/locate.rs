//! `groundel locate`: from a mosaic's pixels to the ground, and back.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use glam::DVec3;
use tiff::TiffError;
use tiff::decoder::{Decoder, DecodingResult};

use super::ortho::mosaic_of_view;
use crate::frame::{FrameSpec, Locator, Mosaic};
use crate::input::{CameraOptions, read_cameras, read_frame};
use crate::{Error, Result};

/// All elevations.
const UNBOUNDED: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// What is asked.
#[derive(Debug)]
pub(super) struct Question<'a> {
    /// The mosaic's file; its frame, and for pixels its elevation layer, lie beside it.
    pub(super) mosaic: &'a Path,
    /// Column and row of each pixel position; (0.5, 0.5) is the middle of the upper-left pixel.
    pub(super) pixels: &'a [[f64; 2]],
    /// Ground points.
    pub(super) grounds: &'a [[f64; 3]],
    /// Takes the place of the elevation layer, metres.
    pub(super) elevation: Option<f64>,
    /// The camera set, for the view of one of its photos.
    pub(super) cameras: Option<(&'a Path, &'a CameraOptions)>,
}

/// A line for each pixel, `column row X Y Z elevation`, then the same for each ground point. Numbers have all digits that
/// read back to the same bits.
///
/// # Errors
/// [`Error::Usage`] for a place outside the mosaic, or one whose elevation is not known; what reading the frame, the
/// layer and the cameras gives.
pub(super) fn answer(question: &Question<'_>) -> Result<String> {
    let frame = beside(question.mosaic, "frame.toml");
    let mosaic = mosaic(&frame, question)?;
    let locator = Locator::new(&mosaic);
    let mut lines = String::new();
    for &[column, row] in question.pixels {
        let [width, height] = [mosaic.size.width, mosaic.size.height].map(f64::from);
        if !(column >= 0.0 && column <= width && row >= 0.0 && row <= height) {
            return Err(Error::usage(format!(
                "--pixel {column},{row}: expected a position within the mosaic, 0,0 to {width},{height}"
            )));
        }
        let elevation = match question.elevation {
            Some(elevation) => elevation,
            None => stored_elevation(question.mosaic, [column, row])?,
        };
        let point = locator.ground(column, row, elevation).ok_or_else(|| {
            Error::usage(format!("--pixel {column},{row}: the view's lens has no ray there"))
        })?;
        lines += &line([column, row], point, elevation);
    }
    for &ground in question.grounds {
        let at = locator.pixel(ground.into()).ok_or_else(|| {
            Error::usage(format!("--ground {ground:?}: the view does not show this point"))
        })?;
        lines += &line([at.x, at.y], ground.into(), at.z);
    }
    Ok(lines)
}

fn line([column, row]: [f64; 2], point: DVec3, elevation: f64) -> String {
    let DVec3 { x, y, z } = point;
    format!("{column:?} {row:?} {x:?} {y:?} {z:?} {elevation:?}\n")
}

/// `<stem>.<what>` beside the mosaic.
fn beside(mosaic: &Path, what: &str) -> PathBuf {
    let mut name = mosaic.file_stem().unwrap_or_default().to_os_string();
    name.push(format!(".{what}"));
    mosaic.with_file_name(name)
}

fn mosaic(frame: &Path, question: &Question<'_>) -> Result<Mosaic> {
    let stated = |pixel_size: Option<f64>, extent: Option<[f64; 4]>| {
        pixel_size.zip(extent).ok_or_else(|| {
            let expected = "pixel_size and extent, as they stand in the frame of a mosaic";
            Error::corrupt(frame, "the frame", expected, "not both")
        })
    };
    match read_frame(frame)? {
        FrameSpec::Plane(plane) => {
            let (pixel_size, extent) = stated(plane.pixel_size, plane.extent)?;
            let slab = plane.elevation.unwrap_or(UNBOUNDED);
            Mosaic::new(plane, pixel_size, extent, slab)
        }
        FrameSpec::Cylinder(cylinder) => {
            let (pixel_size, extent) = stated(cylinder.pixel_size, cylinder.extent)?;
            let slab = cylinder.elevation.unwrap_or(UNBOUNDED);
            Mosaic::new(cylinder, pixel_size, extent, slab)
        }
        FrameSpec::Perspective(view) => {
            let cameras = match question.cameras {
                Some((path, options)) => read_cameras(path, options)?.set,
                None => crate::camera::CameraSet::default(),
            };
            mosaic_of_view(&view, &cameras)
        }
    }
}

/// The elevation of the pixel that holds a position, from the layer beside the mosaic.
fn stored_elevation(mosaic: &Path, position: [f64; 2]) -> Result<f64> {
    let path = beside(mosaic, "elevation.tif");
    let fault = |error: TiffError| match error {
        TiffError::IoError(source) => Error::io(&path, source),
        other => Error::corrupt(&path, "first directory", "a TIFF file", other.to_string()),
    };
    if !path.exists() {
        return Err(Error::usage(format!(
            "{} is not there: render with --layers elevation, or give --elevation METRES",
            path.display()
        )));
    }
    let file = File::open(&path).map_err(|e| Error::io(&path, e))?;
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(fault)?;
    let (width, height) = decoder.dimensions().map_err(fault)?;
    let (chunk_width, chunk_height) = decoder.chunk_dimensions();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within the mosaic; the last edge belongs to the last pixel"
    )]
    let [column, row] = [(position[0], width), (position[1], height)]
        .map(|(at, size)| (at as u32).min(size.saturating_sub(1)));
    let across = width.div_ceil(chunk_width.max(1));
    let chunk = row / chunk_height.max(1) * across + column / chunk_width.max(1);
    let (held_width, _) = decoder.chunk_data_dimensions(chunk);
    let DecodingResult::F32(samples) = decoder.read_chunk(chunk).map_err(fault)? else {
        return Err(Error::corrupt(&path, "samples", "32-bit floating point", "others"));
    };
    let at = (row % chunk_height) * held_width + column % chunk_width;
    let elevation = samples.get(at as usize).copied().unwrap_or(f32::NAN);
    if elevation.is_nan() {
        return Err(Error::usage(format!(
            "--pixel {},{}: the mosaic shows no surface there; give --elevation METRES",
            position[0], position[1]
        )));
    }
    Ok(elevation.into())
}
