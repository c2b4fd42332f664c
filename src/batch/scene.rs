//! [`SceneTiles`]: a [`Scene`] as the renderer of a job's tiles.

use std::sync::{Mutex, PoisonError};

use super::{Manifest, TileAddress, TileRenderer};
use crate::Result;
use crate::image::Samples;
use crate::output::{Meaning, Raster};
use crate::render::{OrthoTile, Renderer, Scene, Statistics};

/// Renders the tiles of a job and adds up what was found. Its statistics are integers: their sum does not depend on
/// the order in which threads finish.
#[derive(Debug)]
pub struct SceneTiles<'a> {
    scene: &'a Scene,
    manifest: &'a Manifest,
    block_bytes: u64,
    statistics: Mutex<Statistics>,
}

impl<'a> SceneTiles<'a> {
    /// A renderer of the job's tiles whose threads keep their working memory within about `block_bytes` each.
    pub fn new(scene: &'a Scene, manifest: &'a Manifest, block_bytes: u64) -> Self {
        let statistics = Mutex::new(Statistics::new(scene.names));
        Self { scene, manifest, block_bytes, statistics }
    }

    /// What was found on the tiles rendered so far.
    pub fn into_statistics(self) -> Statistics {
        self.statistics.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<'a> TileRenderer for SceneTiles<'a> {
    type Scratch = Renderer<'a>;

    fn scratch(&self) -> Renderer<'a> {
        Renderer::new(self.scene, self.block_bytes)
    }

    fn render(&self, tile: TileAddress, renderer: &mut Renderer<'a>) -> Result<Vec<Raster>> {
        let tile = renderer.tile(self.manifest.tile_rect(tile))?;
        let found = renderer.take_statistics();
        self.statistics.lock().unwrap_or_else(PoisonError::into_inner).merge(&found);
        Ok(self.manifest.layers().iter().map(|l| raster(&tile, l.meaning())).collect())
    }
}

/// One layer of a tile.
fn raster(tile: &OrthoTile, meaning: Meaning) -> Raster {
    match meaning {
        Meaning::Mosaic => match &tile.colour {
            Samples::U8(image) => Raster::U8(image.clone()),
            Samples::U16(image) => Raster::U16(image.clone()),
        },
        Meaning::Elevation => Raster::F32(tile.elevation.clone()),
        Meaning::Face => Raster::U32(tile.face.clone()),
        Meaning::Count => Raster::U8(tile.count.clone()),
        Meaning::Used => Raster::U8(tile.used.clone()),
        Meaning::Coverage => Raster::U8(tile.coverage.clone()),
        Meaning::Best => Raster::U16(tile.best.clone()),
    }
}
