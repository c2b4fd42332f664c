//! The mosaic's grid.

use super::super::config::Config;
use super::super::console;
use crate::Result;
use crate::camera::Photo;
use crate::frame::Mosaic;
use crate::plan::{Slab, check_meeting, check_pixels, default_extent, default_pixel_size};
use crate::store::mesh::MeshStore;

/// The mosaic's grid: what the frame and the flags say, and the defaults for what they do not.
pub(super) fn grid(config: &Config, mesh: &MeshStore, photos: &[Photo]) -> Result<Mosaic> {
    let plane = &config.plane;
    let elevation = plane.elevation.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    let slab = Slab { plane, elevation };
    let pixel_size = if let Some(size) = plane.pixel_size {
        size
    } else {
        let size = default_pixel_size(mesh, slab, plane.extent, photos)?;
        console::note(&format!(
            "groundel: --pixel-size {size} (the median footprint of a photo pixel)"
        ));
        size
    };
    let extent = match plane.extent {
        Some(extent) => {
            check_meeting(mesh, slab, extent)?;
            extent
        }
        None => default_extent(mesh, slab, pixel_size)?,
    };
    let mosaic = Mosaic::new(plane.clone(), pixel_size, extent, elevation)?;
    let photo_pixels = photos.iter().map(|p| p.lens.size().area()).sum();
    check_pixels(mosaic.size, photo_pixels, config.force)?;
    Ok(mosaic)
}
