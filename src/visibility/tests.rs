use glam::{DMat3, DVec3};
use proptest::prelude::*;

use super::face_test::FaceTest;
use super::{BlockPoints, OcclusionScratch, PointCells, RayPoints, Sight, Tolerance, ViewPhoto};
use crate::camera::{Lens, LensModel, LocalPose};
use crate::frame::{LocalMosaic, Mosaic, Plane};
use crate::geom::{Bounds3, FaceBlock, FaceId, PixelRect, Size};
use crate::surface::{SurfaceBuilder, SurfaceTile};

const TOLERANCE: f64 = 1e-4;

/// A top view of 24 × 24 pixels of 0.5 m around the origin.
fn mosaic() -> LocalMosaic {
    let slab = [f64::NEG_INFINITY, f64::INFINITY];
    Mosaic::new(Plane::top(), 0.5, [-6.0, -6.0, 6.0, 6.0], slab).unwrap().local(DVec3::ZERO)
}

/// A photo from `centre` that looks along `forward`, 200 × 160 pixels, about 80° wide.
fn photo(centre: DVec3, forward: DVec3) -> ViewPhoto {
    let params = [120.0, 118.0, 97.0, 83.0, -0.1, 0.01, 1e-3, -2e-3];
    let lens = Lens::new(LensModel::OpenCv, Size::new(200, 160), &params).unwrap();
    let z = forward.normalize();
    let x = z.any_orthonormal_vector();
    let rotation = DMat3::from_cols(x, z.cross(x), z).transpose();
    ViewPhoto::new(lens, LocalPose { rotation, centre })
}

struct Mesh {
    positions: Vec<DVec3>,
    triangles: Vec<[u16; 3]>,
    ids: Vec<FaceId>,
}

impl Mesh {
    /// Triangles without shared vertices.
    fn soup(corners: &[[f64; 9]]) -> Self {
        let positions: Vec<_> =
            corners.iter().flat_map(|c| c.chunks(3).map(DVec3::from_slice)).collect();
        let triangles = (0..u16::try_from(corners.len()).unwrap())
            .map(|k| [3 * k, 3 * k + 1, 3 * k + 2])
            .collect();
        let ids = (0..u32::try_from(corners.len()).unwrap()).map(FaceId).collect();
        Self { positions, triangles, ids }
    }

    /// The same mesh in blocks of `n` faces.
    fn blocks(&self, n: usize) -> Vec<FaceBlock<'_>> {
        let chunks = self.triangles.chunks(n).zip(self.ids.chunks(n));
        chunks.map(|(triangles, ids)| self.block(triangles, ids)).collect()
    }

    fn block<'a>(&'a self, triangles: &'a [[u16; 3]], ids: &'a [FaceId]) -> FaceBlock<'a> {
        let corners = triangles.iter().flatten().map(|&i| self.positions[usize::from(i)]);
        FaceBlock { positions: &self.positions, triangles, ids, bounds: Bounds3::of(corners) }
    }

    fn surface(&self, mosaic: &LocalMosaic, rect: PixelRect) -> SurfaceTile {
        let mut builder = SurfaceBuilder::default();
        builder.start(mosaic, rect);
        self.blocks(usize::MAX).iter().for_each(|b| builder.add(mosaic, b));
        builder.finish(mosaic).clone()
    }
}

/// The pixels of `surface` seen, through cells and shafts.
fn seen(mesh: &Mesh, surface: &SurfaceTile, photo: &ViewPhoto, blocks: usize) -> Vec<usize> {
    let (mut points, mut rays) = (BlockPoints::default(), RayPoints::default());
    let (mut cells, mut scratch) = (PointCells::default(), OcclusionScratch::default());
    let sight = Sight { photo, surface, tolerance: Tolerance::Fixed(TOLERANCE) };
    points.start(&sight, &mut rays);
    cells.start(&sight, &mut rays);
    for block in mesh.blocks(blocks) {
        if cells.may_be_hidden_by(&block.bounds) {
            cells.occlude(&sight, &block, &mut points, &mut scratch);
        }
    }
    let (rect, side) = (surface.rect, super::SUB_BLOCK);
    let pixel = |sub: PixelRect, place: u16| {
        let (x, y) = (sub.x0 + i64::from(place) % side, sub.y0 + i64::from(place) / side);
        usize::try_from((y - rect.y0) * (rect.x1 - rect.x0) + x - rect.x0).unwrap()
    };
    let subs = rect.blocks(side).enumerate();
    let mut all: Vec<_> = subs
        .flat_map(|(k, sub)| points.seen_in(k).map(move |p| pixel(sub, p)).collect::<Vec<_>>())
        .collect();
    all.sort_unstable();
    all
}

/// The pixels of `surface` seen, each point against each face by the predicate alone.
fn seen_by_predicate(mesh: &Mesh, surface: &SurfaceTile, photo: &ViewPhoto) -> Vec<usize> {
    let visible = |k: &usize| {
        let Some(face) = surface.face_at(*k) else { return false };
        let [a, ..] = surface.corners(face);
        let q = photo.camera_from_local(surface.points.at(*k));
        if face.normal.dot(photo.pose.centre - a) <= 0.0 || q.z <= 0.0 {
            return false;
        }
        let (x, y) = (q.x / q.z, q.y / q.z);
        let position = photo.lens.photo_from_ray(glam::DVec2::new(x, y));
        if !position.is_some_and(|p| photo.lens.contains(p)) {
            return false;
        }
        let limit = q.z * (1.0 - TOLERANCE / q.length());
        mesh.triangles.iter().zip(&mesh.ids).all(|(t, &id)| {
            let corners = t.map(|i| photo.camera_from_local(mesh.positions[usize::from(i)]));
            id == face.id || !FaceTest::new(corners).cuts(x, y, limit)
        })
    };
    (0..surface.rect.area()).filter(visible).collect()
}

#[test]
fn a_roof_hides_the_floor_below_it_from_above_and_not_from_beside() {
    let floor = [-9.0, -9.0, 0.0, 20.0, -9.0, 0.0, -9.0, 20.0, 0.0];
    // A vertical wall, edge-on for the mosaic, between the photo and the left half of the floor.
    let wall = [0.01, -9.0, 0.0, 0.01, 9.0, 0.0, 0.01, 0.0, 5.0];
    let (with, without) = (Mesh::soup(&[floor, wall]), Mesh::soup(&[floor]));
    let (m, rect) = (mosaic(), PixelRect::new(0, 0, 24, 24));
    let p = photo(DVec3::new(8.0, 0.0, 3.0), DVec3::new(-8.0, 0.0, -3.0));
    let open = seen(&without, &without.surface(&m, rect), &p, 1);
    let hidden = seen(&with, &with.surface(&m, rect), &p, 1);
    let row = 12 * 24;
    assert!(open.contains(&(row + 9)) && !hidden.contains(&(row + 9)));
    assert!(open.contains(&(row + 16)) && hidden.contains(&(row + 16)));
}

#[test]
fn a_face_is_seen_only_from_the_side_of_the_viewer() {
    let floor = Mesh::soup(&[[-9.0, -9.0, 0.0, 20.0, -9.0, 0.0, -9.0, 20.0, 0.0]]);
    let surface = floor.surface(&mosaic(), PixelRect::new(0, 0, 24, 24));
    assert!(!seen(&floor, &surface, &photo(DVec3::new(0.0, 0.0, 5.0), DVec3::NEG_Z), 1).is_empty());
    assert!(seen(&floor, &surface, &photo(DVec3::new(0.0, 0.0, -5.0), DVec3::Z), 1).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]
    #[test]
    fn cells_shafts_blocks_and_rectangles_never_change_a_decision(
        corners in prop::collection::vec(prop::array::uniform9(-6.0..6.0_f64), 2..40),
        big in prop::array::uniform9(-30.0..30.0_f64),
        from in prop::array::uniform3(-7.0..7.0_f64),
        to in prop::array::uniform3(-1.0..1.0_f64),
        blocks in 1..9_usize,
    ) {
        // Among them faces through the photo's plane and photos inside the mesh.
        let mut corners = corners;
        corners.push(big);
        let mesh = Mesh::soup(&corners);
        let from = DVec3::from_array(from) + DVec3::Z * 2.0;
        let p = photo(from, DVec3::from_array(to) - from);
        let m = mosaic();
        let surface = mesh.surface(&m, PixelRect::new(0, 0, 24, 24));
        let expected = seen_by_predicate(&mesh, &surface, &p);
        prop_assert_eq!(&seen(&mesh, &surface, &p, blocks), &expected);
        // A part of the mosaic alone gives the same decisions.
        let part = mesh.surface(&m, PixelRect::new(7, 5, 15, 21));
        let expected: Vec<_> = expected.iter().filter_map(|k| {
            let (x, y) = (k % 24, k / 24);
            ((7..15).contains(&x) && (5..21).contains(&y)).then(|| (y - 5) * 8 + x - 7)
        }).collect();
        prop_assert_eq!(seen(&mesh, &part, &p, blocks), expected);
    }
}
