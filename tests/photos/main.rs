//! Photos of every kind: as GDAL writes them, and through the built binary.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "../gdal/mod.rs"]
mod gdal;

mod command;
mod masks;
mod mixed;
mod profile;
mod reading;
mod tiff_by_gdal;
