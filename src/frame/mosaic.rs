//! [`Mosaic`]: the grid of pixels of a frame.

use glam::DVec3;

use super::central::LocalCentral;
use super::check::{self, FrameError};
use super::cylinder::LocalCylinder;
use super::local::LocalMosaic;
use super::local_plane::LocalPlane;
use super::plane::Plane;
use super::spec::{Cylinder, Orientation};
use crate::camera::{Lens, Pose};
use crate::geom::Size;
use crate::{Error, Result};

/// The greatest width and height, pixels: readers of TIFF hold them in signed 32 bits.
const MAX_SIDE: f64 = i32::MAX as f64;

/// What a mosaic is drawn on.
#[derive(Debug, Clone, PartialEq)]
pub enum MosaicFrame {
    /// Parallel projection on a plane.
    Plane(Plane),
    /// Development of a cylinder.
    Cylinder(Cylinder),
    /// What a camera sees.
    Perspective(Box<CentralView>),
}

/// A camera whose view is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct CentralView {
    /// How the frame states it.
    pub stated: Orientation,
    /// Interior orientation, as it is drawn.
    pub lens: Lens,
    /// Exterior orientation.
    pub pose: Pose,
}

impl From<Plane> for MosaicFrame {
    fn from(plane: Plane) -> Self {
        Self::Plane(plane)
    }
}

impl From<Cylinder> for MosaicFrame {
    fn from(cylinder: Cylinder) -> Self {
        Self::Cylinder(cylinder)
    }
}

/// A frame with its grid of pixels. Mosaic coordinates are pixels, x along the columns, y along the rows; the
/// upper-left pixel's centre is (0.5, 0.5), its upper-left corner exactly (`u_min`, `v_max`).
#[derive(Debug, Clone, PartialEq)]
pub struct Mosaic {
    /// The frame, its optional pixel size, extent and elevation superseded by the fields below.
    pub frame: MosaicFrame,
    /// Side of a pixel, metres; 0 for a perspective view, which has none.
    pub pixel_size: f64,
    /// `[u_min, v_min, u_max, v_max]`, metres; the last column and row may reach beyond it. Of a perspective view:
    /// `[0, 0, width, height]`, pixels.
    pub extent: [f64; 4],
    /// `[min, max]` of the elevations shown, metres, perhaps infinite.
    pub slab: [f64; 2],
    /// Pixels.
    pub size: Size,
}

impl Mosaic {
    /// The mosaic of `extent` (`[u_min, v_min, u_max, v_max]`, metres) and `slab` (`[min, max]`, metres) on a plane or a
    /// cylinder.
    ///
    /// The width is ceil((`u_max` − `u_min`) / `pixel_size` − 1e-9), the height likewise.
    ///
    /// # Errors
    /// [`Error::Usage`] for a pixel size that is not positive, an extent or slab that is not ordered, or an extent
    /// below a pixel; [`Error::Limit`] for a side beyond 2³¹ − 1 pixels.
    pub fn new(
        frame: impl Into<MosaicFrame>,
        pixel_size: f64,
        extent: [f64; 4],
        slab: [f64; 2],
    ) -> Result<Self> {
        let frame = frame.into();
        let usage = |e: FrameError| Error::usage(format!("the mosaic's {e}"));
        let pixel_size = check::positive("pixel_size", pixel_size).map_err(usage)?;
        let extent = check::extent(extent).map_err(usage)?;
        let slab = check::elevation(slab).map_err(usage)?;
        let width = side("width", extent[2] - extent[0], pixel_size)?;
        let height = side("height", extent[3] - extent[1], pixel_size)?;
        if let MosaicFrame::Cylinder(cylinder) = &frame {
            cylinder.check_span(&extent).map_err(usage)?;
        }
        Ok(Self { frame, pixel_size, extent, slab, size: Size::new(width, height) })
    }

    /// The mosaic that is what a camera sees, of depths within `slab` (`[min, max]`, metres).
    ///
    /// # Errors
    /// [`Error::Usage`] for a slab that is not ordered.
    pub fn perspective(view: CentralView, slab: [f64; 2]) -> Result<Self> {
        let usage = |e: FrameError| Error::usage(format!("the mosaic's {e}"));
        let slab = check::elevation(slab).map_err(usage)?;
        let size = view.lens.size();
        let extent = [0.0, 0.0, size.width.into(), size.height.into()];
        let frame = MosaicFrame::Perspective(Box::new(view));
        Ok(Self { frame, pixel_size: 0.0, extent, slab, size })
    }

    /// The mosaic in the coordinates `ground − origin_ground`.
    pub fn local(&self, origin_ground: DVec3) -> LocalMosaic {
        match &self.frame {
            MosaicFrame::Plane(plane) => {
                LocalMosaic::Plane(LocalPlane::new(plane, self, origin_ground))
            }
            MosaicFrame::Cylinder(cylinder) => {
                LocalMosaic::Cylinder(LocalCylinder::new(cylinder, self, origin_ground))
            }
            MosaicFrame::Perspective(view) => LocalMosaic::Central(Box::new(LocalCentral::new(
                &view.lens,
                view.pose.relative_to(origin_ground),
                self.slab,
            ))),
        }
    }

    /// The plane, if it is drawn on one.
    pub fn plane(&self) -> Option<&Plane> {
        match &self.frame {
            MosaicFrame::Plane(plane) => Some(plane),
            _ => None,
        }
    }
}

/// Pixels that cover `span` metres.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole numbers above 0, checked against the limit; a greater one saturates in the message"
)]
fn side(what: &str, span: f64, pixel_size: f64) -> Result<u32> {
    let pixels = (span / pixel_size - 1e-9).ceil();
    if pixels < 1.0 {
        let message =
            format!("the mosaic's {what}, {span:?} m, is less than a pixel of {pixel_size:?} m");
        return Err(Error::usage(message));
    }
    if pixels > MAX_SIDE {
        let what = format!("{what} of the mosaic in pixels");
        return Err(Error::Limit { what, limit: MAX_SIDE as u64, found: pixels as u64 });
    }
    Ok(pixels as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mosaic(pixel_size: f64, extent: [f64; 4]) -> Result<Mosaic> {
        Mosaic::new(Plane::top(), pixel_size, extent, [f64::NEG_INFINITY, f64::INFINITY])
    }

    #[test]
    fn an_extent_of_whole_pixels_gets_no_pixel_more_for_rounding() {
        let m = mosaic(0.01, [0.0, 0.0, 0.3, 0.7]).unwrap();
        assert_eq!(m.size, Size::new(30, 70));
        let m = mosaic(0.01, [500_000.0, 4_000_000.0, 500_000.301, 4_000_000.75]).unwrap();
        assert_eq!(m.size, Size::new(31, 75));
    }

    #[test]
    fn mosaics_without_pixels_or_with_too_many_are_refused() {
        assert!(matches!(mosaic(0.01, [0.0, 0.0, 1e9, 1.0]), Err(Error::Limit { .. })));
        assert!(matches!(mosaic(1e-300, [0.0, 0.0, 1e9, 1.0]), Err(Error::Limit { .. })));
        assert!(matches!(mosaic(1.0, [0.0, 0.0, 1e-10, 1.0]), Err(Error::Usage(_))));
        assert!(matches!(mosaic(1.0, [0.0, 0.0, 0.0, 1.0]), Err(Error::Usage(_))));
        assert!(matches!(mosaic(1.0, [0.0, 0.0, f64::NAN, 1.0]), Err(Error::Usage(_))));
        assert!(matches!(mosaic(0.0, [0.0, 0.0, 1.0, 1.0]), Err(Error::Usage(_))));
        let flat = Mosaic::new(Plane::top(), 1.0, [0.0, 0.0, 1.0, 1.0], [2.0, 2.0]);
        assert!(matches!(flat, Err(Error::Usage(_))));
        let m = mosaic(1.0, [0.0, 0.0, f64::from(i32::MAX), 1.0]).unwrap();
        assert_eq!(m.size.width, 2_147_483_647);
    }
}
