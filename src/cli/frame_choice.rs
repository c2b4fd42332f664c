//! What the mosaic is drawn on, from a frame file, the project's `[frame]` or a view, and the flags over it.

use super::args::OrthoArgs;
use super::settings::View;
use crate::frame::{Cylinder, FrameSpec, Perspective, Plane};
use crate::input::read_frame;
use crate::{Error, Result};

/// What the mosaic is to be drawn on.
#[derive(Clone, Debug, PartialEq)]
pub enum FrameChoice {
    /// A frame; flags for pixel size, extent, slab and reference system stand in it already.
    Stated(FrameSpec),
    /// The upright plane that the photos look at.
    Fit(Fit),
}

/// What is asked of the plane that is to be found.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The direction that is up.
    pub up: [f64; 3],
    /// Side of a pixel, metres.
    pub pixel_size: Option<f64>,
    /// `[u_min, v_min, u_max, v_max]`, metres.
    pub extent: Option<[f64; 4]>,
    /// `[min, max]` of elevation, metres.
    pub elevation: Option<[f64; 2]>,
}

/// The frame that `args`, merged with the project file, ask for; `frame` is the project's `[frame]`.
///
/// # Errors
/// [`Error::Usage`] if there is no frame or flags contradict it, and what reading a frame file gives.
pub(super) fn frame(args: &OrthoArgs, frame: Option<FrameSpec>) -> Result<FrameChoice> {
    let choice = chosen(args, frame)?;
    let what = match &choice {
        FrameChoice::Stated(FrameSpec::Plane(_)) => return Ok(choice),
        FrameChoice::Stated(FrameSpec::Cylinder(_)) => "a development of a cylinder",
        FrameChoice::Stated(FrameSpec::Perspective(_)) => "a perspective view",
        FrameChoice::Fit(_) => "--view fit",
    };
    let what = format!("{what}: points are meshed over a plane that is stated, such as --view top");
    refuse(!args.points.is_empty(), "--points", &what)?;
    Ok(choice)
}

fn chosen(args: &OrthoArgs, frame: Option<FrameSpec>) -> Result<FrameChoice> {
    if args.up.is_some() && args.view != Some(View::Fit) {
        return Err(Error::usage("--up goes with --view fit only (in a project file: `up`)"));
    }
    if args.view == Some(View::Fit) {
        if args.crs.is_some() {
            return Err(Error::usage("--crs does not go with --view fit"));
        }
        return Ok(FrameChoice::Fit(Fit {
            up: args.up.unwrap_or([0.0, 0.0, 1.0]),
            pixel_size: args.pixel_size,
            extent: args.extent,
            elevation: args.elevation,
        }));
    }
    let frame = match (&args.frame, args.view, args.plane_points, frame) {
        (Some(file), ..) => read_frame(file)?,
        (None, Some(_), ..) => FrameSpec::Plane(Plane::top()),
        (None, None, Some(points), _) => {
            let plane = Plane::through(points);
            FrameSpec::Plane(plane.map_err(|e| Error::usage(format!("--plane-points: {e}")))?)
        }
        (None, None, None, Some(frame)) => frame,
        (None, None, None, None) => {
            return Err(Error::usage(
                "a frame is missing: give --frame FILE.toml or --view top (in a project file: `[frame]` or `view`)",
            ));
        }
    };
    overridden(frame, args).map(FrameChoice::Stated)
}

/// `frame` with what the flags say about it.
fn overridden(frame: FrameSpec, args: &OrthoArgs) -> Result<FrameSpec> {
    match frame {
        FrameSpec::Plane(plane) => overridden_plane(plane, args).map(FrameSpec::Plane),
        FrameSpec::Cylinder(cylinder) => {
            refuse(args.crs.is_some(), "--crs", "a development of a cylinder")?;
            Ok(FrameSpec::Cylinder(Cylinder {
                pixel_size: args.pixel_size.or(cylinder.pixel_size),
                extent: args.extent.or(cylinder.extent),
                elevation: args.elevation.or(cylinder.elevation),
                ..cylinder
            }))
        }
        FrameSpec::Perspective(view) => {
            let what = "a perspective view, whose camera says it all";
            refuse(args.crs.is_some(), "--crs", what)?;
            refuse(args.scale.is_some(), "--scale", what)?;
            refuse(args.pixel_size.is_some(), "--pixel-size", what)?;
            refuse(args.extent.is_some(), "--extent", what)?;
            let elevation = args.elevation.or(view.elevation);
            Ok(FrameSpec::Perspective(Perspective { elevation, ..view }))
        }
    }
}

fn refuse(is_given: bool, flag: &str, what: &str) -> Result<()> {
    if is_given { Err(Error::usage(format!("{flag} does not go with {what}"))) } else { Ok(()) }
}

fn overridden_plane(plane: Plane, args: &OrthoArgs) -> Result<Plane> {
    let plane = Plane {
        pixel_size: args.pixel_size.or(plane.pixel_size),
        extent: args.extent.or(plane.extent),
        elevation: args.elevation.or(plane.elevation),
        ..plane
    };
    match &args.crs {
        Some(crs) => plane.with_crs(crs).map_err(|error| Error::usage(format!("--crs: {error}"))),
        None => Ok(plane),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameTable;

    /// The plane that is asked for.
    fn plane(args: &OrthoArgs, spec: Option<FrameSpec>) -> Result<Plane> {
        match frame(args, spec)? {
            FrameChoice::Stated(FrameSpec::Plane(plane)) => Ok(plane),
            other => unreachable!("{other:?}"),
        }
    }

    fn spec(text: &str) -> FrameSpec {
        toml::from_str::<FrameTable>(text).unwrap().check().unwrap()
    }

    fn facade() -> FrameSpec {
        spec(
            "kind = \"plane\"\norigin = [0, 0, 5]\nu_axis = [1, 0, 0]\nv_axis = [0, 0, 1]\n\
             pixel_size = 0.5\nelevation = [-inf, 2]",
        )
    }

    #[test]
    fn flags_override_the_frame() {
        let args = OrthoArgs {
            pixel_size: Some(0.1),
            extent: Some([0.0, 0.0, 1.0, 1.0]),
            ..Default::default()
        };
        let plane = plane(&args, Some(facade())).unwrap();
        assert_eq!((plane.pixel_size, plane.extent), (Some(0.1), Some([0.0, 0.0, 1.0, 1.0])));
        assert_eq!(plane.elevation, Some([f64::NEG_INFINITY, 2.0]));
    }

    #[test]
    fn a_view_flag_overrides_the_projects_frame() {
        let args = OrthoArgs {
            view: Some(View::Top),
            crs: Some("EPSG:32634".into()),
            ..Default::default()
        };
        let found = plane(&args, Some(facade())).unwrap();
        assert_eq!((found.origin.z, found.epsg()), (0.0, Some(32634)));
    }

    #[test]
    fn a_reference_system_on_a_facade_is_a_usage_error() {
        let args = OrthoArgs { crs: Some("EPSG:32634".into()), ..Default::default() };
        let error = plane(&args, Some(facade())).unwrap_err();
        assert!(error.to_string().starts_with("--crs: v_axis: expected"), "{error}");
    }

    #[test]
    fn no_frame_is_an_error_and_up_goes_with_a_fit_alone() {
        let none = plane(&OrthoArgs::default(), None).unwrap_err();
        assert!(none.to_string().contains("--view top"), "{none}");
        let fit =
            OrthoArgs { view: Some(View::Fit), up: Some([0.0, 1.0, 0.0]), ..Default::default() };
        let Ok(FrameChoice::Fit(found)) = frame(&fit, Some(facade())) else { panic!("a fit") };
        assert_eq!(found.up.map(f64::to_bits), [0.0_f64, 1.0, 0.0].map(f64::to_bits));
        let up =
            OrthoArgs { up: Some([0.0, 0.0, 1.0]), view: Some(View::Top), ..Default::default() };
        assert!(matches!(plane(&up, None), Err(Error::Usage(_))));
    }

    #[test]
    fn flags_go_into_every_kind_of_frame_or_are_refused() {
        let cylinder = spec(
            "kind = \"cylinder\"\norigin = [0, 0, 0]\naxis = [0, 0, 1]\nzero = [1, 0, 0]\nradius = 5.0\n\
             facing = \"outside\"",
        );
        let size = OrthoArgs { pixel_size: Some(0.5), ..Default::default() };
        let found = frame(&size, Some(cylinder)).unwrap();
        let FrameChoice::Stated(FrameSpec::Cylinder(found)) = found else { panic!("{found:?}") };
        assert_eq!(found.pixel_size, Some(0.5));
        let view = spec("kind = \"perspective\"\nphoto = \"a.jpg\"");
        let error = frame(&size, Some(view)).unwrap_err();
        assert!(error.to_string().contains("--pixel-size does not go with"), "{error}");
    }
}
