//! One mesh in every format: the same mosaics, byte for byte, face ids included.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use glam::DVec3;
use groundel::synthetic::{Sampling, TestScene, scenes, write_triangles};

const LAYERS: [&str; 6] = ["elevation", "face", "count", "used", "coverage", "best"];

type Triangles = [[DVec3; 3]];

/// Columns before a wall, at coordinates that 32-bit floats hold.
fn scene() -> TestScene {
    let mut scene = scenes::columns();
    for corner in scene.triangles.as_flattened_mut() {
        *corner = corner.as_vec3().as_dvec3();
    }
    scene
}

/// Vertices once each, faces by numbers from 1 and, every second, from the end.
fn obj(triangles: &Triangles) -> String {
    let mut text = "# all vertices, then all faces\nmtllib none.mtl\no scene\n".to_owned();
    let mut numbers = BTreeMap::new();
    for corner in triangles.as_flattened() {
        let next = numbers.len() + 1;
        numbers.entry(corner.to_array().map(f64::to_bits)).or_insert_with(|| {
            writeln!(text, "v {} {} {} 0.5 0.5 0.5", corner.x, corner.y, corner.z).unwrap();
            next
        });
    }
    for (k, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|corner| numbers[&corner.to_array().map(f64::to_bits)]);
        let count = numbers.len();
        if k % 2 == 0 {
            writeln!(text, "f {a}//1 {b}/2/2 \\\n {c}").unwrap();
        } else {
            let back = |number: usize| count + 1 - number;
            writeln!(text, "f -{} -{} -{}", back(a), back(b), back(c)).unwrap();
        }
    }
    text
}

fn stl_text(triangles: &Triangles) -> String {
    let mut text = "solid scene\n".to_owned();
    for triangle in triangles {
        text.push_str("facet normal 0 0 0\n outer loop\n");
        for corner in triangle {
            writeln!(text, "  vertex {:e} {:e} {:e}", corner.x, corner.y, corner.z).unwrap();
        }
        text.push_str(" endloop\nendfacet\n");
    }
    text + "endsolid scene\n"
}

fn stl_binary(triangles: &Triangles) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(count(triangles.len()).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flat_map(|corner| floats(*corner)));
        bytes.extend([0; 2]);
    }
    bytes
}

fn xyz(triangles: &Triangles) -> String {
    let mut text = String::new();
    for [a, b, c] in triangles {
        let numbers = [a, b, c].map(|p| format!("{} {} {}", p.x, p.y, p.z));
        text += &(numbers.join("  ") + "\n");
    }
    text
}

/// Half of the triangles in order, half by indices, in two primitives.
fn glb(triangles: &Triangles) -> Vec<u8> {
    let (one, two) = triangles.split_at(triangles.len() / 2);
    let mut buffer: Vec<u8> = Vec::new();
    buffer.extend(triangles.as_flattened().iter().flat_map(|corner| floats(*corner)));
    let index_start = buffer.len();
    buffer.extend((0..count(3 * two.len())).flat_map(u32::to_le_bytes));
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[1]}}],
        "nodes":[{{"mesh":0}},{{"children":[0],"translation":[0,0,0]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}},
            {{"attributes":{{"POSITION":1}},"indices":2,"mode":4}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3"}},
            {{"bufferView":0,"byteOffset":{},"componentType":5126,"count":{},"type":"VEC3"}},
            {{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{index_start}}},
            {{"buffer":0,"byteOffset":{index_start},"byteLength":{}}}],
        "buffers":[{{"byteLength":{}}}]}}"#,
        3 * one.len(),
        36 * one.len(),
        3 * two.len(),
        3 * two.len(),
        buffer.len() - index_start,
        buffer.len(),
    )
    .into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    for number in [2, 28 + json.len() + buffer.len(), json.len()] {
        bytes.extend(count(number).to_le_bytes());
    }
    bytes.extend(
        [&b"JSON"[..], &json, &count(buffer.len()).to_le_bytes(), b"BIN\0", &buffer].concat(),
    );
    bytes
}

fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap()
}

fn floats(p: DVec3) -> Vec<u8> {
    p.as_vec3().to_array().iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Renders the project in `folder` with these meshes, into a folder called `name`.
fn ortho(folder: &Path, name: &str, meshes: &[&str], flags: &[&str]) -> (Output, PathBuf) {
    let out = folder.join(name).join("mosaic.tif");
    fs::create_dir_all(folder.join(name)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_groundel"));
    command.arg("ortho").current_dir(folder).args(meshes.iter().flat_map(|m| ["--mesh", m]));
    command.args(["--cameras", "sparse", "--photos", "photos", "--frame", "frame.toml"]);
    command.args(["--memory", "256MiB", "--layers", &LAYERS.join(","), "--out"]).arg(&out);
    (command.args(flags).output().unwrap(), out)
}

/// The mosaic and its layers, which must have been made.
fn rendered(folder: &Path, name: &str, meshes: &[&str], flags: &[&str]) -> Vec<Vec<u8>> {
    let (run, out) = ortho(folder, name, meshes, flags);
    assert!(run.status.success(), "{name}: {}", String::from_utf8_lossy(&run.stderr));
    let layers = LAYERS.iter().map(|l| out.with_extension(format!("{l}.tif")));
    layers.chain([out.clone()]).map(|file| fs::read(file).unwrap()).collect()
}

fn project(scene: &TestScene) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    scene.write(folder.path(), Sampling::Box(4), &[]).unwrap();
    folder
}

#[test]
fn every_format_of_one_mesh_gives_the_same_bytes() {
    let scene = scene();
    let (project, triangles) = (project(&scene), &scene.triangles[..]);
    let folder = project.path();
    let reference = rendered(folder, "reference", &["mesh.ply"], &[]);
    let ply = fs::read(folder.join("mesh.ply")).unwrap();
    let shift = DVec3::new(512.0, -256.0, 64.0);
    let reduced: Vec<_> = triangles.iter().map(|t| t.map(|corner| corner - shift)).collect();
    for (name, bytes, flags) in [
        ("mesh.obj", obj(triangles).into_bytes(), &[][..]),
        ("mesh.stl", stl_binary(triangles), &[]),
        ("text.stl", stl_text(triangles).into_bytes(), &[]),
        ("mesh.xyz", xyz(triangles).into_bytes(), &[]),
        ("mesh.glb", glb(triangles), &[]),
        ("mesh.obj.gz", gzip(obj(triangles).as_bytes()), &[]),
        ("mesh.xyz.zst", zstd::encode_all(xyz(triangles).as_bytes(), 3).unwrap(), &[]),
        ("mesh.stl.gz", gzip(&stl_binary(triangles)), &[]),
        ("mesh.ply.zst", zstd::encode_all(&ply[..], 3).unwrap(), &[]),
        ("reduced.obj", obj(&reduced).into_bytes(), &["--shift", "512,-256,64"]),
    ] {
        fs::write(folder.join(name), bytes).unwrap();
        let found = rendered(folder, &format!("of {name}"), &[name], flags);
        assert!(found == reference, "{name}");
    }
}

#[test]
fn face_ids_run_on_over_meshes_of_several_formats() {
    let scene = scene();
    let (project, triangles) = (project(&scene), &scene.triangles[..]);
    let folder = project.path();
    let reference = rendered(folder, "reference", &["mesh.ply"], &[]);
    let (one, rest) = triangles.split_at(triangles.len() / 3);
    let (two, three) = rest.split_at(rest.len() / 2);
    fs::write(folder.join("1.obj"), obj(one)).unwrap();
    fs::write(folder.join("2.stl"), stl_binary(two)).unwrap();
    write_triangles(&folder.join("3.ply"), three).unwrap();
    assert!(rendered(folder, "three", &["1.obj", "2.stl", "3.ply"], &[]) == reference);
    let turned = rendered(folder, "turned", &["3.ply", "1.obj", "2.stl"], &[]);
    assert!(turned != reference && turned[0] == reference[0], "other ids, the same surface");
}

#[test]
fn two_shifts_do_not_share_a_store() {
    let scene = scene();
    let project = project(&scene);
    let folder = project.path();
    let shared = |shift| [&["--work", "work", "--quiet"][..], shift].concat();
    let reference = rendered(folder, "plain", &["mesh.ply"], &shared(&[]));
    let moved = rendered(folder, "moved", &["mesh.ply"], &shared(&["--shift", "0,0,0.25"]));
    assert!(moved != reference);
    let back = rendered(folder, "back", &["mesh.ply"], &shared(&["--shift", "-0,0,0"]));
    assert!(back == reference);
}

#[test]
fn floats_that_lose_detail_are_warned_of_in_words_and_in_the_report() {
    let mut scene = scene();
    let far = DVec3::new(3000.0, 0.0, 0.0);
    scene.triangles.push([far, far + DVec3::X, far + DVec3::Y]);
    let (project, triangles) = (project(&scenes::columns()), &scene.triangles[..]);
    let folder = project.path();
    fs::write(folder.join("mesh.stl"), stl_binary(triangles)).unwrap();
    fs::write(folder.join("mesh.obj"), obj(triangles)).unwrap();
    let warned = |name: &str, flags: &[&str]| {
        let report = folder.join(format!("{name}.json"));
        let flags = [flags, &["--report", report.to_str().unwrap()]].concat();
        let (run, _) = ortho(folder, &format!("of {name}"), &[name], &flags);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(run.status.success(), "{said}");
        let report: serde_json::Value = serde_json::from_slice(&fs::read(report).unwrap()).unwrap();
        (said, report)
    };
    let (said, report) = warned("mesh.stl", &[]);
    let words = "mesh.stl: its coordinates are 32-bit floats, which stand 0.2 mm apart";
    assert!(said.contains(&format!("groundel: warning: {words}")), "{said}");
    assert!(report["warnings"][0].as_str().unwrap().contains(words), "{report}");
    let (said, report) = warned("mesh.obj", &["--shift", "0,0,-0.0"]);
    assert!(!said.contains("warning") && report["warnings"] == serde_json::json!([]), "{said}");
    assert_eq!(report["settings"]["shift"], serde_json::json!([0.0, 0.0, 0.0]));
}
