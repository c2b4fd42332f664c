//! [`PreparedPhoto`]: a photo whose windows can be read, and from what.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::build::{PhotoFingerprint, PhotoTiles};
use super::format::Shape;
use super::jpeg::IndexedJpeg;
use super::memory::MemoryTiles;
use crate::geom::Size;

/// What a job needs of a photo; it decides how the photo is read, never what is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Demand {
    /// Pixels of level 0 that may be touched, estimated.
    pub pixels: u64,
    /// The finest pyramid level that is likely to be read.
    pub level: u32,
}

impl Demand {
    /// The whole photo.
    pub const ALL: Self = Self { pixels: u64::MAX, level: 0 };
}

/// A photo whose windows can be read by a [`PhotoStore`](super::PhotoStore).
#[derive(Debug, Clone, PartialEq)]
pub struct PreparedPhoto {
    pub(super) shape: Shape,
    pub(super) source: Source,
    /// Pixels of level 0 that were decoded from the photo's own file to prepare it.
    pub(super) pixels_decoded: u64,
}

/// Where a photo's samples come from.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Source {
    /// A store file.
    Tiles(PhotoTiles),
    /// Tiles in memory, made from what the fingerprint says, at this path.
    Memory(PathBuf, PhotoFingerprint, Arc<MemoryTiles>),
    /// The photo's own file, by its index.
    Indexed(IndexedJpeg),
    /// Nowhere: nothing of the photo at this path is needed.
    Unread(PathBuf),
}

impl PreparedPhoto {
    /// A photo in a store file.
    pub(super) fn tiles(tiles: PhotoTiles) -> Self {
        Self { shape: tiles.shape, source: Source::Tiles(tiles), pixels_decoded: 0 }
    }

    /// A photo in a store file that was made from it in this run.
    pub(super) fn tiles_just_made(tiles: PhotoTiles) -> Self {
        let pixels_decoded = tiles.shape.size.area();
        Self { pixels_decoded, ..Self::tiles(tiles) }
    }

    /// A photo in memory, decoded in this run.
    pub(super) fn memory(
        path: &Path,
        shape: Shape,
        fingerprint: PhotoFingerprint,
        tiles: Arc<MemoryTiles>,
    ) -> Self {
        let source = Source::Memory(path.to_path_buf(), fingerprint, tiles);
        Self { shape, source, pixels_decoded: shape.size.area() }
    }

    /// A photo whose own file is read by its index.
    pub(super) fn indexed(indexed: IndexedJpeg) -> Self {
        let shape = indexed.shape();
        Self { shape, source: Source::Indexed(indexed), pixels_decoded: 0 }
    }

    /// A photo of which nothing is needed.
    pub(super) fn unread(path: &Path, shape: Shape) -> Self {
        Self { shape, source: Source::Unread(path.to_path_buf()), pixels_decoded: 0 }
    }

    /// The file that its samples are read from.
    pub(super) fn path(&self) -> &Path {
        match &self.source {
            Source::Tiles(tiles) => tiles.path(),
            Source::Indexed(indexed) => indexed.photo(),
            Source::Memory(path, ..) | Source::Unread(path) => path,
        }
    }

    /// Its file in the store folder, if it has one.
    pub fn store_path(&self) -> Option<&Path> {
        match &self.source {
            Source::Tiles(tiles) => Some(tiles.path()),
            Source::Indexed(indexed) => Some(indexed.path()),
            Source::Memory(..) | Source::Unread(_) => None,
        }
    }

    /// Memory of tiles that it holds, bytes.
    pub fn memory_bytes(&self) -> u64 {
        match &self.source {
            Source::Memory(.., tiles) => tiles.bytes(),
            Source::Tiles(_) | Source::Indexed(_) | Source::Unread(_) => 0,
        }
    }

    /// Whether its own file is read, by an index, while windows are asked for.
    pub fn is_indexed(&self) -> bool {
        matches!(self.source, Source::Indexed(_))
    }

    /// Whether its samples can be read: something of it is needed.
    pub fn is_needed(&self) -> bool {
        !matches!(self.source, Source::Unread(_))
    }

    /// Width and height of the photo in pixels.
    pub fn size(&self) -> Size {
        self.shape.size
    }

    /// What it was made from; `None` if nothing of it is needed.
    pub fn fingerprint(&self) -> Option<PhotoFingerprint> {
        match &self.source {
            Source::Tiles(tiles) => Some(tiles.fingerprint()),
            Source::Memory(_, fingerprint, _) => Some(*fingerprint),
            Source::Indexed(indexed) => Some(indexed.fingerprint()),
            Source::Unread(_) => None,
        }
    }
}
