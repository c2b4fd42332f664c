//! What the mosaic covers.

use glam::DVec2;

use super::partitions::SlabFrame;
use super::{Partitions, Slab};
use crate::frame::{Block, Mosaic};
use crate::geom::{Bounds2, Bounds3, Size};
use crate::{Error, Result};

/// Surface that reaches less than this into a pixel, in pixels, does not make the extent grow: it comes from
/// rounding, and is far from the pixel's centre, which alone counts.
const SNAP_PX: f64 = 1e-3;

/// A mosaic of more than this many pixels for each pixel of the photos is likely a mistyped pixel size.
const MOST_PER_PHOTO_PIXEL: u64 = 10;

/// The extent `[u_min, v_min, u_max, v_max]`, metres, that holds the part of every face that lies in the slab, snapped
/// outward to whole multiples of `pixel_size` from the frame's origin.
///
/// A face that crosses the slab counts with the part inside. What reaches less than a thousandth of a pixel into the
/// next one is left out.
///
/// # Errors
/// [`Error::Usage`] if no face lies in the slab; errors of reading the mesh.
pub fn default_extent(mesh: &impl Partitions, slab: Slab<'_>, pixel_size: f64) -> Result<[f64; 4]> {
    let frame = SlabFrame::new(slab, mesh.origin());
    let mut found = Bounds2::EMPTY;
    for k in 0..mesh.count() {
        // A partition that cannot widen the bounds need not be read.
        let outer = frame.box_bounds(&mesh.bounds(k));
        if outer.is_empty() || found.union(outer) == found {
            continue;
        }
        mesh.visit(k, &mut |block| {
            for t in 0..block.triangles.len() {
                found = found.union(frame.face_bounds(block.corners(t)));
            }
        })?;
    }
    if found.is_empty() { Err(apart(mesh, &frame)) } else { Ok(snap(found, pixel_size)) }
}

/// Checks that at least one face has a part in the slab and over `extent` (as [`default_extent`] gives it).
///
/// # Errors
/// [`Error::Usage`] if there is none; errors of reading the mesh.
pub fn check_meeting(mesh: &impl Partitions, slab: Slab<'_>, extent: [f64; 4]) -> Result<()> {
    let frame = SlabFrame::new(slab, mesh.origin());
    let [u0, v0, u1, v1] = extent;
    let extent = Bounds2 { min: DVec2::new(u0, v0), max: DVec2::new(u1, v1) };
    let meets = |b: Bounds2| !b.is_empty() && b.intersects(&extent);
    let mut met = false;
    for k in 0..mesh.count() {
        if meets(frame.box_bounds(&mesh.bounds(k))) {
            mesh.visit(k, &mut |block| {
                met |=
                    (0..block.triangles.len()).any(|t| meets(frame.face_bounds(block.corners(t))));
            })?;
        }
        if met {
            return Ok(());
        }
    }
    Err(apart(mesh, &frame))
}

/// Checks that some part of the mesh may be shown, by the bounds of its partitions.
///
/// # Errors
/// [`Error::Usage`] if there is none.
pub fn check_shown(mesh: &impl Partitions, mosaic: &Mosaic) -> Result<()> {
    let (local, whole) = (mosaic.local(mesh.origin()), Block::outline(mosaic.size.rect()));
    if (0..mesh.count()).any(|k| whole.may_be_shown(&local, &mesh.bounds(k))) {
        return Ok(());
    }
    Err(Error::usage(
        "mesh and frame do not meet: no part of the mesh lies where the frame looks; check the frame, --extent and \
         --elevation",
    ))
}

/// Refuses a mosaic of more than ten times the photos' pixels in all, unless `force`.
///
/// # Errors
/// [`Error::Usage`] with both figures.
pub fn check_pixels(mosaic: Size, photo_pixels: u64, force: bool) -> Result<()> {
    if force || mosaic.area() <= photo_pixels.saturating_mul(MOST_PER_PHOTO_PIXEL) {
        return Ok(());
    }
    Err(Error::usage(format!(
        "the mosaic would have {} × {} = {} pixels, more than {MOST_PER_PHOTO_PIXEL} times the {photo_pixels} pixels of \
         all photos: check --pixel-size and --extent, or give --force",
        mosaic.width,
        mosaic.height,
        mosaic.area()
    )))
}

/// Outward to whole pixels from the frame's origin, at least one.
fn snap(b: Bounds2, pixel_size: f64) -> [f64; 4] {
    let low = (b.min / pixel_size + SNAP_PX).floor();
    let high = (b.max / pixel_size - SNAP_PX).ceil().max(low + 1.0);
    let (low, high) = (low * pixel_size, high * pixel_size);
    [low.x, low.y, high.x, high.y]
}

/// The error of a mesh that is not in the picture, with where it is.
fn apart(mesh: &impl Partitions, frame: &SlabFrame) -> Error {
    let boxes = (0..mesh.count()).map(|k| frame.project_box(&mesh.bounds(k)));
    let all = boxes.fold(Bounds3::EMPTY, Bounds3::union);
    if all.is_empty() {
        return Error::usage("mesh and frame do not meet: the mesh has no face");
    }
    Error::usage(format!(
        "mesh and frame do not meet: the mesh lies within u {:.3} to {:.3}, v {:.3} to {:.3}, elevation {:.3} to {:.3} m of the \
         frame; check the frame, --extent and --elevation",
        all.min.x, all.max.x, all.min.y, all.max.y, all.min.z, all.max.z
    ))
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "extents are whole multiples of the pixel size, exactly")]
mod tests {
    use glam::DVec3;

    use super::super::Base;

    use super::super::partitions::soup::Soup;
    use super::*;
    use crate::frame::Plane;

    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    fn top(plane: &Plane, elevation: [f64; 2]) -> Slab<'_> {
        Slab { base: Base::Plane(plane), elevation }
    }

    /// A ramp: z = x from 0 to 10, y from 0 to 4; local origin (100, 200, 0).
    fn ramp() -> Soup {
        let p = |x: f64, y: f64| DVec3::new(x, y, x);
        let faces =
            [[p(0.0, 0.0), p(10.0, 0.0), p(10.0, 4.0)], [p(0.0, 0.0), p(10.0, 4.0), p(0.0, 4.0)]];
        Soup::new(DVec3::new(100.0, 200.0, 0.0), &faces, 1)
    }

    #[test]
    fn the_extent_is_snapped_outward_from_the_frames_origin() {
        let plane = Plane::top();
        let e = default_extent(&ramp(), top(&plane, ALL), 0.75).unwrap();
        // 100 / 0.75 = 133.3 → 133; 110 / 0.75 = 146.7 → 147; 200 / 0.75 = 266.7 → 266; 204 / 0.75 = 272.
        assert_eq!(e, [133.0 * 0.75, 266.0 * 0.75, 147.0 * 0.75, 272.0 * 0.75]);
    }

    #[test]
    fn a_bound_on_the_grid_gets_no_pixel_for_rounding() {
        // 100 / 0.1 and 110 / 0.1 are not exact, nor are the coordinates of a turned plane.
        let e = default_extent(&ramp(), top(&Plane::top(), ALL), 0.1).unwrap();
        assert_eq!(e, [1000.0 * 0.1, 2000.0 * 0.1, 1100.0 * 0.1, 2040.0 * 0.1]);
        let (s, c) = (0.6, 0.8);
        let turned = Plane::new([100.0, 200.0, 0.0], [c, s, 0.0], [-s, c, 0.0]).unwrap();
        let soup = {
            let p = |u: f64, v: f64| DVec3::new(c * u - s * v, s * u + c * v, 0.0);
            Soup::new(turned.origin, &[[p(0.0, 0.0), p(7.0, 0.0), p(0.0, 3.0)]], 1)
        };
        let e = default_extent(&soup, top(&turned, ALL), 0.1).unwrap();
        assert_eq!(e, [0.0, 0.0, 70.0 * 0.1, 30.0 * 0.1]);
    }

    #[test]
    fn a_face_that_crosses_the_slab_counts_with_the_part_inside() {
        let plane = Plane::top();
        let e = default_extent(&ramp(), top(&plane, [2.25, 5.5]), 1.0).unwrap();
        assert_eq!(e, [102.0, 200.0, 106.0, 204.0]);
        // No vertex of the two faces is in the slab, nor below it.
        let e = default_extent(&ramp(), top(&plane, [3.0, f64::INFINITY]), 1.0).unwrap();
        assert_eq!(e, [103.0, 200.0, 110.0, 204.0]);
    }

    #[test]
    fn an_upright_face_still_gets_a_pixel() {
        let wall = [[DVec3::ZERO, DVec3::new(0.0, 5.0, 0.0), DVec3::new(0.0, 0.0, 5.0)]];
        let soup = Soup::new(DVec3::ZERO, &wall, 1);
        let e = default_extent(&soup, top(&Plane::top(), ALL), 1.0).unwrap();
        assert_eq!(e, [0.0, 0.0, 1.0, 5.0]);
    }

    #[test]
    fn a_mesh_outside_the_slab_does_not_meet_the_frame_and_the_message_says_where_it_is() {
        let plane = Plane::top();
        let e = default_extent(&ramp(), top(&plane, [10.5, 20.0]), 1.0).unwrap_err();
        assert_eq!(e.exit_code(), 2);
        let text = e.to_string();
        assert!(text.starts_with("mesh and frame do not meet"), "{text}");
        assert!(
            text.contains("u 100.000 to 110.000") && text.contains("elevation 0.000 to 10.000"),
            "{text}"
        );
        let none = Soup::new(DVec3::ZERO, &[], 1);
        let text = default_extent(&none, top(&plane, ALL), 1.0).unwrap_err().to_string();
        assert!(text.contains("no face"), "{text}");
    }

    #[test]
    fn a_given_extent_must_meet_a_face_within_the_slab() {
        let plane = Plane::top();
        let meets = |extent, slab| check_meeting(&ramp(), top(&plane, slab), extent);
        assert!(meets([105.0, 203.0, 120.0, 220.0], ALL).is_ok());
        assert!(meets([110.5, 200.0, 120.0, 204.0], ALL).is_err());
        // Over the extent the ramp is higher than the slab.
        assert!(meets([105.0, 203.0, 120.0, 220.0], [0.0, 4.0]).is_err());
        assert!(meets([105.0, 203.0, 120.0, 220.0], [0.0, 5.5]).is_ok());
    }

    #[test]
    fn how_the_mesh_is_cut_into_partitions_does_not_matter() {
        let p = |k: u32| {
            let a = f64::from(k) * 0.7;
            DVec3::new(a.sin() * f64::from(k), a.cos() * f64::from(k), f64::from(k % 7))
        };
        let faces: Vec<_> = (0..200).map(|k| [p(k), p(k + 3), p(k + 11)]).collect();
        let plane = Plane::top();
        let of = |size| {
            let soup = Soup::new(DVec3::new(5e5, 4e6, 0.0), &faces, size);
            default_extent(&soup, top(&plane, [1.5, 4.5]), 0.01).unwrap()
        };
        assert_eq!(of(200), of(1));
        assert_eq!(of(200), of(13));
    }

    #[test]
    fn more_than_ten_times_the_photos_pixels_need_force() {
        let size = Size::new(100, 101);
        assert!(check_pixels(size, 1010, false).is_ok());
        let text = check_pixels(size, 1009, false).unwrap_err().to_string();
        assert!(text.contains("10100 pixels") && text.contains("1009 pixels"), "{text}");
        assert!(check_pixels(size, 1009, true).is_ok());
        assert!(check_pixels(size, u64::MAX, false).is_ok());
    }
}
