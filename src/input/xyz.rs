//! XYZ triplets: plain text, the three corners of one triangle after the other.
//!
//! In: a text, compressed or not, of lines of nine numbers (a triangle, as in Grammatikopoulos et al. 2004) or of three
//! (a corner, three lines a triangle); the first line with numbers decides. Blanks, commas and semicolons part numbers, `#`
//! begins a comment, empty lines are passed over. Out: a [`crate::geom::MeshSource`]. Any other count of numbers on a
//! line is an error that names the line, so that most point clouds are refused; lines of three cannot be told from a
//! cloud whose points are three times a whole number.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::byte_reader::ByteReader;
use super::soup::SoupFaces;
use super::text::{Syntax, Words};
use crate::Result;
use crate::geom::{FaceStream, MeshSource, VertexStream};

/// A text of XYZ triplets whose lines have been counted.
#[derive(Debug)]
pub(in crate::input) struct XyzMesh {
    path: PathBuf,
    triangles: u32,
}

impl XyzMesh {
    /// Opens a text and counts its numbers, for which it is read once.
    ///
    /// # Errors
    /// [`crate::Error::Io`] if it cannot be read; [`crate::Error::Corrupt`] if a line holds neither nine numbers nor three, or
    /// another count than the first, or if the last triangle is not whole; [`crate::Error::Limit`] for more triangles than
    /// 32 bits can number the vertices of.
    pub(in crate::input) fn open(path: &Path) -> Result<Self> {
        let mut words = open_words(path)?;
        let (mut corners, mut per_line) = (0_u64, None);
        while !words.is_at_end()? {
            let mut count = 0_u64;
            while words.word()?.is_some() {
                count += 1;
            }
            let expected = match per_line {
                _ if count == 0 => None,
                None if count == 3 || count == 9 => None,
                None => Some("9 numbers (a triangle) or 3 (a corner)".to_owned()),
                Some(first) if first == count => None,
                Some(first) => Some(format!("{first} numbers, as on the first line")),
            };
            if let Some(expected) = expected {
                return Err(words.malformed(expected, count.to_string()));
            }
            if count > 0 {
                per_line = Some(count);
                corners += count / 3;
            }
            words.skip_line()?;
        }
        if corners % 3 != 0 {
            let found = format!("{} of them at the end of the file", corners % 3);
            return Err(words.malformed("three corners for each triangle", found));
        }
        let triangles = SoupFaces::checked(path, corners / 3)?;
        Ok(Self { path: path.to_path_buf(), triangles })
    }
}

fn open_words(path: &Path) -> Result<Words<'_>> {
    Words::new(ByteReader::open(path, 0)?, Syntax::Separated)
}

impl MeshSource for XyzMesh {
    fn path(&self) -> &Path {
        &self.path
    }

    fn vertex_count(&self) -> u64 {
        3 * u64::from(self.triangles)
    }

    fn face_count(&self) -> u64 {
        self.triangles.into()
    }

    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        Ok(Box::new(XyzVertices { words: open_words(&self.path)?, left: self.vertex_count() }))
    }

    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        Ok(Box::new(SoupFaces::new(self.triangles)))
    }
}

/// The corners of the triangles.
#[derive(Debug)]
struct XyzVertices<'a> {
    words: Words<'a>,
    left: u64,
}

impl VertexStream for XyzVertices<'_> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        while out.len() < max && self.left > 0 {
            if self.words.is_at_line_end()? {
                if self.words.is_at_end()? {
                    let expected = format!("{} more corners", self.left);
                    return Err(self.words.malformed(expected, "the end of the file"));
                }
                self.words.skip_line()?;
                continue;
            }
            let words = &mut self.words;
            out.push(DVec3::new(words.number()?, words.number()?, words.number()?));
            self.left -= 1;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;
    use crate::input::reading::{Read, gzip, read, with_file};

    fn xyz(text: &[u8]) -> Result<Read> {
        with_file("a.xyz", text, |path| read(&XyzMesh::open(path)?))
    }

    #[test]
    fn a_line_holds_a_triangle_or_a_corner() {
        let nine = "# nine\n0 0 0 1 0 0 0 1 -0\n\n1,0,0;1,1,0;0,1,1e0 # c\r\n";
        let three = "0\t0 0\n1 0 0\n\n0, 1, -0\n1 0 0;\n1;1;0\n# c\n0 1 1";
        let expected = xyz(nine.as_bytes()).unwrap();
        assert_eq!(expected.vertices.len(), 6);
        assert_eq!(expected.vertices[5], DVec3::new(0.0, 1.0, 1.0));
        assert_eq!(expected.faces.triangles, [[0, 1, 2], [3, 4, 5]]);
        assert_eq!(expected.faces.faces, [0, 1]);
        for text in [
            three.as_bytes(),
            &gzip(nine.as_bytes()),
            &zstd::encode_all(three.as_bytes(), 1).unwrap(),
        ] {
            assert_eq!(xyz(text).unwrap().vertices, expected.vertices);
        }
        assert_eq!(xyz(b"").unwrap().vertices.len(), 0);
    }

    #[test]
    fn another_count_of_numbers_is_an_error_that_names_the_line() {
        for (text, said) in [
            (
                "0 0 0 1 0 0 0 1\n",
                "line 1: expected 9 numbers (a triangle) or 3 (a corner), found 8",
            ),
            ("1 2 3 255 0 0\n", "line 1: expected 9 numbers (a triangle) or 3 (a corner), found 6"),
            (
                "# c\n0 0 0\n\n0 0 0 1\n",
                "line 4: expected 3 numbers, as on the first line, found 4",
            ),
            (
                "1 2 3 4 5 6 7 8 9\n1 2 3\n",
                "line 2: expected 9 numbers, as on the first line, found 3",
            ),
            ("1 2 3\n4 5 6", "line 2: expected three corners for each triangle, found 2 of them"),
            (
                "1 2 3\n4 5 6\n7 8 9\n1 2 3\n",
                "expected three corners for each triangle, found 1 of them",
            ),
            ("1 2 3\n4 b 6\n7 8 9\n", "line 2: expected a number, found `b`"),
        ] {
            let found = xyz(text.as_bytes()).unwrap_err();
            assert!(matches!(found, Error::Corrupt { .. }));
            assert!(found.to_string().contains(said), "{text:?}: {found}");
        }
    }
}
