//! Partitions: some hundreds of neighbouring triangles as bytes, and back.
//!
//! In: up to [`PARTITION_TRIANGLES`] triangles with lattice corners. Out: a payload as `layout.rs` describes it,
//! and from it again positions, indices and ids in reusable buffers. Promises: the bytes are a function of the
//! set of triangles alone, however they are ordered (a polygon's triangles keep their order among themselves);
//! vertices are unique; positions come back exactly.

use glam::DVec3;

use super::lattice::{Lattice, LatticePoint};
use super::layout::{Entry, Node, PARTITION_TRIANGLES, u32_le};
use crate::geom::{Bounds3, FaceBlock, FaceId};

/// Slots of the table of vertices: a power of two above twice the most vertices of a partition.
const SLOTS: usize = (6 * PARTITION_TRIANGLES).next_power_of_two();

/// A triangle on its way into a partition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Triangle {
    /// Size class and place on the curve.
    pub(super) key: u64,
    /// Face id.
    pub(super) id: u32,
    /// Corners, in the file's winding.
    pub(super) corners: [LatticePoint; 3],
}

/// A partition's payload, and its entry but for the offset.
#[derive(Debug)]
pub(super) struct Encoded {
    pub(super) payload: Vec<u8>,
    pub(super) entry: Entry,
}

/// Working memory of [`PartitionEncoder::encode`], one a thread.
#[derive(Debug)]
pub(super) struct PartitionEncoder {
    /// Index of the vertex in a slot, or `u16::MAX`.
    slots: Vec<u16>,
    vertices: Vec<LatticePoint>,
    indices: Vec<[u16; 3]>,
    order: Vec<(u32, u16)>,
}

impl PartitionEncoder {
    /// Working memory for any number of partitions.
    pub(super) fn new() -> Self {
        let (vertices, indices, order) = (Vec::new(), Vec::new(), Vec::new());
        Self { slots: vec![u16::MAX; SLOTS], vertices, indices, order }
    }

    /// Encodes 1 to [`PARTITION_TRIANGLES`] triangles.
    pub(super) fn encode(&mut self, triangles: &[Triangle]) -> Encoded {
        debug_assert!((1..=PARTITION_TRIANGLES).contains(&triangles.len()));
        // 1. By id, so that differences are small; the place among the others keeps a polygon's order.
        self.order.clear();
        self.order.extend(triangles.iter().zip(0..).map(|(t, place)| (t.id, place)));
        self.order.sort_unstable();
        // 2. Vertices in the order of their first use.
        self.vertices.clear();
        self.indices.clear();
        self.slots.fill(u16::MAX);
        for k in 0..self.order.len() {
            let corners = triangles[usize::from(self.order[k].1)].corners;
            let indices = corners.map(|p| self.index_of(p));
            self.indices.push(indices);
        }
        // 3. Offsets from the least corner.
        let bounds = self.vertices.iter().fold(Node::EMPTY, |b, &p| b.including(p));
        let mut entry = Entry {
            offset: 0,
            bytes: 0,
            crc: 0,
            vertices: u32::from(index16(self.vertices.len())),
            triangles: u32::from(index16(triangles.len())),
            min: bounds.min,
            extent: std::array::from_fn(|a| bounds.max[a].abs_diff(bounds.min[a])),
        };
        let width = entry.offset_width();
        let mut payload = Vec::with_capacity(entry.offset_bytes() + 9 * triangles.len());
        for p in &self.vertices {
            for (k, least) in p.iter().zip(&bounds.min) {
                let offset = k.abs_diff(*least).to_le_bytes();
                payload.extend_from_slice(&offset[..width]);
            }
        }
        // 4. Indices and ids.
        for index in self.indices.iter().flatten() {
            payload.extend_from_slice(&index.to_le_bytes());
        }
        payload.extend_from_slice(&self.order[0].0.to_le_bytes());
        for pair in self.order.windows(2) {
            push_varint(pair[1].0 - pair[0].0, &mut payload);
        }
        entry.bytes = u32::try_from(payload.len()).expect("a partition takes less than 90 KiB");
        entry.crc = crc32fast::hash(&payload);
        Encoded { payload, entry }
    }

    /// The index of a vertex, new or known: open addressing, linear probing.
    fn index_of(&mut self, p: LatticePoint) -> u16 {
        let mixed = p.iter().fold(0_u64, |h, &k| {
            (h ^ k.cast_unsigned()).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
        });
        let mut slot = (mixed >> 32) as usize & (SLOTS - 1);
        loop {
            match self.slots[slot] {
                u16::MAX => {
                    let new = index16(self.vertices.len());
                    self.slots[slot] = new;
                    self.vertices.push(p);
                    return new;
                }
                index if self.vertices[usize::from(index)] == p => return index,
                _ => slot = (slot + 1) & (SLOTS - 1),
            }
        }
    }
}

/// Appends a variable-length integer: seven bits a byte, low bits first.
fn push_varint(mut value: u32, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(low_byte(value) | 0x80);
        value >>= 7;
    }
    out.push(low_byte(value));
}

/// The low eight bits.
fn low_byte(value: u32) -> u8 {
    value.to_le_bytes()[0]
}

/// A number of vertices or triangles of a partition, or an index below it.
fn index16(n: usize) -> u16 {
    u16::try_from(n).expect("a partition has at most 3 × 1024 vertices")
}

/// Takes a variable-length integer off the front of `bytes`; `None` if it is cut or too large.
fn take_varint(bytes: &mut &[u8]) -> Option<u32> {
    let mut value = 0_u64;
    for shift in (0..35).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return u32::try_from(value).ok();
        }
    }
    None
}

/// A decoded partition; reused from one to the next, it allocates only to grow.
#[derive(Debug, Clone)]
pub struct PartitionBuffer {
    positions: Vec<DVec3>,
    triangles: Vec<[u16; 3]>,
    ids: Vec<FaceId>,
    bounds: Bounds3,
    /// The payload, where it is not mapped.
    pub(super) copy: Vec<u8>,
}

impl Default for PartitionBuffer {
    fn default() -> Self {
        Self::new()
    }
}

impl PartitionBuffer {
    /// A buffer that holds nothing.
    pub fn new() -> Self {
        Self {
            positions: Vec::new(),
            triangles: Vec::new(),
            ids: Vec::new(),
            bounds: Bounds3::EMPTY,
            copy: Vec::new(),
        }
    }

    /// The triangles last loaded.
    pub fn block(&self) -> FaceBlock<'_> {
        FaceBlock {
            positions: &self.positions,
            triangles: &self.triangles,
            ids: &self.ids,
            bounds: self.bounds,
        }
    }

    /// Bytes of memory held.
    pub fn memory_bytes(&self) -> usize {
        self.positions.capacity() * size_of::<DVec3>()
            + self.triangles.capacity() * size_of::<[u16; 3]>()
            + self.ids.capacity() * size_of::<FaceId>()
            + self.copy.capacity()
    }

    /// Decodes a payload whose checksum is right; `entry` must be plausible. On `None` the payload is not what
    /// a writer makes, and the buffer holds nothing.
    pub(super) fn decode(
        &mut self,
        entry: &Entry,
        payload: &[u8],
        lattice: &Lattice,
    ) -> Option<()> {
        let decoded = self.try_decode(entry, payload, lattice);
        if decoded.is_none() {
            *self = Self::new();
        }
        decoded
    }

    fn try_decode(&mut self, entry: &Entry, payload: &[u8], lattice: &Lattice) -> Option<()> {
        let (offsets, rest) = payload.split_at_checked(entry.offset_bytes())?;
        let (indices, rest) = rest.split_at_checked(entry.triangles as usize * 6)?;
        self.bounds = entry.node().local(lattice);
        self.decode_positions(entry, offsets, lattice)?;
        self.decode_triangles(entry, indices)?;
        self.decode_ids(entry, rest)
    }

    fn decode_positions(&mut self, entry: &Entry, offsets: &[u8], lattice: &Lattice) -> Option<()> {
        // An offset beyond the extent would lie outside the bounds by which queries cull.
        let mut greatest = [0; 3];
        let mut local = |offset: [u64; 3]| {
            for a in 0..3 {
                greatest[a] = offset[a].max(greatest[a]);
            }
            lattice.local(std::array::from_fn(|a| entry.min[a].wrapping_add_unsigned(offset[a])))
        };
        self.positions.clear();
        if entry.offset_width() == 5 {
            self.positions.extend(offsets.chunks_exact(15).map(|bytes| {
                local(std::array::from_fn(|a| {
                    u64::from(u32_le(&bytes[5 * a..])) | u64::from(bytes[5 * a + 4]) << 32
                }))
            }));
        } else {
            self.positions.extend(
                offsets.chunks_exact(12).map(|bytes| {
                    local(std::array::from_fn(|a| u64::from(u32_le(&bytes[4 * a..]))))
                }),
            );
        }
        (greatest == entry.extent).then_some(())
    }

    fn decode_triangles(&mut self, entry: &Entry, indices: &[u8]) -> Option<()> {
        let mut greatest = 0;
        self.triangles.clear();
        self.triangles.extend(indices.chunks_exact(6).map(|bytes| {
            let triangle: [u16; 3] =
                std::array::from_fn(|c| u16::from_le_bytes([bytes[2 * c], bytes[2 * c + 1]]));
            greatest = triangle.into_iter().fold(greatest, u16::max);
            triangle
        }));
        (u32::from(greatest) < entry.vertices).then_some(())
    }

    fn decode_ids(&mut self, entry: &Entry, bytes: &[u8]) -> Option<()> {
        let (first, mut rest) = bytes.split_at_checked(4)?;
        let mut id = u32_le(first);
        self.ids.clear();
        self.ids.push(FaceId(id));
        for _ in 1..entry.triangles {
            id = id.checked_add(take_varint(&mut rest)?)?;
            self.ids.push(FaceId(id));
        }
        rest.is_empty().then_some(())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn lattice() -> Lattice {
        Lattice { origin: DVec3::new(5e5, 4e6, 0.0), step: 0.125 }
    }

    fn triangles_of(block: &FaceBlock<'_>) -> Vec<(u32, [DVec3; 3])> {
        (0..block.ids.len()).map(|k| (block.ids[k].0, block.corners(k))).collect()
    }

    fn assert_round_trip(mut triangles: Vec<Triangle>) {
        let encoded = PartitionEncoder::new().encode(&triangles);
        assert!(encoded.entry.is_plausible());
        let mut buffer = PartitionBuffer::new();
        buffer.decode(&encoded.entry, &encoded.payload, &lattice()).expect("decodes");
        triangles.sort_by_key(|t| t.id);
        let expected: Vec<_> =
            triangles.iter().map(|t| (t.id, t.corners.map(|p| lattice().local(p)))).collect();
        assert_eq!(triangles_of(&buffer.block()), expected);
        let all = expected.iter().flat_map(|t| t.1);
        assert_eq!(buffer.block().bounds, Bounds3::of(all));
    }

    fn corner(reach: i64) -> impl Strategy<Value = LatticePoint> {
        prop::array::uniform3(-reach..reach)
    }

    fn some_triangles(reach: i64, ids: u32) -> impl Strategy<Value = Vec<Triangle>> {
        let triangle = (0..ids, prop::array::uniform3(corner(reach)))
            .prop_map(|(id, corners)| Triangle { key: 0, id, corners });
        prop::collection::vec(triangle, 1..200)
    }

    proptest! {
        #[test]
        fn a_partition_reads_back_exactly(
            dense in some_triangles(4, 40),
            sparse in some_triangles(1 << 30, u32::MAX),
            wide in some_triangles((1 << 39) - 1, u32::MAX),
        ) {
            for mut triangles in [dense, sparse, wide] {
                // An entry with fewer than three vertices cannot come from triangles with area.
                triangles[0].corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]];
                assert_round_trip(triangles);
            }
        }

        #[test]
        fn a_damaged_payload_never_panics_and_never_leaves_the_bounds(
            triangles in some_triangles(1 << 20, 1000),
            place in any::<prop::sample::Index>(),
            value in any::<u8>(),
            cut in any::<prop::sample::Index>(),
        ) {
            let encoded = PartitionEncoder::new().encode(&triangles);
            let mut buffer = PartitionBuffer::new();
            let mut damaged = encoded.payload.clone();
            damaged[place.index(encoded.payload.len())] = value;
            if buffer.decode(&encoded.entry, &damaged, &lattice()).is_some() {
                let block = buffer.block();
                let all = (0..block.ids.len()).flat_map(|k| block.corners(k));
                let bounds = Bounds3::of(all);
                prop_assert_eq!(bounds.union(block.bounds), block.bounds);
            }
            let cut = &encoded.payload[..cut.index(encoded.payload.len())];
            prop_assert!(buffer.decode(&encoded.entry, cut, &lattice()).is_none());
        }
    }

    #[test]
    fn the_largest_partition_of_unshared_corners_fits_16_bit_indices() {
        let triangle = |k: i64| Triangle {
            key: 0,
            id: u32::MAX - 1,
            corners: [[3 * k, 0, 0], [3 * k + 1, 1, 0], [3 * k + 2, 0, 1]],
        };
        assert_round_trip((0..1024).map(triangle).collect());
    }

    #[test]
    fn shared_vertices_are_stored_once_and_the_bytes_do_not_follow_the_order() {
        let corners = [[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]];
        let a = Triangle { key: 1, id: 5, corners: [corners[0], corners[1], corners[2]] };
        let b = Triangle { key: 0, id: 6, corners: [corners[0], corners[2], corners[3]] };
        let mut encoder = PartitionEncoder::new();
        let (one, other) = (encoder.encode(&[a, b]), encoder.encode(&[b, a]));
        assert_eq!((one.entry.vertices, &one.payload), (4, &other.payload));
        assert_eq!(one.payload.len(), 4 * 12 + 2 * 6 + 4 + 1);
    }
}
