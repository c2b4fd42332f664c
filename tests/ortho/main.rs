//! The whole job on synthetic scenes: against the brute-force oracle, and from outside, as the built binary.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod command;
mod golden;
mod job;
mod known_answer;
