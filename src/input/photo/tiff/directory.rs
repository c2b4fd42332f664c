//! [`Directory`]: the tags of a file's first page.

use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use crate::{Error, Result};

/// First bytes of TIFF and BigTIFF files of either byte order.
pub(in crate::input::photo) const SIGNATURES: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];
/// Most tags of a page; photos have some tens.
const MAX_TAGS: u64 = 4096;

/// A tag that is looked at: its number and its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::input::photo) struct Tag(pub(super) u16, pub(super) &'static str);

/// The tags that are looked at.
pub(in crate::input::photo) mod tag {
    use super::Tag;

    pub(in crate::input::photo) const WIDTH: Tag = Tag(256, "ImageWidth");
    pub(in crate::input::photo) const LENGTH: Tag = Tag(257, "ImageLength");
    pub(in crate::input::photo) const BITS: Tag = Tag(258, "BitsPerSample");
    pub(in crate::input::photo) const COMPRESSION: Tag = Tag(259, "Compression");
    pub(in crate::input::photo) const PHOTOMETRIC: Tag = Tag(262, "PhotometricInterpretation");
    pub(in crate::input::photo) const FILL_ORDER: Tag = Tag(266, "FillOrder");
    pub(in crate::input::photo) const STRIP_OFFSETS: Tag = Tag(273, "StripOffsets");
    pub(in crate::input::photo) const SAMPLES: Tag = Tag(277, "SamplesPerPixel");
    pub(in crate::input::photo) const ROWS_PER_STRIP: Tag = Tag(278, "RowsPerStrip");
    pub(in crate::input::photo) const STRIP_LENGTHS: Tag = Tag(279, "StripByteCounts");
    pub(in crate::input::photo) const PLANAR: Tag = Tag(284, "PlanarConfiguration");
    pub(in crate::input::photo) const PREDICTOR: Tag = Tag(317, "Predictor");
    pub(in crate::input::photo) const TILE_WIDTH: Tag = Tag(322, "TileWidth");
    pub(in crate::input::photo) const TILE_LENGTH: Tag = Tag(323, "TileLength");
    pub(in crate::input::photo) const TILE_OFFSETS: Tag = Tag(324, "TileOffsets");
    pub(in crate::input::photo) const TILE_LENGTHS: Tag = Tag(325, "TileByteCounts");
    pub(in crate::input::photo) const SAMPLE_FORMAT: Tag = Tag(339, "SampleFormat");
    pub(in crate::input::photo) const JPEG_TABLES: Tag = Tag(347, "JPEGTables");
    pub(in crate::input::photo) const ICC_PROFILE: Tag = Tag(34675, "ICCProfile");
    pub(in crate::input::photo) const DNG_VERSION: Tag = Tag(50706, "DNGVersion");
}

impl std::fmt::Display for Tag {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "tag {} ({})", self.0, self.1)
    }
}

/// Order of the bytes of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

impl Order {
    /// The number that up to eight bytes are.
    fn number(self, bytes: &[u8]) -> u64 {
        let push = |all: u64, byte: &u8| all << 8 | u64::from(*byte);
        match self {
            Self::Little => bytes.iter().rev().fold(0, push),
            Self::Big => bytes.iter().fold(0, push),
        }
    }
}

/// An entry: a tag's type, its number of values, and where they stand.
#[derive(Debug, Clone, Copy)]
struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    at: u64,
}

impl Entry {
    /// Bytes of a value, where the type is one of whole numbers or bytes.
    fn value_bytes(self) -> Option<u64> {
        match self.kind {
            1 | 2 | 6 | 7 => Some(1),
            3 => Some(2),
            4 | 13 => Some(4),
            16 | 18 => Some(8),
            _ => None,
        }
    }
}

/// The tags of the first page of a file, and the file to read their values from.
#[derive(Debug)]
pub(in crate::input::photo) struct Directory<'a, R> {
    reader: R,
    path: &'a Path,
    file_bytes: u64,
    pub(super) order: Order,
    entries: Vec<Entry>,
}

impl<'a, R: Read + Seek> Directory<'a, R> {
    /// Reads the first directory of a file of `file_bytes`.
    ///
    /// # Errors
    /// [`Error::Corrupt`], [`Error::Limit`] beyond 4096 tags, [`Error::Io`].
    pub(in crate::input::photo) fn read(
        reader: R,
        path: &'a Path,
        file_bytes: u64,
    ) -> Result<Self> {
        let mut directory =
            Self { reader, path, file_bytes, order: Order::Little, entries: Vec::new() };
        let head = directory.at(0, 8)?;
        if head[0] == b'M' {
            directory.order = Order::Big;
        }
        let order = directory.order;
        let is_big = order.number(&head[2..4]) == 43;
        let first = if is_big {
            if order.number(&head[4..8]) != if order == Order::Little { 8 } else { 8 << 16 } {
                return Err(Error::corrupt(path, "byte 4", "offsets of 8 bytes", "others"));
            }
            order.number(&directory.at(8, 8)?)
        } else {
            order.number(&head[4..8])
        };
        let (count_bytes, entry_bytes, value_bytes) = if is_big { (8, 20, 8) } else { (2, 12, 4) };
        let count = order.number(&directory.at(first, count_bytes)?);
        if count > MAX_TAGS {
            let what = format!("{}: tags of the first page", path.display());
            return Err(Error::Limit { what, limit: MAX_TAGS, found: count });
        }
        // `first` and `count` are known to be small enough.
        let start = first + count_bytes;
        let table = directory.at(start, count * entry_bytes)?;
        let entries = table.chunks_exact(if is_big { 20 } else { 12 }).zip(0..);
        for (entry, k) in entries {
            let (fixed, value) = entry.split_at(entry.len() - if is_big { 8 } else { 4 });
            let mut entry = Entry {
                tag: u16::try_from(order.number(&fixed[..2])).expect("two bytes"),
                kind: u16::try_from(order.number(&fixed[2..4])).expect("two bytes"),
                count: order.number(&fixed[4..]),
                at: start + k * entry_bytes + entry_bytes - value_bytes,
            };
            let bytes = entry.value_bytes().and_then(|n| n.checked_mul(entry.count));
            if bytes.is_none_or(|n| n > value_bytes) {
                entry.at = order.number(value);
            }
            directory.entries.push(entry);
        }
        Ok(directory)
    }

    /// Bytes `at` to `at + length` of the file.
    fn at(&mut self, at: u64, length: u64) -> Result<Vec<u8>> {
        let end = at.checked_add(length).filter(|&end| end <= self.file_bytes);
        let cut = || {
            let expected = format!("{length} bytes");
            let found = format!("the end of the file at {}", self.file_bytes);
            Error::corrupt(self.path, format!("byte {at}"), expected, found)
        };
        if end.is_none() {
            return Err(cut());
        }
        let length = usize::try_from(length).ok().ok_or_else(cut)?;
        let mut bytes = vec![0; length];
        self.reader
            .seek(SeekFrom::Start(at))
            .and_then(|_| self.reader.read_exact(&mut bytes))
            .map_err(|e| match e.kind() {
                ErrorKind::UnexpectedEof => cut(),
                _ => Error::io(self.path, e),
            })?;
        Ok(bytes)
    }

    /// Whether the page has a tag.
    pub(in crate::input::photo) fn has(&self, tag: Tag) -> bool {
        self.entries.iter().any(|e| e.tag == tag.0)
    }

    /// The whole numbers of a tag, at most `limit` of them; `None` without the tag.
    pub(in crate::input::photo) fn numbers(
        &mut self,
        tag: Tag,
        limit: u64,
    ) -> Result<Option<Vec<u64>>> {
        let Some(entry) = self.entries.iter().copied().find(|e| e.tag == tag.0) else {
            return Ok(None);
        };
        let size = match entry.value_bytes() {
            Some(size) if !matches!(entry.kind, 2 | 6 | 7) => size,
            _ => return Err(self.wrong(tag, "whole numbers", format!("type {}", entry.kind))),
        };
        self.check_count(tag, entry.count, limit)?;
        let bytes = self.at(entry.at, entry.count * size)?;
        let size = usize::try_from(size).expect("at most 8");
        Ok(Some(bytes.chunks_exact(size).map(|b| self.order.number(b)).collect()))
    }

    /// The one whole number of a tag; `default` without the tag.
    pub(in crate::input::photo) fn number(&mut self, tag: Tag, default: u64) -> Result<u64> {
        match self.numbers(tag, 16)?.as_deref() {
            None => Ok(default),
            Some([first, ..]) => Ok(*first),
            Some([]) => Err(self.wrong(tag, "a value", "none")),
        }
    }

    /// The whole number of a tag that a page must have.
    pub(in crate::input::photo) fn needed(&mut self, tag: Tag) -> Result<u64> {
        if self.has(tag) { self.number(tag, 0) } else { Err(self.wrong(tag, "the tag", "none")) }
    }

    /// Number of bytes of a tag; `None` without the tag.
    pub(in crate::input::photo) fn byte_count(&self, tag: Tag) -> Option<u64> {
        self.entries.iter().find(|e| e.tag == tag.0).map(|e| e.count)
    }

    /// The bytes of a tag, at most `limit`; `None` without the tag.
    pub(in crate::input::photo) fn bytes(
        &mut self,
        tag: Tag,
        limit: u64,
    ) -> Result<Option<Vec<u8>>> {
        let Some(entry) = self.entries.iter().copied().find(|e| e.tag == tag.0) else {
            return Ok(None);
        };
        if entry.value_bytes() != Some(1) {
            return Err(self.wrong(tag, "bytes", format!("type {}", entry.kind)));
        }
        self.check_count(tag, entry.count, limit)?;
        self.at(entry.at, entry.count).map(Some)
    }

    fn check_count(&self, tag: Tag, found: u64, limit: u64) -> Result<()> {
        if found <= limit {
            return Ok(());
        }
        let what = format!("{}: values of {tag}", self.path.display());
        Err(Error::Limit { what, limit, found })
    }

    /// A tag that does not hold what it should.
    pub(super) fn wrong(
        &self,
        tag: Tag,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Error {
        Error::corrupt(self.path, tag.to_string(), expected, found)
    }
}
