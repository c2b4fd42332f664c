//! The header of a PLY file.
//!
//! In: the first lines of a file. Out: encoding, elements and their properties, checked against the length of
//! the file, so that no count is believed that the file cannot hold. G. Turk (1994), "The PLY polygon file
//! format", Stanford University.

use super::super::byte_reader::ByteReader;
use super::scalar::{Order, Scalar};
use crate::{Error, Result};

/// Longest header taken.
const HEADER_LIMIT: u64 = 1 << 20;
/// Longest line of a header taken.
const LINE_LIMIT: usize = 1 << 14;
/// Most elements, and most properties of an element.
const PROPERTY_LIMIT: usize = 1000;

/// How values stand in the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary(Order),
}

/// The type of a property.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Scalar),
    List { count: Scalar, item: Scalar },
}

/// A property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// An element: how many records there are, and what stands in each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Bytes of a record of a binary file if all have the same.
    pub(super) fn stride(&self) -> Option<usize> {
        let size = |p: &Property| match p.kind {
            Kind::Scalar(scalar) => Some(scalar.size()),
            Kind::List { .. } => None,
        };
        self.properties.iter().map(size).sum()
    }

    /// The property of that name.
    pub(super) fn property(&self, name: &str) -> Option<(usize, &Property)> {
        self.properties.iter().enumerate().find(|(_, p)| p.name == name)
    }

    /// Bytes that a record takes at least.
    fn least_bytes(&self, encoding: Encoding) -> u64 {
        let least = |p: &Property| match (encoding, p.kind) {
            // A digit, and a blank or line end.
            (Encoding::Ascii, _) => 2,
            (Encoding::Binary(_), Kind::Scalar(scalar)) => scalar.size() as u64,
            (Encoding::Binary(_), Kind::List { count, .. }) => count.size() as u64,
        };
        self.properties.iter().map(least).sum()
    }
}

/// A header that fits its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Where the body starts.
    pub(super) bytes: u64,
}

impl Header {
    /// Reads a header and compares it with the file's length.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if it is not a PLY header, or promises more than the file holds;
    /// [`Error::Unsupported`] for another version.
    pub(super) fn read(reader: &mut ByteReader<'_>, file_bytes: u64) -> Result<Self> {
        let mut lines = Lines { reader, number: 0 };
        if lines.next()? != "ply" {
            return Err(lines.error("`ply`", "another kind of file"));
        }
        let (mut encoding, mut elements) = (None, Vec::<Element>::new());
        loop {
            let line = lines.next()?;
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words.as_slice() {
                ["end_header"] => break,
                [] | ["comment" | "obj_info", ..] => {}
                ["format", name, version] => encoding = Some(lines.encoding(name, version)?),
                ["element", name, count] => elements.push(lines.element(name, count, &elements)?),
                ["property", words @ ..] => {
                    let Some(element) = elements.last_mut() else {
                        return Err(lines.error("an element before its properties", line.as_str()));
                    };
                    element.properties.push(lines.property(words, element)?);
                }
                _ => return Err(lines.error("a line of a PLY header", line.as_str())),
            }
        }
        let Some(encoding) = encoding else {
            return Err(lines.error("a format", "the end of the header"));
        };
        let header = Self { encoding, elements, bytes: reader.position() };
        header.check_counts(reader, file_bytes)?;
        Ok(header)
    }

    /// The element of that name, with its place in the file.
    pub(super) fn element(&self, name: &str) -> Option<(usize, &Element)> {
        self.elements.iter().enumerate().find(|(_, e)| e.name == name)
    }

    fn check_counts(&self, reader: &ByteReader<'_>, file_bytes: u64) -> Result<()> {
        // The last line of a text may lack its line end.
        let mut left = file_bytes.saturating_add(1).saturating_sub(self.bytes);
        for element in &self.elements {
            let least = element.count.checked_mul(element.least_bytes(self.encoding));
            let Some(rest) = least.and_then(|least| left.checked_sub(least)) else {
                let found = format!(
                    "{} elements `{}` of {} bytes or more",
                    element.count,
                    element.name,
                    element.least_bytes(self.encoding)
                );
                let expected = format!("elements that fit the {file_bytes} bytes of the file");
                return Err(Error::corrupt(reader.path(), "header", expected, found));
            };
            left = rest;
        }
        Ok(())
    }
}

/// The lines of a header.
struct Lines<'r, 'a> {
    reader: &'r mut ByteReader<'a>,
    number: usize,
}

impl Lines<'_, '_> {
    /// The next line, without its end (LF or CR LF).
    fn next(&mut self) -> Result<String> {
        self.number += 1;
        let bytes = self.reader.fill(LINE_LIMIT)?;
        let window = &bytes[..bytes.len().min(LINE_LIMIT)];
        let Some(length) = window.iter().position(|&b| b == b'\n') else {
            return Err(self.error("a line of a PLY header", "none"));
        };
        let line = String::from_utf8_lossy(&window[..length]).trim_end_matches('\r').to_owned();
        self.reader.consume(length + 1);
        if self.reader.position() > HEADER_LIMIT {
            return Err(self.error(format!("a header within {HEADER_LIMIT} bytes"), "a longer one"));
        }
        Ok(line)
    }

    fn error(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        let mut found: String = found.into();
        if let Some((end, _)) = found.char_indices().nth(100) {
            found.truncate(end);
        }
        Error::corrupt(self.reader.path(), format!("header line {}", self.number), expected, found)
    }

    fn encoding(&self, name: &str, version: &str) -> Result<Encoding> {
        if version != "1.0" {
            let what = format!("PLY version {version}");
            return Err(Error::unsupported(self.reader.path(), what));
        }
        match name {
            "ascii" => Ok(Encoding::Ascii),
            "binary_little_endian" => Ok(Encoding::Binary(Order::Little)),
            "binary_big_endian" => Ok(Encoding::Binary(Order::Big)),
            _ => Err(self.error("ascii, binary_little_endian or binary_big_endian", name)),
        }
    }

    fn element(&self, name: &str, count: &str, known: &[Element]) -> Result<Element> {
        if known.len() >= PROPERTY_LIMIT || known.iter().any(|e| e.name == name) {
            return Err(self.error("elements of different names", format!("`{name}` again")));
        }
        let Ok(count) = count.parse() else {
            return Err(self.error("a count of elements", count));
        };
        Ok(Element { name: name.to_owned(), count, properties: Vec::new() })
    }

    fn property(&self, words: &[&str], element: &Element) -> Result<Property> {
        let scalar = |name: &str| {
            Scalar::named(name).ok_or_else(|| self.error("a number type of PLY", name))
        };
        let (kind, name) = match words {
            ["list", count, item, name] => {
                (Kind::List { count: scalar(count)?, item: scalar(item)? }, name)
            }
            [kind, name] => (Kind::Scalar(scalar(kind)?), name),
            _ => return Err(self.error("a type and a name", words.join(" "))),
        };
        if element.properties.len() >= PROPERTY_LIMIT || element.property(name).is_some() {
            return Err(self.error("properties of different names", format!("`{name}` again")));
        }
        Ok(Property { name: (*name).to_owned(), kind })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Header> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        std::fs::write(&path, text).unwrap();
        Header::read(&mut ByteReader::open(&path, 0)?, text.len() as u64)
    }

    #[test]
    fn comments_and_line_ends_of_either_kind_do_not_matter() {
        let unix = "ply\nformat ascii 1.0\nelement v 0\nproperty float x\n\
                    property list uchar int i\nend_header\n";
        let commented = unix.replace("element", "comment element\nobj_info a b\nelement");
        let (header, dos) = (read(unix).unwrap(), read(&unix.replace('\n', "\r\n")).unwrap());
        assert_eq!(header.elements, dos.elements);
        assert_eq!(header.elements, read(&commented).unwrap().elements);
        assert_eq!(header.bytes, unix.len() as u64);
        let list = Kind::List { count: Scalar::U8, item: Scalar::I32 };
        assert_eq!(header.elements[0].properties[1].kind, list);
    }

    #[test]
    fn malformed_headers_are_errors_that_name_the_line() {
        let cases = [
            ("", "line 1"),
            ("plyx\n", "line 1"),
            ("ply\nformat ascii 1.0\nelement vertex -3\n", "line 3"),
            ("ply\nformat ascii 1.0\nproperty float x\n", "line 3"),
            ("ply\nformat middle_endian 1.0\n", "line 2"),
            ("ply\nelement v 0\nproperty half x\n", "line 3"),
            ("ply\nelement v 0\nelement v 0\n", "line 3"),
            ("ply\nelement v 0\nproperty int x\nproperty int x\n", "line 4"),
            ("ply\nelement v 0\nend_header\n", "line 3"),
            ("ply\nformat ascii 1.0\nelement v 0\n", "line 4"),
        ];
        for (text, place) in cases {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(place), "{text:?}: {message}");
        }
    }

    #[test]
    fn a_count_that_the_file_cannot_hold_is_an_error() {
        for (count, format) in [
            (u64::MAX, "ascii"),
            (u64::MAX / 2, "binary_little_endian"),
            (1, "binary_big_endian"),
            (1, "ascii"),
        ] {
            let text = format!(
                "ply\nformat {format} 1.0\nelement v {count}\nproperty double x\nend_header\n"
            );
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains(&format!("{count} elements `v`")), "{message}");
        }
    }
}
