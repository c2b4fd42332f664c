//! Header of a PNG file (ISO/IEC 15948).

use std::io::Read;
use std::path::Path;

use super::limits::check_size;
use super::{PhotoFormat, PhotoHeader};
use crate::geom::Size;
use crate::{Error, Result};

/// First bytes of every PNG file.
pub(super) const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1A\n";

/// Reads signature and `IHDR` chunk from the start of `reader`.
pub(super) fn read_header<R: Read>(
    reader: &mut R,
    path: &Path,
    file_bytes: u64,
) -> Result<PhotoHeader> {
    let mut head = [0; 33];
    reader.read_exact(&mut head).map_err(|e| match e.kind() {
        std::io::ErrorKind::UnexpectedEof => {
            Error::corrupt(path, "byte 8", "an IHDR chunk", "the end of the file")
        }
        _ => Error::io(path, e),
    })?;
    let word = |at: usize| u32::from_be_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    if word(8) != 13 || &head[12..16] != b"IHDR" {
        return Err(Error::corrupt(path, "byte 8", "an IHDR chunk of 13 bytes", "another chunk"));
    }
    if word(29) != crc32fast::hash(&head[12..29]) {
        return Err(Error::corrupt(path, "byte 29", "the checksum of IHDR", "another one"));
    }
    let size = Size::new(word(16), word(20));
    let [depth, colour, compression, filter, interlace] =
        [head[24], head[25], head[26], head[27], head[28]];
    check_size(path, "byte 16", size)?;
    let channels = match (colour, depth) {
        (0, 1 | 2 | 4 | 8 | 16) | (4, 8 | 16) => 1,
        (2 | 6, 8 | 16) | (3, 1 | 2 | 4 | 8) => 3,
        _ => {
            return Err(Error::corrupt(
                path,
                "byte 24",
                "a colour type with a bit depth it may have",
                format!("colour type {colour} with {depth} bits"),
            ));
        }
    };
    if compression != 0 || filter != 0 || interlace > 1 {
        return Err(Error::corrupt(
            path,
            "byte 26",
            "compression 0, filter 0, interlace 0 or 1",
            format!("{compression}, {filter}, {interlace}"),
        ));
    }
    let stored_bits = u64::from(depth) * [1, 0, 3, 1, 2, 0, 4][usize::from(colour)];
    // Deflate packs at most 1032 bytes in one.
    let least = size.area() * stored_bits / 8 / 1032;
    if file_bytes < least {
        let expected =
            format!("at least {least} bytes for {} × {} pixels", size.width, size.height);
        return Err(Error::corrupt(path, "length", expected, file_bytes.to_string()));
    }
    Ok(PhotoHeader {
        format: PhotoFormat::Png { interlaced: interlace == 1 },
        size,
        channels,
        bits: if depth == 16 { 16 } else { 8 },
        file_bytes,
    })
}
