//! The whole job on synthetic scenes: against the brute-force oracle, and from outside, as the built binary.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod command;
mod cracks;
mod demo;
mod formats;
mod frame_out;
mod frames;
#[path = "../gdal/mod.rs"]
mod gdal;
mod golden;
mod interruption;
mod job;
mod known_answer;
#[path = "../las/mod.rs"]
mod las_files;
mod memory;
mod points;
mod sections;
mod views;
