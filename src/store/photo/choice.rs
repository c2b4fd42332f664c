//! How a photo is read: chosen by cost alone, as the samples are the same in any way.
//!
//! Measured on photos of 1.5 to 6 megapixels, Mpx/s of one thread of a busy machine: a tile of a store file is read at
//! 70–230; a JPEG is decoded as a whole at 40–110, by windows at 45–90; its index is made at 270–620, its store file at
//! 20–50.

use super::build::{Content, working_bytes};
use super::jpeg;
use super::memory::MemoryTiles;
use super::prepare::Preparation;
use super::survey::Needed;
use crate::input::photo::{JpegCoding, PhotoFormat};

/// A photo of which less than one part in so many is needed is not decoded as a whole, if it can be helped.
const SMALL_PART: u64 = 2;
/// From this pyramid level on a store file is cheaper: each of its tiles stands for 16 of the photo's.
const COARSE_LEVEL: u32 = 2;
/// The part of the memory that is left for parts of photos, where some are read by an index.
const CACHE_SHARE: u64 = 4;

/// How photos are to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Reading {
    /// As it costs least. A store file that is there is used. A JPEG that has an index is read by it where less than half of it is needed; the other photos
    /// are decoded once into memory if they fit there together; if not, JPEGs are read by their index, all others, and
    /// those of which coarse levels are needed, from store files.
    #[default]
    Auto,
    /// From store files.
    Tiles,
    /// From memory.
    Memory,
    /// By an index, where there can be one, else from store files.
    Index,
}

/// How one photo is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    Tiles,
    Memory,
    Index,
}

impl Way {
    /// Memory that a photo keeps while it is read.
    pub(super) fn held_bytes(self, photo: &Needed) -> u64 {
        match self {
            Self::Memory => MemoryTiles::forecast_bytes(photo.shape),
            Self::Tiles | Self::Index => 0,
        }
    }

    /// Memory that making the photo ready takes beside that.
    pub(super) fn working_bytes(self, photo: &Needed) -> u64 {
        match self {
            Self::Tiles if photo.existing.is_some() => 0,
            Self::Memory | Self::Tiles => working_bytes(&photo.header),
            Self::Index => jpeg::working_bytes(&photo.header),
        }
    }
}

/// How each photo is read.
pub(super) fn choose(
    content: Content,
    photos: &[Needed],
    preparation: &Preparation<'_>,
) -> Vec<Way> {
    let forced = |photo: &Needed| match preparation.reading {
        _ if content == Content::Mask => Some(Way::Tiles),
        Reading::Auto => None,
        Reading::Memory => Some(Way::Memory),
        Reading::Index if may_have_index(photo) => Some(Way::Index),
        Reading::Index | Reading::Tiles => Some(Way::Tiles),
    };
    let by_index = |photo: &Needed| may_have_index(photo) && photo.demand.level < COARSE_LEVEL;
    let is_part = |photo: &Needed| {
        by_index(photo) && photo.demand.pixels.saturating_mul(SMALL_PART) < photo.shape.size.area()
    };
    let missing = photos.iter().filter(|photo| photo.existing.is_none());
    let (parts, wholes): (Vec<&Needed>, Vec<&Needed>) = missing.partition(|p| is_part(p));
    let all: u64 = wholes.iter().map(|photo| Way::Memory.held_bytes(photo)).sum();
    let left = preparation.free_bytes().saturating_sub(all);
    let cache = if parts.is_empty() && wholes.len() == photos.len() {
        0
    } else {
        preparation.memory_bytes / CACHE_SHARE
    };
    let fits = all <= preparation.memory_bytes - cache
        && wholes.iter().all(|photo| working_bytes(&photo.header) <= left);
    let best = |photo: &Needed| match photo.existing {
        None if is_part(photo) => Way::Index,
        None if fits => Way::Memory,
        None if by_index(photo) => Way::Index,
        _ => Way::Tiles,
    };
    photos.iter().map(|photo| forced(photo).unwrap_or_else(|| best(photo))).collect()
}

/// Whether the header does not speak against an index.
fn may_have_index(photo: &Needed) -> bool {
    matches!(photo.header.format, PhotoFormat::Jpeg { coding: JpegCoding::Sequential, .. })
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::super::build::PhotoFingerprint;
    use super::super::prepared::Demand;
    use super::*;
    use crate::geom::Size;
    use crate::input::photo::PhotoHeader;

    /// A photo of 16 megapixels, 64 MiB with its pyramid.
    fn photo(coding: JpegCoding, pixels: u64, level: u32) -> Needed {
        let format = PhotoFormat::Jpeg { coding, quarter_coefficients: 6 };
        let size = Size::new(4096, 4096);
        let header = PhotoHeader { format, size, channels: 3, bits: 8, file_bytes: 5 << 20 };
        Needed {
            shape: Content::Photo.shape(&header),
            header,
            demand: Demand { pixels, level },
            fingerprint: PhotoFingerprint::from_number(0),
            store: PathBuf::new(),
            index: PathBuf::new(),
            existing: None,
        }
    }

    fn ways(photos: &[Needed], memory_bytes: u64) -> Vec<Way> {
        let preparation = Preparation {
            folder: Path::new("a"),
            budget_bytes: memory_bytes * 4,
            beside_bytes: 0,
            threads: 2,
            memory_bytes,
            reading: Reading::Auto,
        };
        choose(Content::Photo, photos, &preparation)
    }

    #[test]
    fn photos_go_to_memory_together_or_not_at_all() {
        use JpegCoding::{Progressive, Sequential};
        let all = u64::MAX;
        let photos = || [photo(Sequential, all, 0), photo(Progressive, all, 0)];
        assert_eq!(ways(&photos(), 1 << 30), [Way::Memory; 2]);
        // Two do not fit, and a progressive one has no index.
        assert_eq!(ways(&photos(), 120 << 20), [Way::Index, Way::Tiles]);
        assert_eq!(ways(&photos()[..1], 120 << 20), [Way::Memory]);
    }

    #[test]
    fn a_small_part_is_read_by_the_index_and_coarse_levels_from_a_store_file() {
        use JpegCoding::{Progressive, Sequential};
        let part = 3 << 20;
        let photos = [
            photo(Sequential, part, 1),
            photo(Sequential, 9 << 20, 0),
            photo(Progressive, part, 0),
        ];
        assert_eq!(ways(&photos, 1 << 30), [Way::Index, Way::Memory, Way::Memory]);
        // The memory is not all given away: the parts need a cache.
        assert_eq!(ways(&photos[..2], 70 << 20), [Way::Index, Way::Index]);
        assert_eq!(ways(&[photo(Sequential, part, 2)], 1 << 20), [Way::Tiles]);
        assert_eq!(ways(&[photo(Sequential, part, 2)], 1 << 30), [Way::Memory]);
    }
}
