//! [`PartReader`]: finds and reads the tiles of a part file, finished or not.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::Manifest;
use super::part::{
    END_MAGIC, ENTRY_BYTES, Entry, HEADER_BYTES, MAGIC, RECORD_BYTES, TRAILER_BYTES, VERSION,
    header, trailer, u32_at, u64_at,
};
use crate::{Error, Result};

/// Bytes read at a time when a part is scanned.
const BUFFER: usize = 1 << 18;

/// A part file and the index of its tiles.
///
/// Memory: 32 bytes a tile. Tiles may be read by several threads, one after the other. The file is open from the first tile
/// that is read until it is closed: a job may have more parts than a process may have open files.
#[derive(Debug)]
pub struct PartReader {
    path: PathBuf,
    file: Mutex<Option<File>>,
    entries: Vec<Entry>,
    records_end: u64,
    file_bytes: u64,
    finished: bool,
}

/// What stands under the name of a part.
#[derive(Debug)]
pub enum PartState {
    /// Nothing, or a part that was cut within its header.
    Missing,
    /// A part of another job, or of another version of this program.
    Foreign,
    /// A part of this job.
    Own(PartReader),
}

impl PartState {
    /// Looks at what stands under the name of a part of a job.
    ///
    /// # Errors
    /// If it cannot be read, is no part file at all, or holds tiles that the job has not.
    pub fn of(path: &Path, manifest: &Manifest) -> Result<Self> {
        let mut file = match File::open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Self::Missing),
            Err(e) => return Err(Error::io(path, e)),
        };
        let len = file.metadata().map_err(|e| Error::io(path, e))?.len();
        if len < HEADER_BYTES as u64 {
            return Ok(Self::Missing);
        }
        let mut head = [0; HEADER_BYTES];
        file.read_exact(&mut head).map_err(|e| Error::io(path, e))?;
        if &head[..8] != MAGIC {
            // A power cut may leave a part of zeros; anything else is not ours to overwrite.
            if head == [0; HEADER_BYTES] {
                return Ok(Self::Missing);
            }
            let found = format!("{:?}", String::from_utf8_lossy(&head[..8]));
            return Err(Error::corrupt(path, "byte 0", "a part file", found));
        }
        if u32_at(&head, 8) != VERSION || head != header(manifest.fingerprint()) {
            return Ok(Self::Foreign);
        }
        let index = read_index(&mut file, len).map_err(|e| Error::io(path, e))?;
        let finished = index.is_some();
        let (entries, records_end) = match index {
            Some(found) => found,
            None => scan(&mut file, len).map_err(|e| Error::io(path, e))?,
        };
        let pyramid = manifest.pyramid();
        if let Some(e) = entries.iter().find(|e| !e.is_of(&pyramid, manifest.layers().len())) {
            let place = format!("byte {}", e.offset);
            let found = format!("{}, layer {}", e.tile(), e.layer);
            return Err(Error::corrupt(path, place, "a tile of this job", found));
        }
        let path = path.to_path_buf();
        let file = Mutex::new(None);
        let file_bytes = len;
        Ok(Self::Own(PartReader { path, file, entries, records_end, file_bytes, finished }))
    }
}

impl PartReader {
    /// Opens a part of a job.
    ///
    /// # Errors
    /// As [`PartState::of`]; and if it is missing or of another job.
    pub fn open(path: &Path, manifest: &Manifest) -> Result<Self> {
        match PartState::of(path, manifest)? {
            PartState::Own(part) => Ok(part),
            PartState::Missing => {
                Err(Error::corrupt(path, "byte 0", "a part of this job", "nothing"))
            }
            PartState::Foreign => {
                Err(Error::corrupt(path, "byte 8", "a part of this job", "a part of another one"))
            }
        }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the part has an index: its run came to its end.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    /// Number of tiles, each layer counted.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is no tile.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub(super) fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Offset behind the last whole record.
    pub(super) fn records_end(&self) -> u64 {
        self.records_end
    }

    /// Length of the file when it was looked at.
    pub(super) fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Closes the file until the next tile is read.
    pub(super) fn close(&self) {
        *self.file.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Reads a tile into `bytes`, replacing what they held.
    ///
    /// # Errors
    /// If the file cannot be read, or is not what the index says.
    pub(super) fn read(&self, entry: &Entry, bytes: &mut Vec<u8>) -> Result<()> {
        let mut head = [0; RECORD_BYTES];
        // The length was checked against the file's.
        bytes.resize(entry.length as usize, 0);
        {
            let mut open = self.file.lock().unwrap_or_else(PoisonError::into_inner);
            let file = match &mut *open {
                Some(file) => file,
                none => none.insert(File::open(&self.path).map_err(|e| Error::io(&self.path, e))?),
            };
            file.seek(SeekFrom::Start(entry.offset))
                .and_then(|_| file.read_exact(&mut head))
                .and_then(|()| file.read_exact(bytes))
                .map_err(|e| Error::io(&self.path, e))?;
        }
        if head == entry.record_header(bytes) {
            return Ok(());
        }
        let place = format!("byte {}, {}", entry.offset, entry.tile());
        Err(Error::corrupt(&self.path, place, "a record as indexed", "another or a damaged one"))
    }
}

/// The index of a finished part and the end of its records; none if it is missing or damaged.
fn read_index(file: &mut File, len: u64) -> std::io::Result<Option<(Vec<Entry>, u64)>> {
    let least = (HEADER_BYTES + TRAILER_BYTES) as u64;
    if len < least {
        return Ok(None);
    }
    let mut tail = [0; TRAILER_BYTES];
    file.seek(SeekFrom::Start(len - TRAILER_BYTES as u64))?;
    file.read_exact(&mut tail)?;
    let (offset, count) = (u64_at(&tail, 0), u64_at(&tail, 8));
    let bytes = count.checked_mul(ENTRY_BYTES as u64);
    let fits = bytes.is_some_and(|n| offset.checked_add(n) == Some(len - TRAILER_BYTES as u64));
    if &tail[24..] != END_MAGIC || !fits || offset < HEADER_BYTES as u64 {
        return Ok(None);
    }
    let mut index = Vec::new();
    file.seek(SeekFrom::Start(offset))?;
    file.by_ref().take(bytes.unwrap_or(0)).read_to_end(&mut index)?;
    if trailer(&index, offset) != tail {
        return Ok(None);
    }
    let entries: Vec<Entry> =
        index.as_chunks::<ENTRY_BYTES>().0.iter().map(Entry::from_index).collect();
    let inside = |e: &Entry| {
        e.offset
            .checked_add(RECORD_BYTES as u64 + u64::from(e.length))
            .is_some_and(|end| end <= offset)
    };
    let sound = entries.is_sorted() && entries.iter().all(inside);
    Ok(sound.then_some((entries, offset)))
}

/// The whole records from the start of the file to the first that is not, sorted; and where they end.
fn scan(file: &mut File, len: u64) -> std::io::Result<(Vec<Entry>, u64)> {
    let mut entries = Vec::new();
    let mut at = HEADER_BYTES as u64;
    file.seek(SeekFrom::Start(at))?;
    let mut reader = BufReader::with_capacity(BUFFER, file);
    let mut header = [0; RECORD_BYTES];
    while at + RECORD_BYTES as u64 <= len {
        reader.read_exact(&mut header)?;
        let Some((entry, crc)) = Entry::from_record(&header, at) else { break };
        let end = at + RECORD_BYTES as u64 + u64::from(entry.length);
        if end > len || record_crc(&header, &mut reader, entry.length)? != crc {
            break;
        }
        entries.push(entry);
        at = end;
    }
    entries.sort_unstable();
    Ok((entries, at))
}

/// The CRC that a record with this header and the next `length` bytes should state.
fn record_crc(
    header: &[u8; RECORD_BYTES],
    reader: &mut impl Read,
    length: u32,
) -> std::io::Result<u32> {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&header[4..20]);
    let mut left = length as usize;
    let mut buffer = [0; 4096];
    while left > 0 {
        let n = left.min(buffer.len());
        reader.read_exact(&mut buffer[..n])?;
        crc.update(&buffer[..n]);
        left -= n;
    }
    Ok(crc.finalize())
}
