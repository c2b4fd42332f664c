//! Every flavour of PLY, by a writer that shares no code with the reader; and files that are not what they say.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;
use proptest::prelude::*;

use super::PlyMesh;
use crate::geom::{MeshSource, TriangleChunk};
use crate::{Error, Result};

/// How a test file is written.
#[derive(Debug, Clone, Copy)]
struct Flavour {
    format: &'static str,
    line_end: &'static str,
    coordinate: &'static str,
    count: &'static str,
    index: &'static str,
    list: &'static str,
    /// Whether further elements and properties stand before, between and after.
    extras: Extras,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Extras {
    None,
    Fixed,
    Lists,
}

const PLAIN: Flavour = Flavour {
    format: "binary_little_endian",
    line_end: "\n",
    coordinate: "float",
    count: "uchar",
    index: "int",
    list: "vertex_indices",
    extras: Extras::None,
};

/// A body, value by value.
struct Body {
    flavour: Flavour,
    bytes: Vec<u8>,
}

impl Body {
    fn put(&mut self, kind: &str, value: f64) {
        if self.flavour.format == "ascii" {
            self.bytes.extend(format!("{value} ").bytes());
            return;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "test values fit"
        )]
        let mut bytes = match kind {
            "char" | "int8" => (value as i8).to_le_bytes().to_vec(),
            "uchar" | "uint8" => (value as u8).to_le_bytes().to_vec(),
            "short" => (value as i16).to_le_bytes().to_vec(),
            "ushort" => (value as u16).to_le_bytes().to_vec(),
            "int" => (value as i64 as i32).to_le_bytes().to_vec(),
            "uint" => (value as u32).to_le_bytes().to_vec(),
            "float" => (value as f32).to_le_bytes().to_vec(),
            "double" | "float64" => value.to_le_bytes().to_vec(),
            other => panic!("type {other}"),
        };
        if self.flavour.format == "binary_big_endian" {
            bytes.reverse();
        }
        self.bytes.extend(bytes);
    }

    fn put_list(&mut self, count: &str, item: &str, values: &[f64]) {
        self.put(count, values.len() as f64);
        for &value in values {
            self.put(item, value);
        }
    }

    fn end_record(&mut self) {
        if self.flavour.format == "ascii" {
            self.bytes.extend(self.flavour.line_end.bytes());
        }
    }
}

/// The file's bytes, and the length of its header.
fn ply(flavour: Flavour, vertices: &[[f64; 3]], faces: &[Vec<u32>]) -> (Vec<u8>, usize) {
    let Flavour { coordinate, count, index, extras, .. } = flavour;
    let mut header = format!("ply\nformat {} 1.0\ncomment élan\nobj_info x\n", flavour.format);
    let mut body = Body { flavour, bytes: Vec::new() };
    let extra_element = |header: &mut String, body: &mut Body, name: &str| match extras {
        Extras::None => {}
        Extras::Fixed => {
            writeln!(header, "element {name} 2\nproperty short a\nproperty double b").unwrap();
            for _ in 0..2 {
                body.put("short", -7.0);
                body.put("double", 0.5);
                body.end_record();
            }
        }
        Extras::Lists => {
            writeln!(header, "element {name} 2\nproperty list ushort float a\nproperty char b")
                .unwrap();
            for items in [&[0.25, 4.0][..], &[]] {
                body.put_list("ushort", "float", items);
                body.put("char", 3.0);
                body.end_record();
            }
        }
    };
    extra_element(&mut header, &mut body, "before");
    writeln!(header, "element vertex {}", vertices.len()).unwrap();
    if extras == Extras::Lists {
        header += "property list uchar short quality\n";
    }
    writeln!(header, "property {coordinate} x").unwrap();
    if extras != Extras::None {
        header += "property uchar red\n";
    }
    writeln!(header, "property {coordinate} y\nproperty {coordinate} z").unwrap();
    for (k, p) in vertices.iter().enumerate() {
        if extras == Extras::Lists {
            body.put_list("uchar", "short", &[1.0, -2.0, 3.0][..k % 4]);
        }
        body.put(coordinate, p[0]);
        if extras != Extras::None {
            body.put("uchar", 255.0);
        }
        body.put(coordinate, p[1]);
        body.put(coordinate, p[2]);
        body.end_record();
    }
    extra_element(&mut header, &mut body, "between");
    writeln!(header, "element face {}", faces.len()).unwrap();
    if extras != Extras::None {
        header += "property int x\n";
    }
    writeln!(header, "property list {count} {index} {}", flavour.list).unwrap();
    if extras == Extras::Lists {
        header += "property list uchar float texcoord\n";
    }
    if extras != Extras::None {
        header += "property double area\n";
    }
    for face in faces {
        if extras != Extras::None {
            body.put("int", -1.0);
        }
        let indices: Vec<f64> = face.iter().map(|&v| f64::from(v)).collect();
        body.put_list(count, index, &indices);
        if extras == Extras::Lists {
            body.put_list("uchar", "float", &[0.5; 6][..face.len() % 7]);
        }
        if extras != Extras::None {
            body.put("double", 1e9);
        }
        body.end_record();
    }
    extra_element(&mut header, &mut body, "after");
    header += "end_header\n";
    let header = header.replace('\n', flavour.line_end).into_bytes();
    let length = header.len();
    ([header, body.bytes].concat(), length)
}

/// What a reader gives: vertices, triangles, ordinals, short faces.
type Content = (Vec<DVec3>, TriangleChunk);

fn read_in(path: &Path, max: usize) -> Result<Content> {
    let mesh = PlyMesh::open(path)?;
    let (mut vertices, mut chunk) = (Vec::new(), Vec::new());
    let mut stream = mesh.vertices()?;
    loop {
        stream.next_vertices(max, &mut chunk)?;
        if chunk.is_empty() {
            break;
        }
        assert!(chunk.len() <= max);
        vertices.append(&mut chunk);
    }
    let (mut all, mut some) = (TriangleChunk::default(), TriangleChunk::default());
    let mut stream = mesh.faces()?;
    loop {
        stream.next_faces(max, &mut some)?;
        if some.is_empty() {
            break;
        }
        all.triangles.append(&mut some.triangles);
        all.faces.append(&mut some.faces);
        all.short_faces += some.short_faces;
    }
    assert_eq!(vertices.len() as u64, mesh.vertex_count());
    Ok((vertices, all))
}

fn write(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("test.ply");
    std::fs::write(&path, bytes).unwrap();
    (dir, path)
}

fn read(bytes: &[u8]) -> Result<Content> {
    let (_dir, path) = write(bytes);
    read_in(&path, 5)
}

fn expected(vertices: &[[f64; 3]], faces: &[Vec<u32>]) -> Content {
    let mut chunk = TriangleChunk::default();
    for (ordinal, face) in faces.iter().enumerate() {
        for k in 2..face.len() {
            chunk.push(u32::try_from(ordinal).unwrap(), [face[0], face[k - 1], face[k]]);
        }
        chunk.short_faces += u64::from(face.len() < 3);
    }
    (vertices.iter().map(|&p| DVec3::from_array(p)).collect(), chunk)
}

fn assert_content(found: &Content, expected: &Content) {
    assert_eq!(found.0, expected.0);
    assert_eq!(found.1.triangles, expected.1.triangles);
    assert_eq!(found.1.faces, expected.1.faces);
    assert_eq!(found.1.short_faces, expected.1.short_faces);
}

fn small_mesh() -> (Vec<[f64; 3]>, Vec<Vec<u32>>) {
    let vertices = (0..9).map(|k| [f64::from(k), f64::from(k * k), 100.0 - f64::from(k)]).collect();
    let faces = vec![
        vec![0, 1, 2],
        vec![3, 4, 5, 6],
        vec![],
        vec![2, 1],
        vec![8, 7, 6, 5, 4, 3, 2, 1, 0],
        vec![7],
        vec![8, 0, 4],
    ];
    (vertices, faces)
}

#[test]
fn every_flavour_reads_back() {
    let (vertices, faces) = small_mesh();
    let expected = expected(&vertices, &faces);
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for extras in [Extras::None, Extras::Fixed, Extras::Lists] {
            for coordinate in ["char", "uchar", "short", "ushort", "int", "uint", "float", "double"]
            {
                for (count, index, list, line_end) in [
                    ("uchar", "int", "vertex_indices", "\n"),
                    ("int", "uint", "vertex_index", "\r\n"),
                    ("ushort", "uchar", "vertex_indices", "\n"),
                    ("char", "short", "vertex_index", "\r\n"),
                    ("float", "double", "vertex_indices", "\n"),
                    ("uint", "float", "vertex_indices", "\n"),
                ] {
                    let flavour =
                        Flavour { format, line_end, coordinate, count, index, list, extras };
                    let found = read(&ply(flavour, &vertices, &faces).0);
                    assert_content(
                        &found.unwrap_or_else(|e| panic!("{flavour:?}: {e}")),
                        &expected,
                    );
                }
            }
        }
    }
}

#[test]
fn text_keeps_the_digits_of_utm_coordinates_whatever_type_it_states() {
    let vertices = [[500_000.012_345_6, 4_200_000.987_654_3, -0.000_000_1]];
    let flavour = Flavour { format: "ascii", ..PLAIN };
    assert_eq!(read(&ply(flavour, &vertices, &[]).0).unwrap().0[0], DVec3::from_array(vertices[0]));
}

#[test]
fn polygons_and_lists_larger_than_the_buffer_pass_in_small_chunks() {
    let vertices = [[0.0; 3], [1.0; 3], [2.0; 3]];
    let huge: Vec<u32> = (0..400_000).map(|k| k % 3).collect();
    let faces = vec![vec![0, 1, 2], huge, vec![2, 1, 0], vec![0; 3000]];
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for extras in [Extras::None, Extras::Lists] {
            let flavour = Flavour { format, count: "int", extras, ..PLAIN };
            let (_dir, path) = write(&ply(flavour, &vertices, &faces).0);
            assert_content(&read_in(&path, 1000).unwrap(), &expected(&vertices, &faces));
            let mesh = PlyMesh::open(&path).unwrap();
            let (mut stream, mut chunk) = (mesh.faces().unwrap(), TriangleChunk::default());
            stream.next_faces(100, &mut chunk).unwrap();
            stream.next_faces(100, &mut chunk).unwrap();
            assert!(chunk.triangles.len() <= 100, "{format}: {}", chunk.triangles.len());
        }
    }
}

#[test]
fn a_file_cut_anywhere_in_its_body_is_an_error_that_names_the_element() {
    let (vertices, faces) = small_mesh();
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for extras in [Extras::None, Extras::Lists] {
            let flavour = Flavour { format, extras, ..PLAIN };
            let (bytes, header) = ply(flavour, &vertices, &faces);
            // Elements after the faces are not read, and a text cut within its last number is not seen to be cut.
            let after = match (format, extras) {
                ("ascii", Extras::Lists) => "000000000 \n2 0.25 4 3 \n0 3 \n".len(),
                ("ascii", _) => 2,
                (_, Extras::Lists) => 2 + 8 + 1 + 2 + 1,
                _ => 0,
            };
            for length in header..bytes.len() - after {
                let message = match read(&bytes[..length]) {
                    Ok(_) => panic!("{format} {extras:?} cut at {length} of {}", bytes.len()),
                    Err(error) => error.to_string(),
                };
                assert!(
                    ["vertex", "face", "before", "between", "header"]
                        .iter()
                        .any(|e| message.contains(e)),
                    "{message}"
                );
            }
        }
    }
}

#[test]
fn an_index_out_of_range_is_an_error_that_names_face_and_index() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for (index, value) in [("int", 3), ("uint", u32::MAX), ("int", u32::MAX), ("uchar", 255)] {
            for polygon in [vec![0, 1, value], vec![0, value, 1, 2], vec![value]] {
                let faces = vec![vec![0, 1, 2], polygon];
                let value =
                    if index == "int" { value.cast_signed().into() } else { f64::from(value) };
                let flavour = Flavour { format, index, ..PLAIN };
                let (mut bytes, _) = ply(flavour, &[[0.0; 3]; 3], &faces);
                if format == "ascii" && index == "int" {
                    let text = String::from_utf8_lossy(&bytes).replace("4294967295", "-1");
                    bytes = text.into_bytes();
                }
                let message = match read(&bytes) {
                    Ok(_) => panic!("{flavour:?} {faces:?}"),
                    Err(e) => e.to_string(),
                };
                assert!(message.contains("face 1 "), "{message}");
                assert!(message.contains("below 3"), "{message}");
                let value =
                    if index == "int" && format != "ascii" && value > 2e9 { -1.0 } else { value };
                assert!(message.ends_with(&format!("found {value}")), "{message}");
            }
        }
    }
}

#[test]
fn a_senseless_list_count_is_an_error() {
    let faces = [vec![0, 1, 2]];
    for (count, format) in [("char", "binary_little_endian"), ("float", "binary_big_endian")] {
        let flavour = Flavour { format, count, ..PLAIN };
        let (mut bytes, header) = ply(flavour, &[[0.0; 3]; 3], &faces);
        bytes[header + 36] = 0xff;
        let message = read(&bytes).err().unwrap().to_string();
        assert!(message.contains("face 0") && message.contains("list count"), "{message}");
    }
    let flavour = Flavour { count: "uint", ..PLAIN };
    let (mut bytes, header) = ply(flavour, &[[0.0; 3]; 3], &faces);
    bytes[header + 36..header + 40].fill(0xff);
    assert!(read(&bytes).err().unwrap().to_string().contains("face 0"));
}

#[test]
fn a_line_of_text_with_too_many_or_too_few_values_is_an_error() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    let body = "0 0 0\n\n  1 0 0 \n0 1 0\n3 0 1 2";
    assert!(read(format!("{text}{body}").as_bytes()).is_ok());
    for (from, to, place) in [
        ("1 0 0", "1 0 0 0", "vertex 1"),
        ("1 0 0", "1 0", "vertex 1"),
        ("1 0 0", "1 O 0", "vertex 1"),
        ("3 0 1 2", "3 0 1 2 1", "face 0"),
        ("3 0 1 2", "3 0 1", "face 0"),
        ("3 0 1 2", "3 0 1 1.5", "face 0"),
        ("3 0 1 2", "-3 0 1 2", "face 0"),
    ] {
        let message = read(format!("{text}{}", body.replacen(from, to, 1)).as_bytes());
        let message = message.err().unwrap_or_else(|| panic!("{to}")).to_string();
        assert!(message.contains(place), "{to}: {message}");
    }
}

#[test]
fn headers_without_a_mesh_are_refused_with_the_reason() {
    let (bytes, _) = ply(Flavour { format: "ascii", ..PLAIN }, &[], &[]);
    let text = String::from_utf8(bytes).unwrap();
    for (from, to, reason) in [
        ("element vertex", "element vertices", "`vertex`"),
        ("property float y\n", "", "`y`"),
        ("property float y", "property list int float y", "a list"),
        ("element face", "element edge", "point cloud"),
        ("element face", "element tristrips", "strips"),
        ("list uchar int vertex_indices", "list uchar int corners", "vertex_indices"),
        ("list uchar int vertex_indices", "int vertex_indices", "a number"),
        ("1.0", "2.0", "version 2.0"),
    ] {
        let message = read(text.replace(from, to).as_bytes()).err().unwrap().to_string();
        assert!(message.contains(reason), "{message}");
    }
}

#[test]
fn vertices_that_are_not_finite_are_for_the_receiver_to_judge() {
    let vertices = [[f64::NAN, 0.0, 0.0], [0.0, f64::INFINITY, 0.0]];
    for format in ["ascii", "binary_little_endian"] {
        let found = read(&ply(Flavour { format, ..PLAIN }, &vertices, &[]).0).unwrap().0;
        assert!(found[0].x.is_nan() && found[1].y == f64::INFINITY, "{found:?}");
    }
}

#[test]
fn an_element_of_nothing_takes_no_time_however_many_there_are() {
    let (bytes, _) = ply(PLAIN, &[[0.0; 3]; 3], &[vec![0, 1, 2]]);
    let header = format!("element nothing {}\nelement vertex", u64::MAX);
    let at = bytes.windows(14).position(|w| w == b"element vertex").unwrap();
    let bytes = [&bytes[..at], header.as_bytes(), &bytes[at + 14..]].concat();
    assert_eq!(read(&bytes).unwrap().1.triangles, [[0, 1, 2]]);
}

proptest! {
    #[test]
    fn a_damaged_file_is_read_or_refused_but_never_panics(
        format in prop::sample::select(vec!["ascii", "binary_little_endian", "binary_big_endian"]),
        extras in prop::sample::select(vec![Extras::None, Extras::Fixed, Extras::Lists]),
        count in prop::sample::select(vec!["uchar", "int", "float"]),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let (vertices, faces) = small_mesh();
        let (mut bytes, _) = ply(Flavour { format, count, extras, ..PLAIN }, &vertices, &faces);
        for (place, value) in edits {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        match read(&bytes) {
            Ok((vertices, chunk)) => {
                prop_assert!(chunk.triangles.iter().flatten().all(|&v| (v as usize) < vertices.len()));
            }
            Err(error) => prop_assert!(!matches!(error, Error::Io { .. }), "{error}"),
        }
    }
}
