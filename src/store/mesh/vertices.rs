//! The vertices of a mesh while its store is built: on the lattice, packed, reached by number.
//!
//! In: lattice points in file order. Out: the corners of triangles. Memory: all vertices if they fit; else they lie
//! in a temporary file, of which blocks are held, the least recently used given up first. Most meshes are written
//! with faces near their neighbours, so that a few blocks serve; for one that is not, blocks would be read again
//! and again, and [`super::join`] takes over.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use super::join::{Answers, Join};
use super::lattice::{COORDINATE_LIMIT, LatticePoint};
use crate::{Error, Result};

/// Bytes of a packed vertex: three coordinates of 40 bits.
pub(super) const PACKED_BYTES: usize = 15;
/// Bytes read for a vertex, and those among them that are not its own.
const READ_BYTES: usize = 16;
const SLACK_BYTES: usize = READ_BYTES - PACKED_BYTES;
const COORDINATE_BITS: u32 = 40;
const COORDINATE_MASK: u64 = (1 << COORDINATE_BITS) - 1;
/// Stands for a vertex that is not finite; beyond every coordinate.
const UNUSABLE: [u8; PACKED_BYTES] = [0xff; PACKED_BYTES];
/// Loads of a block, on average, from which on a file is held to have no locality.
const THRASHING: u64 = 8;

/// A vertex as 15 bytes; `None` is one that no face may use.
#[inline]
pub(super) fn pack(point: Option<LatticePoint>) -> [u8; PACKED_BYTES] {
    let Some(point) = point else { return UNUSABLE };
    let [x, y, z] = point.map(|k| u128::from((k + COORDINATE_LIMIT).cast_unsigned()));
    let bits = x | y << COORDINATE_BITS | z << (2 * COORDINATE_BITS);
    let mut packed = [0; PACKED_BYTES];
    packed.copy_from_slice(&bits.to_le_bytes()[..PACKED_BYTES]);
    packed
}

/// The vertex that starts at `bytes[at]`; one byte must follow its 15.
#[inline]
pub(super) fn unpack(bytes: &[u8], at: usize) -> Option<LatticePoint> {
    let bytes: [u8; READ_BYTES] = bytes[at..][..READ_BYTES].try_into().expect("sixteen bytes");
    let bits = u128::from_le_bytes(bytes);
    #[expect(clippy::cast_possible_truncation, reason = "the mask keeps 40 bits")]
    let coordinate = |axis: u32| (bits >> (axis * COORDINATE_BITS)) as u64 & COORDINATE_MASK;
    let [x, y, z] = [coordinate(0), coordinate(1), coordinate(2)];
    let point = [x, y, z].map(|k| k.cast_signed() - COORDINATE_LIMIT);
    (x != COORDINATE_MASK).then_some(point)
}

/// The vertices of one mesh, being written.
#[derive(Debug)]
pub(super) struct VertexWriter {
    held: Vec<u8>,
    file: Option<(PathBuf, File)>,
}

impl VertexWriter {
    /// A writer to memory, or to the file at `path`, which is made.
    pub(super) fn new(path: Option<PathBuf>) -> Result<Self> {
        let open = |path: PathBuf| {
            let file = File::create_new(&path).map_err(|e| Error::io(&path, e))?;
            Ok::<_, Error>((path, file))
        };
        Ok(Self { held: Vec::new(), file: path.map(open).transpose()? })
    }

    /// Appends packed vertices.
    pub(super) fn write(&mut self, packed: &[u8]) -> Result<()> {
        if let Some((path, file)) = &mut self.file {
            return file.write_all(packed).map_err(|e| Error::io(path, e));
        }
        self.held.extend_from_slice(packed);
        Ok(())
    }

    /// Ends the writing; of a file, blocks of `block_vertices` (a power of two) are held in `budget_bytes`.
    pub(super) fn finish(mut self, block_vertices: u32, budget_bytes: usize) -> Result<Vertices> {
        if let Some((path, file)) = self.file {
            let blocks = VertexBlocks::open(path, &file, block_vertices, budget_bytes)?;
            return Ok(Vertices::OnDisk(blocks));
        }
        self.held.extend_from_slice(&[0; SLACK_BYTES]);
        Ok(Vertices::Held(self.held))
    }
}

/// The vertices of one mesh.
#[derive(Debug)]
pub(super) enum Vertices {
    /// All in memory, packed.
    Held(Vec<u8>),
    /// In a temporary file.
    OnDisk(VertexBlocks),
    /// The corners of the triangles to come, and of those last held, packed.
    Joined(Answers, Vec<u8>),
}

impl Vertices {
    /// Sees to it that the vertices of the first of these triangles are at hand, and tells of how many. Once
    /// joined, the triangles must come in the order of the file, each once.
    pub(super) fn hold(&mut self, triangles: &[[u32; 3]]) -> Result<usize> {
        match self {
            Self::Held(_) => {}
            Self::OnDisk(blocks) => return blocks.hold(triangles),
            Self::Joined(answers, packed) => {
                answers.take(triangles, packed)?;
                packed.extend_from_slice(&[0; SLACK_BYTES]);
            }
        }
        Ok(triangles.len())
    }

    /// Corner `c` of triangle `k` of those last held; `None` if it is not finite.
    #[inline]
    pub(super) fn corner(
        &self,
        triangles: &[[u32; 3]],
        k: usize,
        c: usize,
    ) -> Option<LatticePoint> {
        match self {
            Self::Held(packed) => unpack(packed, triangles[k][c] as usize * PACKED_BYTES),
            Self::OnDisk(blocks) => blocks.get(triangles[k][c]),
            Self::Joined(_, packed) => unpack(packed, (3 * k + c) * PACKED_BYTES),
        }
    }

    /// Joins the triangles not yet held with the vertices, if blocks are read again and again.
    pub(super) fn join_if_thrashing(&mut self, join: &Join<'_>) -> Result<()> {
        if let Self::OnDisk(blocks) = self
            && blocks.is_thrashing()
        {
            let path = std::mem::take(&mut blocks.path);
            // The blocks' memory is free before the join takes its own.
            *self = Self::Held(Vec::new());
            *self = Self::Joined(join.run(&path)?, Vec::new());
        }
        Ok(())
    }
}

/// A block of vertices that is not held.
const ABSENT: u32 = u32::MAX;

/// Vertices in a temporary file, some blocks of them held.
#[derive(Debug)]
pub(super) struct VertexBlocks {
    path: PathBuf,
    file: File,
    /// Vertices of a block, as a power of two.
    block_log2: u32,
    /// Slots that there may be.
    capacity: usize,
    /// The slot of each block, or [`ABSENT`].
    slot_of: Vec<u32>,
    /// The last request for each block.
    asked: Vec<u64>,
    /// The block in each slot.
    block_in: Vec<u32>,
    slots: Vec<u8>,
    /// Number of the current request.
    request: u64,
    /// Triangles that fitted last.
    batch: usize,
    loads: u64,
}

impl VertexBlocks {
    fn open(path: PathBuf, file: &File, block_vertices: u32, budget_bytes: usize) -> Result<Self> {
        let io = |e| Error::io(&path, e);
        let bytes = file.metadata().map_err(io)?.len();
        let file = File::open(&path).map_err(io)?;
        let block_bytes = u64::from(block_vertices) * PACKED_BYTES as u64;
        let blocks = usize::try_from(bytes.div_ceil(block_bytes)).expect("below 2³² vertices");
        let mut opened = Self {
            path,
            file,
            block_log2: block_vertices.ilog2(),
            capacity: 0,
            slot_of: vec![ABSENT; blocks],
            asked: vec![0; blocks],
            block_in: Vec::new(),
            slots: Vec::new(),
            request: 0,
            batch: usize::MAX / 2,
            loads: 0,
        };
        // Three blocks serve any triangle.
        opened.capacity = (budget_bytes / opened.slot_bytes()).max(3);
        Ok(opened)
    }

    fn block_bytes(&self) -> usize {
        PACKED_BYTES << self.block_log2
    }

    fn slot_bytes(&self) -> usize {
        self.block_bytes() + SLACK_BYTES
    }

    #[inline]
    fn get(&self, index: u32) -> Option<LatticePoint> {
        let slot = self.slot_of[(index >> self.block_log2) as usize] as usize;
        let within = (index & ((1 << self.block_log2) - 1)) as usize;
        unpack(&self.slots, slot * self.slot_bytes() + within * PACKED_BYTES)
    }

    /// Sees to it that the vertices of the first of these triangles are held together, and tells of how many:
    /// all of them if the blocks that they name fit.
    fn hold(&mut self, triangles: &[[u32; 3]]) -> Result<usize> {
        let mut count = triangles.len().min(2 * self.batch);
        loop {
            self.request += 1;
            let (mut missing, mut wanted) = (Vec::new(), 0);
            for index in triangles[..count].iter().flatten() {
                let block = index >> self.block_log2;
                let place = block as usize;
                if self.asked[place] != self.request {
                    self.asked[place] = self.request;
                    wanted += 1;
                    if self.slot_of[place] == ABSENT {
                        missing.push(block);
                    }
                }
            }
            if wanted <= self.capacity {
                self.load(missing)?;
                self.batch = count.max(1);
                return Ok(count);
            }
            count = count.div_ceil(2);
        }
    }

    /// Reads blocks, in file order, into slots that are free or whose blocks have waited longest.
    fn load(&mut self, mut missing: Vec<u32>) -> Result<()> {
        missing.sort_unstable();
        let free = (self.capacity - self.block_in.len()).min(missing.len());
        let mut targets: Vec<usize> = (self.block_in.len()..self.block_in.len() + free).collect();
        if free < missing.len() {
            let last_asked = |slot: usize| self.asked[self.block_in[slot] as usize];
            let mut idle: Vec<(u64, usize)> = (0..self.block_in.len())
                .map(|slot| (last_asked(slot), slot))
                .filter(|&(asked, _)| asked != self.request)
                .collect();
            idle.sort_unstable();
            targets.extend(idle.iter().take(missing.len() - free).map(|&(_, slot)| slot));
        }
        self.block_in.resize(self.block_in.len() + free, ABSENT);
        self.slots.resize(self.block_in.len() * self.slot_bytes(), 0);
        for (&block, &slot) in missing.iter().zip(&targets) {
            if let Some(old) = self.slot_of.get_mut(self.block_in[slot] as usize) {
                *old = ABSENT;
            }
            self.read(block, slot)?;
            self.slot_of[block as usize] = u32::try_from(slot).expect("no more slots than blocks");
            self.block_in[slot] = block;
            self.loads += 1;
        }
        Ok(())
    }

    fn read(&mut self, block: u32, slot: usize) -> Result<()> {
        let io = |e| Error::io(&self.path, e);
        let (block_bytes, start) = (self.block_bytes(), slot * self.slot_bytes());
        let at = u64::from(block) * block_bytes as u64;
        self.file.seek(SeekFrom::Start(at)).map_err(io)?;
        let target = &mut self.slots[start..start + block_bytes];
        // The last block may be short.
        let mut read = 0;
        while read < block_bytes {
            match self.file.read(&mut target[read..]).map_err(io)? {
                0 => break,
                more => read += more,
            }
        }
        Ok(())
    }

    /// Whether blocks are read again and again: the file's faces do not lie near their neighbours.
    fn is_thrashing(&self) -> bool {
        self.loads > THRASHING * self.slot_of.len() as u64
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point(k: i64) -> Option<LatticePoint> {
        (k % 7 != 3).then_some([k, -k * 1000, k - 500])
    }

    fn vertices(count: i64, path: Option<PathBuf>, budget_bytes: usize) -> Vertices {
        let mut writer = VertexWriter::new(path).unwrap();
        for k in 0..count {
            writer.write(&pack(point(k))).unwrap();
        }
        writer.finish(16, budget_bytes).unwrap()
    }

    proptest! {
        #[test]
        fn a_vertex_unpacks_to_itself(
            p in prop::array::uniform3(2 - COORDINATE_LIMIT..=COORDINATE_LIMIT - 2),
        ) {
            let mut bytes = vec![0xab; 3];
            bytes.extend(pack(Some(p)));
            bytes.extend(pack(None));
            bytes.push(0xab);
            prop_assert_eq!(unpack(&bytes, 3), Some(p));
            prop_assert_eq!(unpack(&bytes, 18), None);
        }
    }

    #[test]
    fn vertices_on_disk_are_those_in_memory_however_few_blocks_are_held() {
        let dir = tempfile::tempdir().unwrap();
        let held = vertices(1000, None, 0);
        for (k, budget_bytes) in [0, 1500, 1 << 20].into_iter().enumerate() {
            let mut on_disk = vertices(1000, Some(dir.path().join(k.to_string())), budget_bytes);
            let triangles: Vec<[u32; 3]> =
                (0..500).map(|t| [t, (t * 7919) % 1000, (t * 104_729 + 3) % 1000]).collect();
            let mut rest = &triangles[..];
            while !rest.is_empty() {
                let count = on_disk.hold(rest).unwrap();
                let Vertices::OnDisk(blocks) = &on_disk else { panic!("in memory") };
                assert!(count > 0 && blocks.block_in.len() <= blocks.capacity);
                for (k, c) in (0..count).flat_map(|k| [(k, 0), (k, 1), (k, 2)]) {
                    assert_eq!(on_disk.corner(rest, k, c), held.corner(rest, k, c));
                    assert_eq!(on_disk.corner(rest, k, c), point(i64::from(rest[k][c])));
                }
                rest = &rest[count..];
            }
            let Vertices::OnDisk(blocks) = &on_disk else { panic!("in memory") };
            assert_eq!(blocks.is_thrashing(), budget_bytes < 2000, "{} loads", blocks.loads);
        }
    }
}
