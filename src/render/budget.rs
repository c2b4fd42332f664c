//! How the memory promised by `--memory` is handed out.

/// Shares of the memory cap, bytes.
///
/// Four fifths of the cap are handed out; the binary, the stacks, the allocator and what is counted twice while it
/// changes hands take the rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// Pages of the mesh store that may stay mapped.
    pub mesh_bytes: u64,
    /// Decoded photo tiles.
    pub photo_bytes: u64,
    /// Buckets, vertex blocks and sorting while the mesh store is built.
    pub build_bytes: u64,
    /// Photos decoded at once while their tile stores are built.
    pub decode_bytes: u64,
    /// Points, cells, windows and samples of one rendering thread.
    pub block_bytes: u64,
    /// Finished tiles on their way to the disk.
    pub output_bytes: u64,
}

impl Budget {
    /// Least cap, bytes: 256 MiB.
    pub const LEAST: u64 = 256 << 20;

    /// The shares of a cap of `memory_bytes` among `threads`.
    pub fn new(memory_bytes: u64, threads: usize) -> Self {
        let handed_out = memory_bytes / 5 * 4;
        let threads = u64::try_from(threads.max(1)).unwrap_or(u64::MAX);
        Self {
            mesh_bytes: handed_out / 5,
            photo_bytes: handed_out / 4,
            // Neither rendering nor its caches exist yet while the stores are built.
            build_bytes: handed_out / 2,
            decode_bytes: handed_out,
            block_bytes: handed_out / 3 / threads,
            output_bytes: handed_out / 10,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_handed_out_while_rendering_stays_below_nine_tenths_of_four_fifths() {
        for threads in [1, 2, 64] {
            let cap = 512 << 20;
            let b = Budget::new(cap, threads);
            let all =
                b.mesh_bytes + b.photo_bytes + b.block_bytes * threads as u64 + b.output_bytes;
            assert!(all <= cap / 10 * 8);
        }
    }
}
