//! [`Thinned`]: an even sample of a stream of unknown length.

/// Every n-th item of a stream, n a power of two, so that at least half of `most` items are kept of a long one, and
/// all of a short one. Which ones depends on their order alone. Memory: `most` items.
#[derive(Debug, Clone)]
pub(in crate::input) struct Thinned<T> {
    items: Vec<T>,
    most: usize,
    /// One of so many items is kept.
    step: u64,
    seen: u64,
}

impl<T> Thinned<T> {
    /// A sample of at most `most` items, at least 2.
    pub(in crate::input) fn new(most: usize) -> Self {
        Self { items: Vec::new(), most: most.max(2), step: 1, seen: 0 }
    }

    /// Offers an item, which `make` makes only if it is kept.
    pub(in crate::input) fn offer(&mut self, make: impl FnOnce() -> T) {
        let is_kept = self.seen.is_multiple_of(self.step);
        self.seen += 1;
        if !is_kept {
            return;
        }
        if self.items.len() == self.most {
            // Items 0, 2, 4 … stay; the one offered is one more of them, if their number is even.
            let mut index = 0;
            self.items.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.step *= 2;
            if !(self.seen - 1).is_multiple_of(self.step) {
                return;
            }
        }
        self.items.push(make());
    }

    /// What was kept, in order.
    pub(in crate::input) fn into_items(self) -> Vec<T> {
        self.items
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_stream_is_kept_whole_and_a_long_one_evenly() {
        for (count, most) in [(0, 8), (5, 8), (8, 8), (9, 8), (1000, 8), (1001, 7), (4097, 3)] {
            let mut thinned = Thinned::new(most);
            (0..count).for_each(|i: u64| thinned.offer(|| i));
            let kept = thinned.into_items();
            assert!(kept.len() <= most && kept.len() as u64 >= count.min(most as u64 / 2));
            let step = kept.get(1).map_or(1, |second| second - kept[0]);
            assert!(step.is_power_of_two());
            assert!(kept.iter().enumerate().all(|(i, k)| *k == i as u64 * step), "{kept:?}");
            assert!(count == 0 || count - kept[kept.len() - 1] <= step, "to the very end");
        }
    }
}
