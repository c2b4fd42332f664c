//! STL as text: `solid`, facets, `endsolid`, perhaps several times.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::super::byte_reader::ByteReader;
use super::super::soup::SoupFaces;
use super::super::text::{Syntax, Words, shown};
use crate::Result;
use crate::geom::{FaceStream, MeshSource, VertexStream};

/// An STL file in text whose facets have been counted.
#[derive(Debug)]
pub(in crate::input) struct StlText {
    path: PathBuf,
    faces: u32,
}

impl StlText {
    /// Opens an STL file in text and counts its facets, for which it is read once.
    ///
    /// # Errors
    /// [`crate::Error::Io`] if it cannot be read; [`crate::Error::Corrupt`] if a facet has not three vertices or the text does not
    /// end with `endsolid`; [`crate::Error::Limit`] for more facets than 32 bits can number the vertices of.
    pub(in crate::input) fn open(path: &Path) -> Result<Self> {
        let mut facets = Facets::open(path)?;
        let mut found = 0_u64;
        while facets.next(|_| Ok(()))? {
            found += 1;
        }
        let faces = SoupFaces::checked(path, found)?;
        Ok(Self { path: path.to_path_buf(), faces })
    }
}

impl MeshSource for StlText {
    fn path(&self) -> &Path {
        &self.path
    }

    fn vertex_count(&self) -> u64 {
        3 * u64::from(self.faces)
    }

    fn face_count(&self) -> u64 {
        self.faces.into()
    }

    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        Ok(Box::new(TextVertices { facets: Facets::open(&self.path)?, corners: Vec::new() }))
    }

    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        Ok(Box::new(SoupFaces::new(self.faces)))
    }
}

/// The corners of the facets.
#[derive(Debug)]
struct TextVertices<'a> {
    facets: Facets<'a>,
    /// Corners of the facet at hand that have not been given, the last first.
    corners: Vec<DVec3>,
}

impl VertexStream for TextVertices<'_> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        while out.len() < max {
            if let Some(corner) = self.corners.pop() {
                out.push(corner);
                continue;
            }
            let corners = &mut self.corners;
            let is_facet = self.facets.next(|words| {
                corners.push(DVec3::new(words.number()?, words.number()?, words.number()?));
                Ok(())
            })?;
            if !is_facet {
                break;
            }
            self.corners.reverse();
        }
        Ok(())
    }
}

/// The facets of a file.
#[derive(Debug)]
struct Facets<'a> {
    words: Words<'a>,
    is_in_solid: bool,
}

impl<'a> Facets<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let words = Words::new(ByteReader::open(path, 0)?, Syntax::Plain)?;
        Ok(Self { words, is_in_solid: false })
    }

    /// Reads one facet, `vertex` what follows each word `vertex` on its line; `false` behind the last.
    fn next(&mut self, mut vertex: impl FnMut(&mut Words<'a>) -> Result<()>) -> Result<bool> {
        // 1. To the facet; a name behind `solid` or `endsolid` may be any text.
        loop {
            let expected = if self.is_in_solid { "`facet` or `endsolid`" } else { "`solid`" };
            let is_in_solid = self.is_in_solid;
            let keyword = match self.words.word_on_any_line()? {
                Some(word) if is_in_solid && word.eq_ignore_ascii_case(b"facet") => break,
                Some(word) if is_in_solid && word.eq_ignore_ascii_case(b"endsolid") => Ok(false),
                Some(word) if !is_in_solid && word.eq_ignore_ascii_case(b"solid") => Ok(true),
                Some(word) => Err(shown(word)),
                None if is_in_solid => Err("the end of the file".to_owned()),
                None => return Ok(false),
            };
            self.is_in_solid = keyword.map_err(|found| self.words.malformed(expected, found))?;
            self.words.skip_line()?;
        }
        // 2. Its normal, which may be missing or anything.
        self.words.skip_line()?;
        // 3. Its corners.
        self.expect("outer")?;
        self.expect("loop")?;
        for _ in 0..3 {
            self.expect("vertex")?;
            vertex(&mut self.words)?;
            self.words.skip_line()?;
        }
        self.expect("endloop")?;
        self.expect("endfacet")?;
        Ok(true)
    }

    fn expect(&mut self, keyword: &str) -> Result<()> {
        let found = match self.words.word_on_any_line()? {
            Some(word) if word.eq_ignore_ascii_case(keyword.as_bytes()) => return Ok(()),
            Some(word) => shown(word),
            None => "the end of the file".to_owned(),
        };
        Err(self.words.malformed(format!("`{keyword}`"), found))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;
    use crate::input::reading::{Read, gzip, read, with_file};

    const TEXT: &str = "solid facet normal\n  facet normal -nan(ind) 0 1\n    outer loop\n      vertex 0 0 0\n\
         \x20     vertex 1.5 0 0\n      vertex 0 1 -2.5e-1\n    endloop\n  endfacet\nendsolid a b\n\n\
         SOLID\nfacet\nOUTER LOOP\nvertex 1 2 3\nvertex 4 5 6\nvertex 7 8 9\nendloop\nendfacet\nendsolid";

    fn stl(text: &[u8]) -> Result<Read> {
        with_file("a.stl", text, |path| read(&StlText::open(path)?))
    }

    #[test]
    fn facets_of_all_solids_come_in_order() {
        let texts = [TEXT.to_owned(), TEXT.replace('\n', "\r\n"), TEXT.replace('\n', "\n\n\t")];
        let plain = texts.iter().map(|text| text.as_bytes().to_vec());
        for text in plain.chain([gzip(TEXT.as_bytes())]) {
            let found = stl(&text).unwrap();
            assert_eq!(found.vertices[2], DVec3::new(0.0, 1.0, -0.25));
            assert_eq!(found.vertices[3], DVec3::new(1.0, 2.0, 3.0));
            assert_eq!(found.faces.triangles, [[0, 1, 2], [3, 4, 5]]);
        }
        assert_eq!(stl(b"solid\nendsolid").unwrap().vertices.len(), 0);
    }

    #[test]
    fn malformed_lines_are_named() {
        for (from, to, said) in [
            (
                "vertex 1.5 0 0",
                "vertex 1.5 0",
                "line 5: expected a number, found the end of the line",
            ),
            ("vertex 1.5 0 0", "vertex 1,5 0 0", "line 5: expected a number, found `1,5`"),
            ("    endloop", "vertex 0 0 0\n endloop", "line 7: expected `endloop`, found `vertex`"),
            ("      vertex 0 0 0\n", "", "line 6: expected `vertex`, found `endloop`"),
            ("  endfacet", "", "line 9: expected `endfacet`, found `endsolid`"),
            ("SOLID\n", "", "line 11: expected `solid`, found `facet`"),
            ("outer loop", "inner loop", "line 3: expected `outer`, found `inner`"),
            ("endfacet\nendsolid", "endfacet\nsolid", "found `solid`"),
        ] {
            assert!(TEXT.contains(from));
            let error = stl(TEXT.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
            assert!(error.contains(said), "{from:?}: {error}");
        }
    }

    #[test]
    fn a_file_cut_anywhere_within_its_solids_is_an_error() {
        for length in 1..TEXT.len() {
            let whole = [TEXT.find("endsolid a b").unwrap() + 8, TEXT.find("SOLID").unwrap()];
            match stl(&TEXT.as_bytes()[..length]) {
                Ok(found) => {
                    assert!((whole[0]..=whole[1]).contains(&length), "cut at {length}");
                    assert_eq!(found.vertices.len(), 3);
                }
                Err(error) => assert!(matches!(error, Error::Corrupt { .. }), "{error}"),
            }
        }
    }
}
