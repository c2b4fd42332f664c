//! Points as text: x, y, z and perhaps further columns on each line.
//!
//! Blanks, commas and semicolons part the columns, `#` begins a comment, empty lines are passed over. The first line may be
//! a header, or a count of points: it is passed over if it does not begin with three numbers.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::super::byte_reader::ByteReader;
use super::super::text::{Syntax, Words, number};
use crate::geom::{POINT_LIMIT_M, PointSource, PointStream};
use crate::{Error, Result};

/// Bytes of a line, about, for forecasts.
const LINE_BYTES: u64 = 30;

/// A text of points.
#[derive(Debug)]
pub(super) struct TextFile {
    path: PathBuf,
    about: u64,
}

impl TextFile {
    /// A text of which the first points are read, as a proof.
    ///
    /// # Errors
    /// As of [`PointStream::next_points`]; [`Error::Corrupt`] if there is no point.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let bytes = std::fs::metadata(path).map_err(|e| Error::io(path, e))?.len();
        let file = Self { path: path.to_path_buf(), about: bytes / LINE_BYTES };
        let mut first = Vec::new();
        file.points()?.next_points(1, &mut first)?;
        if first.is_empty() {
            return Err(Error::corrupt(path, "text", "lines of three numbers or more", "none"));
        }
        Ok(file)
    }
}

impl PointSource for TextFile {
    fn path(&self) -> &Path {
        &self.path
    }

    fn about(&self) -> u64 {
        self.about
    }

    fn points(&self) -> Result<Box<dyn PointStream + '_>> {
        let words = Words::new(ByteReader::open(&self.path, 0)?, Syntax::Separated)?;
        Ok(Box::new(TextPoints { words, is_first: true }))
    }
}

struct TextPoints<'a> {
    words: Words<'a>,
    is_first: bool,
}

impl TextPoints<'_> {
    /// The point on this line; `None` if it is the first one, and a header.
    fn point(&mut self) -> Result<Option<DVec3>> {
        let mut xyz = [0.0; 3];
        for value in &mut xyz {
            if !self.is_first {
                *value = self.words.number()?;
                continue;
            }
            match self.words.word()?.and_then(number) {
                Some(found) => *value = found,
                None => return Ok(None),
            }
        }
        let point = DVec3::from_array(xyz);
        // NaN is not within it either.
        if point.abs().cmple(DVec3::splat(POINT_LIMIT_M)).all() {
            return Ok(Some(point));
        }
        let expected = format!("finite coordinates within {POINT_LIMIT_M:e} m");
        Err(self.words.malformed(expected, format!("{xyz:?}")))
    }
}

impl PointStream for TextPoints<'_> {
    fn next_points(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        while out.len() < max && !self.words.is_at_end()? {
            if !self.words.is_at_line_end()? {
                out.extend(self.point()?);
                self.is_first = false;
            }
            self.words.skip_line()?;
        }
        Ok(())
    }

    fn passed_over(&self) -> u64 {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::reading::{gzip, with_file};

    fn read(bytes: &[u8]) -> Result<Vec<DVec3>> {
        with_file("a.txt", bytes, |path| {
            let file = TextFile::open(path)?;
            let (mut stream, mut chunk, mut all) = (file.points()?, Vec::new(), Vec::new());
            loop {
                stream.next_points(2, &mut chunk)?;
                if chunk.is_empty() {
                    return Ok(all);
                }
                all.append(&mut chunk);
            }
        })
    }

    #[test]
    fn headers_counts_comments_and_further_columns_are_passed_over() {
        let expected = [DVec3::new(1.0, 2.0, 3.5), DVec3::new(4.0, 5.0, -6.0), DVec3::ZERO];
        for text in [
            "1 2 3.5\n4 5 -6\n0 0 0",
            "//X Y Z R G B\n1 2 3.5 255 0 0\n4 5 -6 1 2 3\n0 0 0 9 9 9\n",
            "3\n1 2 3.5 -7\n4 5 -6 8\n0 0 0 1\n",
            "# made by hand\n\nx;y;z\r\n1;2;3.5;water\r\n\r\n4;5;-6;\r\n0,0,0\r\n",
        ] {
            assert_eq!(read(text.as_bytes()).unwrap(), expected, "{text}");
            assert_eq!(read(&gzip(text.as_bytes())).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn a_line_that_is_no_point_is_an_error_that_names_it() {
        for (text, said) in [
            ("1 2 3\nx y z\n", "line 2: expected a number, found `x`"),
            ("x y z\n1 2\n", "line 2: expected a number, found the end of the line"),
            ("1 2 inf\n", "line 1: expected finite coordinates"),
            ("1 2 3\n1 2 2e12\n", "line 2: expected finite coordinates within 1.099511627776e12 m"),
            ("x y z\n", "expected lines of three numbers or more, found none"),
        ] {
            let found = read(text.as_bytes()).unwrap_err().to_string();
            assert!(found.contains(said), "{text:?}: {found}");
        }
    }
}
