//! The one place that writes to the terminal.
//!
//! Answers go to standard output, everything about the run to standard error. A reader that has closed its end of the
//! pipe (`groundel info … | head`) is no error of ours.

use std::io::{self, Write};

/// Writes `text` to standard output.
pub(super) fn answer(text: &str) {
    write(io::stdout().lock(), text);
}

/// Writes a line to standard error.
pub(super) fn note(line: &str) {
    write(io::stderr().lock(), &format!("{line}\n"));
}

fn write(mut stream: impl Write, text: &str) {
    // Nowhere is left to report to if the terminal itself fails.
    stream.write_all(text.as_bytes()).and_then(|()| stream.flush()).ok();
}
