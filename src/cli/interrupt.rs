//! Ctrl-C and SIGTERM: the run ends in order, between two tiles, and keeps what is finished.
//!
//! The first signal asks the run to end: unfinished files are removed, finished tiles stay in the work folder. The
//! second ends the process at once; even then no half-written file bears a final name.

use std::sync::atomic::{AtomicBool, Ordering};

use super::console;
use crate::{Error, Result};

static ASKED: AtomicBool = AtomicBool::new(false);

/// Exit code of a process that was ended at once, as shells give it for SIGINT.
const AT_ONCE: i32 = 130;

/// Watches for signals from now on.
pub(super) fn watch() {
    // Whoever watches already, in a process that calls the command twice, watches for this one too.
    ctrlc::try_set_handler(on_signal).ok();
}

#[expect(clippy::exit, reason = "the second signal")]
fn on_signal() {
    if ASKED.swap(true, Ordering::Relaxed) {
        std::process::exit(AT_ONCE);
    }
    console::note("groundel: ending; finished tiles are kept (once more to end at once)");
}

/// Whether the run may go on.
///
/// # Errors
/// [`Error::Interrupted`] once a signal has come.
pub(super) fn check() -> Result<()> {
    if ASKED.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}
