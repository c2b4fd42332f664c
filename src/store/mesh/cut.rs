//! Cutting the sorted sequence of triangles into partitions.
//!
//! In: pieces of the sequence, of any length. Out: partitions, encoded, to the writer. Promise: where it is cut
//! depends on the sequence alone, not on the pieces: what does not yet fill a partition waits for the next.

use std::ops::Range;

use rayon::prelude::*;

use super::curve::CURVE_BITS;
use super::layout::PARTITION_TRIANGLES;
use super::order::Sink;
use super::partition::{PartitionEncoder, Triangle};
use super::write::StoreWriter;
use crate::Result;

/// Fewest triangles of a partition that others of its class follow. A larger window makes partitions more
/// compact, but emptier.
const LEAST_TRIANGLES: usize = PARTITION_TRIANGLES * 5 / 8;

/// Cuts, encodes and writes.
#[derive(Debug)]
pub(super) struct Cutter {
    pending: Vec<Triangle>,
    writer: StoreWriter,
}

impl Cutter {
    /// A cutter before the first triangle.
    pub(super) fn new(writer: StoreWriter) -> Self {
        Self { pending: Vec::new(), writer }
    }

    /// Writes what is left.
    pub(super) fn finish(mut self) -> Result<StoreWriter> {
        let cuts = cuts(&self.pending, true);
        self.write(&cuts)?;
        Ok(self.writer)
    }

    fn write(&mut self, cuts: &[Range<usize>]) -> Result<()> {
        let encoded: Vec<_> = cuts
            .par_iter()
            .map_init(PartitionEncoder::new, |encoder, cut| {
                encoder.encode(&self.pending[cut.clone()])
            })
            .collect();
        encoded.iter().try_for_each(|partition| self.writer.add(partition))?;
        self.pending.drain(..cuts.last().map_or(0, |cut| cut.end));
        Ok(())
    }
}

impl Sink for Cutter {
    fn take(&mut self, triangles: &[Triangle]) -> Result<()> {
        self.pending.extend_from_slice(triangles);
        let cuts = cuts(&self.pending, false);
        self.write(&cuts)
    }
}

/// The partitions at the start of a sorted sequence, without those that more triangles might change; with all of
/// them if the sequence `is_end`.
///
/// A partition ends with its class, or after [`LEAST_TRIANGLES`] to [`PARTITION_TRIANGLES`] triangles: where the
/// curve leaves the largest cell, the last such place if there are several.
fn cuts(sorted: &[Triangle], is_end: bool) -> Vec<Range<usize>> {
    let mut cuts = Vec::new();
    let mut start = 0;
    while start < sorted.len() {
        let window = &sorted[start..sorted.len().min(start + PARTITION_TRIANGLES + 1)];
        let class = window[0].key >> CURVE_BITS;
        let run = window.partition_point(|t| t.key >> CURVE_BITS == class);
        let length = if run > PARTITION_TRIANGLES {
            let cell_left = |k: &usize| (window[k - 1].key ^ window[*k].key).leading_zeros() / 3;
            let best = (LEAST_TRIANGLES..=PARTITION_TRIANGLES).rev().min_by_key(cell_left);
            best.expect("the window is not empty")
        } else if run < window.len() || is_end {
            run
        } else {
            break;
        };
        cuts.push(start..start + length);
        start += length;
    }
    cuts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sequence(count: u64) -> Vec<Triangle> {
        let mut keys: Vec<u64> = (0..count)
            .map(|n| {
                let class = u64::from(n % 100 == 0) + u64::from(n % 1000 == 0);
                class << CURVE_BITS | n.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 6
            })
            .collect();
        keys.sort_unstable();
        let corners = [[0; 3]; 3];
        keys.into_iter().map(|key| Triangle { key, id: 0, corners }).collect()
    }

    #[test]
    fn cuts_do_not_depend_on_the_pieces_in_which_the_sequence_comes() {
        let sorted = sequence(30_000);
        let whole = cuts(&sorted, true);
        for piece in [1, 700, 1024, 1025, 9999] {
            let (mut found, mut pending, mut base) = (Vec::new(), Vec::new(), 0);
            for triangles in sorted.chunks(piece) {
                pending.extend_from_slice(triangles);
                let some = cuts(&pending, false);
                let used = some.last().map_or(0, |cut| cut.end);
                found.extend(some.into_iter().map(|cut| cut.start + base..cut.end + base));
                pending.drain(..used);
                base += used;
            }
            found.extend(cuts(&pending, true).into_iter().map(|c| c.start + base..c.end + base));
            assert_eq!(found, whole, "pieces of {piece}");
        }
    }

    #[test]
    fn partitions_are_full_enough_of_one_class_and_leave_nothing_out() {
        let sorted = sequence(30_000);
        let whole = cuts(&sorted, true);
        assert_eq!(whole[0].start, 0);
        assert_eq!(whole.last().unwrap().end, sorted.len());
        for pair in whole.windows(2) {
            assert_eq!(pair[0].end, pair[1].start);
        }
        for cut in &whole {
            let class = |k: usize| sorted[k].key >> CURVE_BITS;
            assert_eq!(class(cut.start), class(cut.end - 1));
            assert!(cut.len() <= PARTITION_TRIANGLES);
            let is_last = cut.end == sorted.len() || class(cut.end) != class(cut.start);
            assert!(is_last || cut.len() >= LEAST_TRIANGLES);
        }
        assert!(cuts(&[], true).is_empty());
    }
}
