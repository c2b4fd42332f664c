//! Pieces of work on several threads, within a budget of memory.

use std::sync::{Condvar, Mutex, PoisonError};

use crate::{Error, Result};

/// What pieces of work need of a budget, by index.
pub(super) struct Budget {
    pub(super) bytes: u64,
    pub(super) needs: Vec<u64>,
}

impl Budget {
    pub(super) fn unlimited() -> Self {
        Self { bytes: u64::MAX, needs: Vec::new() }
    }

    fn need(&self, index: usize) -> u64 {
        self.needs.get(index).copied().unwrap_or(0)
    }
}

/// The next piece of work, and the bytes of those in progress.
struct Queue {
    next: usize,
    used_bytes: u64,
    failure: Option<Error>,
}

/// Does `work` for 0 to `count − 1`, started in that order, on several threads, each piece when its need fits beside
/// those in progress (one alone always may). The results are in order; after an error no further piece is begun.
///
/// Threads of its own, not rayon's: a rayon worker that waits for the budget could not go on with the piece below it
/// on its stack.
pub(super) fn in_parallel<T: Send>(
    count: usize,
    threads: usize,
    budget: &Budget,
    work: impl Fn(usize) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let queue = Mutex::new(Queue { next: 0, used_bytes: 0, failure: None });
    let changed = Condvar::new();
    let take = || {
        let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if queue.next == count || queue.failure.is_some() {
                return None;
            }
            let need = budget.need(queue.next);
            if queue.used_bytes == 0 || queue.used_bytes.saturating_add(need) <= budget.bytes {
                queue.used_bytes += need;
                queue.next += 1;
                return Some(queue.next - 1);
            }
            queue = changed.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
    };
    let give_back = |index: usize, failure: Option<Error>| {
        let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
        queue.used_bytes -= budget.need(index);
        queue.failure = queue.failure.take().or(failure);
        changed.notify_all();
    };
    let run = || {
        let mut results = Vec::new();
        while let Some(index) = take() {
            match work(index) {
                Ok(result) => {
                    results.push((index, result));
                    give_back(index, None);
                }
                Err(failure) => give_back(index, Some(failure)),
            }
        }
        results
    };
    let mut results = std::thread::scope(|scope| {
        let threads = threads.clamp(1, count.max(1));
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(run)).collect();
        let join = |handle: std::thread::ScopedJoinHandle<'_, Vec<(usize, T)>>| {
            handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        handles.into_iter().flat_map(join).collect::<Vec<_>>()
    });
    if let Some(failure) = queue.into_inner().unwrap_or_else(PoisonError::into_inner).failure {
        return Err(failure);
    }
    results.sort_unstable_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn work_in_progress_stays_in_the_budget_and_results_in_order() {
        let needs: Vec<u64> = (0..60).map(|i| 1 + i * 7 % 10).collect();
        let budget = Budget { bytes: 12, needs: needs.clone() };
        let used = Mutex::new((0, 0));
        let results = in_parallel(60, 4, &budget, |i| {
            let mut now = used.lock().unwrap();
            now.0 += needs[i];
            now.1 = now.1.max(now.0);
            drop(now);
            std::thread::sleep(std::time::Duration::from_micros(300));
            used.lock().unwrap().0 -= needs[i];
            Ok(i)
        });
        assert_eq!(results.unwrap(), (0..60).collect::<Vec<_>>());
        let peak = used.into_inner().unwrap().1;
        assert!((10..=12).contains(&peak), "{peak}");
    }

    #[test]
    fn after_a_failure_nothing_further_is_begun() {
        let begun = AtomicUsize::new(0);
        let failed = in_parallel(1000, 2, &Budget::unlimited(), |i| {
            begun.fetch_add(1, Ordering::Relaxed);
            if i == 3 { Err(Error::usage("stop")) } else { Ok(()) }
        });
        assert!(matches!(failed, Err(Error::Usage(_))));
        assert!(begun.into_inner() < 1000);
    }
}
