//! The mosaic's grid.

use glam::DVec3;

use super::super::config::Config;
use super::super::console;
use super::super::frame_choice::{Fit, FrameChoice};
use crate::camera::{CameraSet, Photo};
use crate::frame::{CentralView, Cylinder, FrameSpec, Mosaic, Orientation, Perspective, Plane};
use crate::plan::{
    Base, Slab, check_meeting, check_pixels, check_shown, default_arc, default_extent,
    default_pixel_size, fit_plane,
};
use crate::store::mesh::MeshStore;
use crate::{Error, Result};

/// All elevations.
const UNBOUNDED: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// The mosaic's grid: what the frame and the flags say, and the defaults for what they do not.
pub(super) fn grid(
    config: &Config,
    mesh: &MeshStore,
    cameras: &CameraSet,
    photos: &[Photo],
) -> Result<Mosaic> {
    let mosaic = match &config.frame {
        FrameChoice::Stated(FrameSpec::Plane(plane)) => on_plane(plane, mesh, photos)?,
        FrameChoice::Stated(FrameSpec::Cylinder(cylinder)) => on_cylinder(cylinder, mesh, photos)?,
        FrameChoice::Stated(FrameSpec::Perspective(view)) => of_view(view, cameras)?,
        FrameChoice::Fit(fit) => on_plane(&fitted(fit, mesh, photos)?, mesh, photos)?,
    };
    if mosaic.plane().is_none() {
        check_shown(mesh, &mosaic)?;
    }
    let photo_pixels = photos.iter().map(|p| p.lens.size().area()).sum();
    check_pixels(mosaic.size, photo_pixels, config.force)?;
    Ok(mosaic)
}

/// The plane that the photos look at, told to the user.
fn fitted(fit: &Fit, mesh: &MeshStore, photos: &[Photo]) -> Result<Plane> {
    let plane = fit_plane(mesh, photos, DVec3::from(fit.up))?;
    let [origin, u, v] = [plane.origin, plane.u, plane.v].map(|v| v.to_array());
    console::note(&format!(
        "groundel: --view fit chose the plane with origin = {origin:?}, u_axis = {u:?}, v_axis = {v:?}"
    ));
    let is_upside_down = |p: &&Photo| p.pose.rotation.row(1).dot(plane.v) > 0.0;
    let upside_down = photos.iter().filter(is_upside_down).count();
    if 2 * upside_down > photos.len() {
        let other = v.map(|v| 0.0 - v);
        console::note(&format!(
            "warning: {upside_down} of {} photos stand upside down in this view: is {other:?} up (--up)?",
            photos.len()
        ));
    }
    let &Fit { pixel_size, extent, elevation, .. } = fit;
    Ok(Plane { pixel_size, extent, elevation, ..plane })
}

fn on_plane(plane: &Plane, mesh: &MeshStore, photos: &[Photo]) -> Result<Mosaic> {
    let elevation = plane.elevation.unwrap_or(UNBOUNDED);
    let slab = Slab { base: Base::Plane(plane), elevation };
    let pixel_size = pixel_size(plane.pixel_size, slab, plane.extent, mesh, photos)?;
    let extent = match plane.extent {
        Some(extent) => {
            check_meeting(mesh, slab, extent)?;
            extent
        }
        None => default_extent(mesh, slab, pixel_size)?,
    };
    Mosaic::new(plane.clone(), pixel_size, extent, elevation)
}

fn on_cylinder(cylinder: &Cylinder, mesh: &MeshStore, photos: &[Photo]) -> Result<Mosaic> {
    let elevation = cylinder.elevation.unwrap_or(UNBOUNDED);
    let slab = Slab { base: Base::Cylinder(cylinder), elevation };
    let pixel_size = pixel_size(cylinder.pixel_size, slab, cylinder.extent, mesh, photos)?;
    let extent = match cylinder.extent {
        Some(extent) => extent,
        None => default_arc(mesh, cylinder, elevation, pixel_size)?,
    };
    Mosaic::new(cylinder.clone(), pixel_size, extent, elevation)
}

/// The pixel size that is stated, or that which the photos can fill.
fn pixel_size(
    stated: Option<f64>,
    slab: Slab<'_>,
    extent: Option<[f64; 4]>,
    mesh: &MeshStore,
    photos: &[Photo],
) -> Result<f64> {
    if let Some(size) = stated {
        return Ok(size);
    }
    let size = default_pixel_size(mesh, slab, extent, photos)?;
    console::note(&format!(
        "groundel: --pixel-size {size} (the median footprint of a photo pixel)"
    ));
    Ok(size)
}

/// The view of a photo of the whole camera set, or of a camera of its own.
pub(in super::super) fn of_view(view: &Perspective, cameras: &CameraSet) -> Result<Mosaic> {
    let stated = view.orientation.clone();
    let (lens, pose) = match &view.orientation {
        Orientation::OfPhoto { name, distorted } => {
            let photo = cameras.find(name).ok_or_else(|| no_photo(name, cameras))?;
            let lens = if *distorted { photo.lens } else { photo.lens.without_distortion() };
            (lens, photo.pose)
        }
        Orientation::Given(camera) => (camera.lens, camera.pose),
    };
    Mosaic::perspective(CentralView { stated, lens, pose }, view.elevation.unwrap_or(UNBOUNDED))
}

fn no_photo(name: &str, cameras: &CameraSet) -> Error {
    match cameras.left_out.iter().find(|photo| photo.name == name) {
        Some(photo) => {
            Error::usage(format!("the frame's photo {name:?} cannot be drawn: {}", photo.reason))
        }
        None => Error::usage(format!(
            "the frame's photo {name:?} is not among the {} of the camera set",
            cameras.names.len()
        )),
    }
}
