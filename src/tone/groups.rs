//! Photos that share surface points, directly or through others.

/// For each of `photos` the lowest photo of its group, by pairs of photos that share something.
pub(super) fn groups(photos: usize, pairs: impl Iterator<Item = (usize, usize)>) -> Vec<usize> {
    let mut above: Vec<usize> = (0..photos).collect();
    for (a, b) in pairs {
        let (a, b) = (root(&mut above, a), root(&mut above, b));
        above[a.max(b)] = a.min(b);
    }
    (0..photos).map(|k| root(&mut above, k)).collect()
}

/// The lowest of a photo's group; the way to it is shortened.
fn root(above: &mut [usize], mut k: usize) -> usize {
    while above[k] != k {
        above[k] = above[above[k]];
        k = above[k];
    }
    k
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_belong_together_through_others() {
        assert_eq!(groups(6, [(4, 2), (5, 4), (0, 1)].into_iter()), [0, 0, 2, 3, 2, 2]);
        assert_eq!(groups(0, std::iter::empty()), Vec::<usize>::new());
    }
}
