//! The layout of a mesh store's file, version 1; all numbers little-endian.
//!
//! In and out: bytes ↔ [`Header`], [`Entry`], [`Node`]. A header is read as [`RawHeader`] and becomes a
//! [`Header`] only by [`RawHeader::check`], against the file's true length.
//!
//! The file is header, payloads of the partitions one after the other, partition table, tree, without gaps.
//!
//! Header, 256 bytes:
//!
//! | offset | bytes | field |
//! |---|---|---|
//! | 0 | 8 | `magic`: `GROUNDMS` |
//! | 8 | 4 | `version`: u32, 1 |
//! | 12 | 4 | `header_bytes`: u32, 256 |
//! | 16 | 8 | `file_bytes`: u64, length of the whole file |
//! | 24 | 16 | `key`: fingerprint of inputs and settings |
//! | 40 | 24 | `origin`: 3 × f64, ground position of the lattice's zero, metres |
//! | 64 | 8 | `step`: f64, metres, a power of two |
//! | 72 | 24 | `min`: 3 × i64, least lattice coordinates of the kept faces |
//! | 96 | 24 | `max`: 3 × i64, greatest |
//! | 120 | 8 | `faces`: u64, faces of the input files |
//! | 128 | 8 | `faces_kept`: u64, those with a triangle in the store |
//! | 136 | 8 | `short_faces`: u64, those with fewer than three vertices |
//! | 144 | 8 | `triangles`: u64, in the store |
//! | 152 | 8 | `triangles_dropped`: u64, without area on the lattice |
//! | 160 | 8 | `vertices`: u64, of the input files |
//! | 168 | 8 | `vertices_unusable`: u64, not finite, and used by no face |
//! | 176 | 8 | `partitions`: u64 |
//! | 184 | 8 | `table_offset`: u64, where the partition table starts |
//! | 192 | 4 | `table_crc`: u32, CRC-32 of the partition table |
//! | 196 | 4 | `tree_crc`: u32, CRC-32 of the tree |
//! | 252 | 4 | `header_crc`: u32, CRC-32 of the 252 bytes before |
//!
//! What no field takes is zero.
//!
//! Partition table, 72 bytes a partition: payload offset u64, payload length u32, CRC-32 of the payload u32,
//! vertices u32, triangles u32, least lattice coordinates 3 × i64, extent in steps 3 × u64.
//!
//! Payload: a vertex's offsets from the partition's least coordinates, 3 × u32 a vertex (3 × 5 bytes if an extent
//! is 2³² or more); vertex indices, 3 × u16 a triangle; face ids, ascending: the first as u32, then each
//! difference to the one before as a variable-length integer (seven bits a byte, low bits first, the high bit
//! set on all but the last byte).
//!
//! Tree: bounds of runs of [`FAN_OUT`] partitions, then of runs of [`FAN_OUT`] of those, until at most
//! [`FAN_OUT`] are left; 48 bytes a node: least 3 × i64, greatest 3 × i64. Without pointers: the counts follow
//! from the number of partitions.

use std::path::Path;

use glam::DVec3;

use super::key::MeshKey;
use super::lattice::{COORDINATE_LIMIT, Lattice, LatticePoint};
use crate::geom::Bounds3;
use crate::{Error, Result};

/// First bytes of every mesh store.
pub(super) const MAGIC: [u8; 8] = *b"GROUNDMS";
/// Version of the layout; raised, too, when the order of triangles or the rule by which they are cut changes.
pub(super) const VERSION: u32 = 1;
/// Length of the header.
pub(super) const HEADER_BYTES: usize = 256;
/// The same, as it stands in the header.
const HEADER_LENGTH: u32 = 256;
/// Length of an entry of the partition table.
pub(super) const ENTRY_BYTES: usize = 72;
/// Length of a node of the tree.
pub(super) const NODE_BYTES: usize = 48;
/// Children of a node.
pub(super) const FAN_OUT: usize = 8;
/// Most triangles of a partition.
pub(super) const PARTITION_TRIANGLES: usize = 1024;

/// Offset and length of each field of the header, as in the module's table.
mod field {
    use std::ops::Range;

    macro_rules! fields {
        ($($name:ident: $range:expr,)*) => {
            $(pub(super) const $name: Range<usize> = $range;)*
            #[cfg(test)]
            pub(super) const ALL: &[(&str, Range<usize>)] = &[$((stringify!($name), $range),)*];
        };
    }
    fields! {
        MAGIC: 0..8,
        VERSION: 8..12,
        HEADER_BYTES: 12..16,
        FILE_BYTES: 16..24,
        KEY: 24..40,
        ORIGIN: 40..64,
        STEP: 64..72,
        MIN: 72..96,
        MAX: 96..120,
        FACES: 120..128,
        FACES_KEPT: 128..136,
        SHORT_FACES: 136..144,
        TRIANGLES: 144..152,
        TRIANGLES_DROPPED: 152..160,
        VERTICES: 160..168,
        VERTICES_UNUSABLE: 168..176,
        PARTITIONS: 176..184,
        TABLE_OFFSET: 184..192,
        TABLE_CRC: 192..196,
        TREE_CRC: 196..200,
        HEADER_CRC: 252..256,
    }
}

/// What was found in the input files, and what became of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshCounts {
    /// Faces of the input files, polygons counted once: the next face id.
    pub faces: u64,
    /// Faces with at least one triangle in the store.
    pub faces_kept: u64,
    /// Faces with fewer than three vertices (they are among the dropped).
    pub short_faces: u64,
    /// Triangles in the store.
    pub triangles: u64,
    /// Triangles dropped: a repeated vertex, or no area at all, after rounding to the lattice.
    pub triangles_dropped: u64,
    /// Vertices of the input files.
    pub vertices: u64,
    /// Vertices that are not finite, or beyond 2⁴⁰ m; no face uses one.
    pub vertices_unusable: u64,
}

impl MeshCounts {
    /// Faces of which nothing is in the store.
    pub fn faces_dropped(&self) -> u64 {
        self.faces - self.faces_kept
    }
}

/// A header whose every field has been checked against the others and the file's length.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub(super) file_bytes: u64,
    pub(super) key: MeshKey,
    pub(super) lattice: Lattice,
    pub(super) bounds: Node,
    pub(super) counts: MeshCounts,
    pub(super) partitions: usize,
    pub(super) table_offset: usize,
    pub(super) table_crc: u32,
    pub(super) tree_crc: u32,
}

impl Header {
    /// The header's bytes, checksum included.
    pub(super) fn encode(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        let mut put = |at: std::ops::Range<usize>, value: &[u8]| bytes[at].copy_from_slice(value);
        put(field::MAGIC, &MAGIC);
        put(field::VERSION, &VERSION.to_le_bytes());
        put(field::HEADER_BYTES, &HEADER_LENGTH.to_le_bytes());
        put(field::FILE_BYTES, &self.file_bytes.to_le_bytes());
        put(field::KEY, &self.key.0);
        put(field::ORIGIN, &self.lattice.origin.to_array().map(f64::to_le_bytes).concat());
        put(field::STEP, &self.lattice.step.to_le_bytes());
        put(field::MIN, &self.bounds.min.map(i64::to_le_bytes).concat());
        put(field::MAX, &self.bounds.max.map(i64::to_le_bytes).concat());
        put(field::FACES, &self.counts.faces.to_le_bytes());
        put(field::FACES_KEPT, &self.counts.faces_kept.to_le_bytes());
        put(field::SHORT_FACES, &self.counts.short_faces.to_le_bytes());
        put(field::TRIANGLES, &self.counts.triangles.to_le_bytes());
        put(field::TRIANGLES_DROPPED, &self.counts.triangles_dropped.to_le_bytes());
        put(field::VERTICES, &self.counts.vertices.to_le_bytes());
        put(field::VERTICES_UNUSABLE, &self.counts.vertices_unusable.to_le_bytes());
        put(field::PARTITIONS, &(self.partitions as u64).to_le_bytes());
        put(field::TABLE_OFFSET, &(self.table_offset as u64).to_le_bytes());
        put(field::TABLE_CRC, &self.table_crc.to_le_bytes());
        put(field::TREE_CRC, &self.tree_crc.to_le_bytes());
        let crc = crc32fast::hash(&bytes[..field::HEADER_CRC.start]);
        bytes[field::HEADER_CRC].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Where the tree starts: at the end of the partition table.
    pub(super) fn tree_offset(&self) -> usize {
        self.table_offset + self.partitions * ENTRY_BYTES
    }
}

/// A header as it was read, not to be believed.
#[derive(Debug, Clone)]
pub(super) struct RawHeader(pub(super) [u8; HEADER_BYTES]);

impl RawHeader {
    /// Checks the header against itself and the file's true length.
    ///
    /// # Errors
    /// [`Error::Corrupt`] for a foreign, cut or damaged file; [`Error::Unsupported`] for another version.
    pub(super) fn check(&self, path: &Path, file_bytes: u64) -> Result<Header> {
        let bytes = &self.0;
        let corrupt = |place: &str, expected: String, found: String| {
            Err(Error::corrupt(path, format!("header, {place}"), expected, found))
        };
        let u32_at = |at: std::ops::Range<usize>| u32_le(&bytes[at]);
        let u64_at = |at: std::ops::Range<usize>| u64_le(&bytes[at]);
        if bytes[field::MAGIC] != MAGIC {
            return corrupt("magic", "a mesh store".into(), "another kind of file".into());
        }
        let crc = crc32fast::hash(&bytes[..field::HEADER_CRC.start]);
        if u32_at(field::HEADER_CRC) != crc {
            return corrupt(
                "checksum",
                format!("{crc:08x}"),
                format!("{:08x}", u32_at(field::HEADER_CRC)),
            );
        }
        let version = u32_at(field::VERSION);
        if version != VERSION || u32_at(field::HEADER_BYTES) != HEADER_LENGTH {
            return Err(Error::unsupported(path, format!("mesh store version {version}")));
        }
        if u64_at(field::FILE_BYTES) != file_bytes {
            let expected = format!("{} bytes", u64_at(field::FILE_BYTES));
            return corrupt("file length", expected, format!("{file_bytes} bytes"));
        }
        let header = self.fields(file_bytes);
        let Some(header) = header.filter(Header::is_consistent) else {
            return corrupt("fields", "counts that fit the file".into(), "others".into());
        };
        Ok(header)
    }

    /// The fields, not yet compared with each other; `None` if a count is beyond this machine.
    fn fields(&self, file_bytes: u64) -> Option<Header> {
        let bytes = &self.0;
        let u32_at = |at: std::ops::Range<usize>| u32_le(&bytes[at]);
        let u64_at = |at: std::ops::Range<usize>| u64_le(&bytes[at]);
        let origin = u64s(&bytes[field::ORIGIN]).map(f64::from_bits);
        Some(Header {
            file_bytes,
            key: MeshKey(bytes[field::KEY].try_into().ok()?),
            lattice: Lattice {
                origin: DVec3::from_array(origin),
                step: f64::from_bits(u64_at(field::STEP)),
            },
            bounds: Node { min: i64s(&bytes[field::MIN]), max: i64s(&bytes[field::MAX]) },
            counts: MeshCounts {
                faces: u64_at(field::FACES),
                faces_kept: u64_at(field::FACES_KEPT),
                short_faces: u64_at(field::SHORT_FACES),
                triangles: u64_at(field::TRIANGLES),
                triangles_dropped: u64_at(field::TRIANGLES_DROPPED),
                vertices: u64_at(field::VERTICES),
                vertices_unusable: u64_at(field::VERTICES_UNUSABLE),
            },
            partitions: usize::try_from(u64_at(field::PARTITIONS)).ok()?,
            table_offset: usize::try_from(u64_at(field::TABLE_OFFSET)).ok()?,
            table_crc: u32_at(field::TABLE_CRC),
            tree_crc: u32_at(field::TREE_CRC),
        })
    }
}

impl Header {
    /// Whether the tables end where the file does, and the numbers are such as a writer makes.
    fn is_consistent(&self) -> bool {
        let step_bits = self.lattice.step.to_bits();
        let tables = u32::try_from(self.partitions).ok().and_then(|n| {
            let nodes = tree_levels(n as usize).iter().map(|l| l.nodes).sum::<usize>();
            self.table_offset.checked_add(n as usize * ENTRY_BYTES + nodes * NODE_BYTES)
        });
        tables.is_some_and(|end| end as u64 == self.file_bytes)
            && self.table_offset >= HEADER_BYTES
            && self.lattice.origin.is_finite()
            && self.lattice.step.is_normal()
            && step_bits & !f64::INFINITY.to_bits() == 0
            && self.counts.faces_kept <= self.counts.faces
            && u32::try_from(self.counts.faces).is_ok()
            && (self.partitions == 0 || self.bounds.is_plausible())
    }
}

/// What the partition table says of a partition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Entry {
    pub(super) offset: u64,
    pub(super) bytes: u32,
    pub(super) crc: u32,
    pub(super) vertices: u32,
    pub(super) triangles: u32,
    pub(super) min: LatticePoint,
    pub(super) extent: [u64; 3],
}

impl Entry {
    /// The entry's bytes.
    pub(super) fn encode(&self) -> [u8; ENTRY_BYTES] {
        let mut bytes = [0; ENTRY_BYTES];
        bytes[..8].copy_from_slice(&self.offset.to_le_bytes());
        let small = [self.bytes, self.crc, self.vertices, self.triangles];
        bytes[8..24].copy_from_slice(&small.map(u32::to_le_bytes).concat());
        bytes[24..48].copy_from_slice(&self.min.map(i64::to_le_bytes).concat());
        bytes[48..].copy_from_slice(&self.extent.map(u64::to_le_bytes).concat());
        bytes
    }

    /// The entry in `bytes`, which must be [`ENTRY_BYTES`] long.
    pub(super) fn decode(bytes: &[u8]) -> Self {
        Self {
            offset: u64_le(&bytes[..8]),
            bytes: u32_le(&bytes[8..12]),
            crc: u32_le(&bytes[12..16]),
            vertices: u32_le(&bytes[16..20]),
            triangles: u32_le(&bytes[20..24]),
            min: i64s(&bytes[24..48]),
            extent: u64s(&bytes[48..72]),
        }
    }

    /// Bytes of an offset: 4, or 5 in a partition of 2³² steps or more.
    pub(super) fn offset_width(&self) -> usize {
        if self.extent.iter().any(|&e| e > u64::from(u32::MAX)) { 5 } else { 4 }
    }

    /// Bytes of the vertices' offsets.
    pub(super) fn offset_bytes(&self) -> usize {
        self.vertices as usize * 3 * self.offset_width()
    }

    /// The bounds; valid for a plausible entry.
    pub(super) fn node(&self) -> Node {
        let max = std::array::from_fn(|a| self.min[a] + self.extent[a].cast_signed());
        Node { min: self.min, max }
    }

    /// Whether the numbers are such as a writer makes; the payload must still be looked at.
    pub(super) fn is_plausible(&self) -> bool {
        let triangles = self.triangles as usize;
        let least = self.offset_bytes() + triangles * 7 + 3;
        (1..=PARTITION_TRIANGLES).contains(&triangles)
            && (3..=3 * triangles).contains(&(self.vertices as usize))
            && self.bytes as usize >= least
            && self.extent.iter().all(|&e| e < COORDINATE_LIMIT.cast_unsigned() * 2)
            && self.min.iter().all(|&k| k.abs() < COORDINATE_LIMIT)
    }
}

/// Bounds on the lattice, both ends included; a node of the tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Node {
    pub(super) min: LatticePoint,
    pub(super) max: LatticePoint,
}

impl Node {
    /// Bounds of nothing.
    pub(super) const EMPTY: Self = Self { min: [i64::MAX; 3], max: [i64::MIN; 3] };

    /// The least bounds that hold both.
    pub(super) fn union(self, other: Self) -> Self {
        Self {
            min: std::array::from_fn(|a| self.min[a].min(other.min[a])),
            max: std::array::from_fn(|a| self.max[a].max(other.max[a])),
        }
    }

    /// These bounds, grown to hold `p`.
    pub(super) fn including(self, p: LatticePoint) -> Self {
        self.union(Self { min: p, max: p })
    }

    /// The bounds in the local frame, metres; exact. Empty stays empty.
    pub(super) fn local(&self, lattice: &Lattice) -> Bounds3 {
        if self.min[0] > self.max[0] {
            return Bounds3::EMPTY;
        }
        Bounds3 { min: lattice.local(self.min), max: lattice.local(self.max) }
    }

    /// The node's bytes.
    pub(super) fn encode(&self) -> [u8; NODE_BYTES] {
        let mut bytes = [0; NODE_BYTES];
        bytes[..24].copy_from_slice(&self.min.map(i64::to_le_bytes).concat());
        bytes[24..].copy_from_slice(&self.max.map(i64::to_le_bytes).concat());
        bytes
    }

    /// The node in `bytes`, which must be [`NODE_BYTES`] long.
    pub(super) fn decode(bytes: &[u8]) -> Self {
        Self { min: i64s(&bytes[..24]), max: i64s(&bytes[24..48]) }
    }

    fn is_plausible(&self) -> bool {
        let within = |k: &i64| (-COORDINATE_LIMIT..=COORDINATE_LIMIT).contains(k);
        (0..3).all(|a| self.min[a] <= self.max[a]) && self.min.iter().chain(&self.max).all(within)
    }
}

/// One level of the tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Level {
    /// Nodes of the levels before.
    pub(super) first: usize,
    /// Nodes of this level.
    pub(super) nodes: usize,
}

/// The levels of the tree over `partitions` partitions, the one nearest to the partitions first; none if
/// [`FAN_OUT`] or fewer partitions need no tree.
pub(super) fn tree_levels(partitions: usize) -> Vec<Level> {
    let mut levels = Vec::new();
    let (mut first, mut below) = (0, partitions);
    while below > FAN_OUT {
        below = below.div_ceil(FAN_OUT);
        levels.push(Level { first, nodes: below });
        first += below;
    }
    levels
}

/// The first four bytes as a number.
pub(super) fn u32_le(bytes: &[u8]) -> u32 {
    u32::from_le_bytes(bytes[..4].try_into().expect("four bytes"))
}

/// The first eight bytes as a number.
pub(super) fn u64_le(bytes: &[u8]) -> u64 {
    u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes"))
}

fn u64s(bytes: &[u8]) -> [u64; 3] {
    std::array::from_fn(|a| u64_le(&bytes[8 * a..]))
}

fn i64s(bytes: &[u8]) -> [i64; 3] {
    u64s(bytes).map(u64::cast_signed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        let partitions = 20;
        let nodes = 3;
        Header {
            file_bytes: (HEADER_BYTES + 500 + partitions * ENTRY_BYTES + nodes * NODE_BYTES) as u64,
            key: MeshKey([7; 16]),
            lattice: Lattice { origin: DVec3::new(1.0, -2.0, 3.0), step: 0.25 },
            bounds: Node { min: [-5, 0, 7], max: [9, 9, 9] },
            counts: MeshCounts { faces: 9, faces_kept: 8, triangles: 11, ..Default::default() },
            partitions,
            table_offset: HEADER_BYTES + 500,
            table_crc: 1,
            tree_crc: 2,
        }
    }

    #[test]
    fn the_documented_table_is_the_constants() {
        let rows: Vec<(String, usize, usize)> = include_str!("layout.rs")
            .lines()
            .filter_map(|l| l.strip_prefix("//! | "))
            .filter_map(|l| {
                let cells: Vec<&str> = l.split('|').map(str::trim).collect();
                let name = cells[2].split('`').nth(1)?.to_uppercase();
                Some((name, cells[0].parse().ok()?, cells[1].parse().ok()?))
            })
            .collect();
        let constants: Vec<(String, usize, usize)> =
            field::ALL.iter().map(|(name, at)| ((*name).to_owned(), at.start, at.len())).collect();
        assert_eq!(rows, constants);
        assert!(field::ALL.windows(2).all(|w| w[0].1.end <= w[1].1.start));
        assert_eq!(field::ALL.last().unwrap().1.end, HEADER_BYTES);
        let document = include_str!("layout.rs");
        assert!(document.contains(&format!("Header, {HEADER_BYTES} bytes")));
        assert!(document.contains(&format!("Partition table, {ENTRY_BYTES} bytes")));
        assert!(document.contains(&format!("{NODE_BYTES} bytes a node")));
        assert!(document.contains(&format!("`magic`: `{}`", str::from_utf8(&MAGIC).unwrap())));
    }

    #[test]
    fn a_header_reads_back_and_a_flip_of_any_of_its_bits_is_an_error() {
        let header = header();
        let bytes = header.encode();
        let path = Path::new("a.mesh");
        assert_eq!(RawHeader(bytes).check(path, header.file_bytes).unwrap(), header);
        for bit in 0..HEADER_BYTES * 8 {
            let mut flipped = bytes;
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(RawHeader(flipped).check(path, header.file_bytes).is_err(), "bit {bit}");
        }
        assert!(RawHeader(bytes).check(path, header.file_bytes - 1).is_err());
    }

    #[test]
    fn a_header_with_a_valid_checksum_over_senseless_fields_is_an_error() {
        let good = header();
        let bad: [fn(&mut Header); 6] = [
            |h| h.partitions = usize::MAX / 100,
            |h| h.partitions += 1,
            |h| h.lattice.step = 0.3,
            |h| h.lattice.origin.x = f64::NAN,
            |h| h.counts.faces_kept = h.counts.faces + 1,
            |h| h.bounds.max[2] = i64::MAX,
        ];
        for spoil in bad {
            let mut header = good.clone();
            spoil(&mut header);
            let raw = RawHeader(header.encode());
            assert!(raw.check(Path::new("a.mesh"), good.file_bytes).is_err(), "{header:?}");
        }
    }

    #[test]
    fn entries_and_nodes_read_back() {
        let entry = Entry {
            offset: 256,
            bytes: 99,
            crc: 5,
            vertices: 3,
            triangles: 1,
            min: [-4, 5, 6],
            extent: [1, 1 << 32, 0],
        };
        assert_eq!(Entry::decode(&entry.encode()), entry);
        assert!(entry.offset_width() == 5 && entry.is_plausible());
        assert_eq!(Node::decode(&entry.node().encode()), entry.node());
    }

    #[test]
    fn the_tree_ends_in_at_most_eight_nodes() {
        assert!(tree_levels(8).is_empty());
        let levels = tree_levels(1000);
        assert_eq!(levels.iter().map(|l| l.nodes).collect::<Vec<_>>(), [125, 16, 2]);
        assert_eq!(levels[2].first, 141);
    }
}
