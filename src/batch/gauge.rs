//! [`Gauge`]: how much is held now, and how much was at most.

use std::sync::atomic::{AtomicU64, Ordering};

/// Counts bytes that any thread takes and gives back.
#[derive(Debug, Default)]
pub(super) struct Gauge {
    now: AtomicU64,
    peak: AtomicU64,
}

impl Gauge {
    /// `bytes` more are held.
    pub(super) fn take(&self, bytes: u64) {
        let now = self.now.fetch_add(bytes, Ordering::Relaxed) + bytes;
        self.peak.fetch_max(now, Ordering::Relaxed);
    }

    /// `bytes` that were taken are held no more.
    pub(super) fn give_back(&self, bytes: u64) {
        self.now.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// The most that was ever held.
    pub(super) fn peak(&self) -> u64 {
        self.peak.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_the_most_that_was_held_at_once() {
        let gauge = Gauge::default();
        for (taken, given) in [(5, 5), (7, 3), (2, 6)] {
            gauge.take(taken);
            gauge.give_back(given);
        }
        assert_eq!(gauge.peak(), 7);
    }
}
