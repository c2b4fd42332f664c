//! The rig in each format, by the format's published definition.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};
use groundel::input::CameraOptions;
use serde_json::{Value, json};

use crate::rig::{Bend, Camera, Rig, SIZE, quaternion};

/// Writes a rig into a folder and gives the path of the cameras; photos lie in `photos` of the folder.
pub(crate) type Writer = fn(&Rig, &Path) -> PathBuf;

/// What every format is read with.
pub(crate) fn options(folder: &Path) -> CameraOptions {
    CameraOptions { photos: Some(folder.join("photos")), ..CameraOptions::default() }
}

pub(crate) const W: f64 = SIZE.width as f64;
pub(crate) const H: f64 = SIZE.height as f64;

/// COLMAP's model, its number and its parameters.
fn colmap_lens(camera: &Camera) -> (&'static str, i32, Vec<f64>) {
    let (f, c) = (camera.focal, camera.principal);
    let (name, id, both, rest) = match camera.bend {
        Bend::Brown([k1, k2, k3], [p1, p2]) => {
            ("FULL_OPENCV", 6, true, vec![k1, k2, p1, p2, k3, 0.0, 0.0, 0.0])
        }
        Bend::Fisheye([k1, 0.0, 0.0, 0.0]) => ("SIMPLE_RADIAL_FISHEYE", 8, false, vec![k1]),
        Bend::Fisheye([k1, k2, 0.0, 0.0]) => ("RADIAL_FISHEYE", 9, false, vec![k1, k2]),
        Bend::Fisheye(k) => ("OPENCV_FISHEYE", 5, true, k.to_vec()),
        Bend::Fov(omega) => ("FOV", 7, true, vec![omega]),
        Bend::ThinPrism([k1, k2, k3, k4], [p1, p2], [s1, s2]) => {
            ("THIN_PRISM_FISHEYE", 10, true, vec![k1, k2, p1, p2, k3, k4, s1, s2])
        }
    };
    let focal = if both { vec![f, f] } else { vec![f] };
    (name, id, [&focal[..], &c.to_array(), &rest].concat())
}

pub(crate) fn words(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

pub(crate) fn rows(m: DMat3) -> [[f64; 3]; 3] {
    m.transpose().to_cols_array_2d()
}

pub(crate) fn written(path: PathBuf, text: &str) -> PathBuf {
    fs::write(&path, text).unwrap();
    path
}

pub(crate) fn colmap_text(rig: &Rig, folder: &Path) -> PathBuf {
    let (mut cameras, mut images, mut points) = (String::new(), String::new(), String::new());
    for (k, camera) in rig.cameras.iter().enumerate() {
        let (model, _, params) = colmap_lens(camera);
        writeln!(cameras, "{k} {model} {W} {H} {}", words(&params)).unwrap();
        let pose = [&quaternion(camera.rotation)[..], &camera.translation().to_array()].concat();
        writeln!(images, "{} {} {k} {}", 100 + k, words(&pose), camera.name).unwrap();
        write!(images, "1 1 -1").unwrap();
        for (p, at) in rig.seen[k].iter().enumerate() {
            write!(images, " {} {} {}", at.x, at.y, 7 * p).unwrap();
        }
        writeln!(images).unwrap();
    }
    for (p, point) in rig.points.iter().enumerate().rev() {
        writeln!(points, "{} {} 1 2 3 0.5 100 1 101 1", 7 * p, words(&point.to_array())).unwrap();
    }
    let sparse = folder.join("sparse");
    fs::create_dir_all(&sparse).unwrap();
    written(sparse.join("cameras.txt"), &cameras);
    written(sparse.join("images.txt"), &images);
    written(sparse.join("points3D.txt"), &points);
    sparse
}

pub(crate) fn colmap_binary(rig: &Rig, folder: &Path) -> PathBuf {
    let count = |n: usize| (n as u64).to_le_bytes();
    let floats = |v: &[f64]| v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let (mut cameras, mut images) = (count(6).to_vec(), count(6).to_vec());
    let mut points = count(rig.points.len()).to_vec();
    for (k, camera) in rig.cameras.iter().enumerate() {
        let id = u32::try_from(k).unwrap().to_le_bytes();
        cameras.extend(id);
        let (_, model, params) = colmap_lens(camera);
        cameras.extend(model.to_le_bytes());
        cameras.extend(u64::from(SIZE.width).to_le_bytes());
        cameras.extend(u64::from(SIZE.height).to_le_bytes());
        cameras.extend(floats(&params));
        images.extend(id);
        images.extend(floats(&quaternion(camera.rotation)));
        images.extend(floats(&camera.translation().to_array()));
        images.extend(id);
        images.extend([camera.name.as_bytes(), &[0], &count(rig.points.len() + 1)].concat());
        images.extend([floats(&[1.0, 1.0]), u64::MAX.to_le_bytes().to_vec()].concat());
        for (p, at) in rig.seen[k].iter().enumerate() {
            images.extend([&floats(&at.to_array())[..], &count(3 * p)].concat());
        }
    }
    for (p, point) in rig.points.iter().enumerate() {
        points.extend([&count(3 * p)[..], &floats(&point.to_array())].concat());
        points.extend([&[1, 2, 3][..], &floats(&[0.5]), &count(2), &[0; 16]].concat());
    }
    let sparse = folder.join("sparse_bin");
    fs::create_dir_all(&sparse).unwrap();
    for (name, bytes) in [("cameras", cameras), ("images", images), ("points3D", points)] {
        fs::write(sparse.join(name).with_extension("bin"), bytes).unwrap();
    }
    sparse
}

pub(crate) fn bundler(rig: &Rig, folder: &Path) -> PathBuf {
    let turn = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let mut list = String::new();
    let mut out = format!("# Bundle file v0.3\n{} {}\n", rig.cameras.len() + 1, rig.points.len());
    for camera in &rig.cameras {
        let ([k1, k2, _], _) = camera.brown();
        writeln!(list, "./images/{} 0 {}", camera.name, camera.focal).unwrap();
        writeln!(out, "{}", words(&[camera.focal, k1, k2])).unwrap();
        for row in rows(turn * camera.rotation) {
            writeln!(out, "{}", words(&row)).unwrap();
        }
        writeln!(out, "{}", words(&(turn * camera.translation()).to_array())).unwrap();
    }
    // One that Bundler did not register.
    list += "blurred.png\n";
    out += &"0 0 0\n".repeat(5);
    for (p, point) in rig.points.iter().enumerate() {
        write!(out, "{}\n10 20 30\n{}", words(&point.to_array()), rig.cameras.len()).unwrap();
        for (k, seen) in rig.seen.iter().enumerate() {
            write!(out, " {k} {p} {} {}", seen[p].x - 0.5 * W, 0.5 * H - seen[p].y).unwrap();
        }
        out += "\n";
    }
    written(folder.join("list.txt"), &list);
    written(folder.join("bundle.out"), &out)
}

pub(crate) fn opensfm(rig: &Rig, folder: &Path) -> PathBuf {
    let side = W.max(H);
    let (mut cameras, mut shots, mut points) = (json!({}), json!({}), json!({}));
    let mut tracks = "OPENSFM_TRACKS_VERSION_v2\n".to_owned();
    for (k, camera) in rig.cameras.iter().enumerate() {
        let id = format!("v2 unknown camera {k}");
        let mut entry = json!({
            "width": SIZE.width, "height": SIZE.height,
            "focal_x": camera.focal / side, "focal_y": camera.focal / side,
            "c_x": (camera.principal.x - 0.5 * W) / side, "c_y": (camera.principal.y - 0.5 * H) / side,
        });
        let set = |entry: &mut Value, kind: &str, names: &[&str], values: &[f64]| {
            entry["projection_type"] = json!(kind);
            names.iter().zip(values).for_each(|(name, value)| entry[*name] = json!(value));
        };
        match camera.bend {
            Bend::Brown([k1, k2, k3], [p1, p2]) => {
                set(&mut entry, "brown", &["k1", "k2", "k3", "p1", "p2"], &[k1, k2, k3, p1, p2]);
            }
            Bend::Fisheye(k) => set(&mut entry, "fisheye_opencv", &["k1", "k2", "k3", "k4"], &k),
            other => panic!("OpenSfM has no {other:?}"),
        }
        cameras[&id] = entry;
        let turn = DQuat::from_mat3(&camera.rotation).to_scaled_axis();
        shots[&camera.name] = json!({
            "rotation": turn.to_array(), "translation": camera.translation().to_array(),
            "camera": id, "orientation": 1, "capture_time": 0.0, "gps_dop": 15.0,
        });
        for (p, at) in rig.seen[k].iter().enumerate() {
            let (x, y) = ((at.x - 0.5 * W) / side, (at.y - 0.5 * H) / side);
            let name = &camera.name;
            writeln!(tracks, "{name}\t{p}\t{p}\t{x}\t{y}\t0.01\t1\t2\t3\t-1\t-1").unwrap();
        }
    }
    for (p, point) in rig.points.iter().enumerate() {
        points[p.to_string()] = json!({"color": [1, 2, 3], "coordinates": point.to_array()});
    }
    written(folder.join("tracks.csv"), &tracks);
    let all = json!([{"cameras": cameras, "shots": shots, "points": points, "biases": {}}]);
    written(folder.join("reconstruction.json"), &all.to_string())
}

pub(crate) fn openmvg(rig: &Rig, folder: &Path) -> PathBuf {
    let (mut views, mut intrinsics, mut extrinsics) = (Vec::new(), Vec::new(), Vec::new());
    for (k, camera) in rig.cameras.iter().enumerate() {
        views.push(json!({"key": k, "value": {"polymorphic_id": 1_073_741_824, "ptr_wrapper": {
            "id": 2_147_483_649_u32 + u32::try_from(k).unwrap(),
            "data": {"local_path": "", "filename": camera.name, "width": SIZE.width,
                "height": SIZE.height, "id_view": k, "id_intrinsic": k, "id_pose": k}}}}));
        let mut data = json!({"width": SIZE.width, "height": SIZE.height,
            "focal_length": camera.focal, "principal_point": camera.principal.to_array()});
        match camera.bend {
            Bend::Brown(k, p) => data["disto_t2"] = json!([&k[..], &p].concat()),
            Bend::Fisheye(k) => data["fisheye"] = json!(k),
            other => panic!("OpenMVG has no {other:?}"),
        }
        intrinsics.push(json!({"key": k, "value": {"polymorphic_id": 2_147_483_649_u32,
            "polymorphic_name": "pinhole_brown_t2", "ptr_wrapper": {"id": 1, "data": data}}}));
        extrinsics.push(json!({"key": k, "value": {"rotation": rows(camera.rotation),
            "center": camera.centre.to_array()}}));
    }
    let structure = rig.points.iter().enumerate().map(|(p, point)| {
        let seen =
            |k: usize| json!({"key": k, "value": {"id_feat": p, "x": rig.seen[k][p].to_array()}});
        let seen: Vec<Value> = (0..rig.cameras.len()).map(seen).collect();
        json!({"key": p, "value": {"X": point.to_array(), "observations": seen}})
    });
    let all = json!({"sfm_data_version": "0.3", "root_path": "/elsewhere/images", "views": views,
        "intrinsics": intrinsics, "extrinsics": extrinsics,
        "structure": structure.collect::<Vec<_>>(), "control_points": []});
    // Keys in the tool's order: the version comes first.
    let text = serde_json::to_string_pretty(&all).unwrap();
    let text = text.replacen('{', "{ \"sfm_data_version\": \"0.3\",", 1);
    written(folder.join("sfm_data.json"), &text.replace(",\n  \"sfm_data_version\": \"0.3\"", ""))
}

/// As version 1.2.6 writes it.
pub(crate) fn alicevision(rig: &Rig, folder: &Path) -> PathBuf {
    alicevision_of(rig, folder, Age::New)
}

/// As version 1.0 wrote it.
pub(crate) fn old_alicevision(rig: &Rig, folder: &Path) -> PathBuf {
    alicevision_of(rig, folder, Age::Old)
}

#[derive(Clone, Copy)]
enum Age {
    Old,
    New,
}

fn texts(values: &[f64]) -> Vec<String> {
    values.iter().map(f64::to_string).collect()
}

fn alicevision_of(rig: &Rig, folder: &Path, age: Age) -> PathBuf {
    let (mut views, mut intrinsics, mut poses) = (Vec::new(), Vec::new(), Vec::new());
    for (k, camera) in rig.cameras.iter().enumerate() {
        let (id, [width, height]) = (format!("44{k}"), [W, H].map(|v| v.to_string()));
        views.push(json!({"viewId": id, "poseId": id, "intrinsicId": id,
            "path": format!("/elsewhere/images/{}", camera.name), "width": width, "height": height,
            "metadata": {"Make": "a maker"}}));
        let (kind, params) = match camera.bend {
            Bend::Brown(k, p) => ("brown", [&k[..], &p].concat()),
            Bend::Fisheye(k) => ("fisheye4", k.to_vec()),
            other => panic!("AliceVision has no {other:?}"),
        };
        let mut entry = json!({"intrinsicId": id, "width": width, "height": height,
            "serialNumber": "1", "initializationMode": "estimated", "type": kind,
            "distortionParams": texts(&params), "locked": "0"});
        let c = camera.principal;
        match age {
            Age::Old => {
                entry["pxFocalLength"] = json!(camera.focal.to_string());
                entry["principalPoint"] = json!(texts(&c.to_array()));
            }
            Age::New => {
                entry["sensorWidth"] = json!("23.5");
                entry["sensorHeight"] = json!("15.6");
                entry["focalLength"] = json!((camera.focal * 23.5 / W).to_string());
                entry["pixelRatio"] = json!("1");
                entry["principalPoint"] = json!(texts(&[c.x - 0.5 * W, c.y - 0.5 * H]));
            }
        }
        intrinsics.push(entry);
        let columns = camera.rotation.to_cols_array();
        poses.push(json!({"poseId": id, "pose": {"transform": {"rotation": texts(&columns),
            "center": texts(&camera.centre.to_array())}, "locked": "0"}}));
    }
    let structure = rig.points.iter().enumerate().map(|(p, point)| {
        let seen = |k: usize| {
            json!({"observationId": format!("44{k}"), "featureId": p.to_string(),
            "x": texts(&rig.seen[k][p].to_array()), "scale": "2.5"})
        };
        let seen: Vec<Value> = (0..rig.cameras.len()).map(seen).collect();
        json!({"landmarkId": p.to_string(), "descType": "sift", "color": ["1", "2", "3"],
            "X": texts(&point.to_array()), "observations": seen})
    });
    let version = match age {
        Age::Old => ["1", "0", "0"],
        Age::New => ["1", "2", "6"],
    };
    let all = json!({"version": version, "featuresFolders": "", "views": views,
        "intrinsics": intrinsics, "poses": poses, "structure": structure.collect::<Vec<_>>()});
    // Keys in the tool's order: version and views come first.
    let mut text = String::from("{");
    for key in ["version", "featuresFolders", "views", "intrinsics", "poses", "structure"] {
        write!(text, "\n{:?}: {},", key, all[key]).unwrap();
    }
    text.pop();
    written(folder.join("cameras.sfm"), &(text + "\n}\n"))
}
