//! A synthetic test scene as files on disk and as a scene to render.

use std::path::Path;

use groundel::camera::CameraSet;
use groundel::image::{Colour, Depth};
use groundel::input::open_mesh;
use groundel::render::{BlendSettings, Canvas, Interpolation, Scene, ScenePhoto, Tolerance};
use groundel::store::mesh::MeshBuild;
use groundel::store::photo::{
    Demand, PhotoSource, PhotoStore, Preparation, Reading, prepare_photos,
};
use groundel::synthetic::{Sampling, TestScene};

/// ε of the occlusion test, as `groundel ortho` takes it by default.
pub(super) fn tolerance_m(test: &TestScene) -> f64 {
    0.02 * test.plane.pixel_size
}

/// Writes mesh, photos, cameras and frame of `test` into `folder`.
pub(super) fn write_files(test: &TestScene, folder: &Path) {
    test.write(folder, Sampling::Box(4), &[]).unwrap();
}

/// The scene in `folder`, ready to be rendered, seen by `cameras`.
pub(super) fn open(folder: &Path, cameras: &CameraSet) -> Scene {
    open_reading(folder, cameras, Reading::Auto)
}

/// Like [`open`], its photos read in one way.
pub(super) fn open_reading(folder: &Path, cameras: &CameraSet, reading: Reading) -> Scene {
    let mesh = open_mesh(&folder.join("mesh.ply")).unwrap();
    let build = MeshBuild {
        work: folder.join("work"),
        budget_bytes: 32 << 20,
        resident_limit_bytes: 32 << 20,
    };
    let mesh = build.open_or_build(&[mesh.as_ref()], &mut |_, _, _| Ok(())).unwrap();
    let source = |name: &String| PhotoSource {
        name: name.clone(),
        path: folder.join("photos").join(name),
        expected: None,
        demand: Some(Demand::ALL),
    };
    let sources: Vec<_> = cameras.names.iter().map(source).collect();
    let tiles = folder.join("work/photos");
    let preparation = Preparation {
        folder: &tiles,
        budget_bytes: 64 << 20,
        beside_bytes: 0,
        threads: 2,
        memory_bytes: 16 << 20,
        reading,
    };
    let stores = prepare_photos(&sources, &preparation, &|_| Ok(())).unwrap();
    let entries = stores.into_iter().map(Result::unwrap).enumerate();
    let origin = mesh.origin();
    let photos = cameras.photos.iter().zip(0..);
    Scene {
        photos: photos.map(|(p, k)| ScenePhoto::new(k, p, origin, 1.0)).collect(),
        mesh,
        pixels: PhotoStore::new(entries, 16 << 20).unwrap(),
        masks: None,
        interpolation: Interpolation::Bicubic,
        blend: BlendSettings {
            colour: Colour::Rgb,
            depth: Depth::Eight,
            ..BlendSettings::default()
        },
        names: cameras.names.len(),
    }
}

/// The test's own mosaic as a canvas for a scene.
pub(super) fn canvas(test: &TestScene, scene: &Scene) -> Canvas {
    Canvas {
        mosaic: test.mosaic().unwrap().local(scene.mesh.origin()),
        below: Vec::new(),
        tolerance: Tolerance::Fixed(tolerance_m(test)),
    }
}
