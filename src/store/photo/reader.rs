//! [`PhotoStore`]: windows of the photos of a job.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::build::{PhotoFingerprint, PhotoTiles};
use super::cache::{Key, Tile, TileCache};
use super::codec::Decoder;
use super::files::OpenFiles;
use super::format::{ENTRY_BYTES, Entry, TILE_SIDE, TileId, entry_offset, tile_crc};
use crate::geom::{PixelRect, Size};
use crate::image::{Image, Samples, Window};
use crate::{Error, Result};

/// Most pixels of a window: 2²⁶, which is 192 MiB of RGB. A window serves some blocks of a mosaic tile.
const MAX_WINDOW_PIXELS: u64 = 1 << 26;
/// Most photos of a store: their number has 24 bits in the cache's keys.
const MAX_PHOTOS: u64 = 1 << 24;

/// The photos of a job, read in windows by any number of threads.
///
/// Decoded tiles are kept within the budget given to [`Self::open`]; beside them each thread that is reading holds
/// at most one more tile and about two tiles of buffers. At most 64 files are open. A tile is decoded outside any
/// lock; two threads may decode the same one, to the same samples.
#[derive(Debug)]
pub struct PhotoStore {
    /// By photo number; `None` where there is no photo.
    photos: Vec<Option<PhotoTiles>>,
    pub(super) files: OpenFiles,
    cache: TileCache,
    /// Buffers for reading and decoding, as many as threads have read at the same time.
    scratch: Mutex<Vec<Scratch>>,
    decoded: AtomicU64,
    hits: AtomicU64,
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
}

struct Scratch {
    stored: Vec<u8>,
    decoder: Decoder,
}

impl std::fmt::Debug for Scratch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Scratch").field("stored", &self.stored.capacity()).finish_non_exhaustive()
    }
}

impl PhotoStore {
    /// Opens the store files of a job: pairs of a photo's number and its file. Numbers need not be dense; tiles are
    /// cached in `cache_bytes`.
    ///
    /// # Errors
    /// Those of [`PhotoTiles::open`]; [`Error::Limit`] for a number of 2²⁴ or more.
    pub fn open(
        entries: impl IntoIterator<Item = (usize, PathBuf)>,
        cache_bytes: u64,
    ) -> Result<Self> {
        let mut photos = Vec::new();
        for (number, path) in entries {
            if number as u64 >= MAX_PHOTOS {
                let what = "number of a photo in the store".to_string();
                return Err(Error::Limit { what, limit: MAX_PHOTOS - 1, found: number as u64 });
            }
            if photos.len() <= number {
                photos.resize(number + 1, None);
            }
            photos[number] = Some(PhotoTiles::open(&path)?);
        }
        Ok(Self {
            photos,
            files: OpenFiles::default(),
            cache: TileCache::new(cache_bytes),
            scratch: Mutex::default(),
            decoded: AtomicU64::new(0),
            hits: AtomicU64::new(0),
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
        self.tiles(photo).levels()
    }

    /// Width and height of a level of a photo; of any level beyond the last, too.
    ///
    /// # Panics
    /// If there is no such photo.
    pub fn level_size(&self, photo: usize, level: u32) -> Size {
        self.tiles(photo).shape.level_size(level)
    }

    /// Samples a pixel of a photo: 1 (grey) or 3 (RGB).
    ///
    /// # Panics
    /// If there is no such photo.
    pub fn channels(&self, photo: usize) -> usize {
        self.tiles(photo).channels()
    }

    /// Bits a sample of a photo: 8 or 16.
    ///
    /// # Panics
    /// If there is no such photo.
    pub fn bits(&self, photo: usize) -> u32 {
        self.tiles(photo).bits()
    }

    /// What a photo's store file was made from.
    ///
    /// # Panics
    /// If there is no such photo.
    pub fn fingerprint(&self, photo: usize) -> PhotoFingerprint {
        self.tiles(photo).fingerprint()
    }

    fn tiles(&self, photo: usize) -> &PhotoTiles {
        self.photos.get(photo).and_then(Option::as_ref).expect("a photo of the store")
    }

    /// What the cache did so far.
    pub fn statistics(&self) -> CacheStatistics {
        let (bytes, peak_bytes) = self.cache.bytes();
        CacheStatistics {
            tiles_decoded: self.decoded.load(Ordering::Relaxed),
            tile_hits: self.hits.load(Ordering::Relaxed),
            bytes,
            peak_bytes,
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
        let Some(Some(tiles)) = self.photos.get(photo) else {
            return Err(Error::usage(format!("photo {photo} is not in the photo store")));
        };
        let size = window_size(tiles, level, rect)?;
        (window.level, window.rect) = (level, rect);
        let nothing = Samples::U8(Image::from_data(Size::new(0, 0), 1, Vec::new()));
        let old = std::mem::replace(&mut window.samples, nothing);
        let channels = tiles.channels();
        let length = rect.area() * channels;
        window.samples = if tiles.bits() == 16 {
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
        let shape = self.tiles(photo).shape;
        let channels = shape.channels;
        let frame = Placement::of(rect, shape.level_size(level));
        let side = i64::from(TILE_SIDE);
        let stride = rect.width() * channels;
        for y in frame.inner.y0 / side..=(frame.inner.y1 - 1) / side {
            for x in frame.inner.x0 / side..=(frame.inner.x1 - 1) / side {
                let id = TileId { level, x: tile_index(x), y: tile_index(y) };
                let tile = self.tile(photo, id)?;
                let width = shape.tile_size(id).width as usize * channels;
                let part = PixelRect::new(x * side, y * side, (x + 1) * side, (y + 1) * side)
                    .intersection(&frame.inner);
                let left = offset(part.x0 - x * side) * channels;
                let length = part.width() * channels;
                let rows = S::of(&tile).chunks_exact(width).skip(offset(part.y0 - y * side));
                let to = (frame.top + offset(part.y0 - frame.inner.y0)) * stride
                    + (frame.left + offset(part.x0 - frame.inner.x0)) * channels;
                let out_rows = out[to..].chunks_mut(stride).take(part.height());
                for (row, out_row) in rows.zip(out_rows) {
                    out_row[..length].copy_from_slice(&row[left..left + length]);
                }
            }
        }
        frame.repeat_edges(out, stride, channels);
        Ok(())
    }

    /// A decoded tile, from the cache or the file.
    fn tile(&self, photo: usize, id: TileId) -> Result<Arc<Tile>> {
        let key = Key::new(photo, id);
        if let Some(tile) = self.cache.get(key) {
            self.hits.fetch_add(1, Ordering::Relaxed);
            return Ok(tile);
        }
        self.decoded.fetch_add(1, Ordering::Relaxed);
        let tiles = self.tiles(photo);
        let samples = tiles.shape.tile_samples(id);
        let bytes = samples * tiles.shape.sample_bytes();
        let mut room = self.cache.reserve(key, bytes as u64);
        let mut scratch = self.scratch(&tiles.path)?;
        let tile = if tiles.bits() == 16 {
            let mut buffer = match room.recycled() {
                Some(Tile::U16(buffer)) => buffer,
                _ => vec![0; samples],
            };
            self.read_tile(photo, id, &mut scratch, &mut buffer)?;
            Tile::U16(buffer)
        } else {
            let mut buffer = match room.recycled() {
                Some(Tile::U8(buffer)) => buffer,
                _ => vec![0; samples],
            };
            self.read_tile(photo, id, &mut scratch, &mut buffer)?;
            Tile::U8(buffer)
        };
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).push(scratch);
        Ok(room.keep(tile))
    }

    fn scratch(&self, path: &Path) -> Result<Scratch> {
        if let Some(scratch) = self.scratch.lock().unwrap_or_else(PoisonError::into_inner).pop() {
            return Ok(scratch);
        }
        let decoder = Decoder::new().map_err(|e| Error::io(path, e))?;
        Ok(Scratch { stored: Vec::new(), decoder })
    }

    /// Reads a tile's entry and bytes, checks them, and decodes them into `tile`.
    fn read_tile<S: TileSample>(
        &self,
        photo: usize,
        id: TileId,
        scratch: &mut Scratch,
        tile: &mut [S],
    ) -> Result<()> {
        let tiles = self.tiles(photo);
        let (path, shape) = (&tiles.path, tiles.shape);
        let ordinal = shape.ordinal(id);
        let corrupt = |expected: &str, found: String| {
            let place = format!("tile {} {} of level {}", id.x, id.y, id.level);
            Error::corrupt(path, place, expected, found)
        };
        let read_error = |e: std::io::Error| match e.kind() {
            ErrorKind::UnexpectedEof => corrupt("its bytes", "the end of the file".to_string()),
            _ => Error::io(path, e),
        };
        let file = self.files.get(photo, || tiles.open_again())?;
        let mut bytes = [0; ENTRY_BYTES];
        file.read_exact_at(&mut bytes, entry_offset(ordinal)).map_err(read_error)?;
        let entry = Entry::from_bytes(&bytes);
        let limit = zstd::zstd_safe::compress_bound(std::mem::size_of_val(tile));
        let end = entry.offset.checked_add(entry.length.into());
        if entry.length as usize > limit || end.is_none_or(|end| end > tiles.file_bytes()) {
            let found = format!("{} bytes at {}", entry.length, entry.offset);
            return Err(corrupt("an entry within the file", found));
        }
        scratch.stored.resize(entry.length as usize, 0);
        file.read_exact_at(&mut scratch.stored, entry.offset).map_err(read_error)?;
        if tile_crc(ordinal, &scratch.stored) != entry.crc {
            return Err(corrupt("the checksum of its bytes", "another one".to_string()));
        }
        let width = shape.tile_size(id).width as usize;
        scratch
            .decoder
            .decode(&scratch.stored, width, shape.channels, tile)
            .map_err(|found| corrupt("a Zstandard frame of its samples", found))
    }
}

/// Samples that tiles hold.
trait TileSample: super::codec::Sample {
    fn of(tile: &Tile) -> &[Self];
}

impl TileSample for u8 {
    fn of(tile: &Tile) -> &[Self] {
        match tile {
            Tile::U8(samples) => samples,
            Tile::U16(_) => &[],
        }
    }
}

impl TileSample for u16 {
    fn of(tile: &Tile) -> &[Self] {
        match tile {
            Tile::U16(samples) => samples,
            Tile::U8(_) => &[],
        }
    }
}

/// The size of a window, checked.
fn window_size(tiles: &PhotoTiles, level: u32, rect: PixelRect) -> Result<Size> {
    let last = tiles.levels() - 1;
    if level > last {
        let what = format!("{}: pyramid level", tiles.path.display());
        return Err(Error::Limit { what, limit: last.into(), found: level.into() });
    }
    if rect.is_empty() {
        return Ok(Size::new(clamped(rect.width()), clamped(rect.height())));
    }
    let pixels = (rect.width() as u64).saturating_mul(rect.height() as u64);
    if pixels > MAX_WINDOW_PIXELS {
        let what = format!("{}: pixels of a window", tiles.path.display());
        return Err(Error::Limit { what, limit: MAX_WINDOW_PIXELS, found: pixels });
    }
    Ok(Size::new(clamped(rect.width()), clamped(rect.height())))
}

fn clamped(side: usize) -> u32 {
    u32::try_from(side).unwrap_or(u32::MAX)
}

fn tile_index(index: i64) -> u32 {
    u32::try_from(index).expect("tiles of a level start at 0")
}

fn offset(difference: i64) -> usize {
    usize::try_from(difference).expect("a part begins within its whole")
}

/// Where the part of a window that lies in the level goes.
struct Placement {
    /// The window, each side clamped to the level: at least one pixel.
    inner: PixelRect,
    /// Column and row of the window where `inner` begins.
    left: usize,
    top: usize,
}

impl Placement {
    fn of(rect: PixelRect, size: Size) -> Self {
        let (x0, x1, left) = place(rect.x0, rect.x1, size.width.into());
        let (y0, y1, top) = place(rect.y0, rect.y1, size.height.into());
        Self { inner: PixelRect::new(x0, y0, x1, y1), left, top }
    }

    /// Repeats the outermost columns and rows of `inner`, which is in its place in `out`.
    fn repeat_edges<S: Copy>(&self, out: &mut [S], stride: usize, channels: usize) {
        let (begin, end) = (self.left * channels, (self.left + self.inner.width()) * channels);
        let rows = self.inner.height();
        if begin > 0 || end < stride {
            for row in out.chunks_exact_mut(stride).skip(self.top).take(rows) {
                let (before, rest) = row.split_at_mut(begin);
                let (inner, after) = rest.split_at_mut(end - begin);
                before
                    .chunks_exact_mut(channels)
                    .for_each(|p| p.copy_from_slice(&inner[..channels]));
                let last = &inner[inner.len() - channels..];
                after.chunks_exact_mut(channels).for_each(|p| p.copy_from_slice(last));
            }
        }
        let first = self.top * stride;
        for row in 0..self.top {
            out.copy_within(first..first + stride, row * stride);
        }
        let last = first + (rows - 1) * stride;
        let mut below = last + stride;
        while below < out.len() {
            out.copy_within(last..last + stride, below);
            below += stride;
        }
    }
}

/// A half-open range clamped to `0..length`, keeping one pixel at least, and the position in the range where it goes.
fn place(begin: i64, end: i64, length: i64) -> (i64, i64, usize) {
    let inner_begin = begin.clamp(0, length - 1);
    let inner_end = end.clamp(inner_begin + 1, length);
    let at = inner_begin.saturating_sub(begin).clamp(0, end - begin - 1);
    (inner_begin, inner_end, offset(at))
}
