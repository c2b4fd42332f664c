//! Triangles in the order of a store: by key, then by face id, then by their place in the polygon.
//!
//! In: buckets. Out: pieces of the one sorted sequence, which does not depend on how the buckets were cut.
//! Memory: two buckets that fit the limit. A bucket that does not is cut by its own keys into smaller ones; if
//! all its keys are equal it is in order already, because buckets keep the order in which triangles came: that
//! of the files. While one bucket is given out, the next is read and sorted.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::buckets::{Bucket, Buckets, RECORD_BYTES, bucket_of, decode, id_of, key_of};
use super::partition::Triangle;
use crate::Result;

/// Bytes of working memory for a triangle of a bucket: its record and its place in the order.
pub(super) const BYTES_PER_TRIANGLE: usize = RECORD_BYTES + size_of::<(u64, u32, u32)>();
/// Triangles given out at a time.
const PIECE: usize = 1 << 15;
/// Cells into which the keys of a bucket that is too large are counted.
const CELLS: usize = 1 << 12;

/// Takes pieces of the sorted sequence.
pub(super) trait Sink: Send {
    /// Takes the next triangles.
    fn take(&mut self, triangles: &[Triangle]) -> Result<()>;
}

/// A bucket, as far as it can be made ready for giving out; the memory is used again for the one after the next.
#[derive(Debug, Default)]
struct Prepared {
    records: Vec<u8>,
    /// The order of the records: key, id and place of each.
    order: Vec<(u64, u32, u32)>,
    /// A bucket that does not fit, in place of records.
    too_large: Option<Bucket>,
}

/// Sorts what is in buckets.
#[derive(Debug)]
pub(super) struct Sorter<'a> {
    /// Where the files of smaller buckets go.
    pub(super) folder: &'a Path,
    /// Triangles of the largest bucket that is sorted in memory.
    pub(super) capacity: usize,
    /// Bytes held by smaller buckets before they are written.
    pub(super) spill_bytes: usize,
}

impl Sorter<'_> {
    /// Gives all triangles of the buckets to `sink` in order.
    pub(super) fn run(&self, buckets: Buckets, sink: &mut impl Sink) -> Result<()> {
        let mut buckets = buckets.into_buckets();
        let (mut now, mut next) = (Prepared::default(), Prepared::default());
        let mut is_left = self.prepare(buckets.next(), &mut now)?;
        while is_left {
            let (prepared, given) = rayon::join(
                || self.prepare(buckets.next(), &mut next),
                || self.give_out(&mut now, sink),
            );
            given?;
            is_left = prepared?;
            std::mem::swap(&mut now, &mut next);
        }
        Ok(())
    }

    /// Reads and sorts a bucket, if it fits; tells whether there was one.
    fn prepare(&self, bucket: Option<Bucket>, out: &mut Prepared) -> Result<bool> {
        let Some(bucket) = bucket else { return Ok(false) };
        if bucket.records() > self.capacity {
            out.too_large = Some(bucket);
            return Ok(true);
        }
        bucket.into_records(&mut out.records)?;
        out.records
            .par_chunks_exact(RECORD_BYTES)
            .enumerate()
            .map(|(place, record)| {
                let place = u32::try_from(place).expect("a bucket in memory has fewer triangles");
                (key_of(record), id_of(record), place)
            })
            .collect_into_vec(&mut out.order);
        out.order.par_sort_unstable();
        Ok(true)
    }

    fn give_out(&self, prepared: &mut Prepared, sink: &mut impl Sink) -> Result<()> {
        let Some(bucket) = prepared.too_large.take() else {
            return give_sorted(&prepared.records, &prepared.order, sink);
        };
        if bucket.keys.end - bucket.keys.start == 1 {
            return bucket.for_each(|records| {
                let triangles = records.par_chunks_exact(RECORD_BYTES).map(decode);
                sink.take(&triangles.collect::<Vec<_>>())
            });
        }
        let parts = self.cut(&bucket)?;
        drop(bucket);
        self.run(parts, sink)
    }

    /// Cuts a bucket into smaller ones, each of which fits, or holds the keys of one cell of its range.
    fn cut(&self, bucket: &Bucket) -> Result<Buckets> {
        let keys = bucket.keys.clone();
        let width = (keys.end - keys.start).div_ceil(CELLS as u64);
        let mut counts = vec![0_u64; CELLS];
        bucket.for_each(|records| {
            for record in records.chunks_exact(RECORD_BYTES) {
                let cell = usize::try_from((key_of(record) - keys.start) / width);
                counts[cell.expect("below the number of cells")] += 1;
            }
            Ok(())
        })?;
        let start_of = |cell: usize| (keys.start + cell as u64 * width).min(keys.end);
        let ranges = balanced(counts, start_of, self.capacity as u64, keys.end);
        let name = format!("cut-{:016x}-{width:x}", keys.start);
        let mut parts = Buckets::new(self.folder, &name, ranges, self.spill_bytes, false);
        let starts = parts.starts();
        bucket.for_each(|records| {
            for record in records.chunks_exact(RECORD_BYTES) {
                parts.push(bucket_of(&starts, key_of(record)), record);
            }
            parts.spill_beyond_limit()
        })?;
        Ok(parts)
    }
}

/// Ranges of keys up to `end`: runs of cells whose weights sum to `capacity` at most, or single cells. Cell `k`
/// starts at key `start_of(k)`.
pub(super) fn balanced(
    weights: impl IntoIterator<Item = u64>,
    start_of: impl Fn(usize) -> u64,
    capacity: u64,
    end: u64,
) -> Vec<Range<u64>> {
    let (mut starts, mut sum, mut last) = (vec![start_of(0)], 0, start_of(0));
    for (cell, weight) in weights.into_iter().enumerate() {
        let start = start_of(cell);
        // A cell that is too large stands alone, without empty ones before it.
        if sum + weight > capacity && last < start && start < end {
            starts.push(start);
            (sum, last) = (0, start);
        }
        sum += weight;
    }
    let ends = starts[1..].iter().copied().chain([end]);
    starts.iter().copied().zip(ends).map(|(start, end)| start..end).collect()
}

/// Gives records out in their order.
fn give_sorted(records: &[u8], order: &[(u64, u32, u32)], sink: &mut impl Sink) -> Result<()> {
    let record = |place: u32| &records[place as usize * RECORD_BYTES..][..RECORD_BYTES];
    let mut piece = Vec::new();
    for places in order.chunks(PIECE) {
        places.par_iter().map(|&(.., place)| decode(record(place))).collect_into_vec(&mut piece);
        sink.take(&piece)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::mesh::buckets::encode;

    struct Collected(Vec<Triangle>);

    impl Sink for Collected {
        fn take(&mut self, triangles: &[Triangle]) -> Result<()> {
            self.0.extend_from_slice(triangles);
            Ok(())
        }
    }

    #[test]
    fn the_order_is_by_key_id_and_place_however_small_the_memory() {
        // Many equal keys, many near one another, some far; ids ascend, three triangles a face.
        let triangles: Vec<Triangle> = (0..30_000_u32)
            .map(|n| {
                let many = u64::from(n).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                let key = match n % 3 {
                    0 => 77,
                    1 => (1 << 40) + many % 500,
                    _ => many,
                };
                let corners = [[i64::from(n), 0, 0], [0, 1, 0], [0, 0, 1]];
                Triangle { key, id: n / 3, corners }
            })
            .collect();
        let mut expected = triangles.clone();
        expected.sort_by_key(|t| (t.key, t.id));
        for (capacity, spill_bytes) in [(1 << 20, 1 << 30), (5000, 1 << 30), (300, 10_000)] {
            let dir = tempfile::tempdir().unwrap();
            let ranges = vec![0..1 << 45, 1 << 45..u64::MAX];
            let mut buckets =
                Buckets::new(dir.path(), "b", ranges, spill_bytes, spill_bytes > 20_000);
            for t in &triangles {
                buckets.push(bucket_of(&buckets.starts(), t.key), &encode(t));
                buckets.spill_beyond_limit().unwrap();
            }
            let mut found = Collected(Vec::new());
            let sorter = Sorter { folder: dir.path(), capacity, spill_bytes };
            sorter.run(buckets, &mut found).unwrap();
            assert!(found.0 == expected, "capacity {capacity}");
            assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        }
    }

    #[test]
    fn ranges_hold_no_more_than_asked_but_for_single_cells() {
        let weights = [3, 0, 5, 9, 20, 1, 1, 0, 0];
        let ranges = balanced(weights, |cell| 100 + 10 * cell as u64, 10, 185);
        assert_eq!(ranges, [100..130, 130..140, 140..150, 150..185]);
        assert_eq!(balanced([0, 0, 99, 0], |cell| cell as u64, 10, 4), [0..2, 2..3, 3..4]);
    }
}
