//! [`PartWriter`]: appends finished tiles to a part file.

use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::PartReader;
use super::part::{Entry, RECORD_BYTES, header, trailer};
use crate::output::{TileKey, lock};
use crate::{Error, Result};

/// A finished tile is on the disk after this time, even if the power fails.
const SYNC_AFTER: Duration = Duration::from_secs(1);

/// Appends tiles to a part file; what was appended survives a killed process, and a power cut after a second.
///
/// Memory: 32 bytes a tile for the index.
#[derive(Debug)]
pub struct PartWriter {
    path: PathBuf,
    file: File,
    entries: Vec<Entry>,
    end: u64,
    synced: Instant,
    record: Vec<u8>,
}

impl PartWriter {
    /// Begins a part of the job with this fingerprint; what was under this name before is lost. `held` is the file if
    /// this process has locked it already.
    ///
    /// # Errors
    /// If the file cannot be written or another process is writing it.
    pub fn create(path: &Path, held: Option<&File>, fingerprint: u128) -> Result<Self> {
        let mut writer = Self::open(path, held)?;
        let head = header(fingerprint);
        writer.cut(0)?;
        writer.write(&head)?;
        Ok(writer)
    }

    /// Goes on with a part: what follows its last whole record is cut off. `held` as for [`Self::create`].
    ///
    /// # Errors
    /// If the file cannot be written or another process is writing it.
    pub fn resume(part: &PartReader, held: Option<&File>) -> Result<Self> {
        let mut writer = Self::open(part.path(), held)?;
        // If it was not held, then between the look at it and the lock another process may have gone on with it.
        let found = writer.file.metadata().map_err(|e| Error::io(part.path(), e))?.len();
        if found != part.file_bytes() {
            let busy = std::io::Error::new(
                std::io::ErrorKind::ResourceBusy,
                "another process has just written this file",
            );
            return Err(Error::io(part.path(), busy));
        }
        writer.entries = part.entries().to_vec();
        writer.cut(part.records_end())?;
        Ok(writer)
    }

    fn open(path: &Path, held: Option<&File>) -> Result<Self> {
        let own = || {
            let file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
            lock(&file).map(|()| file)
        };
        let file = held.map_or_else(own, File::try_clone).map_err(|e| Error::io(path, e))?;
        Ok(Self {
            path: path.to_path_buf(),
            file,
            entries: Vec::new(),
            end: 0,
            synced: Instant::now(),
            record: Vec::new(),
        })
    }

    fn cut(&mut self, end: u64) -> Result<()> {
        self.end = end;
        self.file
            .set_len(end)
            .and_then(|()| self.file.seek(SeekFrom::Start(end)).map(|_| ()))
            .map_err(|e| Error::io(&self.path, e))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|e| Error::io(&self.path, e))?;
        self.end += bytes.len() as u64;
        Ok(())
    }

    /// Appends a tile of layer `layer` (its place in the manifest).
    ///
    /// # Errors
    /// If the disk refuses, or the tile is 4 GiB long.
    pub fn append(&mut self, layer: usize, tile: TileKey, bytes: &[u8]) -> Result<()> {
        let length = u32::try_from(bytes.len()).ok().ok_or_else(|| Error::Limit {
            what: format!("{tile}, compressed"),
            limit: u32::MAX.into(),
            found: bytes.len() as u64,
        })?;
        let entry = Entry::new(layer, tile, length, self.end);
        // One write a record: nothing waits in memory, so that a killed process loses no finished tile.
        let mut record = std::mem::take(&mut self.record);
        record.clear();
        record.reserve(RECORD_BYTES + bytes.len());
        record.extend(entry.record_header(bytes));
        record.extend(bytes);
        let result = self.write(&record);
        self.record = record;
        result?;
        self.entries.push(entry);
        if self.synced.elapsed() > SYNC_AFTER {
            self.sync()?;
        }
        Ok(())
    }

    fn sync(&mut self) -> Result<()> {
        self.synced = Instant::now();
        self.file.sync_data().map_err(|e| Error::io(&self.path, e))
    }

    /// Waits until all is on the disk, without an index: the part can be resumed.
    ///
    /// # Errors
    /// If the disk refuses.
    pub fn suspend(mut self) -> Result<()> {
        self.sync()
    }

    /// Writes the index and waits until all is on the disk.
    ///
    /// # Errors
    /// If the disk refuses.
    pub fn finish(mut self) -> Result<()> {
        // The records first: an index never speaks of one that is not there.
        self.sync()?;
        self.entries.sort_unstable();
        let index: Vec<u8> = self.entries.iter().flat_map(|e| e.to_index()).collect();
        let tail = trailer(&index, self.end);
        self.write(&index)?;
        self.write(&tail)?;
        self.sync()
    }
}
