//! Point clouds as the surface: terrain of known height and colour, seen by photos from above.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "small counts, and colours within 0 to 255"
)]

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use super::las_files::{Kind, SCALE, write};
use glam::{DVec2, DVec3};
use groundel::camera::LensModel;
use groundel::geom::Size;
use groundel::image::Image;
use groundel::synthetic::{
    CameraSpec, Likeness, Part, Placement, PlaneSpec, Random, Sampling, Shot, TestScene, Texture,
    likeness,
};
use tiff::decoder::{Decoder, DecodingResult};

/// Mosaic pixel, metres.
const PIXEL: f64 = 1.0 / 64.0;
/// Extent of the mosaic, scene coordinates, metres.
const EXTENT: [f64; 4] = [0.0, 0.0, 2.0, 1.5];
/// Beyond it there is terrain this far, metres.
const MARGIN: f64 = 0.3;
/// Distance of neighbouring points, metres.
const SPACING: f64 = 0.03;
/// What linear interpolation between them may be off, and the rounding of the coordinates, metres.
const ROOM: f64 = 2.5e-3;

/// The height of the terrain, scene coordinates.
fn height(at: DVec2) -> f64 {
    0.12 * (2.0 * PI * at.x / 1.9).sin() * (2.0 * PI * at.y / 1.3).cos() + 0.05 * at.x
}

fn placement() -> Placement {
    Placement { origin: DVec3::new(500_000.25, 4_200_000.5, 812.0), ..Placement::IDENTITY }
}

/// The terrain as a fine mesh, and five photos from above.
fn terrain() -> TestScene {
    let camera = CameraSpec {
        model: LensModel::Pinhole,
        size: Size::new(400, 300),
        params: vec![300.0, 300.0, 200.0, 150.0],
    };
    let placement = placement();
    let shots = [(0.4, 0.4), (1.6, 0.4), (1.0, 0.75), (0.4, 1.1), (1.6, 1.1)];
    let shots = shots.iter().enumerate().map(|(k, &(x, y))| {
        let ends = [DVec3::new(x, y, 2.5), DVec3::new(x + 0.02, y - 0.01, 0.0)];
        Shot::towards(&format!("{k}.png"), &camera, &placement, ends, 0.3 * k as f64)
    });
    let mut scene = TestScene {
        name: "terrain",
        triangles: Vec::new(),
        parts: Vec::new(),
        placement,
        texture: Texture::new(5.0 * PIXEL),
        shots: shots.collect(),
        plane: PlaneSpec::of_scene(&placement, PIXEL, EXTENT),
    };
    let step = 0.02;
    let count = |length: f64| ((length + 2.0 * MARGIN) / step).round() as i32;
    let corner = |i: i32, j: i32| {
        let at = DVec2::new(f64::from(i), f64::from(j)) * step - MARGIN;
        placement.ground_from_scene(at.extend(height(at)))
    };
    for j in 0..count(EXTENT[3]) {
        for i in 0..count(EXTENT[2]) {
            let [a, b, c, d] =
                [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| corner(i, j));
            scene.push([a, b, c], Part::Wall);
            scene.push([a, c, d], Part::Wall);
        }
    }
    scene
}

/// What the coordinates of a point become in a file.
fn rounded(point: DVec3) -> DVec3 {
    let offset = placement().origin;
    ((point - offset) / SCALE).round() * SCALE + offset
}

/// Points of the terrain, irregular, and some above and below it that are no part of it.
fn cloud() -> (Vec<DVec3>, Vec<DVec3>) {
    let mut random = Random::new(77);
    let ground = |at: DVec2, dz: f64| placement().ground_from_scene(at.extend(height(at) + dz));
    let size = DVec2::new(EXTENT[2], EXTENT[3]) + 2.0 * MARGIN;
    let mut points = Vec::new();
    for j in 0..(size.y / SPACING) as i32 {
        for i in 0..(size.x / SPACING) as i32 {
            let jitter = DVec2::new(random.unit(), random.unit()) * 0.8;
            let at = (DVec2::new(f64::from(i), f64::from(j)) + jitter) * SPACING - MARGIN;
            points.push(rounded(ground(at, 0.0)));
        }
    }
    let mut noise = || ground(DVec2::new(random.unit(), random.unit()) * size - MARGIN, 0.5);
    let noise = (0..40).map(|_| noise()).collect();
    (points, noise)
}

fn text(points: &[DVec3], shift: DVec3) -> String {
    let mut text = "X,Y,Z,Intensity\n".to_owned();
    for p in points {
        let p = *p - shift;
        writeln!(text, "{},{},{},17", p.x, p.y, p.z).unwrap();
    }
    text
}

fn run(folder: &Path, name: &str, flags: &[&str]) -> (Output, PathBuf) {
    let out = folder.join(name).join("mosaic.tif");
    fs::create_dir_all(folder.join(name)).unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .current_dir(folder)
        .args(["ortho", "--cameras", "sparse", "--photos", "photos", "--frame", "frame.toml"])
        .args(["--layers", "elevation,face,count", "--out"])
        .arg(&out)
        .args(flags)
        .output()
        .unwrap();
    (run, out)
}

fn made(folder: &Path, name: &str, flags: &[&str]) -> PathBuf {
    let (run, out) = run(folder, name, flags);
    assert!(run.status.success(), "{name}: {}", String::from_utf8_lossy(&run.stderr));
    out
}

fn decoded(path: &Path) -> DecodingResult {
    Decoder::new(fs::File::open(path).unwrap()).unwrap().read_image().unwrap()
}

fn elevations(mosaic: &Path) -> Vec<f32> {
    let DecodingResult::F32(all) = decoded(&mosaic.with_extension("elevation.tif")) else {
        unreachable!("the layer is in floats")
    };
    all
}

/// Colour, and alpha, of a mosaic.
fn colours(mosaic: &Path) -> [Image<u8>; 2] {
    let DecodingResult::U8(rgba) = decoded(mosaic) else { unreachable!("8-bit photos") };
    let size = terrain().plane.size();
    let rgb = rgba.chunks_exact(4).flat_map(|p| p[..3].to_vec()).collect();
    let alpha = rgba.chunks_exact(4).map(|p| p[3]).collect();
    [Image::from_data(size, 3, rgb), Image::from_data(size, 1, alpha)]
}

/// A folder with the terrain's photos, cameras and frame, its mesh as `mesh.ply`, its cloud as `cloud.las`.
fn project() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    terrain().write(folder.path(), Sampling::Box(2), &[]).unwrap();
    let (points, noise) = cloud();
    let kind = Kind { format: 1, is_compressed: false };
    write(&folder.path().join("cloud.las"), kind, placement().origin, &points, &noise);
    folder
}

/// The colours of the texture at the analytic height.
fn truth(scene: &TestScene) -> Image<u8> {
    let size = scene.plane.size();
    let mut rgb = Vec::new();
    for row in 0..size.height {
        for column in 0..size.width {
            let at = scene
                .plane
                .plane_from_pixel(DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5));
            let colour = scene.texture.colour(at.extend(height(at)), Part::Wall);
            rgb.extend(colour.map(|c| (c * 255.0).round().clamp(0.0, 255.0) as u8));
        }
    }
    Image::from_data(size, 3, rgb)
}

fn alike(a: &Image<u8>, b: &Image<u8>, mask: &Image<u8>) -> Likeness {
    likeness(a.view(), b.view(), mask.view())
}

#[test]
fn a_point_cloud_gives_the_terrain_and_the_picture_that_its_mesh_gives() {
    let folder = project();
    let scene = terrain();
    let by_mesh = made(folder.path(), "mesh", &["--mesh", "mesh.ply"]);
    let by_points = made(folder.path(), "points", &["--points", "cloud.las"]);
    let size = scene.plane.size();
    let (mesh, points) = (elevations(&by_mesh), elevations(&by_points));
    for (k, (a, b)) in mesh.iter().zip(&points).enumerate() {
        let (row, column) = (k / size.width as usize, k % size.width as usize);
        let at = scene.plane.plane_from_pixel(DVec2::new(column as f64 + 0.5, row as f64 + 0.5));
        let known = height(at);
        for found in [a, b] {
            let off = (f64::from(*found) - known).abs();
            assert!(off < ROOM, "pixel {column} {row}: {found} for {known}");
        }
    }
    let [(mesh, alpha), (points, _)] = [by_mesh, by_points].map(|m| {
        let [rgb, alpha] = colours(&m);
        (rgb, alpha)
    });
    assert!(alpha.data().iter().all(|&a| a == 255), "every pixel is seen");
    let truth = truth(&scene);
    let (together, of_mesh, of_points) = (
        alike(&mesh, &points, &alpha),
        alike(&truth, &mesh, &alpha),
        alike(&truth, &points, &alpha),
    );
    println!("{together:?}\n{of_mesh:?}\n{of_points:?}");
    assert!(
        together.psnr_db > 40.0
            && of_points.psnr_db > of_mesh.psnr_db - 0.5
            && of_points.psnr_db > 30.0
    );
}

#[test]
fn las_laz_and_text_of_the_same_points_give_the_same_bytes() {
    let folder = project();
    let path = folder.path();
    let (points, noise) = cloud();
    let reference = made(path, "las", &["--points", "cloud.las"]);
    let mut names = Vec::new();
    for (format, is_compressed) in [(0, true), (3, true), (6, false), (6, true), (8, true)] {
        let name = format!("{format} {is_compressed}.points");
        write(
            &path.join(&name),
            Kind { format, is_compressed },
            placement().origin,
            &points,
            &noise,
        );
        names.push(vec![name]);
    }
    fs::write(path.join("cloud.txt"), text(&points, DVec3::ZERO)).unwrap();
    let packed = zstd::encode_all(text(&points, DVec3::ZERO).as_bytes(), 1).unwrap();
    fs::write(path.join("cloud.zst"), packed).unwrap();
    let (one, two) = points.split_at(points.len() / 3);
    // In two files, in another order.
    fs::write(path.join("one.csv"), text(one, DVec3::ZERO)).unwrap();
    let kind = Kind { format: 7, is_compressed: true };
    write(&path.join("two.laz"), kind, placement().origin, two, &noise);
    names.extend([
        vec!["cloud.txt".into()],
        vec!["cloud.zst".into()],
        vec!["two.laz".into(), "one.csv".into()],
    ]);
    for (k, names) in names.iter().enumerate() {
        let flags: Vec<&str> = names.iter().flat_map(|n| ["--points", n]).collect();
        let mosaic = made(path, &k.to_string(), &flags);
        for layer in ["tif", "elevation.tif", "face.tif", "count.tif"] {
            let [a, b] = [&reference, &mosaic].map(|m| fs::read(m.with_extension(layer)).unwrap());
            assert!(a == b, "{names:?}: {layer}");
        }
    }
}

#[test]
fn memory_and_threads_change_nothing_and_a_tin_is_used_again() {
    let folder = project();
    let path = folder.path();
    let reference = made(path, "a", &["--points", "cloud.las", "--max-edge", "0.2"]);
    let other = made(
        path,
        "b",
        &["--points", "cloud.las", "--max-edge", "0.2", "--memory", "256MiB", "--threads", "1"],
    );
    for layer in ["tif", "elevation.tif", "face.tif"] {
        let [a, b] = [&reference, &other].map(|m| fs::read(m.with_extension(layer)).unwrap());
        assert!(a == b, "{layer}");
    }
    let tin = |folder: &str| {
        let all =
            fs::read_dir(path.join(folder).join(".groundel")).unwrap().map(|e| e.unwrap().path());
        let mut tins: Vec<_> = all.filter(|p| p.extension().is_some_and(|e| e == "ply")).collect();
        assert_eq!(tins.len(), 1);
        tins.remove(0)
    };
    let first = fs::read(tin("a")).unwrap();
    assert!(first == fs::read(tin("b")).unwrap(), "the TIN is one");
    // Used again as it is; made again if it is damaged.
    let modified = fs::metadata(tin("a")).unwrap().modified().unwrap();
    made(path, "a", &["--points", "cloud.las", "--max-edge", "0.2"]);
    assert_eq!(fs::metadata(tin("a")).unwrap().modified().unwrap(), modified);
    let mut damaged = first.clone();
    damaged[700] ^= 1;
    fs::write(tin("a"), damaged).unwrap();
    made(path, "a", &["--points", "cloud.las", "--max-edge", "0.2"]);
    assert!(first == fs::read(tin("a")).unwrap());
}

#[test]
fn long_edges_are_dropped_a_shift_moves_points_and_a_mesh_goes_before_them() {
    let folder = project();
    let path = folder.path();
    let (points, _) = cloud();
    // A pond without points.
    let middle = placement().ground_from_scene(DVec3::new(1.0, 0.75, 0.0)).truncate();
    let around: Vec<_> =
        points.into_iter().filter(|p| (p.truncate() - middle).length() > 0.3).collect();
    let reduced = DVec3::new(500_000.0, 4_200_000.0, 0.0);
    fs::write(path.join("pond.xyz"), text(&around, reduced)).unwrap();
    let shift = ["--shift", "500000,4200000,0"];
    let holes = |mosaic: &Path| elevations(mosaic).iter().filter(|e| e.is_nan()).count();
    let short = made(
        path,
        "short",
        &[&["--points", "pond.xyz", "--max-edge", "0.15"], &shift[..]].concat(),
    );
    let pixels = PI * 0.3 * 0.3 / (PIXEL * PIXEL);
    let found = holes(&short) as f64;
    assert!(found > 0.8 * pixels && found < 1.05 * pixels, "{found} of {pixels}");
    let closed = made(
        path,
        "closed",
        &[&["--points", "pond.xyz", "--max-edge", "inf"], &shift[..]].concat(),
    );
    assert_eq!(holes(&closed), 0);
    // A mesh and points: ids of points run on behind those of the mesh.
    let lid = "v 0 0 5\nv 0.25 0 5\nv 0 0.25 5\nf 1 2 3\n";
    let lid = lid.replace("v 0", "v 500001").replace(" 5\n", " 815\n").replace(" 0", " 4200001");
    fs::write(path.join("lid.obj"), &lid).unwrap();
    let both = made(path, "both", &["--mesh", "lid.obj", "--points", "cloud.las"]);
    let DecodingResult::U32(faces) = decoded(&both.with_extension("face.tif")) else {
        panic!("ids")
    };
    let alone = made(path, "alone", &["--points", "cloud.las"]);
    let DecodingResult::U32(ids) = decoded(&alone.with_extension("face.tif")) else {
        panic!("ids")
    };
    let mut of_lid = 0;
    for (with, without) in faces.iter().zip(&ids) {
        of_lid += u32::from(*with == 0);
        assert!(*with == 0 || *with == without + 1);
    }
    assert!(of_lid > 50, "{of_lid}");
}
