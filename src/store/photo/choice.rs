//! How a photo is read: chosen by cost alone, as the samples are the same in any way.

use super::build::{Content, working_bytes};
use super::memory::MemoryTiles;
use super::prepare::Preparation;
use super::survey::Needed;

/// How photos are to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Reading {
    /// As it costs least: decoded once into memory if all photos of a job fit there together, else from store files.
    #[default]
    Auto,
    /// From store files.
    Tiles,
    /// From memory.
    Memory,
}

/// How one photo is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    Tiles,
    Memory,
}

impl Way {
    /// Memory that a photo keeps while it is read.
    pub(super) fn held_bytes(self, photo: &Needed) -> u64 {
        match self {
            Self::Memory => MemoryTiles::forecast_bytes(photo.shape),
            Self::Tiles => 0,
        }
    }

    /// Memory that making the photo ready takes beside that.
    pub(super) fn working_bytes(self, photo: &Needed) -> u64 {
        match self {
            Self::Tiles if photo.existing.is_some() => 0,
            Self::Memory | Self::Tiles => working_bytes(&photo.header),
        }
    }
}

/// How each photo is read.
pub(super) fn choose(
    content: Content,
    photos: &[Needed],
    preparation: &Preparation<'_>,
) -> Vec<Way> {
    let held = |photo: &Needed| Way::Memory.held_bytes(photo);
    let all: u64 = photos.iter().map(held).sum();
    let left = preparation.free_bytes().saturating_sub(all);
    let fits = all <= preparation.memory_bytes
        && photos.iter().all(|photo| working_bytes(&photo.header) <= left);
    let way = match preparation.reading {
        _ if content == Content::Mask => Way::Tiles,
        Reading::Memory => Way::Memory,
        Reading::Auto if fits => Way::Memory,
        Reading::Auto | Reading::Tiles => Way::Tiles,
    };
    vec![way; photos.len()]
}
