//! What tells other programs where the mosaic lies: GeoTIFF, world file and drawing, as independent readers have them;
//! the scale of a print; the way between pixels and ground for every kind of frame.

use std::fmt::Write;
use std::fs;

use super::gdal;
use super::views::{Project, key, numbers, triple};
use glam::{DMat3, DQuat, DVec3};
use groundel::synthetic::{Placement, TestScene, scenes};
use serde_json::{Value, json};

/// A millionth of a pixel of a centimetre, and ten times what coordinates of four million metres stand apart.
const ROOM_M: f64 = 1e-8;

/// Columns before a wall, seen from above, where zone 34 of UTM has its middle.
fn utm() -> TestScene {
    let offset = DVec3::new(500_000.0, 4_200_000.0, 100.0);
    let mut scene = scenes::columns();
    for corner in scene.triangles.as_flattened_mut() {
        *corner += offset;
    }
    for shot in &mut scene.shots {
        let [w, x, y, z] = shot.quaternion;
        shot.translation -= DQuat::from_xyzw(x, y, z, w).normalize() * offset;
    }
    scene.placement = Placement { origin: offset, ..scene.placement };
    scene
}

fn floats(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn point(value: &Value) -> DVec3 {
    DVec3::from_slice(&floats(value))
}

/// The answers of `groundel locate` as column, row, elevation and ground point.
fn located(project: &Project, args: &[&str]) -> Vec<(DVec3, DVec3)> {
    let told = project.answer("locate", args);
    let lines = told.lines().map(numbers);
    lines.map(|n| (DVec3::new(n[0], n[1], n[5]), DVec3::from_slice(&n[2..5]))).collect()
}

#[test]
fn gdal_finds_a_mosaic_in_a_real_system_to_the_last_bit() {
    let project = Project::new(utm());
    let flags = ["--view", "top", "--crs", "EPSG:32634", "--extent"];
    let extent = "500000.1,4200000.2,500002.1,4200001.5";
    let print = ["--scale", "1:100", "--dpi", "254", "--tile-size", "64", "--world-file"];
    let layers = ["--layers", "elevation,face,coverage"];
    project.ortho("nadir", &[&flags[..], &[extent], &print, &layers].concat());
    let pixels = ["nadir.tif", "--pixel", "60.5,50.25", "--pixel", "120,90.75"];
    for (at, ground) in located(&project, &pixels) {
        let ask = |name: &str| {
            json!({ "path": project.path(name), "world_file": project.path("nadir.tfw"),
                    "ground": [ground.x, ground.y] })
        };
        let names = ["nadir.tif", "nadir.elevation.tif", "nadir.face.tif", "nadir.coverage.tif"];
        let told = gdal::python("check_frame_out.py", &json!(names.map(ask)));
        for (name, told) in names.iter().zip(told.as_array().unwrap()) {
            assert_eq!(told["faults"], json!([]), "{name}");
            let due = [0.01, 0.0, 500_000.1, 0.0, -0.01, 4_200_001.5].map(f64::to_bits);
            let bits: Vec<_> =
                floats(&told["transform"]).iter().map(|v| (v + 0.0).to_bits()).collect();
            assert_eq!(bits, due, "{name}: {told}");
            assert_eq!(told["epsg"], 32634, "{name}");
            let index = floats(&told["index"]);
            assert!((index[0] - at.x).hypot(index[1] - at.y) < 1e-6, "{name}: {index:?} {at}");
            // GDAL takes half a pixel from the centre of the first.
            for (by_file, due) in floats(&told["by_world_file"]).iter().zip(due) {
                assert!((by_file - f64::from_bits(due)).abs() < ROOM_M, "{told}");
            }
            assert_eq!(told["resolution"], json!(["254", "254", "2 (pixels/inch)"]), "{name}");
            let overviews = told["overview_resolutions"].as_array().unwrap();
            assert!(overviews.len() >= 2, "{told}");
            for (level, found) in overviews.iter().enumerate() {
                let dpi = (254.0 / 2_f64.powi(i32::try_from(level).unwrap() + 1)).to_string();
                assert_eq!(*found, json!([dpi, dpi, "2 (pixels/inch)"]), "{name}");
            }
        }
    }
    assert!(project.answer("info", &["nadir.tif"]).contains("\nresolution: 254 dpi\n"));
    let world = fs::read_to_string(project.path("nadir.tfw")).unwrap();
    let due = format!("0.01\n0\n0\n-0.01\n{}\n{}\n", 500_000.1 + 0.005, 4_200_001.5 - 0.005);
    assert_eq!(world, due);
}

#[test]
fn a_drawing_holds_the_picture_where_locate_says() {
    for (test, frame) in [(scenes::oblique(), None), (utm(), Some("top"))] {
        let project = Project::new(test);
        let flags = match frame {
            Some(view) => ["--view", view],
            None => ["--frame", "frame.toml"],
        };
        // The last column and row reach beyond the extent.
        let name = "Fassade süd 1";
        let size = ["--pixel-size", "0.021", "--cad", "dxf", "--dpi", "300"];
        project.ortho(name, &[&flags[..], &size].concat());
        let drawing = project.path(&format!("{name}.dxf"));
        let told = &gdal::python("check_dxf.py", &json!([drawing]))[0];
        assert_eq!(told["faults"], json!([]), "{told}");
        assert_eq!((&told["version"], &told["units"]), (&json!("AC1015"), &json!(6)));
        assert_eq!((&told["file"], &told["key"]), (&json!(format!("{name}.tif")), &json!(name)));
        assert!(told["tied"] == true && told["size"] == told["defined"], "{told}");
        let size = floats(&told["size"]);
        let (width, height) = (size[0], size[1]);
        let [insert, u, v] = ["insert", "u", "v"].map(|key| point(&told[key]));
        let corners = [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]];
        let mut args = vec![format!("{name}.tif"), "--elevation".into(), "0".into()];
        args.extend(corners.iter().flat_map(|[x, y]| ["--pixel".into(), format!("{x},{y}")]));
        let found = located(&project, &args.iter().map(String::as_str).collect::<Vec<_>>());
        assert_eq!(found.len(), 4);
        let mut centre = DVec3::ZERO;
        for (at, ground) in found {
            let drawn = insert + u * at.x + v * (height - at.y);
            assert!((drawn - ground).length() < ROOM_M, "{at}: {drawn} {ground}");
            centre += 0.25 * ground;
        }
        let [direction, target] = [0, 1].map(|k| point(&told["view"][k]));
        assert!((target - centre).length() < 1e-6, "{target} {centre}");
        assert!(direction.dot(u.cross(v).normalize()) > 1.0 - 1e-12, "{direction}");
        let [min, max] = [0, 1].map(|k| point(&told["extents"][k]));
        assert!(min.cmple(insert).all() && max.cmpge(insert).all(), "{told}");
        // Nothing asked for a world file; the mosaic states its pixels on paper, its size is its own.
        assert!(!project.path(&format!("{name}.tfw")).exists());
        let info = project.answer("info", &[&format!("{name}.tif")]);
        assert!(info.contains("\nresolution: 300 dpi\npixel size: 0.021 × 0.021\n"), "{info}");
    }
}

#[test]
fn a_project_file_asks_for_the_same_files_in_the_same_bytes() {
    let project = Project::new(scenes::columns());
    let flags = ["--frame", "frame.toml", "--scale", "1:50", "--dpi", "72.5"];
    project.ortho("a", &[&flags[..], &["--world-file", "--cad", "dxf"]].concat());
    let text = "mesh = [\"mesh.ply\"]\ncameras = \"sparse\"\nphotos = \"photos\"\nout = \"b.tif\"\nquiet = true\n\
                scale = \"1:50\"\ndpi = 72.5\nworld_file = true\ncad = \"dxf\"\n[frame]\n";
    let frame = fs::read_to_string(project.path("frame.toml")).unwrap();
    fs::write(project.path("b.toml"), format!("{text}{frame}")).unwrap();
    project.answer("ortho", &["b.toml"]);
    for extension in ["tif", "tfw", "frame.toml"] {
        let read = |stem: &str| fs::read(project.path(&format!("{stem}.{extension}"))).unwrap();
        assert!(read("a") == read("b"), "{extension}");
    }
    let drawing = |stem: &str| fs::read_to_string(project.path(&format!("{stem}.dxf"))).unwrap();
    let renamed =
        drawing("a").replace("\na.tif\n", "\nb.tif\n").replace("\n  3\na\n", "\n  3\nb\n");
    assert!(renamed == drawing("b") && renamed != drawing("a"));
    let frame: toml::Table =
        fs::read_to_string(project.path("a.frame.toml")).unwrap().parse().unwrap();
    let pixel_size = frame["pixel_size"].as_float().unwrap();
    assert!((pixel_size - 50.0 * 0.0254 / 72.5).abs() < 1e-17, "{pixel_size}");
    // A pixel size by flag takes the place of the file's scale; its dots per inch stay.
    project.answer("ortho", &["b.toml", "--pixel-size", "0.05", "--out", "c.tif"]);
    let info = project.answer("info", &["c.tif"]);
    assert!(info.contains("\nresolution: 72.5 dpi\npixel size: 0.05 × 0.05\n"), "{info}");
}

/// Asks for `pixels` of `mosaic`, compares the ground points with `due` (of column, row, elevation), and asks back.
fn assert_closes(
    project: &Project,
    args: &[&str],
    pixels: &[[f64; 2]],
    due: impl Fn(DVec3) -> Option<DVec3>,
) {
    let flags = pixels.iter().flat_map(|[x, y]| ["--pixel".into(), format!("{x:?},{y:?}")]);
    let flags: Vec<String> = flags.collect();
    let flags: Vec<&str> = flags.iter().map(String::as_str).collect();
    let there = located(project, &[args, &flags].concat());
    assert_eq!(there.len(), pixels.len());
    for ((at, ground), pixel) in there.iter().zip(pixels) {
        assert_eq!([at.x, at.y].map(f64::to_bits), pixel.map(f64::to_bits));
        if let Some(due) = due(*at) {
            assert!((due - ground).length() < ROOM_M, "{args:?} {at}: {ground}, not {due}");
        }
    }
    let points: Vec<_> = there.iter().map(|(_, ground)| triple(&ground.to_array())).collect();
    let flags: Vec<&str> = points.iter().flat_map(|point| ["--ground", point]).collect();
    for ((at, _), (back, _)) in there.iter().zip(located(project, &[args, &flags].concat())) {
        let off = back - *at;
        assert!(off.x.hypot(off.y) < 1e-6 && off.z.abs() < ROOM_M, "{args:?} {at}: {back}");
    }
}

/// Pixels on surface, then corners and edges of the mosaic.
fn places(project: &Project, mosaic: &str) -> ([[f64; 2]; 3], Vec<[f64; 2]>) {
    let info = project.answer("info", &[mosaic]);
    let size = info.lines().find_map(|line| line.strip_prefix("size: ")).unwrap();
    let sides: Vec<f64> = size.split(' ').filter_map(|word| word.parse().ok()).collect();
    let (w, h) = (sides[0], sides[1]);
    let edges = vec![[0.0, 0.0], [w, 0.0], [0.0, h], [w, h], [0.5, 0.5], [w - 0.5, h / 3.0]];
    ([[60.5, 50.5], [61.25, 40.75], [40.125, 70.0]], edges)
}

#[test]
fn planes_and_cylinders_about_skew_axes_close_by_their_layers_and_beyond() {
    let project = Project::new(scenes::oblique());
    let p = project.test.placement;
    project.ortho("plane", &["--frame", "frame.toml", "--layers", "elevation"]);
    let frame = project.path("plane.frame.toml");
    let [origin, u, v] = ["origin", "u_axis", "v_axis"].map(|k| DVec3::from_slice(&key(&frame, k)));
    let (extent, pixel) = (key(&frame, "extent"), project.test.plane.pixel_size);
    let due = |at: DVec3| {
        let (a, b) = (extent[0] + at.x * pixel, extent[3] - at.y * pixel);
        Some(origin + u * a + v * b + u.cross(v) * at.z)
    };
    let (on_surface, edges) = places(&project, "plane.tif");
    assert_closes(&project, &["plane.tif"], &on_surface, due);
    assert_closes(&project, &["plane.tif", "--elevation", "-1.5"], &edges, due);
    // The wall from an axis a long way before it, or behind it, upright in neither the scene nor the ground.
    let axis = p.direction(DVec3::new(0.02, 1.0, 0.03)).normalize();
    for (facing, sense, z) in [("inside", -1.0, 20.0), ("outside", 1.0, -20.0)] {
        let origin = p.ground_from_scene(DVec3::new(1.2, 0.9, z));
        let towards = p.direction(DVec3::new(0.0, 0.0, -z));
        let zero = (towards - axis * axis.dot(towards)).normalize();
        let radius = if z > 0.0 { 20.7 } else { 19.8 };
        let vectors = [("origin", origin), ("axis", axis), ("zero", zero)];
        let mut text = format!("kind = \"cylinder\"\nfacing = \"{facing}\"\nradius = {radius}\n");
        for (name, vector) in vectors {
            writeln!(text, "{name} = {:?}", vector.to_array()).unwrap();
        }
        fs::write(project.path("axis.toml"), text).unwrap();
        let flags = ["--frame", "axis.toml", "--pixel-size", "0.02", "--layers", "elevation"];
        project.ortho(facing, &[&flags[..], &["--world-file"]].concat());
        let extent = key(&project.path(&format!("{facing}.frame.toml")), "extent");
        let due = |at: DVec3| {
            let angle = sense * (extent[0] + 0.02 * at.x) / radius;
            let around = zero * angle.cos() + axis.cross(zero) * angle.sin();
            let v = extent[3] - 0.02 * at.y;
            Some(origin + axis * v + around * (radius + sense * at.z))
        };
        let mosaic = format!("{facing}.tif");
        let (on_surface, edges) = places(&project, &mosaic);
        assert_closes(&project, &[&mosaic], &on_surface, due);
        assert_closes(&project, &[&mosaic, "--elevation", "0.75"], &edges, due);
        let world = fs::read_to_string(project.path(&format!("{facing}.tfw"))).unwrap();
        let lines: Vec<f64> = world.lines().map(|line| line.parse().unwrap()).collect();
        let due = [0.02, 0.0, 0.0, -0.02, extent[0] + 0.01, extent[3] - 0.01];
        assert_eq!(lines, due);
    }
}

#[test]
fn perspective_views_close_at_their_depths() {
    let project = Project::new(scenes::oblique());
    // As a photo saw it, distortion and all.
    fs::write(
        project.path("photo.toml"),
        "kind = \"perspective\"\nphoto = \"b.png\"\ndistorted = true\n",
    )
    .unwrap();
    project.ortho("photo", &["--frame", "photo.toml", "--layers", "elevation", "--dpi", "300"]);
    let (_, edges) = places(&project, "photo.tif");
    let args = ["photo.tif", "--cameras", "sparse"];
    assert_closes(&project, &args, &[[150.5, 120.5], [160.25, 100.75]], |_| None);
    assert_closes(&project, &[&args[..], &["--elevation", "2.5"]].concat(), &edges, |_| None);
    assert!(project.answer("info", &["photo.tif"]).contains("\nresolution: 300 dpi\n"));
    // A camera of its own, through no lens.
    let shot = project.test.shots.iter().find(|shot| shot.name == "b.png").unwrap();
    let ([w, x, y, z], t) = (shot.quaternion, shot.translation);
    let text = format!(
        "kind = \"perspective\"\n\
         camera = {{ model = \"PINHOLE\", width = 300, height = 200, params = [250.0, 251.0, 140.5, 104.25] }}\n\
         pose = {{ rotation = [{w:?}, {x:?}, {y:?}, {z:?}], translation = {:?} }}\n",
        t.to_array()
    );
    fs::write(project.path("own.toml"), text).unwrap();
    project.ortho("own", &["--frame", "own.toml", "--layers", "elevation"]);
    let turn = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
    let due = |at: DVec3| {
        let ray = DVec3::new((at.x - 140.5) / 250.0, (at.y - 104.25) / 251.0, 1.0);
        Some(turn.transpose() * (ray * at.z - t))
    };
    let (_, edges) = places(&project, "own.tif");
    assert_closes(&project, &["own.tif"], &[[140.5, 100.5], [150.25, 90.75]], due);
    assert_closes(&project, &["own.tif", "--elevation", "2.5"], &edges, due);
}
