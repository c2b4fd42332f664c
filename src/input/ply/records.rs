//! The records of one element of a binary PLY file, read forwards, part by part.

use super::super::byte_reader::ByteReader;
use super::header::{Element, Kind};
use super::scalar::{Order, Scalar};
use crate::{Error, Result};

/// What to do with a part of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// Scalars of no interest, so many bytes.
    Skip(usize),
    /// A list of no interest.
    SkipList { count: Scalar, item: Scalar },
    /// The coordinate x, y or z.
    Coordinate { axis: usize, scalar: Scalar },
    /// The list of a face's vertices.
    Indices { count: Scalar, item: Scalar },
}

/// What is wanted of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// The scalars x, y, z.
    Coordinates,
    /// The list with this place among the properties.
    Indices(usize),
    /// Nothing: the element is gone past.
    Nothing,
}

/// The steps through a record.
pub(super) fn steps(element: &Element, wanted: Wanted) -> Vec<Step> {
    let mut steps = Vec::new();
    for (place, property) in element.properties.iter().enumerate() {
        let axis = ["x", "y", "z"].iter().position(|axis| *axis == property.name);
        match (property.kind, axis) {
            (Kind::Scalar(scalar), Some(axis)) if wanted == Wanted::Coordinates => {
                steps.push(Step::Coordinate { axis, scalar });
            }
            (Kind::Scalar(scalar), _) => match steps.last_mut() {
                Some(Step::Skip(bytes)) => *bytes += scalar.size(),
                _ => steps.push(Step::Skip(scalar.size())),
            },
            (Kind::List { count, item }, _) if wanted == Wanted::Indices(place) => {
                steps.push(Step::Indices { count, item });
            }
            (Kind::List { count, item }, _) => steps.push(Step::SkipList { count, item }),
        }
    }
    steps
}

/// The records of one element.
#[derive(Debug)]
pub(super) struct Records<'a> {
    pub(super) reader: ByteReader<'a>,
    pub(super) element: &'a Element,
    pub(super) order: Order,
    /// Number of the current record.
    pub(super) next: u64,
}

impl<'a> Records<'a> {
    /// The records of `element`, which starts where `reader` stands.
    pub(super) fn new(reader: ByteReader<'a>, element: &'a Element, order: Order) -> Self {
        Self { reader, element, order, next: 0 }
    }

    /// Records not yet gone past.
    pub(super) fn left(&self) -> u64 {
        self.element.count - self.next
    }

    /// The next bytes, `bytes` of them or more, without going past them.
    pub(super) fn peek(&mut self, bytes: usize) -> Result<&[u8]> {
        if self.reader.fill(bytes)?.len() < bytes {
            return Err(self.cut());
        }
        self.reader.fill(bytes)
    }

    /// Goes past `bytes` bytes of the current record.
    pub(super) fn skip(&mut self, bytes: u64) -> Result<()> {
        let end = self.reader.position().checked_add(bytes);
        if end.is_none_or(|end| end > self.reader.most_bytes()) {
            return Err(self.cut());
        }
        self.reader.skip(bytes)
    }

    /// Goes past a list's count, and gives it.
    pub(super) fn take_count(&mut self, count: Scalar) -> Result<u64> {
        let order = self.order;
        let bytes = self.peek(count.size())?;
        let Some(items) = count.read_index(bytes, order) else {
            let found = count.read(bytes, order).to_string();
            return Err(self.malformed("a list count", found));
        };
        self.reader.consume(count.size());
        Ok(items)
    }

    /// Goes past a list of no interest.
    pub(super) fn skip_list(&mut self, count: Scalar, item: Scalar) -> Result<()> {
        let items = self.take_count(count)?;
        self.skip(items * item.size() as u64)
    }

    /// Goes past the whole element and gives the place behind it.
    pub(super) fn skip_all(mut self) -> Result<u64> {
        if let Some(stride) = self.element.stride() {
            self.skip(self.left() * stride as u64)?;
            return Ok(self.reader.position());
        }
        let steps = steps(self.element, Wanted::Nothing);
        while self.left() > 0 {
            for step in &steps {
                match *step {
                    Step::SkipList { count, item } => self.skip_list(count, item)?,
                    Step::Skip(bytes) => self.skip(bytes as u64)?,
                    Step::Coordinate { .. } | Step::Indices { .. } => {}
                }
            }
            self.next += 1;
        }
        Ok(self.reader.position())
    }

    /// The error for a file that ends within the current record.
    #[cold]
    fn cut(&self) -> Error {
        self.reader.cut(&self.element.name, self.next)
    }

    /// The error for malformed bytes at the reader's place.
    #[cold]
    pub(super) fn malformed(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        self.reader.malformed(&self.element.name, self.next, expected, found)
    }
}
