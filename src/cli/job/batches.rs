//! [`cut`]: the tiles of a job in batches of about equal work.

/// First tile of each of `count` batches of tiles whose estimated work is `weights`, in the order of the curve; fewer if
/// there are fewer tiles. Each batch has at least one tile, and ends where its share of the whole work is reached.
pub(super) fn cut(weights: &[f64], count: usize) -> Vec<u64> {
    let count = count.clamp(1, weights.len().max(1));
    let total: f64 = weights.iter().sum();
    let mut starts = vec![0];
    let mut done = 0.0;
    for (tile, weight) in weights.iter().enumerate() {
        let (batches, left) = (starts.len(), weights.len() - tile);
        let target = total * batches as f64 / count as f64;
        // The tile goes where most of it lies; enough tiles must be left for the other batches.
        let is_due = done + weight / 2.0 > target || left <= count - batches;
        if is_due && batches < count && starts.last() != Some(&(tile as u64)) {
            starts.push(tile as u64);
        }
        done += weight;
    }
    starts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(weights: &[f64], starts: &[u64]) -> Vec<f64> {
        let ends = starts.iter().skip(1).copied().chain([weights.len() as u64]);
        let range = |(from, to): (&u64, u64)| {
            weights[usize::try_from(*from).unwrap()..usize::try_from(to).unwrap()].iter().sum()
        };
        starts.iter().zip(ends).map(range).collect()
    }

    #[test]
    fn batches_have_equal_work_as_far_as_tiles_allow() {
        let weights: Vec<f64> =
            (0..1000).map(|k| 1.0 + f64::from(k % 37) + f64::from(k / 100)).collect();
        for count in [1, 2, 7, 30, 100] {
            let starts = cut(&weights, count);
            assert_eq!(starts.len(), count);
            let sums = sums(&weights, &starts);
            let mean = weights.iter().sum::<f64>() / count as f64;
            // No more than a tile off.
            assert!(sums.iter().all(|s| (s - mean).abs() <= 50.0), "{count}: {sums:?}");
        }
    }

    #[test]
    fn every_batch_has_a_tile_whatever_the_weights() {
        for weights in [vec![0.0; 10], vec![1e9, 0.0, 0.0, 0.0, 1.0], vec![0.0, 0.0, 0.0, 5.0]] {
            for count in 1..=12 {
                let starts = cut(&weights, count);
                assert_eq!(starts.len(), count.min(weights.len()), "{weights:?} {count}");
                assert!(starts.is_sorted_by(|a, b| a < b) && starts[0] == 0);
                assert!(starts.iter().all(|&s| s < weights.len() as u64));
            }
        }
    }
}
