//! Reading tiles from store files.

use std::io::ErrorKind;
use std::sync::{Mutex, PoisonError};

use super::build::PhotoTiles;
use super::codec::{Decoder, Sample};
use super::files::OpenFiles;
use super::format::{ENTRY_BYTES, Entry, TileId, entry_offset, tile_crc};
use crate::{Error, Result};

/// Reads tiles from many store files; keeps files open and buffers at hand.
#[derive(Debug, Default)]
pub(super) struct TileFiles {
    pub(super) files: OpenFiles,
    /// Buffers for reading and decoding, as many as threads have read at the same time.
    scratch: Mutex<Vec<Scratch>>,
}

struct Scratch {
    stored: Vec<u8>,
    decoder: Decoder,
}

impl std::fmt::Debug for Scratch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Scratch").field("stored", &self.stored.capacity()).finish_non_exhaustive()
    }
}

impl TileFiles {
    /// Reads a tile's entry and bytes, checks them, and decodes them into `tile`. `photo` is the photo's number.
    ///
    /// # Errors
    /// [`Error::Corrupt`] for a damaged tile, [`Error::Io`].
    pub(super) fn read<S: Sample>(
        &self,
        photo: usize,
        tiles: &PhotoTiles,
        id: TileId,
        tile: &mut [S],
    ) -> Result<()> {
        let mut scratch = self.scratch(tiles)?;
        let read = self.read_with(photo, tiles, id, &mut scratch, tile);
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
        read
    }

    fn scratch(&self, tiles: &PhotoTiles) -> Result<Scratch> {
        if let Some(scratch) = self.scratch.lock().unwrap_or_else(PoisonError::into_inner).pop() {
            return Ok(scratch);
        }
        let decoder = Decoder::new().map_err(|e| Error::io(&tiles.path, e))?;
        Ok(Scratch { stored: Vec::new(), decoder })
    }

    fn read_with<S: Sample>(
        &self,
        photo: usize,
        tiles: &PhotoTiles,
        id: TileId,
        scratch: &mut Scratch,
        tile: &mut [S],
    ) -> Result<()> {
        let (path, shape) = (&tiles.path, tiles.shape);
        let ordinal = shape.ordinal(id);
        let corrupt = |expected: &str, found: String| {
            let place = format!("tile {} {} of level {}", id.x, id.y, id.level);
            Error::corrupt(path, place, expected, found)
        };
        let read_error = |e: std::io::Error| match e.kind() {
            ErrorKind::UnexpectedEof => corrupt("its bytes", "the end of the file".to_string()),
            _ => Error::io(path, e),
        };
        let file = self.files.get(photo, || tiles.open_again())?;
        let mut bytes = [0; ENTRY_BYTES];
        file.read_exact_at(&mut bytes, entry_offset(ordinal)).map_err(read_error)?;
        let entry = Entry::from_bytes(&bytes);
        let limit = zstd::zstd_safe::compress_bound(std::mem::size_of_val(tile));
        let end = entry.offset.checked_add(entry.length.into());
        if entry.length as usize > limit || end.is_none_or(|end| end > tiles.file_bytes()) {
            let found = format!("{} bytes at {}", entry.length, entry.offset);
            return Err(corrupt("an entry within the file", found));
        }
        scratch.stored.resize(entry.length as usize, 0);
        file.read_exact_at(&mut scratch.stored, entry.offset).map_err(read_error)?;
        if tile_crc(ordinal, &scratch.stored) != entry.crc {
            return Err(corrupt("the checksum of its bytes", "another one".to_string()));
        }
        let width = shape.tile_size(id).width as usize;
        scratch
            .decoder
            .decode(&scratch.stored, width, shape.channels, tile)
            .map_err(|found| corrupt("a Zstandard frame of its samples", found))
    }
}
