//! Keeps a panic of the crate `laz` from ending the process: of damaged chunks it reads beyond its tables.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    static IS_GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What `work` gives, or `None` if it panics, of which nothing is printed. What it changed until then is not to be used.
pub(super) fn guarded<T>(work: impl FnOnce() -> T) -> Option<T> {
    static SILENCE: Once = Once::new();
    SILENCE.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            if !IS_GUARDED.get() {
                before(panic);
            }
        }));
    });
    IS_GUARDED.set(true);
    let done = catch_unwind(AssertUnwindSafe(work));
    IS_GUARDED.set(false);
    done.ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_nothing_and_the_rest_its_result() {
        let table = [1, 2];
        let at = |k: usize| guarded(|| table[k]);
        assert_eq!([at(0), at(1), at(2), at(1)], [Some(1), Some(2), None, Some(2)]);
    }
}
