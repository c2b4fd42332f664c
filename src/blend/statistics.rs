//! [`Statistics`]: what the blend found, for the report.

use super::OrthoTile;

/// What became of one photo's samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PhotoStats {
    /// Pixels that it sees.
    pub seen: u64,
    /// Pixels where its sample was kept.
    pub used: u64,
    /// Pixels where its sample was dropped as an outlier.
    pub rejected: u64,
    /// Pixels where its sample could be compared: those that at least one more photo sees.
    pub compared: u64,
    /// Sum, over the compared pixels, of the Euclidean distance over the channels of its sample, kept or not, to the
    /// weighted mean of those kept; in 1/256 of an output unit, each rounded half up to a whole number.
    pub residual_256: u64,
}

impl PhotoStats {
    /// Mean distance of its samples to the blend, in output units; `None` where nothing could be compared.
    pub fn mean_residual(&self) -> Option<f64> {
        (self.compared > 0).then(|| self.residual_256 as f64 / 256.0 / self.compared as f64)
    }

    /// Adds the counts of another part of the mosaic.
    pub fn merge(&mut self, other: &Self) {
        self.seen += other.seen;
        self.used += other.used;
        self.rejected += other.rejected;
        self.compared += other.compared;
        self.residual_256 += other.residual_256;
    }

    /// Takes away the counts of a part of the mosaic that are among these.
    pub fn take_away(&mut self, part: &Self) {
        self.seen -= part.seen;
        self.used -= part.used;
        self.rejected -= part.rejected;
        self.compared -= part.compared;
        self.residual_256 -= part.residual_256;
    }
}

/// Counts of a block's samples by the part that their pixel belongs to.
#[derive(Debug)]
pub struct Parts<'a> {
    /// The part of each pixel of the block, row-major.
    pub part_of: &'a [u16],
    /// One a part.
    pub statistics: &'a mut [Statistics],
}

/// Counts over some tiles. They are integers: merging is exact, in any order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Statistics {
    /// One a photo of the whole camera set.
    pub photos: Vec<PhotoStats>,
    /// Pixels by their value in the layer `count`: that many photos (254: or more), 255 no surface. Always 256.
    pub counts: Vec<u64>,
}

impl Statistics {
    /// Those of no tile, for a camera set of `photos`.
    pub fn new(photos: usize) -> Self {
        Self { photos: vec![PhotoStats::default(); photos], counts: vec![0; 256] }
    }

    /// Counts the pixels of a finished tile.
    pub fn count_tile(&mut self, tile: &OrthoTile) {
        for &count in tile.count.data() {
            self.counts[usize::from(count)] += 1;
        }
    }

    /// Adds those of other tiles.
    ///
    /// # Panics
    /// If the other is of another camera set.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(self.photos.len(), other.photos.len(), "one camera set");
        for (a, b) in self.photos.iter_mut().zip(&other.photos) {
            a.merge(b);
        }
        for (a, b) in self.counts.iter_mut().zip(&other.counts) {
            *a += b;
        }
    }
}
