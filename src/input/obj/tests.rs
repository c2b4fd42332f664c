//! OBJ files written by hand, with every liberty that the format and its writers take.

use glam::DVec3;
use proptest::prelude::*;

use super::ObjMesh;
use crate::geom::TriangleChunk;
use crate::input::reading::{Read, read, read_in, with_file};
use crate::{Error, Result};

fn obj(text: &[u8]) -> Result<Read> {
    with_file("a.obj", text, |path| read(&ObjMesh::open(path)?))
}

fn message(text: &str) -> String {
    obj(text.as_bytes()).err().unwrap_or_else(|| panic!("accepted: {text:?}")).to_string()
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn corners_may_bear_texture_and_normal_and_polygons_any_number_of_corners() {
    let text = format!(
        "# made by hand\r\nmtllib a b.mtl\no wall\n{SQUARE}vt 0 0\nvn 0 0 1\ns off\nusemtl stone\n\
         g front main\nf 1 2 3\nf 1/1 2/1 3/1\nf 1//1 2//1 3//1\nf 1/1/1 2/1/1 3/1/1 4/1/1\nl 1 2\np 1\n\
         f 1 2\nf\nfo 4 3 2"
    );
    for text in [text.clone(), text.replace('\n', "\r\n"), text.replace('\n', " \t\n\n")] {
        let found = obj(text.as_bytes()).unwrap();
        assert_eq!(found.vertices.len(), 4);
        assert_eq!(found.vertices[2], DVec3::new(1.0, 1.0, 0.0));
        let triangles = [[0, 1, 2], [0, 1, 2], [0, 1, 2], [0, 1, 2], [0, 2, 3], [3, 2, 1]];
        assert_eq!(found.faces.triangles, triangles);
        assert_eq!((found.faces.faces, found.faces.short_faces), (vec![0, 1, 2, 3, 3, 6], 2));
    }
}

#[test]
fn weights_and_colours_behind_the_coordinates_are_passed_over() {
    let text = "v 500000.012345 4200000.9876543 -1e-7 1.0\nv 1 2 3 0.5 0.5 0.5\nv +1 2 3 1 255 0 0 # c\n\
                f 1 2 3\n";
    let found = obj(text.as_bytes()).unwrap().vertices;
    assert_eq!(found[0], DVec3::new(500_000.012_345, 4_200_000.987_654_3, -1e-7));
    assert_eq!(found[1..], [DVec3::new(1.0, 2.0, 3.0); 2]);
}

#[test]
fn negative_indices_count_back_from_the_line_and_positive_ones_may_look_ahead() {
    let text = "v 0 0 0\nf 1 2 4\nv 1 0 0\nv 1 1 0\nf -1 -2 -3\nf -1 1 4\nv 0 1 0\nf -4//-1 -3 -1";
    let triangles = obj(text.as_bytes()).unwrap().faces.triangles;
    assert_eq!(triangles, [[0, 1, 3], [2, 1, 0], [2, 0, 3], [0, 1, 3]]);
}

#[test]
fn statements_go_on_behind_a_backslash() {
    let text = "v 0 \\\n0 0\nv 1 0 0\\\n\nv 1 1\\\r\n 0 1\\\n1 1\nvn 0 \\\n0 1\nv 0 1 0\nf 1 2\\\n 3 \\\n\\\n4\n\
                # no continuation \\\nf 4 3 2";
    let found = obj(text.as_bytes()).unwrap();
    assert_eq!(found.vertices[..3], [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0)]);
    assert_eq!(found.faces.triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
}

#[test]
fn a_polygon_larger_than_the_buffer_passes_in_small_chunks() {
    let corners = " 1 2 3 4".repeat(100_000);
    let text = format!("{SQUARE}f{corners}\nf 1 2 3\n");
    with_file("a.obj", text.as_bytes(), |path| {
        let mesh = ObjMesh::open(path).unwrap();
        let found = read_in(&mesh, 1000).unwrap().faces;
        assert_eq!(found.triangles.len(), 399_999);
        assert_eq!(found.triangles[399_996..], [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
        assert_eq!(found.faces[399_997..], [0, 1]);
        let (mut stream, mut chunk) =
            (crate::geom::MeshSource::faces(&mesh).unwrap(), TriangleChunk::default());
        stream.next_faces(100, &mut chunk).unwrap();
        assert_eq!(chunk.triangles.len(), 100);
    });
}

#[test]
fn malformed_lines_are_named() {
    for (line, place) in [
        ("v 1 2", "line 5: expected a number, found the end of the line"),
        ("v 1 x 2", "line 5: expected a number, found `x`"),
        ("f 1 2 5", "line 5, face 0: expected a vertex from 1 to 4, found 5"),
        ("f 1 2 0", "line 5, face 0: expected a vertex from 1 to 4, found 0"),
        ("f 1 2 -5", "line 5, face 0: expected a vertex from -4 to -1, found -5"),
        (
            "f 1 2 3\n\nf 1 2 99999999999",
            "line 7, face 1: expected a vertex from 1 to 4, found 99999999999",
        ),
        ("f 1 2 a/b", "line 5: expected the number of a vertex, found `a/b`"),
        ("f 1 2 1.5", "line 5: expected the number of a vertex, found `1.5`"),
        ("f 1 2 /3", "line 5: expected the number of a vertex, found `/3`"),
        ("f 1 2 \\\n\\\n9", "line 7, face 0: expected a vertex from 1 to 4, found 9"),
        ("12 3", "line 5: expected a statement of an OBJ file, found `12`"),
        ("\0\0", "line 5: expected a statement of an OBJ file, found `\\0\\0`"),
        ("surf 0 1 0 1", "line 5: a free-form surface or a call of another file is not supported"),
        ("call b.obj", "line 5: a free-form surface or a call of another file is not supported"),
    ] {
        let said = message(&format!("{SQUARE}{line}\nf 1 2 3\n"));
        assert!(said.contains(place), "{line:?}: {said}");
    }
    let long = format!("{SQUARE}f 1 2 {}", "3".repeat(600));
    assert!(message(&long).contains("line 5: expected a word of at most 512 bytes"));
    assert!(message("f -1 1 2").contains("line 1, face 0: expected a vertex above it, found -1"));
}

#[test]
fn a_file_without_faces_is_refused() {
    assert!(message(SQUARE).ends_with("expected faces, found none: a point cloud"));
    assert!(message("# nothing\n").ends_with("expected faces, found none"));
}

#[test]
fn vertices_that_are_not_finite_are_for_the_receiver_to_judge() {
    let found = obj(b"v nan 0 0\nv 0 -inf 1e999\nf 1 2 1").unwrap().vertices;
    assert!(found[0].x.is_nan() && found[1].y == f64::NEG_INFINITY && found[1].z == f64::INFINITY);
}

proptest! {
    #[test]
    fn a_damaged_file_is_read_or_refused_but_never_panics(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
    ) {
        let text = format!("{SQUARE}vn 0 0 1\nf 1//1 2//1 3//1 \\\n 4//1\nf -1 -2 -3 # c\ng a\nf 3 1 2\n");
        let mut bytes = text.into_bytes();
        for (place, value) in edits {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        bytes.truncate(cut.index(bytes.len()) + 1);
        match obj(&bytes) {
            Ok(found) => {
                let all = found.vertices.len();
                prop_assert!(found.faces.triangles.iter().flatten().all(|&v| (v as usize) < all));
            }
            Err(error) => prop_assert!(!matches!(error, Error::Io { .. }), "{error}"),
        }
    }
}
