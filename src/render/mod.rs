//! Joins the stages for one rectangle of the mosaic: the only place where stores and stages meet.
//!
//! In: a [`Scene`] (mesh store, photo store, photos, mosaic, settings) and a rectangle. Out: an
//! [`OrthoTile`] and what was found about each photo. [`Renderer::tile`] *is* the data path:
//! surface; for each view visibility; windows, samples, tone; outliers and blend. Of a mosaic in several sections
//! [`Renderer::section_tiles`] makes all: from the highest down, and of each only what the one above does not show.
//! Promise: the pixels depend on the scene and the pixel alone, never on the rectangle, the memory or the thread; the
//! memory of a [`Renderer`] stays within [`Budget::block_bytes`], because a rectangle that would need more is cut in
//! four. Starts no thread and writes no file.

mod budget;
mod colour;
mod fading;
mod masking;
mod observe;
mod scene;
mod sections;
mod tile;

pub use budget::{Budget, TileDemand};
pub use observe::{Observed, observed_blocks};
pub use scene::{Canvas, Scene, ScenePhoto};
pub use tile::Renderer;

pub use crate::blend::{
    Blend, Edges, OrthoTile, Outliers, PhotoStats, Settings as BlendSettings, Statistics, Weights,
};
pub use crate::sample::Interpolation;
pub use crate::visibility::Tolerance;
