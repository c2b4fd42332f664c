//! [`OverviewBuilder`]: overview tiles while the finer tiles pass by, in any order.
//!
//! A tile is halved when it is there ([`halve`]); the builder keeps that quarter until its up to three
//! siblings have come, and then hands back the tile of the next level, which is halved and added in its turn. What a
//! parent looks like depends on where its quarters lie, never on which came first. Along a space-filling curve at
//! most three quarters a level wait, beside those of the tiles in flight.

use std::collections::BTreeMap;

use super::{Layer, Pyramid, Raster, TileKey, halve};
use crate::geom::Size;
use crate::image::Image;

/// Collects quarters of overview tiles, all layers of a tile together.
#[derive(Debug)]
pub struct OverviewBuilder {
    pyramid: Pyramid,
    levels: u32,
    pending: BTreeMap<TileKey, Vec<Quarter>>,
}

/// All layers of a tile, halved: its part of the parent tile.
#[derive(Debug, Clone, PartialEq)]
pub struct Quarter {
    child: TileKey,
    rasters: Vec<Raster>,
}

/// An overview tile of which all quarters are there.
#[derive(Debug, Clone, PartialEq)]
pub struct Gathered {
    tile: TileKey,
    size: Size,
    tile_size: u32,
    quarters: Vec<Quarter>,
}

impl Quarter {
    /// The quarter that a finished tile gives to its parent; one raster for each layer.
    ///
    /// # Panics
    /// If the samples of a raster are not its layer's.
    pub fn of(tile: TileKey, layers: &[Layer], rasters: &[Raster]) -> Self {
        let rasters = layers.iter().zip(rasters).map(|(l, r)| halve(l, r)).collect();
        Self { child: tile, rasters }
    }

    /// Bytes of its samples.
    pub fn bytes(&self) -> u64 {
        self.rasters.iter().map(Raster::bytes).sum()
    }
}

impl OverviewBuilder {
    /// A builder for the overviews of a file.
    pub fn new(pyramid: Pyramid) -> Self {
        Self { pyramid, levels: pyramid.levels(), pending: BTreeMap::new() }
    }

    /// Whether a tile has a parent, so that its quarter is wanted.
    pub fn wants(&self, tile: TileKey) -> bool {
        tile.level + 1 < self.levels
    }

    /// Takes a quarter; gives back the parent tile if this was its last one.
    ///
    /// # Panics
    /// If the quarter came before, or its tile has no parent.
    pub fn add(&mut self, quarter: Quarter) -> Option<Gathered> {
        assert!(self.wants(quarter.child), "only a tile below the coarsest level has a parent");
        let tile = quarter.child.parent();
        let expected = self.pyramid.children(tile).count();
        let quarters = self.pending.entry(tile).or_default();
        assert!(quarters.iter().all(|q| q.child != quarter.child), "a tile is added once");
        quarters.push(quarter);
        if quarters.len() < expected {
            return None;
        }
        let quarters = self.pending.remove(&tile)?;
        let size = self.pyramid.tile_pixels(tile);
        Some(Gathered { tile, size, tile_size: self.pyramid.tile_size(), quarters })
    }

    /// Number of quarters that wait for their siblings.
    pub fn pending(&self) -> usize {
        self.pending.values().map(Vec::len).sum()
    }
}

impl Gathered {
    /// Which tile it is.
    pub fn tile(&self) -> TileKey {
        self.tile
    }

    /// Bytes of the samples of its quarters.
    pub fn bytes(&self) -> u64 {
        self.quarters.iter().map(Quarter::bytes).sum()
    }

    /// The pixels of the tile, one raster for each layer.
    pub fn into_rasters(self) -> Vec<Raster> {
        let layers = self.quarters.first().map_or(0, |q| q.rasters.len());
        (0..layers).map(|layer| self.join(layer)).collect()
    }

    fn join(&self, layer: usize) -> Raster {
        match &self.quarters[0].rasters[layer] {
            Raster::U8(_) => Raster::U8(self.paste(layer, Raster::as_u8)),
            Raster::U16(_) => Raster::U16(self.paste(layer, Raster::as_u16)),
            Raster::U32(_) => Raster::U32(self.paste(layer, Raster::as_u32)),
            Raster::F32(_) => Raster::F32(self.paste(layer, Raster::as_f32)),
        }
    }

    fn paste<T: Copy + Default>(
        &self,
        layer: usize,
        image_of: impl Fn(&Raster) -> Option<&Image<T>>,
    ) -> Image<T> {
        let channels = self.quarters[0].rasters[layer].channels();
        let mut whole = Image::filled(self.size, channels, T::default());
        let half = self.tile_size as usize / 2;
        let stride = self.size.width as usize * channels;
        for quarter in &self.quarters {
            let (x, y) = (quarter.child.x % 2, quarter.child.y % 2);
            let corner = y as usize * half * stride + x as usize * half * channels;
            let image =
                image_of(&quarter.rasters[layer]).expect("a layer has one sample type").view();
            for row in 0..image.size().height as usize {
                let at = corner + row * stride;
                let samples = image.row(row);
                whole.data_mut()[at..at + samples.len()].copy_from_slice(samples);
            }
        }
        whole
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_pixels::{all_layers, cut, noise};
    use super::*;

    /// All tiles of all levels, the tiles of level 0 added in the order of `key`; and the most quarters that waited.
    fn build<K: Ord>(
        pyramid: Pyramid,
        layers: &[Layer],
        whole: &[Raster],
        key: impl Fn(&TileKey) -> K,
    ) -> (BTreeMap<TileKey, Vec<Raster>>, usize) {
        let mut builder = OverviewBuilder::new(pyramid);
        let mut tiles: Vec<_> = pyramid.level_tiles(0).collect();
        tiles.sort_by_key(key);
        let (mut all, mut most) = (BTreeMap::new(), 0);
        for tile in tiles {
            let rect = pyramid.tile_rect(tile);
            let mut done = (tile, whole.iter().map(|r| cut(r, rect)).collect::<Vec<_>>());
            loop {
                let (tile, rasters) = done;
                let next = builder
                    .wants(tile)
                    .then(|| builder.add(Quarter::of(tile, layers, &rasters)))
                    .flatten();
                assert!(all.insert(tile, rasters).is_none());
                most = most.max(builder.pending());
                match next {
                    Some(gathered) => done = (gathered.tile(), gathered.into_rasters()),
                    None => break,
                }
            }
        }
        assert_eq!(builder.pending(), 0);
        (all, most)
    }

    #[test]
    fn tiles_of_every_level_are_the_halved_image_in_whatever_order_they_come() {
        let size = Size::new(151, 70);
        let pyramid = Pyramid::new(size, 16).unwrap();
        let layers = all_layers();
        let whole: Vec<_> = layers.iter().map(|l| noise(l, size, 3)).collect();
        let (rows, _) = build(pyramid, &layers, &whole, |t| (t.y, t.x));
        let (back, _) = build(pyramid, &layers, &whole, |t| std::cmp::Reverse((t.x, t.y)));
        assert_eq!(format!("{rows:?}"), format!("{back:?}"));
        let mut level_pixels = whole;
        for level in 0..pyramid.levels() {
            for tile in pyramid.level_tiles(level) {
                let want: Vec<_> =
                    level_pixels.iter().map(|r| cut(r, pyramid.tile_rect(tile))).collect();
                assert_eq!(format!("{want:?}"), format!("{:?}", rows[&tile]), "{tile:?}");
            }
            level_pixels = layers.iter().zip(&level_pixels).map(|(l, r)| halve(l, r)).collect();
        }
    }

    #[test]
    fn along_the_curve_at_most_three_quarters_a_level_wait() {
        let size = Size::new(1024, 1024);
        let pyramid = Pyramid::new(size, 16).unwrap();
        let layers = [Layer::of(super::super::Meaning::Count).unwrap()];
        let whole = [noise(&layers[0], size, 3)];
        let curve = |t: &TileKey| crate::geom::hilbert2([t.x, t.y], 6);
        let (_, most) = build(pyramid, &layers, &whole, curve);
        assert!(most <= 3 * 6, "{most}");
        let (_, by_rows) = build(pyramid, &layers, &whole, |t| (t.y, t.x));
        assert!(by_rows > 64, "{by_rows}");
    }
}
