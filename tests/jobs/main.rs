//! Jobs in steps, from outside: planned, rendered in batches by several processes, killed, moved, changed, assembled; and
//! always the bytes of `groundel ortho`.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod batches;
mod changed;
mod dask;
mod facade;
mod faults;
