//! Reading a mesh store.
//!
//! In: a store's file. Out: its counts, bounds, and partitions: which of them a query needs, and their triangles
//! in the local frame. Promises: a cut, foreign, stale or damaged file is an error, never misread; partitions
//! come in curve order; any number of threads may read at once. Memory: the tree and the table are mapped, which
//! is a hundredth of the file or less; so are the payloads of a store within the limit given, while those of a
//! larger one are copied, and leave nothing resident.

use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use glam::DVec3;

use super::key::MeshKey;
use super::layout::{
    ENTRY_BYTES, Entry, FAN_OUT, HEADER_BYTES, Header, Level, MeshCounts, NODE_BYTES, Node,
    RawHeader, tree_levels,
};
use super::partition::PartitionBuffer;
use crate::geom::Bounds3;
use crate::store::mmap::MappedFile;
use crate::{Error, Result};

/// Number of a partition: its place on the space-filling curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartitionId(pub u32);

/// An open mesh store.
#[derive(Debug)]
pub struct MeshStore {
    map: MappedFile,
    header: Header,
    levels: Vec<Level>,
    /// Whether the whole store may stay in memory.
    is_resident: bool,
}

impl MeshStore {
    /// Opens a store and checks everything but the payloads, which are checked when they are loaded.
    ///
    /// `resident_limit_bytes`: a store no longer than that may stay in memory whole.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be opened or mapped; [`Error::Corrupt`] or [`Error::Unsupported`] if it
    /// is not a whole, undamaged mesh store of this version.
    pub fn open(path: &Path, resident_limit_bytes: u64) -> Result<Self> {
        let mut file = File::open(path).map_err(|e| Error::io(path, e))?;
        let file_bytes = file.metadata().map_err(|e| Error::io(path, e))?.len();
        let mut raw = RawHeader([0; HEADER_BYTES]);
        if file_bytes < HEADER_BYTES as u64 {
            let (expected, found) =
                (format!("{HEADER_BYTES} bytes or more"), file_bytes.to_string());
            return Err(Error::corrupt(path, "file length", expected, found));
        }
        file.read_exact(&mut raw.0).map_err(|e| Error::io(path, e))?;
        let header = raw.check(path, file_bytes)?;
        let map = MappedFile::map(file, path, file_bytes)?;
        let is_resident = file_bytes <= resident_limit_bytes;
        let levels = tree_levels(header.partitions);
        let store = Self { map, header, levels, is_resident };
        store.check_tables()?;
        Ok(store)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        self.map.path()
    }

    /// What the store was made from.
    pub fn key(&self) -> MeshKey {
        self.header.key
    }

    /// Ground position of the local frame's origin, metres: ground = local + origin.
    pub fn origin(&self) -> DVec3 {
        self.header.lattice.origin
    }

    /// Metres between neighbouring points of the lattice on which all vertices stand; a power of two.
    pub fn step(&self) -> f64 {
        self.header.lattice.step
    }

    /// Bounds of all triangles, local frame, metres; empty if there are none.
    pub fn bounds(&self) -> Bounds3 {
        self.header.bounds.local(&self.header.lattice)
    }

    /// What was found in the input files, and what became of it.
    pub fn counts(&self) -> MeshCounts {
        self.header.counts
    }

    /// Length of the file.
    pub fn file_bytes(&self) -> u64 {
        self.header.file_bytes
    }

    /// Bytes that may be resident: the whole file, or the tree and the table of a file that is copied from.
    pub fn held_bytes(&self) -> u64 {
        let file = self.header.file_bytes;
        let tree: usize = self.levels.iter().map(|level| level.nodes * NODE_BYTES).sum();
        let table = self.header.partitions * ENTRY_BYTES;
        if self.is_resident { file } else { (tree + table) as u64 }
    }

    /// Number of partitions; their ids run from 0.
    pub fn partition_count(&self) -> usize {
        self.header.partitions
    }

    /// Bounds of a partition's triangles, local frame, metres; exact.
    ///
    /// # Panics
    /// If the store has no such partition.
    pub fn partition_bounds(&self, id: PartitionId) -> Bounds3 {
        self.entry(id.0 as usize).node().local(&self.header.lattice)
    }

    /// Triangles in a partition.
    ///
    /// # Panics
    /// If the store has no such partition.
    pub fn partition_triangles(&self, id: PartitionId) -> usize {
        self.entry(id.0 as usize).triangles as usize
    }

    /// Appends to `out`, ascending, the partitions whose bounds `keep` accepts, looking only below nodes whose
    /// bounds it accepts: `keep` must accept any box that holds one that it accepts.
    pub fn query(&self, mut keep: impl FnMut(&Bounds3) -> bool, out: &mut Vec<PartitionId>) {
        let top = self.levels.last().map_or(self.header.partitions, |level| level.nodes);
        for place in 0..top {
            self.descend(self.levels.len(), place, &mut keep, out);
        }
    }

    /// Decodes a partition into `buffer`, after checking its checksum.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if the payload is damaged, and [`Error::Io`] if it cannot be read; what the buffer then
    /// holds is nothing, or what it held before.
    ///
    /// # Panics
    /// If the store has no such partition.
    pub fn load(&self, id: PartitionId, buffer: &mut PartitionBuffer) -> Result<()> {
        let entry = self.entry(id.0 as usize);
        let range = payload_range(&entry);
        if self.is_resident {
            let payload = self.map.get(range).expect("checked when the store was opened");
            return self.decode(id, &entry, payload, buffer);
        }
        let mut copy = std::mem::take(&mut buffer.copy);
        let loaded =
            self.map.read(range, &mut copy).and_then(|()| self.decode(id, &entry, &copy, buffer));
        buffer.copy = copy;
        loaded
    }

    fn decode(
        &self,
        id: PartitionId,
        entry: &Entry,
        payload: &[u8],
        buffer: &mut PartitionBuffer,
    ) -> Result<()> {
        let found = crc32fast::hash(payload);
        if found != entry.crc {
            *buffer = PartitionBuffer::new();
            let expected = format!("checksum {:08x}", entry.crc);
            return Err(self.corrupt_partition(id, expected, format!("{found:08x}")));
        }
        buffer.decode(entry, payload, &self.header.lattice).ok_or_else(|| {
            self.corrupt_partition(id, "a partition's payload".into(), "other bytes".into())
        })
    }

    fn corrupt_partition(&self, id: PartitionId, expected: String, found: String) -> Error {
        Error::corrupt(self.path(), format!("partition {}", id.0), expected, found)
    }

    /// Visits the node `place` of tree level `level`; level 0 is the partitions themselves.
    fn descend(
        &self,
        level: usize,
        place: usize,
        keep: &mut impl FnMut(&Bounds3) -> bool,
        out: &mut Vec<PartitionId>,
    ) {
        let node = match level {
            0 => self.entry(place).node(),
            _ => self.node(self.levels[level - 1].first + place),
        };
        if !keep(&node.local(&self.header.lattice)) {
            return;
        }
        if level == 0 {
            let id = u32::try_from(place).expect("the header's check allows no more partitions");
            out.push(PartitionId(id));
            return;
        }
        let below = match level {
            1 => self.header.partitions,
            _ => self.levels[level - 2].nodes,
        };
        for child in place * FAN_OUT..below.min((place + 1) * FAN_OUT) {
            self.descend(level - 1, child, keep, out);
        }
    }

    fn entry(&self, place: usize) -> Entry {
        assert!(place < self.header.partitions, "partition {place} of {}", self.header.partitions);
        let start = self.header.table_offset + place * ENTRY_BYTES;
        let bytes = self.map.get(start..start + ENTRY_BYTES);
        Entry::decode(bytes.expect("the header's check found the table within the file"))
    }

    fn node(&self, place: usize) -> Node {
        let start = self.header.tree_offset() + place * NODE_BYTES;
        let bytes = self.map.get(start..start + NODE_BYTES);
        Node::decode(bytes.expect("the header's check found the tree within the file"))
    }

    /// Compares the tables with their checksums, and every entry with what a writer makes: after this,
    /// [`Self::entry`] may be believed.
    fn check_tables(&self) -> Result<()> {
        let (table, tree) = (self.header.table_offset, self.header.tree_offset());
        let file_bytes = self.header.tree_offset() + self.node_count() * NODE_BYTES;
        self.check_table("partition table", table..tree, self.header.table_crc)?;
        self.check_table("tree", tree..file_bytes, self.header.tree_crc)?;
        let mut end = HEADER_BYTES as u64;
        for place in 0..self.header.partitions {
            let entry = self.entry(place);
            if entry.offset != end || !entry.is_plausible() {
                let place = format!("partition table, entry {place}");
                return Err(Error::corrupt(self.path(), place, "an entry that fits", "another"));
            }
            end += u64::from(entry.bytes);
        }
        if end != table as u64 {
            let expected = format!("{table} bytes");
            return Err(Error::corrupt(self.path(), "payloads", expected, format!("{end} bytes")));
        }
        if !self.is_resident {
            self.map.release(table..file_bytes);
        }
        Ok(())
    }

    fn check_table(&self, name: &str, range: Range<usize>, expected: u32) -> Result<()> {
        let bytes = self.map.get(range).expect("the header's check found the tables in the file");
        let found = crc32fast::hash(bytes);
        if found == expected {
            return Ok(());
        }
        let expected = format!("checksum {expected:08x}");
        Err(Error::corrupt(self.path(), name, expected, format!("{found:08x}")))
    }

    fn node_count(&self) -> usize {
        self.levels.iter().map(|level| level.nodes).sum()
    }
}

/// Where a partition's payload lies in the file.
fn payload_range(entry: &Entry) -> Range<usize> {
    let start = usize::try_from(entry.offset).expect("the whole file is mapped");
    start..start + entry.bytes as usize
}
