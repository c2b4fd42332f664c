//! Binary STL: 80 bytes of no meaning, the number of faces (u32), then for each normal and corners (twelve f32) and an
//! attribute (u16), all little-endian.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::super::byte_reader::ByteReader;
use super::super::soup::SoupFaces;
use crate::geom::{Bounds3, FaceStream, MeshSource, VertexStream, f32_spacing};
use crate::{Error, Result};

/// Bytes before the first face.
pub(in crate::input) const HEAD_BYTES: usize = 84;
/// Bytes of a face.
const FACE_BYTES: usize = 50;
/// Where its corners lie.
const CORNER_BYTES: std::ops::Range<usize> = 12..48;

/// The length that a binary file with this head must have.
pub(in crate::input) fn bytes_of(head: &[u8; HEAD_BYTES]) -> u64 {
    HEAD_BYTES as u64 + FACE_BYTES as u64 * u64::from(face_count(head))
}

fn face_count(head: &[u8; HEAD_BYTES]) -> u32 {
    let [.., a, b, c, d] = *head;
    u32::from_le_bytes([a, b, c, d])
}

/// A binary STL file of the length that its count of faces gives it.
#[derive(Debug)]
pub(in crate::input) struct StlMesh {
    path: PathBuf,
    faces: u32,
}

impl StlMesh {
    /// Opens a binary STL file and checks its length, for which a compressed one is read once.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read; [`Error::Corrupt`] if it has another length; [`Error::Limit`] for more
    /// faces than 32 bits can number the vertices of.
    pub(in crate::input) fn open(path: &Path) -> Result<Self> {
        let mut reader = ByteReader::open(path, 0)?;
        let Some(head) = reader.fill(HEAD_BYTES)?.first_chunk().copied() else {
            let expected = format!("{HEAD_BYTES} bytes of a binary STL file");
            return Err(Error::corrupt(path, "header", expected, "the end of the file"));
        };
        let content_bytes = reader.content_bytes()?;
        let faces = face_count(&head);
        if content_bytes != bytes_of(&head) {
            let expected = format!("{} bytes for {faces} faces", bytes_of(&head));
            return Err(Error::corrupt(path, "length", expected, content_bytes.to_string()));
        }
        let faces = SoupFaces::checked(path, faces.into())?;
        Ok(Self { path: path.to_path_buf(), faces })
    }
}

impl MeshSource for StlMesh {
    fn path(&self) -> &Path {
        &self.path
    }

    fn vertex_count(&self) -> u64 {
        3 * u64::from(self.faces)
    }

    fn face_count(&self) -> u64 {
        self.faces.into()
    }

    fn spacing_m(&self, bounds: &Bounds3) -> f64 {
        f32_spacing(bounds)
    }

    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        let reader = ByteReader::open(&self.path, HEAD_BYTES as u64)?;
        Ok(Box::new(BinaryVertices { reader, faces: self.faces, next: 0 }))
    }

    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        Ok(Box::new(SoupFaces::new(self.faces)))
    }
}

/// The corners of the faces.
#[derive(Debug)]
struct BinaryVertices<'a> {
    reader: ByteReader<'a>,
    faces: u32,
    /// The next vertex.
    next: u64,
}

impl VertexStream for BinaryVertices<'_> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        let end = 3 * u64::from(self.faces);
        while out.len() < max && self.next < end {
            let bytes = self.reader.fill(FACE_BYTES)?;
            if bytes.len() < FACE_BYTES {
                return Err(self.reader.cut("face", self.next / 3));
            }
            // A chunk may begin or end within a face.
            let corners = bytes[CORNER_BYTES].as_chunks::<12>().0;
            let first = usize::try_from(self.next % 3).unwrap_or(0);
            let last = (first + max - out.len()).min(3);
            out.extend(corners[first..last].iter().map(position));
            self.next += (last - first) as u64;
            if last == 3 {
                self.reader.consume(FACE_BYTES);
            }
        }
        Ok(())
    }
}

fn position(bytes: &[u8; 12]) -> DVec3 {
    let [x, y, z] = [0, 4, 8].map(|at| {
        let number = [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        f64::from(f32::from_le_bytes(number))
    });
    DVec3::new(x, y, z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::reading::{Read, gzip, read, with_file};

    fn stl(name: &str, faces: &[[f32; 9]]) -> Vec<u8> {
        let mut bytes = vec![b' '; 80];
        bytes[..name.len()].copy_from_slice(name.as_bytes());
        bytes.extend(u32::try_from(faces.len()).unwrap().to_le_bytes());
        for face in faces {
            for number in [9.0, f32::NAN, 9.0].iter().chain(face) {
                bytes.extend(number.to_le_bytes());
            }
            bytes.extend([1, 2]);
        }
        bytes
    }

    fn opened(bytes: &[u8]) -> Result<Read> {
        with_file("a.stl", bytes, |path| read(&StlMesh::open(path)?))
    }

    const FACES: [[f32; 9]; 2] = [
        [0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0, 1.0, -0.25],
        [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0],
    ];

    #[test]
    fn corners_come_in_order_plain_and_compressed() {
        let bytes = stl("solid as many write", &FACES);
        for bytes in [bytes.clone(), gzip(&bytes), zstd::encode_all(&bytes[..], 1).unwrap()] {
            let found = opened(&bytes).unwrap();
            assert_eq!(found.vertices[..2], [DVec3::ZERO, DVec3::new(1.5, 0.0, 0.0)]);
            assert_eq!(found.vertices[5], DVec3::new(7.0, 8.0, 9.0));
            assert_eq!(found.faces.triangles, [[0, 1, 2], [3, 4, 5]]);
            assert_eq!(found.faces.faces, [0, 1]);
        }
        assert_eq!(opened(&stl("", &[])).unwrap().vertices.len(), 0);
    }

    #[test]
    fn another_length_than_the_count_of_faces_gives_is_an_error() {
        let bytes = stl("", &FACES);
        for (bytes, said) in [
            (bytes[..bytes.len() - 1].to_vec(), "expected 184 bytes for 2 faces, found 183"),
            ([&bytes[..], b"x"].concat(), "expected 184 bytes for 2 faces, found 185"),
            (gzip(&bytes[..100]), "expected 184 bytes for 2 faces, found 100"),
            (bytes[..83].to_vec(), "expected 84 bytes of a binary STL file, found the end"),
            (
                [&[0; 80][..], &[0xff; 4]].concat(),
                "expected 214748364834 bytes for 4294967295 faces",
            ),
        ] {
            let error = opened(&bytes).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn faces_whose_vertices_32_bits_cannot_number_are_beyond_the_limit() {
        let error = SoupFaces::checked(Path::new("a.stl"), 1 << 31).unwrap_err();
        assert!(matches!(error, Error::Limit { limit: 0x5555_5555, .. }), "{error}");
    }
}
