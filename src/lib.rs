//! groundel: true orthoimages from a 3-D surface mesh and oriented photographs.

pub mod batch;
pub mod blend;
pub mod camera;
pub mod cli;
mod error;
pub mod frame;
pub mod geom;
pub mod image;
pub mod input;
pub mod output;
pub mod plan;
pub mod raster;
pub mod render;
pub mod report;
pub mod sample;
pub mod store;
pub mod surface;
pub mod synthetic;
pub mod visibility;

pub use error::{Error, Result};
