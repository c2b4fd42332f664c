//! Photos of every kind: as GDAL writes them, and through the built binary.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../gdal/mod.rs"]
mod gdal;
mod tiff_by_gdal;
