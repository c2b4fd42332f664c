//! glTF files written by hand, and every way in which one may lie.

use glam::DVec3;
use proptest::prelude::*;
use serde_json::{Value, json};

use super::GltfMesh;
use crate::geom::{Bounds3, MeshSource};
use crate::input::reading::{Read, read, with_file};
use crate::{Error, Result};

/// A square of four vertices, then indices as bytes, then as u16, then as u32; padded.
fn buffer() -> Vec<u8> {
    let square = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.5];
    let mut bytes: Vec<u8> = square.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0, 1, 2, 0, 2, 3, 0, 0]);
    bytes.extend([0_u16, 1, 2, 3].iter().flat_map(|k| k.to_le_bytes()));
    bytes.extend([3_u32, 2, 1].iter().flat_map(|k| k.to_le_bytes()));
    bytes
}

/// One node with one mesh of two triangles.
fn document() -> Value {
    json!({
        "asset": {"version": "2.0", "generator": "a hand"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "wall"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 9}, "indices": 1, "material": 3}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": [0, 0, 0], "max": [1, 1, 0.5]},
            {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"},
            {"bufferView": 2, "componentType": 5123, "count": 4, "type": "SCALAR"},
            {"bufferView": 2, "byteOffset": 8, "componentType": 5125, "count": 3, "type": "SCALAR", "min": [1]}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 8},
            {"buffer": 0, "byteOffset": 56, "byteLength": 20}
        ],
        "buffers": [{"byteLength": 76}]
    })
}

fn glb(document: &Value, buffer: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    let mut bytes = [&b"glTF"[..], &[2, 0, 0, 0], &length(28 + json.len() + buffer.len())].concat();
    bytes.extend([&length(json.len())[..], b"JSON", &json].concat());
    bytes.extend([&length(buffer.len())[..], b"BIN\0", buffer].concat());
    bytes
}

fn opened(bytes: &[u8]) -> Result<Read> {
    with_file("a.glb", bytes, |path| read(&GltfMesh::open(path)?))
}

/// The document with the value at `pointer` (which must exist, or be a key to add) replaced, as GLB.
fn changed(changes: &[(&str, Value)]) -> Vec<u8> {
    let mut document = document();
    for (pointer, value) in changes {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match document.pointer_mut(parent).unwrap() {
            Value::Array(list) => list[key.parse::<usize>().unwrap()] = value.clone(),
            table => table[key] = value.clone(),
        }
    }
    glb(&document, &buffer())
}

fn corners(bytes: &[u8]) -> Vec<[DVec3; 3]> {
    opened(bytes).unwrap().corners().into_iter().map(|(corners, _)| corners).collect()
}

const SQUARE: [DVec3; 4] =
    [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, 1.0, 0.5)];

fn triangle(k: [usize; 3]) -> [DVec3; 3] {
    k.map(|k| SQUARE[k])
}

#[test]
fn indices_of_every_type_and_none_name_the_vertices() {
    let two = [triangle([0, 1, 2]), triangle([0, 2, 3])];
    assert_eq!(corners(&changed(&[])), two);
    let found = opened(&changed(&[])).unwrap();
    assert_eq!((found.vertices.len(), found.faces.faces), (4, vec![0, 1]));
    let indices = "/meshes/0/primitives/0/indices";
    let mode = "/meshes/0/primitives/0/mode";
    assert_eq!(corners(&changed(&[(indices, json!(3))])), [triangle([3, 2, 1])]);
    let strip = [triangle([0, 1, 2]), triangle([1, 3, 2])];
    assert_eq!(corners(&changed(&[(indices, json!(2)), (mode, json!(5))])), strip);
    assert_eq!(corners(&changed(&[(indices, Value::Null), (mode, json!(5))])), strip);
    let fan = [triangle([1, 2, 0]), triangle([2, 3, 0])];
    assert_eq!(corners(&changed(&[(indices, json!(2)), (mode, json!(6))])), fan);
    let three = [(indices, Value::Null), ("/accessors/0/count", json!(3))];
    assert_eq!(corners(&changed(&three)), [triangle([0, 1, 2])]);
    let short = [(indices, Value::Null), (mode, json!(6)), ("/accessors/0/count", json!(2))];
    assert_eq!(corners(&changed(&short)), [[DVec3::ZERO; 3]; 0]);
}

#[test]
fn vertices_may_be_interleaved_and_the_last_may_end_with_the_buffer() {
    let mut bytes = Vec::new();
    for (k, p) in SQUARE.iter().enumerate() {
        bytes.extend([7; 4]);
        bytes.extend(p.as_vec3().to_array().iter().flat_map(|x| x.to_le_bytes()));
        if k < 3 {
            bytes.extend([8; 4]);
        }
    }
    let mut document = document();
    document["bufferViews"][0] = json!({"buffer": 0, "byteLength": 76, "byteStride": 20});
    document["accessors"][0]["byteOffset"] = json!(4);
    document["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0}, "mode": 6});
    let fan = [triangle([1, 2, 0]), triangle([2, 3, 0])];
    assert_eq!(corners(&glb(&document, &bytes)), fan);
}

#[test]
fn transforms_are_multiplied_down_the_tree_in_doubles() {
    let offset = [500_000.123_456_7, 4_200_000.765_432_1, 120.5];
    let nodes = json!([
        {"children": [2, 1], "translation": offset},
        {"mesh": 0},
        {"matrix": [0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 10, 0, 0, 1], "children": [3]},
        {"mesh": 0, "rotation": [0, 0, 1, 0], "scale": [1, 1, 3], "translation": [0, 0, 1]},
        {"mesh": 0}
    ]);
    let found = corners(&changed(&[("/nodes", nodes.clone())]));
    let offset = DVec3::from_array(offset);
    // Node 3 first: turned by half a turn, stretched, moved; then scaled by 2, turned by a quarter, moved.
    let node_3 = |p: DVec3| DVec3::new(-p.x, -p.y, 3.0 * p.z + 1.0);
    let node_2 = |p: DVec3| DVec3::new(10.0 - 2.0 * p.y, 2.0 * p.x, 2.0 * p.z);
    assert_eq!(found.len(), 4);
    for (k, corner) in [0, 2, 3].into_iter().enumerate() {
        let expected = node_2(node_3(SQUARE[corner])) + offset;
        assert!((found[1][k] - expected).length() < 1e-9, "{:?} {expected:?}", found[1][k]);
        assert_eq!(found[3][k], SQUARE[corner] + offset);
    }
    // Without scenes, all roots count, and node 4 is one.
    let mut whole = document();
    whole["nodes"] = nodes;
    whole.as_object_mut().unwrap().remove("scenes");
    whole.as_object_mut().unwrap().remove("scene");
    assert_eq!(corners(&glb(&whole, &buffer())).len(), 6);
}

#[test]
fn primitives_of_a_node_share_their_vertices() {
    let primitives = json!([
        {"attributes": {"POSITION": 0}, "indices": 1},
        {"attributes": {"POSITION": 0}, "indices": 3}
    ]);
    let found = opened(&changed(&[("/meshes/0/primitives", primitives)])).unwrap();
    assert_eq!(found.faces.triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
    assert_eq!((found.vertices.len(), found.faces.faces), (4, vec![0, 1, 2]));
}

#[test]
fn buffers_may_be_data_uris_and_files_beside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    let mut document = document();
    let expected = corners(&glb(&document, &buffer()));
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(folder.path().join("sub/a b.bin"), buffer()).unwrap();
    let letters = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut coded = String::new();
    for group in buffer().chunks(3) {
        let bits = group.iter().fold(0_usize, |sum, &b| sum << 8 | usize::from(b))
            << (8 * (3 - group.len()));
        (0..=group.len()).for_each(|k| coded.push(letters[bits >> (18 - 6 * k) & 63].into()));
    }
    for uri in
        ["sub/a%20b.bin".to_owned(), format!("data:application/octet-stream;base64,{coded}==")]
    {
        document["buffers"][0]["uri"] = json!(uri);
        std::fs::write(&path, format!("\u{feff} {document}")).unwrap();
        let mesh = GltfMesh::open(&path).unwrap();
        let found: Vec<_> = read(&mesh).unwrap().corners().into_iter().map(|c| c.0).collect();
        assert_eq!(found, expected);
        assert_eq!(mesh.further_files().len(), usize::from(uri.starts_with("sub")));
    }
    for (uri, said) in [
        ("../a.bin", "folder"),
        ("/a.bin", "folder"),
        ("http://a/b.bin", "folder"),
        ("", "folder"),
        ("a%2", "folder"),
        ("data:text/plain,abc", "Base64"),
        ("data:;base64,AAAA", "expected 76 bytes, as the document states, found 3"),
    ] {
        document["buffers"][0]["uri"] = json!(uri);
        std::fs::write(&path, document.to_string()).unwrap();
        let error = GltfMesh::open(&path).unwrap_err();
        assert!(error.to_string().contains(said) && error.exit_code() == 2, "{uri}: {error}");
    }
    document["buffers"][0]["uri"] = json!("none.bin");
    std::fs::write(&path, document.to_string()).unwrap();
    assert!(matches!(GltfMesh::open(&path), Err(Error::Io { .. })));
}

#[test]
fn what_is_not_supported_is_named() {
    let primitive = "/meshes/0/primitives/0";
    for (pointer, value, said) in [
        (
            "/extensionsRequired",
            json!(["KHR_draco_mesh_compression"]),
            "KHR_draco_mesh_compression",
        ),
        ("/extensionsRequired", json!(["KHR_materials_unlit", "CESIUM_RTC"]), "CESIUM_RTC"),
        ("/accessors/0/sparse", json!({"count": 1}), "accessor 0: a sparse accessor"),
        ("/accessors/1/sparse", json!({"count": 1}), "accessor 1: a sparse accessor"),
        ("/accessors/0/componentType", json!(5122), "positions that are no 32-bit floats"),
        (
            &format!("{primitive}/mode"),
            json!(1),
            "node 0, mesh 0, primitive 0: a primitive of lines",
        ),
        (&format!("{primitive}/mode"), json!(0), "a primitive of points"),
        (&format!("{primitive}/targets"), json!([]), "morph targets"),
        ("/nodes/0/skin", json!(0), "node 0: a skin"),
        ("/asset/version", json!("1.0"), "glTF version 1.0"),
    ] {
        let error = opened(&changed(&[(pointer, value)])).unwrap_err();
        assert!(matches!(error, Error::Unsupported { .. }), "{pointer}: {error}");
        assert!(error.to_string().contains(said), "{pointer}: {error}");
    }
    assert!(opened(&changed(&[("/extensionsRequired", json!(["KHR_materials_unlit"]))])).is_ok());
}

#[test]
fn what_does_not_fit_together_is_named() {
    let primitive = "/meshes/0/primitives/0";
    let cycle = json!([{"children": [1]}, {"children": [0], "mesh": 0}]);
    let two_parents = json!([{"children": [1, 1]}, {"mesh": 0}]);
    for (pointer, value, said) in [
        ("/scene", json!(1), "scene: expected a scene below 1, found 1"),
        ("/scenes/0/nodes", json!([7]), "expected a node below 1, found 7"),
        ("/nodes", cycle, "node 0: expected one parent at most"),
        ("/nodes", two_parents, "node 1: expected one parent at most"),
        ("/nodes/0/mesh", json!(4), "node 0: expected a mesh below 1, found 4"),
        ("/nodes/0/rotation", json!([0, 0, 0, 0]), "node 0: expected a rotation of length 1"),
        (
            "/nodes/0/matrix",
            json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 2]),
            "node 0: expected a matrix",
        ),
        (&format!("{primitive}/mode"), json!(7), "expected a mode from 0 to 6, found 7"),
        (
            &format!("{primitive}/attributes"),
            json!({}),
            "expected an attribute POSITION, found none",
        ),
        (
            &format!("{primitive}/attributes/POSITION"),
            json!(1),
            "expected accessor 1 of type VEC3, found SCALAR",
        ),
        (
            &format!("{primitive}/indices"),
            json!(0),
            "expected accessor 0 of type SCALAR, found VEC3",
        ),
        (&format!("{primitive}/indices"), json!(99), "expected an accessor below 4, found 99"),
        (
            &format!("{primitive}/indices"),
            json!(2),
            "expected a multiple of three corners, found 4",
        ),
        ("/accessors/1/componentType", json!(5126), "expected accessor 1: indices of type"),
        (
            "/accessors/0/count",
            json!(3),
            "node 0, primitive 0, index 5: expected a vertex below 3, found 3",
        ),
        ("/accessors/0/count", json!(5), "within its view of 48 bytes, found 60 bytes from byte 0"),
        ("/accessors/0/byteOffset", json!(u64::MAX), "within its view of 48 bytes"),
        ("/accessors/0/bufferView", json!(9), "expected accessor 0 with a buffer view, found none"),
        (
            "/bufferViews/0/byteStride",
            json!(8),
            "expected accessor 0: a stride from 12 to 252, found 8",
        ),
        ("/bufferViews/0/byteStride", json!(u64::MAX), "a stride from 12 to 252"),
        ("/bufferViews/2/byteLength", json!(21), "found 6"),
        ("/bufferViews/0/byteOffset", json!(u64::MAX), "a view within the 76 bytes of buffer 0"),
        ("/bufferViews/0/buffer", json!(1), "a view within the 0 bytes of buffer 1"),
        (
            "/buffers/0/byteLength",
            json!(77),
            "buffer 0: expected 77 bytes, as the document states, found 76",
        ),
        ("/buffers", json!([{"byteLength": 1}, {"byteLength": 1}]), "buffer 1: expected a URI"),
    ] {
        let result = opened(&changed(&[(pointer, value.clone())]));
        if pointer == "/bufferViews/2/byteLength" {
            // Of no use to the scene: not looked at.
            assert!(result.is_ok());
            continue;
        }
        let error = result.err().unwrap_or_else(|| panic!("{pointer} {value}"));
        assert!(matches!(error, Error::Corrupt { .. }), "{pointer}: {error}");
        assert!(error.to_string().contains(said), "{pointer}: {error}");
    }
    let many = changed(&[("/accessors/0/count", json!(1_u64 << 32))]);
    assert!(matches!(opened(&many), Err(Error::Limit { .. })));
}

#[test]
fn containers_that_are_cut_or_lie_are_errors() {
    let whole = changed(&[]);
    assert!(opened(&whole).is_ok());
    for length in 0..whole.len() {
        let error = opened(&whole[..length]).err().unwrap_or_else(|| panic!("cut at {length}"));
        assert!(matches!(error, Error::Corrupt { .. }), "{error}");
    }
    let with = |at: usize, value: [u8; 4]| {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&value);
        opened(&bytes).unwrap_err().to_string()
    };
    assert!(with(4, [1, 0, 0, 0]).contains("GLB version 1"));
    assert!(with(8, [0xff; 4]).contains("length: expected the 4294967295 bytes"));
    assert!(with(12, [0xff; 4]).contains("chunk 0 (byte 20): expected at most"));
    assert!(with(16, *b"BIN\0").contains("chunk 0 (byte 20): expected JSON"));
    assert!(with(20, *b"[[[[").contains("JSON, line 1, column"));
}

#[test]
fn lists_and_json_have_limits() {
    let nodes: Vec<Value> = vec![json!({}); (1 << 16) + 1];
    let error = opened(&changed(&[("/nodes", json!(nodes))])).unwrap_err().to_string();
    assert!(error.contains("a list of at most 65536 entries"), "{error}");
    let nodes = json!((0..40).map(|k| json!({"mesh": k % 2})).collect::<Vec<_>>());
    let primitives = vec![json!({"attributes": {"POSITION": 0}, "mode": 6}); 4000];
    let meshes = json!([{"primitives": primitives}, {"primitives": primitives}]);
    let scenes = json!([{"nodes": (0..40).collect::<Vec<_>>()}]);
    let many = changed(&[("/nodes", nodes), ("/meshes", meshes), ("/scenes", scenes)]);
    assert!(matches!(opened(&many), Err(Error::Limit { limit: 65536, .. })));
    let mut long = b"{".to_vec();
    long.resize((32 << 20) + 1, b' ');
    assert!(matches!(opened(&long), Err(Error::Limit { .. })));
}

#[test]
fn the_spacing_is_that_of_the_floats_before_the_transform() {
    let spacing = |changes: &[(&str, Value)]| {
        with_file("a.glb", &changed(changes), |path| {
            let far = Bounds3::of([DVec3::splat(4e6)]);
            GltfMesh::open(path).unwrap().spacing_m(&far)
        })
    };
    let moved = spacing(&[("/nodes/0/translation", json!([5e5, 4.2e6, 0]))]);
    assert!(moved < 1e-6, "{moved}");
    let far = spacing(&[
        ("/accessors/0/max", json!([1, 4.2e6, 1])),
        ("/nodes/0/scale", json!([2, 2, 2])),
    ]);
    assert_eq!(far.to_bits(), 1.0_f64.to_bits());
}

proptest! {
    #[test]
    fn a_damaged_file_is_read_or_refused_but_never_panics(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut bytes = changed(&[("/nodes/0/translation", json!([1, 2, 3]))]);
        for (place, value) in edits {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        match opened(&bytes) {
            Ok(found) => {
                let all = found.vertices.len();
                prop_assert!(found.faces.triangles.iter().flatten().all(|&v| (v as usize) < all));
            }
            Err(error) => prop_assert!(!matches!(error, Error::Io { .. }) || error.to_string().contains("No such"), "{error}"),
        }
    }
}
