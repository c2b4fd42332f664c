//! How the memory promised by `--memory` is handed out.

use crate::{Error, Result};

/// Shares of the memory cap, bytes.
///
/// Four fifths of the cap are handed out; the binary, the stacks, the allocator and what is counted twice while it
/// changes hands take the rest. Stores are built before anything is rendered: their shares are the same memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// Buckets, vertex blocks and sorting while the mesh store is built.
    pub build_bytes: u64,
    /// Photos decoded at once while their tile stores are built.
    pub decode_bytes: u64,
    /// Pages of the mesh store that may stay mapped.
    pub mesh_bytes: u64,
    /// Decoded tiles of photos and masks.
    pub photo_bytes: u64,
    /// Points, cells, windows and samples of one rendering thread.
    pub block_bytes: u64,
    /// Finished tiles of all threads on their way to the disk.
    pub output_bytes: u64,
}

/// What finished tiles take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileDemand {
    /// Side of a tile of the files, pixels.
    pub tile_size: u32,
    /// Bytes a pixel of all files, those of all sections counted.
    pub pixel_bytes: u64,
    /// Overview levels, at most.
    pub levels: u64,
    /// Sections of the mosaic; 1 for an ordinary one.
    pub sections: u64,
}

impl TileDemand {
    /// Bytes a pixel of an [`OrthoTile`](super::OrthoTile) of the greatest depth.
    const ORTHO_BYTES: u64 = 22;

    /// So many sections of what is one here.
    #[must_use]
    pub fn times(self, sections: usize) -> Self {
        let sections = sections as u64;
        let pixel_bytes = self.pixel_bytes * sections;
        Self { pixel_bytes, sections: self.sections * sections, ..self }
    }

    /// Memory of finished tiles, bytes: in each thread the tile with all its layers, the layers asked for as rasters
    /// and again as encoded tiles that wait for the disk; and on each level of overviews one tile that is gathered.
    fn bytes(&self, threads: u64) -> u64 {
        let area = u64::from(self.tile_size).pow(2);
        area * (threads * (self.sections * Self::ORTHO_BYTES + 2 * self.pixel_bytes)
            + self.levels * self.pixel_bytes)
    }
}

impl Budget {
    /// Least cap, bytes: 256 MiB.
    pub const LEAST: u64 = 256 << 20;
    /// Least share of the caches together, and of the blocks of each thread, bytes.
    const LEAST_CACHES: u64 = 32 << 20;
    const LEAST_BLOCK: u64 = 4 << 20;
    /// Share of the blocks of each thread beyond which they do not grow, bytes: what a block of the largest side takes
    /// that four photos see if each pixel shows a face of its own, or some twenty if faces are large. What is over goes
    /// to the caches.
    const MOST_BLOCK: u64 = 64 << 20;

    /// The shares of a cap of `memory_bytes` among `threads` that make tiles as `tiles` says.
    ///
    /// # Errors
    /// [`Error::OverBudget`] if finished tiles alone leave too little for anything else.
    pub fn new(memory_bytes: u64, threads: usize, tiles: TileDemand) -> Result<Self> {
        let handed_out = memory_bytes / 5 * 4;
        let threads = u64::try_from(threads.max(1)).unwrap_or(u64::MAX);
        let output_bytes = tiles.bytes(threads);
        let least = output_bytes + Self::LEAST_CACHES + threads * Self::LEAST_BLOCK;
        if least > handed_out {
            return Err(Error::OverBudget {
                what: format!(
                    "--threads {threads} with --tile-size {} and {} bytes a pixel in the files",
                    tiles.tile_size, tiles.pixel_bytes
                ),
                needed_bytes: least.div_ceil(4).saturating_mul(5),
                allowed_bytes: memory_bytes,
                hint: Some(
                    "take fewer threads, smaller tiles or fewer layers, or allow more --memory"
                        .into(),
                ),
            });
        }
        let rest = handed_out - output_bytes;
        let block_bytes = (rest / 9 * 4 / threads).min(Self::MOST_BLOCK);
        let caches = rest - block_bytes * threads;
        Ok(Self {
            // Neither rendering nor its caches exist yet while the stores are built.
            build_bytes: handed_out / 2,
            decode_bytes: handed_out,
            mesh_bytes: caches / 9 * 3,
            photo_bytes: caches / 9 * 6,
            block_bytes,
            output_bytes,
        })
    }

    /// How many sections to make at a time, at least one: as many as keep finished tiles within half of what is handed
    /// out, so that the caches stay of use. `one` is what one section takes.
    pub fn sections_at_once(memory_bytes: u64, threads: usize, one: TileDemand) -> usize {
        let threads = u64::try_from(threads.max(1)).unwrap_or(u64::MAX);
        let fitting = (memory_bytes / 5 * 2) / one.bytes(threads).max(1);
        usize::try_from(fitting).unwrap_or(usize::MAX).max(1)
    }

    /// The shares for a mesh store of `file_bytes`: what it cannot fill goes to the photos.
    #[must_use]
    pub fn with_mesh(self, file_bytes: u64) -> Self {
        let mesh_bytes = self.mesh_bytes.min(file_bytes);
        Self { mesh_bytes, photo_bytes: self.photo_bytes + (self.mesh_bytes - mesh_bytes), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TILES: TileDemand = TileDemand { tile_size: 512, pixel_bytes: 8, levels: 4, sections: 1 };

    #[test]
    fn what_is_handed_out_while_rendering_stays_below_four_fifths() {
        for (threads, cap) in [(1, 256 << 20), (2, 512 << 20), (64, 4 << 30)] {
            let b = Budget::new(cap, threads, TILES).unwrap();
            let all =
                b.mesh_bytes + b.photo_bytes + b.block_bytes * threads as u64 + b.output_bytes;
            assert!(all <= cap / 5 * 4);
            assert!(b.build_bytes <= cap / 5 * 4 && b.decode_bytes <= cap / 5 * 4);
        }
    }

    #[test]
    fn as_many_sections_are_made_at_once_as_leave_half_to_the_rest() {
        for (cap, threads) in [(256_u64 << 20, 1), (512 << 20, 2), (4 << 30, 3), (1 << 30, 64)] {
            let n = Budget::sections_at_once(cap, threads, TILES);
            let taken = |n| TILES.times(n).bytes(threads as u64);
            assert!(n == 1 || taken(n) <= cap / 5 * 2, "{n} of {cap}");
            assert!(taken(n + 1) > cap / 5 * 2);
        }
        assert!(Budget::sections_at_once(512 << 20, 2, TILES) > 5);
        assert_eq!(TILES.times(3), TileDemand { pixel_bytes: 24, sections: 3, ..TILES });
    }

    #[test]
    fn what_a_small_mesh_leaves_goes_to_the_photos() {
        let b = Budget::new(1 << 30, 2, TILES).unwrap();
        let small = b.with_mesh(5 << 20);
        assert_eq!(small.mesh_bytes, 5 << 20);
        assert_eq!(small.mesh_bytes + small.photo_bytes, b.mesh_bytes + b.photo_bytes);
        assert_eq!(b.with_mesh(1 << 40), b);
    }

    #[test]
    fn tiles_that_leave_no_room_are_refused_with_the_memory_that_they_need() {
        let large = TileDemand { tile_size: 4096, ..TILES };
        let refused = Budget::new(256 << 20, 2, large).unwrap_err();
        let Error::OverBudget { needed_bytes, .. } = refused else { panic!("{refused}") };
        assert_eq!(refused.exit_code(), 3);
        assert!(Budget::new(needed_bytes - 10, 2, large).is_err());
        assert!(Budget::new(needed_bytes + 10, 2, large).is_ok());
        assert!(Budget::new(256 << 20, 64, TILES).is_err());
    }
}
