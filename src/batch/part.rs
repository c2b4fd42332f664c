//! The layout of a part file, as constants and records.
//!
//! All little-endian. A header; then records, each a tile of a layer, appended as they are made; then, once the part
//! is finished, an index and a trailer. A part without a trailer is unfinished: its records count up to the first
//! that is not whole.
//!
//! | what | bytes |
//! |---|---|
//! | header | magic `GRNDPART` 8, version u32, zero u32, fingerprint of the job u128 |
//! | record | magic `TILE` 4, layer u16, level u16, tile x u32, tile y u32, length u32, CRC-32 u32, then `length` bytes |
//! | index entry | layer u16, level u16, tile x u32, tile y u32, length u32, offset of the record u64 |
//! | trailer | offset of the index u64, number of entries u64, CRC-32 u32, zero u32, magic `GRNDPEND` 8 |
//!
//! What was found on a tile of level 0, its note, is a record of its own, whose layer is the number of layers.
//!
//! A record's CRC is over its header from `layer` to `length` and its bytes; the trailer's over the entries and the
//! trailer's first 16 bytes. Index entries are in the order level, y, x, layer.

use std::collections::BTreeSet;

use crate::output::{Pyramid, TileKey};

pub(super) const MAGIC: &[u8; 8] = b"GRNDPART";
pub(super) const VERSION: u32 = 2;
pub(super) const HEADER_BYTES: usize = 32;
pub(super) const RECORD_MAGIC: &[u8; 4] = b"TILE";
pub(super) const RECORD_BYTES: usize = 24;
pub(super) const ENTRY_BYTES: usize = 24;
pub(super) const END_MAGIC: &[u8; 8] = b"GRNDPEND";
pub(super) const TRAILER_BYTES: usize = 32;

/// Where a tile of a layer stands in a part. Ordered by level, y, x, layer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Entry {
    pub(super) level: u16,
    pub(super) y: u32,
    pub(super) x: u32,
    pub(super) layer: u16,
    /// Bytes of the tile.
    pub(super) length: u32,
    /// Offset of the record in the file.
    pub(super) offset: u64,
}

impl Entry {
    /// The entry of a record.
    ///
    /// Levels are at most 32 and layers at most 7 a section; greater ones, from a damaged file, fit no pyramid anyway.
    pub(super) fn new(layer: usize, tile: TileKey, length: u32, offset: u64) -> Self {
        let level = u16::try_from(tile.level).unwrap_or(u16::MAX);
        let layer = u16::try_from(layer).unwrap_or(u16::MAX);
        Self { level, y: tile.y, x: tile.x, layer, length, offset }
    }

    pub(super) fn tile(&self) -> TileKey {
        TileKey::new(self.level.into(), self.x, self.y)
    }

    /// Whether a job has such a tile; `layers` is the number that its notes bear in place of a layer's.
    pub(super) fn is_of(&self, pyramid: &Pyramid, layers: usize) -> bool {
        let layer = usize::from(self.layer);
        (layer < layers || layer == layers && self.level == 0) && pyramid.contains(self.tile())
    }

    /// Header of the record, with the CRC of it and of `bytes`.
    pub(super) fn record_header(&self, bytes: &[u8]) -> [u8; RECORD_BYTES] {
        let mut header = [0; RECORD_BYTES];
        header[..4].copy_from_slice(RECORD_MAGIC);
        header[4..20].copy_from_slice(&self.fields());
        let mut crc = crc32fast::Hasher::new();
        crc.update(&header[4..20]);
        crc.update(bytes);
        header[20..].copy_from_slice(&crc.finalize().to_le_bytes());
        header
    }

    /// The entry of the record with this header at `offset`, and the CRC it states; none if it is no such header.
    pub(super) fn from_record(header: &[u8; RECORD_BYTES], offset: u64) -> Option<(Self, u32)> {
        if &header[..4] != RECORD_MAGIC {
            return None;
        }
        Some((Self::from_fields(&header[4..20], offset), u32_at(header, 20)))
    }

    /// The entry as it stands in the index.
    pub(super) fn to_index(self) -> [u8; ENTRY_BYTES] {
        let mut bytes = [0; ENTRY_BYTES];
        bytes[..16].copy_from_slice(&self.fields());
        bytes[16..].copy_from_slice(&self.offset.to_le_bytes());
        bytes
    }

    pub(super) fn from_index(bytes: &[u8; ENTRY_BYTES]) -> Self {
        Self::from_fields(&bytes[..16], u64_at(bytes, 16))
    }

    fn fields(&self) -> [u8; 16] {
        let mut bytes = [0; 16];
        bytes[..2].copy_from_slice(&self.layer.to_le_bytes());
        bytes[2..4].copy_from_slice(&self.level.to_le_bytes());
        bytes[4..8].copy_from_slice(&self.x.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.y.to_le_bytes());
        bytes[12..].copy_from_slice(&self.length.to_le_bytes());
        bytes
    }

    fn from_fields(bytes: &[u8], offset: u64) -> Self {
        Self {
            layer: u16::from_le_bytes([bytes[0], bytes[1]]),
            level: u16::from_le_bytes([bytes[2], bytes[3]]),
            x: u32_at(bytes, 4),
            y: u32_at(bytes, 8),
            length: u32_at(bytes, 12),
            offset,
        }
    }
}

/// Header of a part of the job with this fingerprint.
pub(super) fn header(fingerprint: u128) -> [u8; HEADER_BYTES] {
    let mut bytes = [0; HEADER_BYTES];
    bytes[..8].copy_from_slice(MAGIC);
    bytes[8..12].copy_from_slice(&VERSION.to_le_bytes());
    bytes[16..].copy_from_slice(&fingerprint.to_le_bytes());
    bytes
}

/// Trailer of a part whose index, with these bytes, stands at `offset`.
pub(super) fn trailer(index: &[u8], offset: u64) -> [u8; TRAILER_BYTES] {
    let mut bytes = [0; TRAILER_BYTES];
    bytes[..8].copy_from_slice(&offset.to_le_bytes());
    bytes[8..16].copy_from_slice(&((index.len() / ENTRY_BYTES) as u64).to_le_bytes());
    let mut crc = crc32fast::Hasher::new();
    crc.update(index);
    crc.update(&bytes[..16]);
    bytes[16..20].copy_from_slice(&crc.finalize().to_le_bytes());
    bytes[24..].copy_from_slice(END_MAGIC);
    bytes
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

pub(super) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}

/// Names the first ten of some tiles, and how many more there are.
pub(super) fn name_tiles(tiles: &BTreeSet<TileKey>) -> String {
    const NAMED: usize = 10;
    let names: Vec<String> =
        tiles.iter().take(NAMED).map(|t| format!("({}, {})", t.x, t.y)).collect();
    let more = tiles.len().saturating_sub(NAMED);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{rest}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_layout_is_the_documented_one() {
        let entry = Entry::new(2, TileKey::new(1, 0x0403, 5), 3, 0x20);
        let record = entry.record_header(b"abc");
        let fields = [2, 0, 1, 0, 3, 4, 0, 0, 5, 0, 0, 0, 3, 0, 0, 0];
        assert_eq!(&record[..4], b"TILE");
        assert_eq!(record[4..20], fields);
        let crc = crc32fast::hash(&[&fields[..], b"abc"].concat());
        assert_eq!(record[20..], crc.to_le_bytes());
        assert_eq!(entry.to_index(), [&fields[..], &[0x20, 0, 0, 0, 0, 0, 0, 0]].concat()[..]);
        assert_eq!(Entry::from_record(&record, 0x20), Some((entry, crc)));
        assert_eq!(Entry::from_index(&entry.to_index()), entry);
        let head = header(7);
        assert_eq!(&head[..17], b"GRNDPART\x02\0\0\0\0\0\0\0\x07");
        let tail = trailer(&entry.to_index(), 0x100);
        assert_eq!(tail[..16], [0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(&tail[24..], b"GRNDPEND");
    }
}
