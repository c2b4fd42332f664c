//! Shape of a pyramid and layout of a store file; see the module page.

use std::path::Path;

use crate::geom::Size;
use crate::{Error, Result};

/// First bytes of a store file.
pub(super) const MAGIC: [u8; 8] = *b"GRNDPHOT";
/// To be raised with every change of the layout, the codec, the pyramid, or a decoder's samples.
pub(super) const VERSION: u32 = 1;
/// Side of a tile in pixels: a tile of RGB is 192 KiB decoded, some 80 KiB stored.
pub(super) const TILE_SIDE: u32 = 256;
/// Length of the header.
pub(super) const HEADER_BYTES: usize = 64;
/// Length of an index entry.
pub(super) const ENTRY_BYTES: usize = 16;
/// A level is the last when one of its sides is at most this.
const LAST_SIDE: u32 = 16;

/// Size and samples of a photo, from which the shape of its pyramid follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) size: Size,
    pub(super) channels: usize,
    pub(super) bits: u32,
}

/// One tile of a pyramid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TileId {
    pub(super) level: u32,
    pub(super) x: u32,
    pub(super) y: u32,
}

impl Shape {
    /// Number of levels, at least 1.
    pub(super) fn levels(&self) -> u32 {
        let mut size = self.size;
        let mut levels = 1;
        while size.width > LAST_SIDE && size.height > LAST_SIDE {
            size = size.halved();
            levels += 1;
        }
        levels
    }

    /// Size of a level in pixels.
    pub(super) fn level_size(&self, level: u32) -> Size {
        // 32 halvings make one pixel of any size.
        (0..level.min(32)).fold(self.size, |size, _| size.halved())
    }

    /// Columns and rows of tiles of a level.
    pub(super) fn level_tiles(&self, level: u32) -> Size {
        let size = self.level_size(level);
        Size::new(size.width.div_ceil(TILE_SIDE), size.height.div_ceil(TILE_SIDE))
    }

    /// Number of tiles before those of `level`.
    fn tiles_before(&self, level: u32) -> u64 {
        (0..level).map(|l| self.level_tiles(l).area()).sum()
    }

    /// Number of tiles of all levels.
    pub(super) fn tiles(&self) -> u64 {
        self.tiles_before(self.levels())
    }

    /// Number of a tile in the index.
    pub(super) fn ordinal(&self, tile: TileId) -> u64 {
        let columns = u64::from(self.level_tiles(tile.level).width);
        self.tiles_before(tile.level) + u64::from(tile.y) * columns + u64::from(tile.x)
    }

    /// Size of a tile in pixels; smaller at the right and lower edge.
    pub(super) fn tile_size(&self, tile: TileId) -> Size {
        let size = self.level_size(tile.level);
        Size::new(
            (size.width - tile.x * TILE_SIDE).min(TILE_SIDE),
            (size.height - tile.y * TILE_SIDE).min(TILE_SIDE),
        )
    }

    /// Number of samples of a tile.
    pub(super) fn tile_samples(&self, tile: TileId) -> usize {
        let size = self.tile_size(tile);
        size.width as usize * size.height as usize * self.channels
    }

    /// Bytes of a sample: 1 or 2.
    pub(super) fn sample_bytes(&self) -> usize {
        if self.bits == 16 { 2 } else { 1 }
    }

    /// Offset of the first tile.
    pub(super) fn tiles_offset(&self) -> u64 {
        entry_offset(self.tiles())
    }
}

/// A store file's header that has been checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) shape: Shape,
    pub(super) fingerprint: u128,
    pub(super) file_bytes: u64,
    pub(super) index_crc: u32,
}

impl Header {
    /// The header as it stands in the file.
    pub(super) fn to_bytes(self) -> [u8; HEADER_BYTES] {
        let small = |v: usize| u8::try_from(v).expect("channels, bits and levels are below 256");
        let shape = self.shape;
        let mut bytes = [0; HEADER_BYTES];
        bytes[0..8].copy_from_slice(&MAGIC);
        bytes[8..12].copy_from_slice(&VERSION.to_le_bytes());
        bytes[12..16].copy_from_slice(&TILE_SIDE.to_le_bytes());
        bytes[16..20].copy_from_slice(&shape.size.width.to_le_bytes());
        bytes[20..24].copy_from_slice(&shape.size.height.to_le_bytes());
        bytes[24] = small(shape.channels);
        bytes[25] = small(shape.bits as usize);
        bytes[26] = small(shape.levels() as usize);
        let tiles = u32::try_from(shape.tiles()).expect("a photo has at most 2^32 pixels");
        bytes[28..32].copy_from_slice(&tiles.to_le_bytes());
        bytes[32..48].copy_from_slice(&self.fingerprint.to_le_bytes());
        bytes[48..56].copy_from_slice(&self.file_bytes.to_le_bytes());
        bytes[56..60].copy_from_slice(&self.index_crc.to_le_bytes());
        let crc = crc32fast::hash(&bytes[..60]);
        bytes[60..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Checks the bytes of a header against each other and against the length of the file.
    pub(super) fn check(bytes: &[u8; HEADER_BYTES], path: &Path, file_bytes: u64) -> Result<Self> {
        let bad = |place: &str, expected: String, found: String| {
            Err(Error::corrupt(path, place, expected, found))
        };
        let word = |at| u32::from_le_bytes(array(bytes, at));
        if bytes[..8] != MAGIC {
            return bad("byte 0", "a photo store".into(), "something else".into());
        }
        if word(8) != VERSION {
            return bad("byte 8", format!("version {VERSION}"), word(8).to_string());
        }
        if word(60) != crc32fast::hash(&bytes[..60]) {
            return bad("byte 60", "the checksum of the header".into(), "another one".into());
        }
        let shape = Shape {
            size: Size::new(word(16), word(20)),
            channels: bytes[24].into(),
            bits: bytes[25].into(),
        };
        let is_photo = matches!((shape.channels, shape.bits), (1 | 3, 8 | 16))
            && shape.size.width > 0
            && shape.size.height > 0;
        if !is_photo
            || word(12) != TILE_SIDE
            || u32::from(bytes[26]) != shape.levels()
            || u64::from(word(28)) != shape.tiles()
        {
            return bad("byte 12", "the shape of a pyramid".into(), "a contradiction".into());
        }
        let header = Self {
            shape,
            fingerprint: u128::from_le_bytes(array(bytes, 32)),
            file_bytes: u64::from_le_bytes(array(bytes, 48)),
            index_crc: word(56),
        };
        if header.file_bytes != file_bytes || file_bytes < shape.tiles_offset() {
            return bad("length", format!("{} bytes", header.file_bytes), file_bytes.to_string());
        }
        Ok(header)
    }
}

/// An index entry: where a tile lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Entry {
    pub(super) offset: u64,
    pub(super) length: u32,
    pub(super) crc: u32,
}

impl Entry {
    pub(super) fn to_bytes(self) -> [u8; ENTRY_BYTES] {
        let mut bytes = [0; ENTRY_BYTES];
        bytes[..8].copy_from_slice(&self.offset.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.length.to_le_bytes());
        bytes[12..].copy_from_slice(&self.crc.to_le_bytes());
        bytes
    }

    pub(super) fn from_bytes(bytes: &[u8; ENTRY_BYTES]) -> Self {
        Self {
            offset: u64::from_le_bytes(array(bytes, 0)),
            length: u32::from_le_bytes(array(bytes, 8)),
            crc: u32::from_le_bytes(array(bytes, 12)),
        }
    }
}

/// Offset of a tile's index entry.
pub(super) fn entry_offset(ordinal: u64) -> u64 {
    HEADER_BYTES as u64 + ordinal * ENTRY_BYTES as u64
}

/// Checksum of a stored tile; its number is in it, so that no tile can pass for another.
pub(super) fn tile_crc(ordinal: u64, stored: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(&ordinal.to_le_bytes());
    crc.update(stored);
    crc.finalize()
}

fn array<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes[at..at + N].try_into().expect("a slice of N bytes")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        let shape = Shape { size: Size::new(0x0102, 0x0304), channels: 3, bits: 16 };
        let fingerprint = 0x1122_3344_5566_7788_99AA_BBCC_DDEE_FF00;
        Header { shape, fingerprint, file_bytes: 0x0001_0203_0405, index_crc: 0xA1B2_C3D4 }
    }

    #[test]
    fn the_header_lies_as_the_module_page_says() {
        let page = include_str!("mod.rs");
        let bytes = header().to_bytes();
        let check = |row: &str, from: usize, expected: &[u8]| {
            assert!(page.contains(row), "{row}");
            assert_eq!(&bytes[from..from + expected.len()], expected, "{row}");
        };
        check("| 0–7 | `GRNDPHOT` |", 0, b"GRNDPHOT");
        check("| 8–11 | version |", 8, &VERSION.to_le_bytes());
        check("| 12–15 | side of a tile, 256 |", 12, &256_u32.to_le_bytes());
        check("| 16–23 | width, height |", 16, &[2, 1, 0, 0, 4, 3, 0, 0]);
        check("| 24–27 | channels, bits, levels, 0 |", 24, &[3, 16, 6, 0]);
        // 2 × 4, 1 × 2 and four times 1.
        check("| 28–31 | number of tiles |", 28, &[14, 0, 0, 0]);
        check("| 32–47 | fingerprint of the photo |", 32, &header().fingerprint.to_le_bytes());
        check("| 48–55 | length of the file |", 48, &[5, 4, 3, 2, 1, 0, 0, 0]);
        check("| 56–59 | CRC-32 of the index |", 56, &[0xD4, 0xC3, 0xB2, 0xA1]);
        check("| 60–63 | CRC-32 of bytes 0–59 |", 60, &crc32fast::hash(&bytes[..60]).to_le_bytes());
        assert!(page.contains(&format!("File layout, version {VERSION}")));
        assert!(page.contains("The header, 64 bytes:") && HEADER_BYTES == 64);
        assert!(page.contains("16 bytes a tile: offset (8), length (4), CRC-32"));
        let entry = Entry { offset: 1, length: 2, crc: 3 }.to_bytes();
        assert_eq!(entry, [1, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0]);
    }

    #[test]
    fn a_header_reads_back_and_every_flipped_bit_is_found() {
        let bytes = header().to_bytes();
        let path = Path::new("a.tiles");
        assert_eq!(Header::check(&bytes, path, header().file_bytes).unwrap(), header());
        assert!(Header::check(&bytes, path, header().file_bytes + 1).is_err());
        for bit in 0..8 * HEADER_BYTES {
            let mut flipped = bytes;
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(Header::check(&flipped, path, header().file_bytes).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn a_header_with_a_right_checksum_but_an_impossible_shape_is_refused() {
        for (at, value) in [(12, 128), (16, 0), (24, 2), (25, 12), (26, 9), (28, 1), (8, 2)] {
            let mut bytes = header().to_bytes();
            bytes[at] = value;
            bytes[17] = if at == 16 { 0 } else { bytes[17] };
            let crc = crc32fast::hash(&bytes[..60]);
            bytes[60..].copy_from_slice(&crc.to_le_bytes());
            assert!(Header::check(&bytes, Path::new("a"), header().file_bytes).is_err(), "{at}");
        }
    }

    #[test]
    fn tiles_are_numbered_without_a_gap() {
        let shape = Shape { size: Size::new(1300, 700), channels: 1, bits: 8 };
        let mut next = 0;
        let mut pixels = 0;
        for level in 0..shape.levels() {
            let tiles = shape.level_tiles(level);
            for (y, x) in (0..tiles.height).flat_map(|y| (0..tiles.width).map(move |x| (y, x))) {
                let tile = TileId { level, x, y };
                assert_eq!(shape.ordinal(tile), next);
                pixels += shape.tile_samples(tile) as u64;
                next += 1;
            }
        }
        assert_eq!(next, shape.tiles());
        let all: u64 = (0..shape.levels()).map(|l| shape.level_size(l).area()).sum();
        assert_eq!(pixels, all);
    }
}
