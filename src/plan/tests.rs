//! The plan over a real mesh store.

use std::fmt::Write;

use glam::DVec3;

use super::*;
use crate::camera::{Lens, LensModel, Photo, PhotoId, Pose};
use crate::frame::Plane;
use crate::geom::Size;
use crate::input::PlyMesh;
use crate::store::mesh::MeshBuild;

/// 200 × 100 squares of 5 cm, rising by 1 cm a row, at UTM coordinates.
fn ply() -> String {
    let (columns, rows) = (200, 100);
    let (v, f) = ((columns + 1) * (rows + 1), columns * rows);
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {v}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {f}\nproperty list uchar int vertex_indices\nend_header\n"
    );
    for row in 0..=rows {
        for column in 0..=columns {
            let (x, y) = (5e5 + 0.05 * f64::from(column), 4e6 + 0.05 * f64::from(row));
            writeln!(text, "{x} {y} {}", 0.01 * f64::from(row)).unwrap();
        }
    }
    for row in 0..rows {
        for column in 0..columns {
            let at = row * (columns + 1) + column;
            let above = at + columns + 1;
            writeln!(text, "4 {at} {} {} {above}", at + 1, above + 1).unwrap();
        }
    }
    text
}

#[test]
fn a_store_of_many_partitions_gives_extent_and_pixel_size() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.ply");
    std::fs::write(&path, ply()).unwrap();
    let mesh = PlyMesh::open(&path).unwrap();
    let work = folder.path().to_path_buf();
    let build = MeshBuild { work, budget_bytes: 1 << 20, resident_limit_bytes: 0 };
    let store = build.open_or_build(&[&mesh], &mut |_, _, _| Ok(())).unwrap();
    assert!(store.count() > 5, "several partitions");

    let plane = Plane::top();
    let all = Slab { base: Base::Plane(&plane), elevation: [f64::NEG_INFINITY, f64::INFINITY] };
    let extent = default_extent(&store, all, 0.01).unwrap();
    let want = [5e5, 4e6, 500_010.0, 4_000_005.0];
    assert!(extent.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-9), "{extent:?}");
    // From 40 cm up: rows 40 to 100 of the squares.
    let upper = Slab { base: Base::Plane(&plane), elevation: [0.4, f64::INFINITY] };
    let extent = default_extent(&store, upper, 0.01).unwrap();
    let want = [5e5, 4_000_002.0, 500_010.0, 4_000_005.0];
    assert!(extent.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-9), "{extent:?}");
    assert!(check_meeting(&store, upper, [5e5, 4e6, 500_001.0, 4_000_001.0]).is_err());
    assert!(check_meeting(&store, upper, [5e5, 4e6, 500_001.0, 4_000_003.0]).is_ok());

    // 20.1 m above the middle: 20.1 / 5000 · √1.0198 for the slope = 0.00406 m.
    let pinhole = [5000.0, 5000.0, 1000.0, 500.0];
    let lens = Lens::new(LensModel::Pinhole, Size::new(2000, 1000), &pinhole).unwrap();
    let mut pose = Pose::from_colmap([0.0, 1.0, 0.0, 0.0], DVec3::ZERO).unwrap();
    pose.centre_ground = DVec3::new(500_005.0, 4_000_002.5, 20.6);
    let photo = Photo { id: PhotoId(0), name: "a.jpg".into(), lens, pose };
    let size = default_pixel_size(&store, all, None, &[photo]).unwrap();
    assert!((size - 0.0040).abs() < 1e-12, "{size}");
}
