//! The key of a TIN: what it was made from.

use glam::DVec3;
use xxhash_rust::xxh3::Xxh3;

use super::super::mesh::add_file;
use super::plane::TinPlane;
use crate::geom::PointSource;
use crate::{Error, Result};

/// Changes with whatever changes the triangles of the same points.
const VERSION: u32 = 1;

/// The key, as 32 hexadecimal digits, of the TIN of these clouds; `max_edge` is as it was asked for. It changes as the key
/// of a mesh store does.
pub(super) fn key(
    sources: &[&dyn PointSource],
    shift: DVec3,
    plane: &TinPlane,
    max_edge: Option<f64>,
) -> Result<String> {
    let mut hash = Xxh3::new();
    hash.update(&VERSION.to_le_bytes());
    hash.update(&(sources.len() as u64).to_le_bytes());
    for source in sources {
        add_file(&mut hash, source.path()).map_err(|e| Error::io(source.path(), e))?;
    }
    let edge = max_edge.unwrap_or(-1.0);
    for number in shift.to_array().into_iter().chain(plane.numbers()).chain([edge]) {
        hash.update(&number.to_le_bytes());
    }
    Ok(format!("{:032x}", hash.digest128()))
}
