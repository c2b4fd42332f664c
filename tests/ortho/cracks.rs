//! Neighbouring partitions share their vertices to the last bit: no pin-hole opens between them. And what would
//! happen if they did not.

use super::job;
use glam::DVec3;
use groundel::frame::LocalMosaic;
use groundel::geom::FaceBlock;
use groundel::render::Scene;
use groundel::store::mesh::{PartitionBuffer, PartitionId};
use groundel::surface::SurfaceBuilder;
use groundel::synthetic::scenes;

/// Pixels without surface, and partitions, in a fine mosaic well within a relief of sub-pixel faces, when each
/// partition's vertices pass through `round(position, bounds' least corner, bounds' size)`.
fn pin_holes(round: impl Fn(DVec3, DVec3, DVec3) -> DVec3) -> (usize, usize) {
    let mut test = scenes::sub_pixel();
    test.plane.pixel_size = 0.0004;
    // The relief covers 0.051 to 0.740 by 0.049 to 0.542 m.
    test.plane.extent = [0.0603, 0.0601, 0.7303, 0.5301];
    let folder = tempfile::tempdir().unwrap();
    let cameras = test.photos().unwrap();
    job::write_files(&test, folder.path());
    let scene: Scene = job::open(folder.path(), &cameras);
    let canvas = job::canvas(&test, &scene);
    let mosaic: &LocalMosaic = &canvas.mosaic;
    let mut surface = SurfaceBuilder::default();
    surface.start(mosaic, test.plane.size().rect());
    let mut partitions: Vec<PartitionId> = Vec::new();
    scene.mesh.query(|_| true, &mut partitions);
    partitions.sort_unstable();
    let mut buffer = PartitionBuffer::default();
    for &id in &partitions {
        scene.mesh.load(id, &mut buffer).unwrap();
        let block = buffer.block();
        let (low, size) = (block.bounds.min, block.bounds.max - block.bounds.min);
        let positions: Vec<_> = block.positions.iter().map(|&p| round(p, low, size)).collect();
        surface.add(mosaic, &FaceBlock { positions: &positions, ..block });
    }
    let tile = surface.finish(mosaic);
    (tile.elevations.iter().filter(|e| e.is_nan()).count(), partitions.len())
}

#[test]
fn no_pin_hole_between_partitions() {
    let (holes, partitions) = pin_holes(|p, _, _| p);
    assert!(partitions > 5, "{partitions} partitions");
    assert_eq!(holes, 0);
}

#[test]
fn vertices_rounded_within_each_partition_are_found_out() {
    // Sixteen bits a coordinate, the usual way to keep partitions small.
    let steps = f64::from(u16::MAX);
    let (holes, _) =
        pin_holes(|p, low, size| low + ((p - low) / size * steps).round() / steps * size);
    assert!(holes > 0);
}
