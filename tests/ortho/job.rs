//! A synthetic test scene as files on disk and as a scene to render.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use groundel::camera::CameraSet;
use groundel::frame::frame_toml;
use groundel::image::{Colour, Depth};
use groundel::input::open_mesh;
use groundel::render::{BlendSettings, Interpolation, Scene, ScenePhoto};
use groundel::store::mesh::MeshBuild;
use groundel::store::photo::{PhotoSource, PhotoStore, Preparation, prepare_photos};
use groundel::synthetic::{Sampling, TestScene, photograph};

/// ε of the occlusion test, as `groundel ortho` takes it by default.
pub(super) fn tolerance_m(test: &TestScene) -> f64 {
    0.02 * test.plane.pixel_size
}

/// Writes mesh, photos, cameras and frame of `test` into `folder`.
pub(super) fn write_files(test: &TestScene, folder: &Path) {
    fs::create_dir_all(folder.join("photos")).unwrap();
    fs::create_dir_all(folder.join("sparse")).unwrap();
    fs::write(folder.join("mesh.ply"), ply(test)).unwrap();
    fs::write(folder.join("frame.toml"), frame_toml(&test.mosaic().unwrap())).unwrap();
    let (mut cameras, mut images) = (String::new(), String::new());
    for (k, shot) in test.shots.iter().enumerate() {
        let c = &shot.camera;
        let params: Vec<_> = c.params.iter().map(|p| format!("{p:?}")).collect();
        let size = format!("{} {}", c.size.width, c.size.height);
        writeln!(cameras, "{} {} {size} {}", k + 1, c.model.name(), params.join(" ")).unwrap();
        let ([w, x, y, z], t) = (shot.quaternion, shot.translation);
        let pose = format!("{w:?} {x:?} {y:?} {z:?} {:?} {:?} {:?}", t.x, t.y, t.z);
        writeln!(images, "{} {pose} {} {}\n", k + 1, k + 1, shot.name).unwrap();
    }
    fs::write(folder.join("sparse/cameras.txt"), cameras).unwrap();
    fs::write(folder.join("sparse/images.txt"), images).unwrap();
    fs::write(folder.join("sparse/points3D.txt"), "").unwrap();
    let caster = test.caster();
    for photo in test.photos().unwrap().photos {
        let picture = photograph::<u8>(&caster, &photo, Sampling::Box(4), 3);
        let file = folder.join("photos").join(&photo.name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        let size = picture.size();
        let kind = image::ExtendedColorType::Rgb8;
        let format = image::ImageFormat::Png;
        image::save_buffer_with_format(file, picture.data(), size.width, size.height, kind, format)
            .unwrap();
    }
}

/// The faces as a binary PLY of doubles, three vertices a face.
fn ply(test: &TestScene) -> Vec<u8> {
    let n = test.triangles.len();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
         property double z\nelement face {n}\nproperty list uchar int vertex_indices\nend_header\n",
        3 * n
    )
    .into_bytes();
    for p in test.triangles.iter().flatten() {
        bytes.extend(p.to_array().iter().flat_map(|c| c.to_le_bytes()));
    }
    for k in 0..i32::try_from(n).unwrap() {
        bytes.push(3);
        bytes.extend([3 * k, 3 * k + 1, 3 * k + 2].iter().flat_map(|i| i.to_le_bytes()));
    }
    bytes
}

/// The scene in `folder`, ready to be rendered, seen by `cameras`.
pub(super) fn open(test: &TestScene, folder: &Path, cameras: &CameraSet) -> Scene {
    let mesh = open_mesh(&folder.join("mesh.ply")).unwrap();
    let build = MeshBuild {
        work: folder.join("work"),
        budget_bytes: 32 << 20,
        resident_limit_bytes: 32 << 20,
    };
    let mesh = build.open_or_build(&[mesh.as_ref()], &mut |_, _, _| {}).unwrap();
    let source = |name: &String| PhotoSource {
        name: name.clone(),
        path: folder.join("photos").join(name),
        expected: None,
    };
    let sources: Vec<_> = cameras.names.iter().map(source).collect();
    let tiles = folder.join("work/photos");
    let preparation = Preparation { folder: &tiles, budget_bytes: 64 << 20, threads: 2 };
    let stores = prepare_photos(&sources, &preparation, &|_| {}).unwrap();
    let paths = stores.into_iter().map(|s| s.unwrap().path().to_path_buf());
    let entries: Vec<(usize, PathBuf)> = paths.enumerate().collect();
    let origin = mesh.origin();
    let photos = cameras.photos.iter().zip(0..);
    Scene {
        mosaic: test.mosaic().unwrap().local(origin),
        photos: photos.map(|(p, k)| ScenePhoto::new(k, p, origin, 1.0)).collect(),
        mesh,
        pixels: PhotoStore::open(entries, 16 << 20).unwrap(),
        interpolation: Interpolation::Bicubic,
        blend: BlendSettings {
            colour: Colour::Rgb,
            depth: Depth::Eight,
            ..BlendSettings::default()
        },
        names: cameras.names.len(),
        tolerance_m: tolerance_m(test),
    }
}
