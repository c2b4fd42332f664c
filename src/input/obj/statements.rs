//! The statements of an OBJ file, one by one.

use std::path::Path;

use glam::DVec3;

use super::super::byte_reader::ByteReader;
use super::super::text::{Syntax, Words, shown};
use crate::{Error, Result};

/// The statements that a file may begin with.
const FIRST: [&[u8]; 14] = [
    b"v", b"vn", b"vt", b"vp", b"f", b"fo", b"l", b"p", b"o", b"g", b"s", b"mg", b"mtllib",
    b"usemtl",
];

/// What a statement is to a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Statement {
    /// A vertex; its coordinates follow.
    Vertex,
    /// A face; its corners follow.
    Face,
    /// The end of the file.
    End,
}

/// Whether a file that begins with this word may be an OBJ file.
pub(in crate::input) fn is_keyword(word: &[u8]) -> bool {
    FIRST.contains(&word)
}

/// The statements of a file.
#[derive(Debug)]
pub(super) struct Statements<'a> {
    path: &'a Path,
    pub(super) words: Words<'a>,
}

impl<'a> Statements<'a> {
    /// The statements from the first.
    pub(super) fn open(path: &'a Path) -> Result<Self> {
        let words = Words::new(ByteReader::open(path, 0)?, Syntax::Continued)?;
        Ok(Self { path, words })
    }

    /// Goes behind the keyword of the next statement that matters.
    pub(super) fn next(&mut self) -> Result<Statement> {
        loop {
            match self.words.word()? {
                Some(b"v") => return Ok(Statement::Vertex),
                Some(b"f" | b"fo") => return Ok(Statement::Face),
                Some(b"surf" | b"call") => return Err(self.unsupported()),
                Some(word) if word[0].is_ascii_alphabetic() => {}
                Some(word) => {
                    let found = shown(word);
                    return Err(self.words.malformed("a statement of an OBJ file", found));
                }
                None => {
                    if self.words.is_at_end()? {
                        return Ok(Statement::End);
                    }
                }
            }
            self.words.skip_line()?;
        }
    }

    /// The coordinates of a vertex; goes behind its line.
    pub(super) fn position(&mut self) -> Result<DVec3> {
        let words = &mut self.words;
        let position = DVec3::new(words.number()?, words.number()?, words.number()?);
        words.skip_line()?;
        Ok(position)
    }

    /// The next corner of a face: its vertex as it is written, or `None` behind the last corner.
    #[inline]
    pub(super) fn corner(&mut self) -> Result<Option<i64>> {
        let Some(word) = self.words.word()? else { return Ok(None) };
        let length = word.iter().position(|&b| b == b'/').unwrap_or(word.len());
        if let Some(index) = index(&word[..length]) {
            return Ok(Some(index));
        }
        let found = shown(word);
        Err(self.words.malformed("the number of a vertex", found))
    }

    #[cold]
    fn unsupported(&self) -> Error {
        Error::Unsupported {
            path: self.path.to_path_buf(),
            what: format!(
                "line {}: a free-form surface or a call of another file",
                self.words.line()
            ),
            hint: Some("export the mesh as polygons in one file".to_owned()),
        }
    }
}

/// A whole number of up to eighteen digits.
#[inline]
fn index(word: &[u8]) -> Option<i64> {
    let (is_negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        digits => (false, digits),
    };
    if digits.is_empty() || digits.len() > 18 || !digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    let value = digits
        .iter()
        .fold(0, |sum: i64, digit| sum.wrapping_mul(10).wrapping_add(i64::from(digit - b'0')));
    Some(if is_negative { -value } else { value })
}
