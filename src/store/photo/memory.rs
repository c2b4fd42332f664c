//! [`MemoryTiles`]: a photo decoded as a whole, its pyramid's tiles in memory.

use std::path::Path;
use std::sync::Arc;

use super::cache::{Tile, TileSample};
use super::codec::TileView;
use super::format::Shape;
use super::pyramid::Pyramid;
use crate::Result;
use crate::input::photo::{PhotoHeader, decode_photo};

/// All tiles of a photo's pyramid, by number.
#[derive(Debug, PartialEq)]
pub(super) struct MemoryTiles {
    tiles: Vec<Arc<Tile>>,
}

impl MemoryTiles {
    /// Decodes a photo. Takes [`super::working_bytes`] of memory beside what it keeps.
    ///
    /// # Errors
    /// Those of [`decode_photo`].
    pub(super) fn decode(photo: &Path, header: &PhotoHeader, shape: Shape) -> Result<Self> {
        if shape.bits == 16 {
            Self::decode_as::<u16>(photo, header, shape)
        } else {
            Self::decode_as::<u8>(photo, header, shape)
        }
    }

    /// Memory that the tiles of a photo of this shape take.
    pub(super) fn forecast_bytes(shape: Shape) -> u64 {
        let pixels: u64 = (0..shape.levels()).map(|l| shape.level_size(l).area()).sum();
        pixels * (shape.channels * shape.sample_bytes()) as u64
    }

    /// The tile of this number.
    pub(super) fn tile(&self, ordinal: u64) -> Arc<Tile> {
        let place = usize::try_from(ordinal).expect("a tile of the pyramid");
        Arc::clone(&self.tiles[place])
    }

    /// Bytes of all tiles.
    pub(super) fn bytes(&self) -> u64 {
        self.tiles.iter().map(|tile| tile.bytes()).sum()
    }

    fn decode_as<S: TileSample>(photo: &Path, header: &PhotoHeader, shape: Shape) -> Result<Self> {
        let count = usize::try_from(shape.tiles()).expect("at most 2^32 pixels in tiles of 2^16");
        let mut tiles: Vec<Option<Arc<Tile>>> = vec![None; count];
        let mut pyramid = Pyramid::<S>::new(shape);
        let mut sink = |id, view: TileView<'_, S>| {
            let place = usize::try_from(shape.ordinal(id)).expect("a tile of the pyramid");
            tiles[place] = Some(Arc::new(S::tile(view.to_vec())));
            Ok(())
        };
        decode_photo(photo, header, &mut |rows| {
            let rows = S::rows(rows).expect("the type of samples follows from the header");
            pyramid.push(rows, &mut sink)
        })?;
        pyramid.finish(&mut sink)?;
        let tiles = tiles.into_iter().map(|t| t.expect("every tile is handed on once")).collect();
        Ok(Self { tiles })
    }
}
