//! Vertices and faces of a PLY file in text.
//!
//! In: a reader at the start of an element. Out: vertices or triangles in chunks. One line is one record; a line
//! with too few or too many values is an error, empty lines are passed over. Values of any type are read as f64,
//! so that a coordinate keeps the digits that the text gives it.

use glam::DVec3;

use super::super::byte_reader::ByteReader;
use super::super::text::number;
use super::header::{Element, Kind};
use super::scalar::whole;
use crate::geom::{FaceStream, PolygonFan, TriangleChunk, VertexStream};
use crate::{Error, Result};

/// Longest number taken, in characters.
const WORD_LIMIT: usize = 512;

/// The lines of one element.
#[derive(Debug)]
pub(super) struct Lines<'a> {
    reader: ByteReader<'a>,
    element: &'a Element,
    /// Number of the current record.
    next: u64,
}

impl<'a> Lines<'a> {
    /// The lines of `element`, which starts where `reader` stands.
    pub(super) fn new(reader: ByteReader<'a>, element: &'a Element) -> Self {
        Self { reader, element, next: 0 }
    }

    fn left(&self) -> u64 {
        self.element.count - self.next
    }

    /// Goes past the whole element and gives the place behind it.
    pub(super) fn skip_all(mut self) -> Result<u64> {
        if self.element.properties.is_empty() {
            return Ok(self.reader.position());
        }
        while self.left() > 0 {
            self.start()?;
            self.skip_line()?;
            self.next += 1;
        }
        Ok(self.reader.position())
    }

    /// Goes past blanks; within a line, or also over line ends.
    fn skip_blanks(&mut self, is_blank: fn(u8) -> bool) -> Result<()> {
        loop {
            let bytes = self.reader.fill(1)?;
            let Some(blanks) = bytes.iter().position(|&b| !is_blank(b)) else {
                let all = bytes.len();
                self.reader.consume(all);
                if all == 0 {
                    return Ok(());
                }
                continue;
            };
            self.reader.consume(blanks);
            return Ok(());
        }
    }

    /// Goes to the first value of the next record.
    fn start(&mut self) -> Result<()> {
        self.skip_blanks(|b| b.is_ascii_whitespace())
            .and_then(|()| if self.reader.fill(1)?.is_empty() { Err(self.cut()) } else { Ok(()) })
    }

    /// Goes behind the end of the line.
    fn skip_line(&mut self) -> Result<()> {
        self.skip_blanks(|b| b != b'\n')?;
        let end = self.reader.fill(1)?.len().min(1);
        self.reader.consume(end);
        Ok(())
    }

    /// The next value of the line.
    fn value(&mut self) -> Result<f64> {
        self.skip_blanks(|b| b.is_ascii_whitespace() && b != b'\n')?;
        let bytes = self.reader.fill(WORD_LIMIT)?;
        let window = &bytes[..bytes.len().min(WORD_LIMIT)];
        let length = window.iter().position(u8::is_ascii_whitespace).unwrap_or(window.len());
        let Some(value) = number(&window[..length]) else {
            let found = String::from_utf8_lossy(&window[..length.min(40)]).into_owned();
            return Err(match (window.is_empty(), length) {
                (true, _) => self.cut(),
                (_, 0) => self.malformed("another value", "the end of the line"),
                _ => self.malformed("a number", found),
            });
        };
        self.reader.consume(length);
        Ok(value)
    }

    /// The next value of the line as a list's count.
    fn count(&mut self) -> Result<u64> {
        let value = self.value()?;
        whole(value).ok_or_else(|| self.malformed("a list count", value.to_string()))
    }

    /// Ends a record, behind its last value.
    fn finish(&mut self) -> Result<()> {
        self.skip_blanks(|b| b.is_ascii_whitespace() && b != b'\n')?;
        match self.reader.fill(1)?.first() {
            None => {}
            Some(b'\n') => self.reader.consume(1),
            Some(_) => return Err(self.malformed("the end of the line", "another value")),
        }
        self.next += 1;
        Ok(())
    }

    #[cold]
    fn cut(&self) -> Error {
        self.reader.cut(&self.element.name, self.next)
    }

    #[cold]
    fn malformed(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        self.reader.malformed(&self.element.name, self.next, expected, found)
    }
}

/// Vertices of a file in text.
#[derive(Debug)]
pub(super) struct AsciiVertices<'a> {
    lines: Lines<'a>,
    /// What each property is: an axis, or nothing of interest.
    axes: Vec<Option<usize>>,
}

impl<'a> AsciiVertices<'a> {
    /// The vertices of an element that has scalars x, y and z.
    pub(super) fn new(lines: Lines<'a>) -> Self {
        let axis = |name: &str| ["x", "y", "z"].iter().position(|axis| *axis == name);
        let axes = lines.element.properties.iter().map(|p| axis(&p.name)).collect();
        Self { lines, axes }
    }
}

impl VertexStream for AsciiVertices<'_> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        let properties = &self.lines.element.properties;
        while out.len() < max && self.lines.left() > 0 {
            let mut position = [0.0; 3];
            self.lines.start()?;
            for (property, axis) in properties.iter().zip(&self.axes) {
                match (property.kind, axis) {
                    (Kind::Scalar(_), Some(axis)) => position[*axis] = self.lines.value()?,
                    (Kind::Scalar(_), None) => drop(self.lines.value()?),
                    (Kind::List { .. }, _) => {
                        for _ in 0..self.lines.count()? {
                            self.lines.value()?;
                        }
                    }
                }
            }
            self.lines.finish()?;
            out.push(DVec3::from_array(position));
        }
        Ok(())
    }
}

/// Faces of a file in text.
#[derive(Debug)]
pub(super) struct AsciiFaces<'a> {
    lines: Lines<'a>,
    indices: usize,
    vertex_count: u64,
    pending: Option<Pending>,
}

/// A face that is being read: the property at hand, and the values of its list not yet read.
#[derive(Debug, Clone, Copy)]
struct Pending {
    property: usize,
    left: u64,
    fan: PolygonFan,
}

impl<'a> AsciiFaces<'a> {
    /// The faces of an element whose property number `indices` is the list of vertices.
    pub(super) fn new(lines: Lines<'a>, indices: usize, vertex_count: u64) -> Self {
        Self { lines, indices, vertex_count, pending: None }
    }

    /// Reads one face, or as much of it as `out` takes.
    fn read_face(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        let properties = &self.lines.element.properties;
        let mut pending = if let Some(pending) = self.pending.take() {
            pending
        } else {
            let face = u32::try_from(self.lines.next);
            let face = face.expect("the count of faces is at most u32::MAX");
            self.lines.start()?;
            let left = self.values(0)?;
            Pending { property: 0, left, fan: PolygonFan::new(face) }
        };
        loop {
            while pending.left > 0 {
                if out.triangles.len() >= max {
                    self.pending = Some(pending);
                    return Ok(());
                }
                let value = self.lines.value()?;
                if pending.property == self.indices {
                    pending.fan.push(self.vertex(value)?, out);
                }
                pending.left -= 1;
            }
            pending.property += 1;
            if pending.property == properties.len() {
                break;
            }
            pending.left = self.values(pending.property)?;
        }
        pending.fan.finish(out);
        self.lines.finish()
    }

    /// The number of values of a property, after its count if it is a list.
    fn values(&mut self, property: usize) -> Result<u64> {
        match self.lines.element.properties[property].kind {
            Kind::Scalar(_) => Ok(1),
            Kind::List { .. } => self.lines.count(),
        }
    }

    fn vertex(&self, value: f64) -> Result<u32> {
        let vertex = whole(value).filter(|&v| v < self.vertex_count);
        vertex.and_then(|v| u32::try_from(v).ok()).ok_or_else(|| {
            let expected = format!("a vertex index below {}", self.vertex_count);
            self.lines.malformed(expected, value.to_string())
        })
    }
}

impl FaceStream for AsciiFaces<'_> {
    fn next_faces(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        out.clear();
        while out.triangles.len() < max && self.lines.left() > 0 {
            self.read_face(max, out)?;
        }
        Ok(())
    }
}
