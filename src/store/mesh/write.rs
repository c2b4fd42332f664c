//! Writing a store's file.
//!
//! In: encoded partitions in curve order. Out: the file, under its final name only when all of it is on disk.
//! Memory: one entry of the tree a run of [`FAN_OUT`] partitions; the partition table waits in a file of its own.

use std::fs::File;
use std::io::{BufReader, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::key::MeshKey;
use super::lattice::Lattice;
use super::layout::{
    ENTRY_BYTES, Entry, FAN_OUT, HEADER_BYTES, Header, MeshCounts, NODE_BYTES, Node,
};
use super::partition::Encoded;
use crate::{Error, Result};

/// Bytes gathered before a write.
const BUFFER_BYTES: usize = 1 << 18;

/// A store being written, under a temporary name.
#[derive(Debug)]
pub(super) struct StoreWriter {
    path: PathBuf,
    file: BufWriter<File>,
    table_path: PathBuf,
    table: BufWriter<File>,
    table_crc: crc32fast::Hasher,
    /// Bounds of runs of partitions: the lowest level of the tree.
    runs: Vec<Node>,
    partitions: usize,
    triangles: u64,
    end: u64,
}

impl StoreWriter {
    /// Starts a store in `folder`, which holds nothing else that matters.
    pub(super) fn new(folder: &Path) -> Result<Self> {
        let (path, table_path) = (folder.join("store"), folder.join("table"));
        let create = |path: &Path| {
            let file = File::options().read(true).write(true).create_new(true).open(path);
            file.map(|f| BufWriter::with_capacity(BUFFER_BYTES, f)).map_err(|e| Error::io(path, e))
        };
        let (mut file, table) = (create(&path)?, create(&table_path)?);
        file.write_all(&[0; HEADER_BYTES]).map_err(|e| Error::io(&path, e))?;
        Ok(Self {
            path,
            file,
            table_path,
            table,
            table_crc: crc32fast::Hasher::new(),
            runs: Vec::new(),
            partitions: 0,
            triangles: 0,
            end: HEADER_BYTES as u64,
        })
    }

    /// Appends a partition.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Limit`] beyond 2³² − 1 partitions.
    pub(super) fn add(&mut self, partition: &Encoded) -> Result<()> {
        let entry = Entry { offset: self.end, ..partition.entry };
        let bytes = entry.encode();
        self.file.write_all(&partition.payload).map_err(|e| Error::io(&self.path, e))?;
        self.table.write_all(&bytes).map_err(|e| Error::io(&self.table_path, e))?;
        self.table_crc.update(&bytes);
        if self.partitions.is_multiple_of(FAN_OUT) {
            self.runs.push(Node::EMPTY);
        }
        let run = self.runs.last_mut().expect("the run of this partition has been begun");
        *run = run.union(entry.node());
        self.partitions += 1;
        self.triangles += u64::from(entry.triangles);
        self.end += u64::from(entry.bytes);
        if self.partitions > u32::MAX as usize {
            let (what, limit) = ("number of partitions".to_owned(), u64::from(u32::MAX));
            return Err(Error::Limit { what, limit, found: limit + 1 });
        }
        Ok(())
    }

    /// Appends the tables, writes the header, and renames the file to `path` once all is on disk.
    pub(super) fn finish(
        mut self,
        path: &Path,
        key: MeshKey,
        lattice: Lattice,
        counts: MeshCounts,
    ) -> Result<()> {
        self.append_table().map_err(|e| Error::io(&self.path, e))?;
        debug_assert_eq!(counts.triangles, self.triangles, "every triangle scattered is written");
        let bounds = self.runs.iter().fold(Node::EMPTY, |all, &run| all.union(run));
        let tree = tree_bytes(&self.runs, self.partitions);
        let table_offset = usize::try_from(self.end).expect("64 bits");
        let tables = self.partitions * ENTRY_BYTES + tree.len();
        let header = Header {
            file_bytes: self.end + tables as u64,
            key,
            lattice,
            bounds,
            counts,
            partitions: self.partitions,
            table_offset,
            table_crc: self.table_crc.clone().finalize(),
            tree_crc: crc32fast::hash(&tree),
        };
        self.seal(&tree, &header).map_err(|e| Error::io(&self.path, e))?;
        std::fs::rename(&self.path, path).map_err(|e| Error::io(path, e))?;
        sync_folder(path)
    }

    fn append_table(&mut self) -> std::io::Result<()> {
        self.table.flush()?;
        let mut table = BufReader::new(self.table.get_ref());
        table.seek(SeekFrom::Start(0))?;
        std::io::copy(&mut table, &mut self.file)?;
        Ok(())
    }

    fn seal(&mut self, tree: &[u8], header: &Header) -> std::io::Result<()> {
        self.file.write_all(tree)?;
        self.file.flush()?;
        let mut file = self.file.get_ref();
        file.seek(SeekFrom::Start(0))?;
        file.write_all(&header.encode())?;
        file.sync_all()
    }
}

/// The tree's bytes, from its lowest level; none if there are [`FAN_OUT`] partitions or fewer.
fn tree_bytes(runs: &[Node], partitions: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (mut level, mut below) = (runs.to_vec(), partitions);
    while below > FAN_OUT {
        bytes.reserve(level.len() * NODE_BYTES);
        for node in &level {
            bytes.extend_from_slice(&node.encode());
        }
        below = level.len();
        level = level
            .chunks(FAN_OUT)
            .map(|run| run.iter().fold(Node::EMPTY, |all, &node| all.union(node)))
            .collect();
    }
    bytes
}

/// Makes a rename last through a power cut, where the system lets a folder be synced.
fn sync_folder(path: &Path) -> Result<()> {
    let Some(folder) = path.parent().filter(|folder| cfg!(unix) && !folder.as_os_str().is_empty())
    else {
        return Ok(());
    };
    File::open(folder).and_then(|f| f.sync_all()).map_err(|e| Error::io(folder, e))
}
