//! The façade of the demo, its photos and its frame.

use glam::DVec3;

use crate::camera::LensModel;
use crate::geom::Size;
use crate::synthetic::{
    CameraSpec, FACADE_SIZE, Placement, PlaneSpec, Scene, Shot, Texture, facade,
};

/// Shortest wavelength of the texture, metres: five photo pixels, so that every photo resolves it.
const FINEST_M: f64 = 0.025;
/// Mosaic pixel, metres: about the footprint of a photo pixel.
const PIXEL_M: f64 = 0.004;
/// Empty border around the façade, metres.
const MARGIN_M: f64 = 0.1;
/// Longest edge of a face, metres.
pub(super) const EDGE_M: f64 = 0.02;
/// A façade looks about south-south-east.
const BEARING_RAD: f64 = 0.35;

/// What the demo shows: a scene, the photos to take of it, and the frame of the mosaic.
#[derive(Debug)]
pub(super) struct DemoSet {
    pub(super) scene: Scene,
    pub(super) shots: Vec<Shot>,
    pub(super) frame: PlaneSpec,
}

impl DemoSet {
    /// The set, always the same.
    pub(super) fn new() -> Self {
        let placement = Placement::upright(DVec3::new(4_120.4, 7_312.9, 103.6), BEARING_RAD);
        let [width, height] = FACADE_SIZE;
        let extent = [-MARGIN_M, -MARGIN_M, width + MARGIN_M, height + MARGIN_M];
        Self {
            scene: facade(placement, Texture::new(FINEST_M)),
            shots: shots(&placement),
            frame: PlaneSpec::of_scene(&placement, PIXEL_M, extent),
        }
    }
}

/// Nine photos in two rows, from the left to the right, each looking a little inward; metres in the scene.
fn shots(placement: &Placement) -> Vec<Shot> {
    let camera = CameraSpec {
        model: LensModel::OpenCv,
        size: Size::new(1600, 1200),
        params: vec![1300.0, 1302.0, 806.5, 594.0, -0.11, 0.035, 0.0006, -0.0004],
    };
    let stands = [
        ("ground/IMG 01.jpg", [-0.6, 1.6, 5.6], [1.9, 2.4, -0.5]),
        ("ground/IMG 02.jpg", [1.2, 1.7, 5.9], [2.1, 2.6, -0.5]),
        ("ground/IMG 03.jpg", [3.0, 1.5, 6.2], [3.3, 2.7, -0.5]),
        ("ground/IMG 04.jpg", [4.9, 1.6, 5.8], [4.5, 2.6, -0.5]),
        ("ground/IMG 05.jpg", [8.1, 1.7, 5.5], [5.6, 2.4, -0.5]),
        ("lift/IMG 11.jpg", [0.9, 4.4, 5.7], [2.2, 3.1, -0.5]),
        ("lift/IMG 12.jpg", [3.6, 4.6, 6.0], [3.7, 2.9, -0.5]),
        ("lift/IMG 13.jpg", [5.8, 4.5, 5.6], [5.2, 3.0, -0.5]),
        ("lift/IMG 14.jpg", [6.6, 3.2, 5.9], [4.9, 2.7, -0.5]),
    ];
    let shot = |(k, (name, from, to)): (usize, &(&str, [f64; 3], [f64; 3]))| {
        let roll_rad = 0.02 * (k as f64 - 4.0);
        Shot::towards(name, &camera, placement, [DVec3::from(*from), DVec3::from(*to)], roll_rad)
    };
    stands.iter().enumerate().map(shot).collect()
}
