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

/// Time between two looks at the parent.
#[cfg(unix)]
const LOOK_AFTER: std::time::Duration = std::time::Duration::from_millis(250);

/// Ends the run, as a signal does, once `parent` is no longer the parent of this process. A parent that ended before this
/// call is noticed too.
///
/// # Errors
/// [`Error::Usage`] where processes do not know their parents.
#[cfg(unix)]
pub(super) fn end_with(parent: u32) -> Result<()> {
    let watch = move || {
        while std::os::unix::process::parent_id() == parent {
            std::thread::sleep(LOOK_AFTER);
        }
        if !ASKED.swap(true, Ordering::Relaxed) {
            console::note("groundel: ending: the process that started this one has ended");
        }
    };
    let started = std::thread::Builder::new().name("parent".into()).spawn(watch);
    started.map(drop).map_err(|e| Error::usage(format!("--parent: {e}")))
}

#[cfg(not(unix))]
pub(super) fn end_with(_parent: u32) -> Result<()> {
    Err(Error::usage("--parent: this system does not tell a process's parent"))
}

/// Whether the run may go on.
///
/// # Errors
/// [`Error::Interrupted`] once a signal has come.
pub(super) fn check() -> Result<()> {
    if ASKED.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
}
