//! Camera formats from outside: one rig with known answer, written in each format as its publication defines it and
//! read back; faults written into the files and detected; hostile files refused.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod faults;
mod formats;
mod hostile;
mod job;
mod odm;
mod rig;
mod suites;
mod table;
mod writers;
