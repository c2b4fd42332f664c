//! Vertices and faces of a binary PLY file, of either byte order.
//!
//! In: a reader at the start of an element. Out: vertices or triangles in chunks. Records of fixed length are
//! read by stride; records with lists are measured first, and parsed where they lie in the buffer; only a record
//! longer than what the buffer holds is read piece by piece, so that a polygon of any size passes.

use glam::DVec3;

use super::records::{Records, Step, Wanted, steps};
use super::scalar::{Order, Scalar, u32_at};
use crate::geom::{FaceStream, PolygonFan, TriangleChunk, VertexStream};
use crate::{Error, Result};

/// Bytes held before records with lists are parsed: many of them.
const LOOK_AHEAD: usize = 1 << 13;

/// Vertices of a binary file.
#[derive(Debug)]
pub(super) struct BinaryVertices<'a> {
    records: Records<'a>,
    layout: VertexLayout,
}

/// Where x, y and z lie in a record.
#[derive(Debug)]
enum VertexLayout {
    /// Every record has the same length: offsets and types of the coordinates, bytes from record to record.
    Fixed { coordinates: [(usize, Scalar); 3], stride: usize },
    /// Records have lists.
    Varying(Vec<Step>),
}

impl<'a> BinaryVertices<'a> {
    /// The vertices of an element that has scalars x, y and z.
    pub(super) fn new(records: Records<'a>) -> Self {
        let steps = steps(records.element, Wanted::Coordinates);
        let Some(stride) = records.element.stride() else {
            return Self { records, layout: VertexLayout::Varying(steps) };
        };
        let (mut offset, mut coordinates) = (0, [(0, Scalar::F32); 3]);
        for step in steps {
            match step {
                Step::Coordinate { axis, scalar } => {
                    coordinates[axis] = (offset, scalar);
                    offset += scalar.size();
                }
                Step::Skip(bytes) => offset += bytes,
                Step::SkipList { .. } | Step::Indices { .. } => {}
            }
        }
        Self { records, layout: VertexLayout::Fixed { coordinates, stride } }
    }
}

impl VertexStream for BinaryVertices<'_> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        while out.len() < max && self.records.left() > 0 {
            match &self.layout {
                VertexLayout::Fixed { coordinates, stride } => {
                    read_fixed(&mut self.records, coordinates, *stride, max, out)?;
                }
                VertexLayout::Varying(steps) => out.push(read_varying(&mut self.records, steps)?),
            }
        }
        Ok(())
    }
}

/// Vertices of fixed stride: as many as the buffer holds and `out` still takes.
fn read_fixed(
    records: &mut Records<'_>,
    coordinates: &[(usize, Scalar); 3],
    stride: usize,
    max: usize,
    out: &mut Vec<DVec3>,
) -> Result<()> {
    let (order, left) = (records.order, records.left());
    let bytes = records.peek(stride)?;
    let wanted = usize::try_from(left).unwrap_or(usize::MAX).min(max - out.len());
    let count = (bytes.len() / stride).min(wanted);
    out.extend(bytes[..count * stride].chunks_exact(stride).map(|record| {
        DVec3::from_array(coordinates.map(|(at, scalar)| scalar.read(&record[at..], order)))
    }));
    records.reader.consume(count * stride);
    records.next += count as u64;
    Ok(())
}

/// One vertex whose record has lists.
fn read_varying(records: &mut Records<'_>, steps: &[Step]) -> Result<DVec3> {
    let order = records.order;
    let mut position = [0.0; 3];
    for step in steps {
        match *step {
            Step::Coordinate { axis, scalar } => {
                position[axis] = scalar.read(records.peek(scalar.size())?, order);
                records.reader.consume(scalar.size());
            }
            Step::SkipList { count, item } => records.skip_list(count, item)?,
            Step::Skip(bytes) => records.skip(bytes as u64)?,
            Step::Indices { .. } => {}
        }
    }
    records.next += 1;
    Ok(DVec3::from_array(position))
}

/// Faces of a binary file.
#[derive(Debug)]
pub(super) struct BinaryFaces<'a> {
    records: Records<'a>,
    steps: Vec<Step>,
    item: Scalar,
    vertex_count: u64,
    pending: Option<Pending>,
}

/// A face that is being read piece by piece.
#[derive(Debug, Clone, Copy)]
struct Pending {
    step: usize,
    fan: PolygonFan,
    /// Indices of the list not yet read, once its count has been.
    left: Option<u64>,
}

impl<'a> BinaryFaces<'a> {
    /// The faces of an element whose property number `indices` is the list of vertices, of type `item`.
    pub(super) fn new(
        records: Records<'a>,
        indices: usize,
        item: Scalar,
        vertex_count: u64,
    ) -> Self {
        let steps = steps(records.element, Wanted::Indices(indices));
        Self { records, steps, item, vertex_count, pending: None }
    }

    /// Parses records that the buffer holds whole, up to about `max` triangles.
    fn read_whole(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        let (item, order) = (self.item, self.records.order);
        // The common types have a loop of their own, so that the type is not asked for at every corner.
        match item {
            Scalar::U32 => self.parse(|b| Some(u32_at(b, order)), max, out),
            Scalar::I32 => {
                self.parse(|b| Some(u32_at(b, order)).filter(|v| v >> 31 == 0), max, out)
            }
            _ => self.parse(|b| rare_index(item, b, order), max, out),
        }
    }

    /// The loop of [`Self::read_whole`].
    fn parse(
        &mut self,
        index: impl Fn(&[u8]) -> Option<u32>,
        max: usize,
        out: &mut TriangleChunk,
    ) -> Result<()> {
        let (order, item_bytes, limit) = (self.records.order, self.item.size(), self.vertex_count);
        let (mut face, faces) = (self.records.next, self.records.element.count);
        let bytes = self.records.reader.fill(LOOK_AHEAD)?;
        let (mut at, mut bad) = (0, None);
        while out.triangles.len() < max && face < faces && bad.is_none() {
            let Some(record) = measure(&self.steps, &bytes[at..], order) else { break };
            let list = &bytes[at + record.indices..][..record.count * item_bytes];
            let vertex = |k: usize| {
                index(&list[k * item_bytes..]).filter(|&v| u64::from(v) < limit).ok_or(k)
            };
            let ordinal = face_ordinal(face);
            match add_face(ordinal, record.count, vertex, out) {
                Ok(()) => (at, face) = (at + record.bytes, face + 1),
                Err(k) => bad = Some(at + record.indices + k * item_bytes),
            }
        }
        self.records.next = face;
        self.records.reader.consume(bad.unwrap_or(at));
        if bad.is_some() { Err(self.bad_index()?) } else { Ok(()) }
    }

    /// Reads one face that the buffer does not hold whole, or as much of it as `out` takes.
    fn read_pieces(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        let fresh = || Pending {
            step: 0,
            fan: PolygonFan::new(face_ordinal(self.records.next)),
            left: None,
        };
        let mut pending = self.pending.take().unwrap_or_else(fresh);
        while pending.step < self.steps.len() {
            match self.steps[pending.step] {
                Step::Skip(bytes) => self.records.skip(bytes as u64)?,
                Step::SkipList { count, item } => self.records.skip_list(count, item)?,
                Step::Coordinate { .. } => {}
                Step::Indices { count, .. } => {
                    let left = match pending.left {
                        Some(left) => left,
                        None => self.records.take_count(count)?,
                    };
                    pending.left = Some(self.read_indices(left, &mut pending.fan, max, out)?);
                    if pending.left != Some(0) {
                        self.pending = Some(pending);
                        return Ok(());
                    }
                }
            }
            pending.step += 1;
        }
        pending.fan.finish(out);
        self.records.next += 1;
        Ok(())
    }

    /// Reads up to `left` indices, while `out` takes them, and gives the number left after that.
    fn read_indices(
        &mut self,
        mut left: u64,
        fan: &mut PolygonFan,
        max: usize,
        out: &mut TriangleChunk,
    ) -> Result<u64> {
        let (item, order) = (self.item, self.records.order);
        while left > 0 && out.triangles.len() < max {
            let bytes = self.records.peek(item.size())?;
            let vertex = rare_index(item, bytes, order);
            let Some(vertex) = vertex.filter(|&v| u64::from(v) < self.vertex_count) else {
                return Err(self.bad_index()?);
            };
            fan.push(vertex, out);
            self.records.reader.consume(item.size());
            left -= 1;
        }
        Ok(left)
    }

    /// The error for the index at the reader's place.
    #[cold]
    fn bad_index(&mut self) -> Result<Error> {
        let (item, order) = (self.item, self.records.order);
        let found = item.read(self.records.peek(item.size())?, order);
        let expected = format!("a vertex index below {}", self.vertex_count);
        Ok(self.records.malformed(expected, found.to_string()))
    }
}

impl FaceStream for BinaryFaces<'_> {
    fn next_faces(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        out.clear();
        while out.triangles.len() < max && self.records.left() > 0 {
            let next = self.records.next;
            if self.pending.is_none() {
                self.read_whole(max, out)?;
            }
            if self.records.next == next {
                self.read_pieces(max, out)?;
            }
        }
        Ok(())
    }
}

/// A record that the buffer holds whole.
struct Whole {
    /// Where the indices start.
    indices: usize,
    /// How many there are.
    count: usize,
    /// Length of the record.
    bytes: usize,
}

/// Measures the record at the start of `bytes`; `None` if it goes on beyond them, or a count is senseless.
#[inline]
fn measure(steps: &[Step], bytes: &[u8], order: Order) -> Option<Whole> {
    let list = |at: usize, count: Scalar, item: Scalar| {
        let items = count.read_index(bytes.get(at..at + count.size())?, order)?;
        let items = usize::try_from(items).ok()?;
        Some((items, items.checked_mul(item.size())?))
    };
    let (mut at, mut indices, mut count_of_indices) = (0_usize, 0, 0);
    for step in steps {
        match *step {
            Step::Skip(bytes) => at += bytes,
            Step::Coordinate { scalar, .. } => at += scalar.size(),
            Step::SkipList { count, item } => {
                at = at.checked_add(count.size() + list(at, count, item)?.1)?;
            }
            Step::Indices { count, item } => {
                let (items, length) = list(at, count, item)?;
                (indices, count_of_indices) = (at + count.size(), items);
                at = indices.checked_add(length)?;
            }
        }
    }
    let whole = Whole { indices, count: count_of_indices, bytes: at };
    (at <= bytes.len()).then_some(whole)
}

/// Adds a face of `count` vertices; an error is the place in the list of a vertex that there is not.
#[inline]
fn add_face(
    face: u32,
    count: usize,
    vertex: impl Fn(usize) -> std::result::Result<u32, usize>,
    out: &mut TriangleChunk,
) -> std::result::Result<(), usize> {
    if count == 3 {
        out.push(face, [vertex(0)?, vertex(1)?, vertex(2)?]);
        return Ok(());
    }
    let mut fan = PolygonFan::new(face);
    for k in 0..count {
        fan.push(vertex(k)?, out);
    }
    fan.finish(out);
    Ok(())
}

/// An index of any type; `None` if it is not a vertex's number.
#[inline]
fn rare_index(item: Scalar, bytes: &[u8], order: Order) -> Option<u32> {
    item.read_index(bytes, order).and_then(|v| u32::try_from(v).ok())
}

/// A face's number; that all fit was checked when the file was opened.
#[inline]
fn face_ordinal(face: u64) -> u32 {
    u32::try_from(face).expect("the count of faces is at most u32::MAX")
}
