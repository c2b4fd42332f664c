//! Layout of an index file; see the module page.

use std::path::Path;

use super::scan::{COMPONENTS, Checkpoint, STEP};
use crate::geom::Size;
use crate::{Error, Result};

/// First bytes of an index file.
pub(super) const MAGIC: [u8; 8] = *b"GRNDJIDX";
/// To be raised with every change of the layout, of what is accepted, or of the decoder's samples.
pub(super) const VERSION: u32 = 1;
/// Length of the header.
pub(super) const HEADER_BYTES: usize = 112;
/// Bytes of a checksum.
pub(super) const CRC_BYTES: usize = 4;
/// Most bytes of the kept segments.
const MAX_KEPT_BYTES: u32 = 1 << 16;

/// An index file's header that has been checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) size: Size,
    pub(super) channels: usize,
    /// Width and height of a unit, pixels.
    pub(super) mcu: Size,
    pub(super) kept_bytes: u32,
    pub(super) kept_crc: u32,
    pub(super) fingerprint: u128,
    /// Where the entropy-coded data lie in the photo.
    pub(super) data_at: u64,
    pub(super) data_bytes: u64,
    /// The photo's length and time of modification, nanoseconds since 1970.
    pub(super) photo_bytes: u64,
    pub(super) modified: u128,
}

impl Header {
    /// Columns and rows of units.
    pub(super) fn mcus(&self) -> Size {
        Size::new(
            self.size.width.div_ceil(self.mcu.width),
            self.size.height.div_ceil(self.mcu.height),
        )
    }

    /// Checkpoints of a row.
    pub(super) fn columns(&self) -> usize {
        self.mcus().width.div_ceil(STEP) as usize
    }

    /// Bytes of a checkpoint.
    pub(super) fn checkpoint_bytes(&self) -> usize {
        5 + 2 * self.channels
    }

    /// Bytes of a row of checkpoints with its checksum.
    pub(super) fn row_bytes(&self) -> usize {
        self.columns() * self.checkpoint_bytes() + CRC_BYTES
    }

    /// Offset of a row.
    pub(super) fn row_offset(&self, row: u32) -> u64 {
        HEADER_BYTES as u64 + u64::from(self.kept_bytes) + u64::from(row) * self.row_bytes() as u64
    }

    /// Length of the file.
    pub(super) fn file_bytes(&self) -> u64 {
        self.row_offset(self.mcus().height)
    }

    /// The header as it stands in the file.
    pub(super) fn to_bytes(self) -> [u8; HEADER_BYTES] {
        let small = |v: u32| u8::try_from(v).unwrap_or(u8::MAX);
        let mut bytes = [0; HEADER_BYTES];
        let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
        put(0, &MAGIC);
        put(8, &VERSION.to_le_bytes());
        put(12, &STEP.to_le_bytes());
        put(16, &self.size.width.to_le_bytes());
        put(20, &self.size.height.to_le_bytes());
        let channels = u32::try_from(self.channels).unwrap_or(u32::MAX);
        put(24, &[small(channels), small(self.mcu.width), small(self.mcu.height), 0]);
        put(28, &self.kept_bytes.to_le_bytes());
        put(32, &self.fingerprint.to_le_bytes());
        put(48, &self.file_bytes().to_le_bytes());
        put(56, &self.data_at.to_le_bytes());
        put(64, &self.data_bytes.to_le_bytes());
        put(72, &self.photo_bytes.to_le_bytes());
        put(80, &self.modified.to_le_bytes());
        put(96, &self.kept_crc.to_le_bytes());
        let crc = crc32fast::hash(&bytes[..108]);
        bytes[108..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Checks the bytes of a header against each other and against the length of the file.
    pub(super) fn check(bytes: &[u8; HEADER_BYTES], path: &Path, file_bytes: u64) -> Result<Self> {
        let bad = |place: &str, expected: String, found: String| {
            Err(Error::corrupt(path, place, expected, found))
        };
        let word = |at| u32::from_le_bytes(array(bytes, at));
        let long = |at| u64::from_le_bytes(array(bytes, at));
        if bytes[..8] != MAGIC {
            return bad("byte 0", "a JPEG's index".into(), "something else".into());
        }
        if word(8) != VERSION {
            return bad("byte 8", format!("version {VERSION}"), word(8).to_string());
        }
        if word(108) != crc32fast::hash(&bytes[..108]) {
            return bad("byte 108", "the checksum of the header".into(), "another one".into());
        }
        let header = Self {
            size: Size::new(word(16), word(20)),
            channels: bytes[24].into(),
            mcu: Size::new(bytes[25].into(), bytes[26].into()),
            kept_bytes: word(28),
            kept_crc: word(96),
            fingerprint: u128::from_le_bytes(array(bytes, 32)),
            data_at: long(56),
            data_bytes: long(64),
            photo_bytes: long(72),
            modified: u128::from_le_bytes(array(bytes, 80)),
        };
        let is_side = |side: u32| side > 0 && side <= u16::MAX.into();
        let is_unit = |side: u32| matches!(side, 8 | 16 | 24 | 32);
        let is_whole = word(12) == STEP
            && is_side(header.size.width)
            && is_side(header.size.height)
            && matches!(header.channels, 1 | COMPONENTS)
            && is_unit(header.mcu.width)
            && is_unit(header.mcu.height)
            && header.kept_bytes <= MAX_KEPT_BYTES
            && header
                .data_at
                .checked_add(header.data_bytes)
                .is_some_and(|e| e <= header.photo_bytes);
        if !is_whole {
            return bad("byte 12", "the index of a JPEG".into(), "a contradiction".into());
        }
        if long(48) != file_bytes || header.file_bytes() != file_bytes {
            let expected = format!("{} bytes", header.file_bytes());
            return bad("length", expected, file_bytes.to_string());
        }
        Ok(header)
    }

    /// Appends a row of checkpoints with its checksum.
    pub(super) fn write_row(&self, row: u32, checkpoints: &[Checkpoint], out: &mut Vec<u8>) {
        let begin = out.len();
        for checkpoint in checkpoints {
            out.extend(checkpoint.byte.to_le_bytes());
            out.push(checkpoint.bit);
            checkpoint.dc[..self.channels].iter().for_each(|dc| out.extend(dc.to_le_bytes()));
        }
        let crc = row_crc(row, &out[begin..]);
        out.extend(crc.to_le_bytes());
    }

    /// The checkpoints of a row, if its checksum is right: they can be had by [`Self::checkpoint`].
    pub(super) fn checked_row(row: u32, bytes: &[u8]) -> Option<&[u8]> {
        let (checkpoints, crc) = bytes.split_last_chunk::<CRC_BYTES>()?;
        (row_crc(row, checkpoints) == u32::from_le_bytes(*crc)).then_some(checkpoints)
    }

    /// A checkpoint of a row.
    pub(super) fn checkpoint(&self, row: &[u8], column: usize) -> Option<Checkpoint> {
        let bytes = row.chunks_exact(self.checkpoint_bytes()).nth(column)?;
        let (byte, rest) = bytes.split_first_chunk::<4>()?;
        let (&bit, rest) = rest.split_first()?;
        let mut dc = [0; COMPONENTS];
        for (to, from) in dc.iter_mut().zip(rest.chunks_exact(2)) {
            *to = i16::from_le_bytes([from[0], from[1]]);
        }
        Some(Checkpoint { byte: u32::from_le_bytes(*byte), bit, dc })
    }
}

/// Checksum of a row; its number is in it, so that no row can pass for another.
fn row_crc(row: u32, bytes: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&row.to_le_bytes());
    crc.update(bytes);
    crc.finalize()
}

fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes[at..at + N].try_into().expect("a slice of N bytes")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        Header {
            size: Size::new(0x0202, 0x0304),
            channels: 3,
            mcu: Size::new(16, 8),
            kept_bytes: 300,
            kept_crc: 0xA1B2_C3D4,
            fingerprint: 0x1122_3344_5566_7788_99AA_BBCC_DDEE_FF00,
            data_at: 700,
            data_bytes: 9000,
            photo_bytes: 9702,
            modified: 1_790_000_000_123_456_789,
        }
    }

    #[test]
    fn the_header_lies_as_the_module_page_says() {
        let page = include_str!("mod.rs");
        let bytes = header().to_bytes();
        let check = |row: &str, from: usize, expected: &[u8]| {
            assert!(page.contains(row), "{row}");
            assert_eq!(&bytes[from..from + expected.len()], expected, "{row}");
        };
        check("| 0–7 | `GRNDJIDX` |", 0, b"GRNDJIDX");
        check("| 8–11 | version |", 8, &VERSION.to_le_bytes());
        check("| 12–15 | units between checkpoints, 32 |", 12, &32_u32.to_le_bytes());
        check("| 16–23 | width, height |", 16, &[2, 2, 0, 0, 4, 3, 0, 0]);
        check("| 24–27 | channels, width and height of a unit, 0 |", 24, &[3, 16, 8, 0]);
        check("| 28–31 | length of the segments |", 28, &300_u32.to_le_bytes());
        check("| 32–47 | fingerprint of the photo |", 32, &header().fingerprint.to_le_bytes());
        // 33 columns of units, 97 rows: 2 checkpoints of 11 bytes and a checksum each.
        let length = 112 + 300 + 97 * (2 * 11 + 4_u64);
        check("| 48–55 | length of the file |", 48, &length.to_le_bytes());
        check(
            "| 56–71 | offset and length of the photo's coded data |",
            56,
            &700_u64.to_le_bytes(),
        );
        check("| 72–79 | length of the photo |", 72, &9702_u64.to_le_bytes());
        check(
            "| 80–95 | its time of modification, ns since 1970 |",
            80,
            &header().modified.to_le_bytes(),
        );
        check("| 96–99 | CRC-32 of the segments |", 96, &[0xD4, 0xC3, 0xB2, 0xA1]);
        check(
            "| 108–111 | CRC-32 of bytes 0–107 |",
            108,
            &crc32fast::hash(&bytes[..108]).to_le_bytes(),
        );
        assert!(page.contains(&format!("File layout, version {VERSION}")));
        assert!(page.contains("The header, 112 bytes:") && HEADER_BYTES == 112);
    }

    #[test]
    fn a_header_reads_back_and_every_flipped_bit_is_found() {
        let bytes = header().to_bytes();
        let (path, length) = (Path::new("a.index"), header().file_bytes());
        assert_eq!(Header::check(&bytes, path, length).unwrap(), header());
        assert!(Header::check(&bytes, path, length + 1).is_err());
        for bit in 0..8 * HEADER_BYTES {
            let mut flipped = bytes;
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(Header::check(&flipped, path, length).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn a_row_reads_back_and_does_not_pass_for_another() {
        let header = header();
        let row = [
            Checkpoint { byte: 70_000, bit: 5, dc: [-1, 300, -2047] },
            Checkpoint { byte: 70_100, bit: 0, dc: [7, 8, 9] },
        ];
        let mut bytes = Vec::new();
        header.write_row(3, &row, &mut bytes);
        assert_eq!(bytes.len(), header.row_bytes());
        assert!(Header::checked_row(4, &bytes).is_none());
        let checked = Header::checked_row(3, &bytes).unwrap();
        assert_eq!([0, 1].map(|k| header.checkpoint(checked, k).unwrap()), row);
        assert!(header.checkpoint(checked, 2).is_none());
        bytes[6] ^= 1;
        assert!(Header::checked_row(3, &bytes).is_none());
    }
}
