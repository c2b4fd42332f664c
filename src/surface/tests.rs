use glam::DVec3;
use proptest::prelude::*;

use super::{SurfaceBuilder, SurfaceTile};
use crate::frame::{LocalMosaic, Mosaic, Plane};
use crate::geom::{Bounds3, FaceBlock, FaceId, PixelRect};

/// A top view of 8 × 8 pixels of 1 m; column x, row y is (x, 8 − y).
fn mosaic(slab: [f64; 2]) -> LocalMosaic {
    Mosaic::new(Plane::top(), 1.0, [0.0, 0.0, 8.0, 8.0], slab).unwrap().local(DVec3::ZERO)
}

const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

fn render(mosaic: &LocalMosaic, rect: PixelRect, faces: &[([DVec3; 3], u32)]) -> SurfaceTile {
    let mut builder = SurfaceBuilder::default();
    builder.start(mosaic, rect);
    for (corners, id) in faces {
        let block = FaceBlock {
            positions: corners,
            triangles: &[[0, 1, 2]],
            ids: &[FaceId(*id)],
            bounds: Bounds3::of(*corners),
        };
        builder.add(mosaic, &block);
    }
    builder.finish(mosaic).clone()
}

fn ids(tile: &SurfaceTile) -> Vec<Option<u32>> {
    (0..tile.rect.area()).map(|k| tile.face_at(k).map(|f| f.id.0)).collect()
}

/// A level triangle that covers the whole mosaic.
fn sheet(z: f64) -> [DVec3; 3] {
    [DVec3::new(-1.0, -1.0, z), DVec3::new(20.0, -1.0, z), DVec3::new(-1.0, 20.0, z)]
}

#[test]
fn the_greatest_elevation_wins_whatever_the_order() {
    let (m, rect) = (mosaic(ALL), PixelRect::new(0, 0, 8, 8));
    let (low, high) = ((sheet(1.0), 0), (sheet(2.0), 1));
    for faces in [[low, high], [high, low]] {
        let tile = render(&m, rect, &faces);
        assert!(tile.elevations.iter().all(|&e| (e - 2.0).abs() < 1e-12));
        assert!(ids(&tile).iter().all(|&id| id == Some(1)));
        assert_eq!(tile.faces.len(), 1);
        assert_eq!(tile.vertices.len(), 3);
    }
}

#[test]
fn equal_elevations_go_to_the_lowest_id_whatever_the_order() {
    let (m, rect) = (mosaic(ALL), PixelRect::new(0, 0, 8, 8));
    for faces in [[(sheet(1.0), 7), (sheet(1.0), 3)], [(sheet(1.0), 3), (sheet(1.0), 7)]] {
        assert!(ids(&render(&m, rect, &faces)).iter().all(|&id| id == Some(3)));
    }
}

#[test]
fn a_duplicate_in_any_corner_order_never_wins_over_the_lowest_id() {
    let (m, rect) = (mosaic(ALL), PixelRect::new(0, 0, 8, 8));
    let [a, b, c] =
        [DVec3::new(-1.1, -1.3, 0.7), DVec3::new(20.3, -1.7, 3.1), DVec3::new(-1.9, 20.7, 5.3)];
    for twin in [[b, c, a], [c, a, b], [a, c, b], [c, b, a], [b, a, c]] {
        let tile = render(&m, rect, &[(twin, 9), ([a, b, c], 4)]);
        assert!(ids(&tile).iter().all(|&id| id == Some(4)));
        assert!(tile.faces[0].normal.z > 0.0);
    }
}

#[test]
fn a_slab_cuts_a_face_at_the_point_not_as_a_whole() {
    // Elevation equals x.
    let slope =
        [DVec3::new(-1.0, -9.0, -1.0), DVec3::new(20.0, -9.0, 20.0), DVec3::new(-1.0, 40.0, -1.0)];
    let tile = render(&mosaic([2.0, 5.0]), PixelRect::new(0, 0, 8, 8), &[(slope, 0)]);
    for (k, elevation) in tile.elevations.iter().enumerate() {
        let x = (k % 8) as f64 + 0.5;
        if (2.0..=5.0).contains(&x) {
            assert!((elevation - x).abs() < 1e-12);
        } else {
            assert!(elevation.is_nan());
        }
    }
}

#[test]
fn the_normal_points_to_the_viewer_for_either_winding_and_points_lie_on_the_face() {
    let (m, rect) = (mosaic(ALL), PixelRect::new(0, 0, 8, 8));
    let [a, b, c] = sheet(3.0);
    for corners in [[a, b, c], [a, c, b]] {
        let tile = render(&m, rect, &[(corners, 0)]);
        assert!(tile.faces[0].normal.z > 0.0);
        assert!((tile.points.at(9) - DVec3::new(1.5, 6.5, 3.0)).length() < 1e-12);
    }
}

#[test]
fn a_pixel_that_is_not_kept_has_no_surface_and_a_face_shown_nowhere_else_is_forgotten() {
    let (m, rect) = (mosaic(ALL), PixelRect::new(0, 0, 8, 8));
    let mut builder = SurfaceBuilder::default();
    builder.start(&m, rect);
    // The second covers the pixels whose column and row are small alone.
    let small = [DVec3::new(-1.0, 9.0, 3.0), DVec3::new(3.0, 9.0, 3.0), DVec3::new(-1.0, 5.0, 3.0)];
    for (corners, id) in [(sheet(1.0), 0), (small, 1)] {
        let block = FaceBlock {
            positions: &corners,
            triangles: &[[0, 1, 2]],
            ids: &[FaceId(id)],
            bounds: Bounds3::of(corners),
        };
        builder.add(&m, &block);
    }
    builder.retain(|k| k >= 32);
    let tile = builder.finish(&m);
    assert_eq!((tile.faces.len(), tile.vertices.len()), (1, 3));
    for (k, id) in ids(tile).into_iter().enumerate() {
        assert_eq!(id, (k >= 32).then_some(0));
        assert_eq!(tile.points.at(k).is_nan(), k < 32);
    }
}

proptest! {
    #[test]
    fn a_pixel_alone_equals_the_same_pixel_of_the_whole(
        corners in prop::collection::vec(prop::array::uniform9(-4.0..12.0_f64), 1..30),
    ) {
        let faces: Vec<_> = corners.iter().zip(0..).map(|(c, id)| {
            ([DVec3::from_slice(&c[0..]), DVec3::from_slice(&c[3..]), DVec3::from_slice(&c[6..])], id)
        }).collect();
        let m = mosaic([-1.0, 9.0]);
        let whole = render(&m, PixelRect::new(0, 0, 8, 8), &faces);
        for k in 0..64 {
            let (x, y) = (k % 8, k / 8);
            let one = render(&m, PixelRect::new(x, y, x + 1, y + 1), &faces);
            let k = usize::try_from(k).unwrap();
            prop_assert_eq!(one.elevations[0].to_bits(), whole.elevations[k].to_bits());
            prop_assert_eq!(ids(&one)[0], ids(&whole)[k]);
        }
    }
}
