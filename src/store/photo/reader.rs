//! [`PhotoStore`]: windows of the photos of a job.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use super::build::{PhotoFingerprint, PhotoTiles};
use super::cache::{TileCache, TileSample};
use super::format::{Shape, TILE_SIDE};
use super::halve::average_rows;
use super::jpeg::IndexedFiles;
use super::placement::Placement;
use super::prepared::PreparedPhoto;
use super::source::tile_ids;
use super::tile_file::TileFiles;
use super::touched::Touched;
use crate::geom::{PixelRect, Size};
use crate::image::{Image, Samples, Window};
use crate::{Error, Result};

/// Most pixels of a window: 2²⁶, which is 192 MiB of RGB. A window serves some blocks of a mosaic tile.
const MAX_WINDOW_PIXELS: u64 = 1 << 26;
/// Most pixels of level 0 that a window of a coarser level is halved from. A single point of the coarsest level of a photo of
/// 24 megapixels needs 1.6 million; by whole tiles of that level it would need the whole photo.
const MAX_COARSE_PIXELS: usize = 2 << 20;
/// The part of the cache that one prefetch may fill.
const PREFETCH_SHARE: u64 = 4;
/// Most photos of a store: their number has 24 bits in the cache's keys.
const MAX_PHOTOS: u64 = 1 << 24;

/// The photos of a job, read in windows by any number of threads.
///
/// Decoded tiles are kept within the budget given to [`Self::new`]; beside them each thread that is reading holds
/// at most one more tile and about two tiles of buffers, or [`Self::WINDOW_BYTES`] if photos are read by an index. At
/// most 64 files of each kind are open. A tile is decoded outside any lock; two threads may decode the same one, to the
/// same samples.
#[derive(Debug)]
pub struct PhotoStore {
    /// By photo number; `None` where there is no photo.
    photos: Vec<Option<Slot>>,
    pub(super) files: TileFiles,
    pub(super) indexed: IndexedFiles,
    pub(super) cache: TileCache,
    pub(super) counts: Counts,
}

/// What was done so far.
#[derive(Debug, Default)]
pub(super) struct Counts {
    /// Tiles made.
    pub(super) decoded: AtomicU64,
    /// Tiles found made.
    pub(super) hits: AtomicU64,
    /// Pixels decoded from the photos' own files in windows.
    pub(super) pixels: AtomicU64,
}

/// A photo, and which of its tiles were asked for.
#[derive(Debug)]
struct Slot {
    photo: PreparedPhoto,
    touched: Touched,
}

/// What the tile cache did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CacheStatistics {
    /// Tiles read and decoded.
    pub tiles_decoded: u64,
    /// Tiles found decoded.
    pub tile_hits: u64,
    /// Bytes of tiles held now.
    pub bytes: u64,
    /// Bytes of tiles held at most, never above the budget.
    pub peak_bytes: u64,
    /// Pixels of level 0 in or below the tiles that windows touched, each counted once.
    pub pixels_needed: u64,
    /// Pixels of level 0 that were decoded from the photos' own files, in this run, each as often as it was.
    pub pixels_decoded: u64,
}

impl PhotoStore {
    /// Opens store files: pairs of a photo's number and its file; otherwise like [`Self::new`].
    ///
    /// # Errors
    /// Those of [`PhotoTiles::open`] and of [`Self::new`].
    pub fn open(
        entries: impl IntoIterator<Item = (usize, PathBuf)>,
        cache_bytes: u64,
    ) -> Result<Self> {
        let open = |(number, path): (usize, PathBuf)| {
            Ok((number, PreparedPhoto::tiles(PhotoTiles::open(&path)?)))
        };
        Self::new(entries.into_iter().map(open).collect::<Result<Vec<_>>>()?, cache_bytes)
    }

    /// The photos of a job: pairs of a photo's number and what was prepared. Numbers need not be dense; tiles are
    /// cached in `cache_bytes`, those that were prepared in memory not counted.
    ///
    /// # Errors
    /// [`Error::Limit`] for a number of 2²⁴ or more.
    pub fn new(
        entries: impl IntoIterator<Item = (usize, PreparedPhoto)>,
        cache_bytes: u64,
    ) -> Result<Self> {
        let mut photos = Vec::new();
        for (number, photo) in entries {
            if number as u64 >= MAX_PHOTOS {
                let what = "number of a photo in the store".to_string();
                return Err(Error::Limit { what, limit: MAX_PHOTOS - 1, found: number as u64 });
            }
            if photos.len() <= number {
                photos.resize_with(number + 1, || None);
            }
            photos[number] = Some(Slot { touched: Touched::new(photo.shape), photo });
        }
        Ok(Self {
            photos,
            files: TileFiles::default(),
            cache: TileCache::new(cache_bytes),
            indexed: IndexedFiles::default(),
            counts: Counts::default(),
        })
    }

    /// Whether there is a photo of this number.
    pub fn has(&self, photo: usize) -> bool {
        self.photos.get(photo).is_some_and(Option::is_some)
    }

    /// Number of pyramid levels of a photo.
    ///
    /// # Panics
    /// This and the other properties: if there is no such photo, see [`Self::has`].
    pub fn levels(&self, photo: usize) -> u32 {
        self.photo(photo).shape.levels()
    }

    /// Width and height of a level of a photo; of any level beyond the last, too.
    ///
    /// # Panics
    /// If there is no such photo.
    pub fn level_size(&self, photo: usize, level: u32) -> Size {
        self.photo(photo).shape.level_size(level)
    }

    /// Samples a pixel of a photo: 1 (grey) or 3 (RGB).
    ///
    /// # Panics
    /// If there is no such photo.
    pub fn channels(&self, photo: usize) -> usize {
        self.photo(photo).shape.channels
    }

    /// Bits a sample of a photo: 8 or 16.
    ///
    /// # Panics
    /// If there is no such photo.
    pub fn bits(&self, photo: usize) -> u32 {
        self.photo(photo).shape.bits
    }

    /// What a photo was prepared from; `None` if nothing of it is needed.
    ///
    /// # Panics
    /// If there is no such photo.
    pub fn fingerprint(&self, photo: usize) -> Option<PhotoFingerprint> {
        self.photo(photo).fingerprint()
    }

    fn slot(&self, photo: usize) -> &Slot {
        self.photos.get(photo).and_then(Option::as_ref).expect("a photo of the store")
    }

    pub(super) fn photo(&self, photo: usize) -> &PreparedPhoto {
        &self.slot(photo).photo
    }

    /// What the cache did so far.
    pub fn statistics(&self) -> CacheStatistics {
        let (bytes, peak_bytes) = self.cache.bytes();
        let slots = || self.photos.iter().flatten();
        let in_memory = slots().map(|s| s.photo.memory_bytes()).sum::<u64>();
        CacheStatistics {
            tiles_decoded: self.counts.decoded.load(Ordering::Relaxed),
            tile_hits: self.counts.hits.load(Ordering::Relaxed),
            bytes: bytes + in_memory,
            peak_bytes: peak_bytes + in_memory,
            pixels_needed: slots().map(|s| s.touched.pixels()).sum(),
            pixels_decoded: slots().map(|s| s.photo.pixels_decoded).sum::<u64>()
                + self.counts.pixels.load(Ordering::Relaxed),
        }
    }

    /// The window `rect` of a level of a photo. Where `rect` lies outside of the level, also wholly, the samples
    /// repeat the level's edge.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no such photo, [`Error::Limit`] for a level beyond the last or a window of more
    /// than 2²⁶ pixels, [`Error::Corrupt`] for a damaged tile, [`Error::Io`].
    pub fn window(&self, photo: usize, level: u32, rect: PixelRect) -> Result<Window> {
        let nothing = Samples::U8(Image::from_data(Size::new(0, 0), 1, Vec::new()));
        let mut window = Window { level, rect, samples: nothing };
        self.window_into(photo, level, rect, &mut window)?;
        Ok(window)
    }

    /// Like [`Self::window`], into a window whose memory is used again. After an error its samples mean nothing.
    ///
    /// # Errors
    /// As [`Self::window`].
    pub fn window_into(
        &self,
        photo: usize,
        level: u32,
        rect: PixelRect,
        window: &mut Window,
    ) -> Result<()> {
        let Some(Some(slot)) = self.photos.get(photo) else {
            return Err(Error::usage(format!("photo {photo} is not in the photo store")));
        };
        let size = window_size(&slot.photo, level, rect)?;
        (window.level, window.rect) = (level, rect);
        let nothing = Samples::U8(Image::from_data(Size::new(0, 0), 1, Vec::new()));
        let old = std::mem::replace(&mut window.samples, nothing);
        let Shape { channels, bits, .. } = slot.photo.shape;
        let length = rect.area() * channels;
        window.samples = if bits == 16 {
            let mut out = match old {
                Samples::U16(image) => image.into_data(),
                Samples::U8(_) => Vec::new(),
            };
            out.resize(length, 0);
            self.fill(photo, level, rect, &mut out)?;
            Samples::U16(Image::from_data(size, channels, out))
        } else {
            let mut out = match old {
                Samples::U8(image) => image.into_data(),
                Samples::U16(_) => Vec::new(),
            };
            out.resize(length, 0);
            self.fill(photo, level, rect, &mut out)?;
            Samples::U8(Image::from_data(size, channels, out))
        };
        Ok(())
    }

    /// Gets ready for windows within these rectangles of level 0 of photos: of those that are read by an index, parts
    /// that are not decoded yet are decoded, in pieces as large as may be, because each piece costs a margin. Does nothing
    /// where the cache could not hold all of it beside what other threads need.
    ///
    /// # Errors
    /// As [`Self::window`].
    pub fn prefetch(&self, parts: impl Iterator<Item = (usize, PixelRect)> + Clone) -> Result<()> {
        let side = i64::from(TILE_SIDE);
        let indexed = parts.filter_map(|(photo, rect)| {
            let slot = self.photos.get(photo)?.as_ref()?;
            let inner = rect.intersection(&slot.photo.shape.size.rect());
            (slot.photo.is_indexed() && !inner.is_empty()).then(|| {
                let last = |end: i64| (end - 1) / side + 1;
                let tiles = PixelRect::new(
                    inner.x0 / side,
                    inner.y0 / side,
                    last(inner.x1),
                    last(inner.y1),
                );
                (photo, slot, tiles)
            })
        });
        let bytes = |slot: &Slot, tiles: PixelRect| {
            let samples = tiles.area() as u64 * u64::from(TILE_SIDE).pow(2);
            samples * (slot.photo.shape.channels * slot.photo.shape.sample_bytes()) as u64
        };
        let all: u64 = indexed.clone().map(|(_, slot, tiles)| bytes(slot, tiles)).sum();
        if all > self.cache.budget_bytes() / PREFETCH_SHARE {
            return Ok(());
        }
        for (photo, slot, tiles) in indexed {
            for block in blocks(tiles, slot.photo.block()) {
                self.tiles(photo, 0, block)?;
            }
        }
        Ok(())
    }

    /// Fills `out`, of `rect`'s shape, with samples of a level.
    fn fill<S: TileSample>(
        &self,
        photo: usize,
        level: u32,
        rect: PixelRect,
        out: &mut [S],
    ) -> Result<()> {
        if rect.is_empty() {
            return Ok(());
        }
        let slot = self.slot(photo);
        let shape = slot.photo.shape;
        let frame = Placement::of(rect, shape.level_size(level));
        let side = i64::from(TILE_SIDE);
        let stride = rect.width() * shape.channels;
        if slot.photo.is_indexed() && level > 0 {
            let finest = frame.finest(level, shape.size);
            if finest.area() <= MAX_COARSE_PIXELS {
                let samples = self.coarse(photo, level, finest)?;
                frame.put(&samples, shape.channels, stride, out);
                frame.repeat_edges(out, stride, shape.channels);
                return Ok(());
            }
        }
        let last = |end: i64| (end - 1) / side + 1;
        let inner = frame.inner;
        let tiles =
            PixelRect::new(inner.x0 / side, inner.y0 / side, last(inner.x1), last(inner.y1));
        for block in blocks(tiles, slot.photo.block()) {
            let ids = || tile_ids(level, block);
            ids().for_each(|id| slot.touched.touch(shape.ordinal(id)));
            for (id, tile) in ids().zip(self.tiles(photo, level, block)?) {
                frame.copy(id, S::of(&tile), shape, stride, out);
            }
        }
        frame.repeat_edges(out, stride, shape.channels);
        Ok(())
    }

    /// Samples of a coarser level, halved from the part `finest` of level 0, which begins at a multiple of 2^level and
    /// ends there too, or at the photo's edge. Of a photo that is read by an index the tiles of level 0 around are
    /// likely in the cache, where a whole tile of a coarse level would need many more of them.
    fn coarse<S: TileSample>(&self, photo: usize, level: u32, finest: PixelRect) -> Result<Vec<S>> {
        let channels = self.photo(photo).shape.channels;
        let mut samples = vec![S::default(); finest.area() * channels];
        self.fill(photo, 0, finest, &mut samples)?;
        let mut width = finest.width();
        for _ in 0..level {
            let stride = width * channels;
            let mut halved = Vec::with_capacity(samples.len() / 4 + stride);
            for pair in samples.chunks(2 * stride) {
                average_rows(pair, stride, channels, &mut halved);
            }
            samples = halved;
            width = width.div_ceil(2);
        }
        Ok(samples)
    }
}

/// The size of a window, checked.
fn window_size(photo: &PreparedPhoto, level: u32, rect: PixelRect) -> Result<Size> {
    let last = photo.shape.levels() - 1;
    if level > last {
        let what = format!("{}: pyramid level", photo.path().display());
        return Err(Error::Limit { what, limit: last.into(), found: level.into() });
    }
    if rect.is_empty() {
        return Ok(Size::new(clamped(rect.width()), clamped(rect.height())));
    }
    let pixels = (rect.width() as u64).saturating_mul(rect.height() as u64);
    if pixels > MAX_WINDOW_PIXELS {
        let what = format!("{}: pixels of a window", photo.path().display());
        return Err(Error::Limit { what, limit: MAX_WINDOW_PIXELS, found: pixels });
    }
    Ok(Size::new(clamped(rect.width()), clamped(rect.height())))
}

fn clamped(side: usize) -> u32 {
    u32::try_from(side).unwrap_or(u32::MAX)
}

/// A rectangle of tiles cut into blocks of at most so many columns and rows.
fn blocks(tiles: PixelRect, (columns, rows): (i64, i64)) -> impl Iterator<Item = PixelRect> {
    let step = |side: i64| usize::try_from(side).expect("a block holds a tile");
    (tiles.y0..tiles.y1).step_by(step(rows)).flat_map(move |y| {
        let block = move |x| PixelRect::new(x, y, x + columns, y + rows).intersection(&tiles);
        (tiles.x0..tiles.x1).step_by(step(columns)).map(block)
    })
}
