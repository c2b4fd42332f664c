//! Markers with coordinates: the tie points of such a document.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use crate::Result;
use crate::input::cameras::{MOST_TIES, Thinned, Tie};
use crate::input::xml::Node;

/// Where photos saw the markers whose coordinates are given; `photos` are their numbers by camera id.
///
/// A marker's `reference` is in the system of the chunk; one that is not enabled was not believed by its owner and is passed
/// over. Its `location` in a frame is in pixels from the corner of the photo.
///
/// # Errors
/// [`crate::Error::Corrupt`] with the line for numbers that are none.
pub(super) fn ties(chunk: Node, photos: &BTreeMap<&str, usize>) -> Result<Vec<Tie>> {
    // Without a transform the chunk has a scale of its own, and coordinates are in another system.
    if chunk.child("transform").is_none() && chunk.child("components").is_none() {
        return Ok(Vec::new());
    }
    let mut points = BTreeMap::new();
    for marker in chunk.child("markers").iter().flat_map(|all| all.children_named("marker")) {
        let Some(reference) = marker.child("reference").filter(|r| is_enabled(*r)) else {
            continue;
        };
        if let Some(point) = numbers(reference, ["x", "y", "z"])? {
            points.insert(marker.needed_attribute("id")?, DVec3::from(point));
        }
    }
    let mut ties = Thinned::new(MOST_TIES);
    let frames = chunk.child("frames");
    let frames = frames.iter().flat_map(|all| all.children_named("frame"));
    for marker in frames.filter_map(|f| f.child("markers")).flat_map(|m| m.children_named("marker"))
    {
        let Some(&point_ground) = points.get(marker.needed_attribute("marker_id")?) else {
            continue;
        };
        for location in marker.children_named("location").filter(|l| is_enabled(*l)) {
            let photo = photos.get(location.needed_attribute("camera_id")?);
            if let (Some(&photo), Some(at)) = (photo, numbers(location, ["x", "y"])?) {
                ties.offer(|| Tie { photo, position_px: DVec2::from(at), point_ground });
            }
        }
    }
    Ok(ties.into_items())
}

/// Whether an element is not switched off.
fn is_enabled(node: Node) -> bool {
    let is_off = |name: &str| matches!(node.attribute(name), Some("0" | "false"));
    !is_off("enabled") && !is_off("valid")
}

/// Attributes as finite numbers; `None` if one is missing.
fn numbers<const N: usize>(node: Node, names: [&str; N]) -> Result<Option<[f64; N]>> {
    let mut numbers = [0.0; N];
    for (number, name) in numbers.iter_mut().zip(names) {
        let Some(text) = node.attribute(name) else { return Ok(None) };
        [*number] = node.numbers_in(text)?;
    }
    Ok(Some(numbers))
}
