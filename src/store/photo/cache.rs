//! Decoded tiles that were used last, within a budget of bytes, shared by the threads.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::format::TileId;

/// Samples of a tile: `height × width × channels`, row-major, interleaved.
#[derive(Debug, PartialEq)]
pub(super) enum Tile {
    U8(Vec<u8>),
    U16(Vec<u16>),
}

impl Tile {
    /// A tile of so many samples, in the buffer of `old` if that fits; what it holds means nothing yet.
    pub(super) fn of(bits: u32, samples: usize, old: Option<Self>) -> Self {
        match (bits, old) {
            (16, Some(Self::U16(buffer))) if buffer.len() == samples => Self::U16(buffer),
            (16, _) => Self::U16(vec![0; samples]),
            (_, Some(Self::U8(buffer))) if buffer.len() == samples => Self::U8(buffer),
            _ => Self::U8(vec![0; samples]),
        }
    }

    pub(super) fn bytes(&self) -> u64 {
        match self {
            Self::U8(samples) => samples.len() as u64,
            Self::U16(samples) => 2 * samples.len() as u64,
        }
    }
}

/// Samples that tiles hold.
pub(super) trait TileSample: super::codec::Sample {
    fn of(tile: &Tile) -> &[Self];
    fn tile(samples: Vec<Self>) -> Tile;
}

impl TileSample for u8 {
    fn of(tile: &Tile) -> &[Self] {
        match tile {
            Tile::U8(samples) => samples,
            Tile::U16(_) => &[],
        }
    }

    fn tile(samples: Vec<Self>) -> Tile {
        Tile::U8(samples)
    }
}

impl TileSample for u16 {
    fn of(tile: &Tile) -> &[Self] {
        match tile {
            Tile::U16(samples) => samples,
            Tile::U8(_) => &[],
        }
    }

    fn tile(samples: Vec<Self>) -> Tile {
        Tile::U16(samples)
    }
}

/// A tile of a photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Key(u64);

impl Key {
    /// The key of a tile of the photo in this slot: 24 bits for the photo, 6 for the level, 17 for x and for y.
    pub(super) fn new(slot: usize, tile: TileId) -> Self {
        let TileId { level, x, y } = tile;
        Self((slot as u64) << 40 | u64::from(level) << 34 | u64::from(y) << 17 | u64::from(x))
    }

    /// Spreads the keys evenly (Knuth's multiplicative hashing).
    fn shard(self, shards: usize) -> usize {
        let spread = self.0.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32;
        usize::try_from(spread).expect("32 bits") % shards
    }
}

/// Bytes that each part of the cache has at least, so that it holds some tens of tiles.
const MIN_SHARD_BYTES: u64 = 8 << 20;
/// Most parts, each behind a lock of its own.
const MAX_SHARDS: u64 = 16;

/// The tiles used last. Its bytes, with those that threads have reserved for tiles they are decoding, never exceed
/// the budget; a tile that does not fit beside such reservations is handed out, but not kept.
#[derive(Debug)]
pub(super) struct TileCache {
    budget_bytes: u64,
    shards: Vec<Mutex<Shard>>,
}

impl TileCache {
    pub(super) fn new(budget_bytes: u64) -> Self {
        let shards = (budget_bytes / MIN_SHARD_BYTES).clamp(1, MAX_SHARDS);
        let shard = |_| Mutex::new(Shard::new(budget_bytes / shards));
        Self { budget_bytes, shards: (0..shards).map(shard).collect() }
    }

    fn shard(&self, key: Key) -> MutexGuard<'_, Shard> {
        let shard = &self.shards[key.shard(self.shards.len())];
        // A thread that panicked never did so within a change of the list.
        shard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The tile, if it is there; it becomes the most recently used.
    pub(super) fn get(&self, key: Key) -> Option<Arc<Tile>> {
        self.shard(key).get(key)
    }

    /// Makes room for a tile that is about to be decoded.
    pub(super) fn reserve(&self, key: Key, bytes: u64) -> Reservation<'_> {
        let (is_granted, recycled) = self.shard(key).reserve(bytes);
        Reservation { cache: self, key, bytes: if is_granted { bytes } else { 0 }, recycled }
    }

    /// Bytes that it may hold.
    pub(super) fn budget_bytes(&self) -> u64 {
        self.budget_bytes
    }

    /// Bytes held, and the most that were ever held, summed over the parts.
    pub(super) fn bytes(&self) -> (u64, u64) {
        self.shards.iter().fold((0, 0), |(used, peak), shard| {
            let shard = shard.lock().unwrap_or_else(PoisonError::into_inner);
            (used + shard.used_bytes, peak + shard.peak_bytes)
        })
    }
}

/// Room for one tile, given back when dropped without a tile.
#[derive(Debug)]
pub(super) struct Reservation<'a> {
    cache: &'a TileCache,
    key: Key,
    /// Bytes reserved: 0 when there was no room.
    bytes: u64,
    recycled: Option<Tile>,
}

impl Reservation<'_> {
    /// The buffer of a tile of the same length that had to go, if there was one.
    pub(super) fn recycled(&mut self) -> Option<Tile> {
        self.recycled.take()
    }

    /// Keeps the tile in the cache, unless there was no room or another thread was quicker.
    pub(super) fn keep(mut self, tile: Tile) -> Arc<Tile> {
        let tile = Arc::new(tile);
        if self.bytes == 0 {
            return tile;
        }
        let mut shard = self.cache.shard(self.key);
        if let Some(there) = shard.get(self.key) {
            return there;
        }
        debug_assert_eq!(self.bytes, tile.bytes(), "the bytes reserved are the tile's");
        shard.insert(self.key, Arc::clone(&tile), self.bytes);
        self.bytes = 0;
        tile
    }
}

impl Drop for Reservation<'_> {
    fn drop(&mut self) {
        if self.bytes > 0 {
            self.cache.shard(self.key).used_bytes -= self.bytes;
        }
    }
}

/// No entry.
const NONE: usize = usize::MAX;

/// One part of the cache: a map into entries that form a list from the most to the least recently used.
#[derive(Debug)]
struct Shard {
    budget_bytes: u64,
    used_bytes: u64,
    peak_bytes: u64,
    places: HashMap<Key, usize>,
    entries: Vec<Entry>,
    unused: Vec<usize>,
    first: usize,
    last: usize,
}

#[derive(Debug)]
struct Entry {
    key: Key,
    tile: Option<Arc<Tile>>,
    bytes: u64,
    before: usize,
    after: usize,
}

impl Shard {
    fn new(budget_bytes: u64) -> Self {
        Self {
            budget_bytes,
            used_bytes: 0,
            peak_bytes: 0,
            places: HashMap::new(),
            entries: Vec::new(),
            unused: Vec::new(),
            first: NONE,
            last: NONE,
        }
    }

    fn get(&mut self, key: Key) -> Option<Arc<Tile>> {
        let place = *self.places.get(&key)?;
        self.unlink(place);
        self.link_first(place);
        self.entries[place].tile.clone()
    }

    /// Drops the least recently used tiles until `bytes` fit; whether they do, and a buffer of that length.
    fn reserve(&mut self, bytes: u64) -> (bool, Option<Tile>) {
        let mut recycled = None;
        if bytes > self.budget_bytes {
            return (false, None);
        }
        while self.used_bytes + bytes > self.budget_bytes {
            if self.last == NONE {
                return (false, recycled);
            }
            let (tile, length) = self.remove_last();
            if length == bytes && recycled.is_none() {
                recycled = Arc::try_unwrap(tile).ok();
            }
        }
        self.used_bytes += bytes;
        self.peak_bytes = self.peak_bytes.max(self.used_bytes);
        (true, recycled)
    }

    fn remove_last(&mut self) -> (Arc<Tile>, u64) {
        let place = self.last;
        self.unlink(place);
        self.unused.push(place);
        let entry = &mut self.entries[place];
        self.places.remove(&entry.key);
        self.used_bytes -= entry.bytes;
        (entry.tile.take().expect("a linked entry has a tile"), entry.bytes)
    }

    /// Takes a tile whose bytes were reserved.
    fn insert(&mut self, key: Key, tile: Arc<Tile>, bytes: u64) {
        let entry = Entry { key, tile: Some(tile), bytes, before: NONE, after: NONE };
        let place = if let Some(place) = self.unused.pop() {
            self.entries[place] = entry;
            place
        } else {
            self.entries.push(entry);
            self.entries.len() - 1
        };
        self.places.insert(key, place);
        self.link_first(place);
    }

    fn link_first(&mut self, place: usize) {
        self.entries[place].before = NONE;
        self.entries[place].after = self.first;
        match self.first {
            NONE => self.last = place,
            first => self.entries[first].before = place,
        }
        self.first = place;
    }

    fn unlink(&mut self, place: usize) {
        let (before, after) = (self.entries[place].before, self.entries[place].after);
        match before {
            NONE => self.first = after,
            before => self.entries[before].after = after,
        }
        match after {
            NONE => self.last = before,
            after => self.entries[after].before = before,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(x: u32) -> Key {
        Key::new(0, TileId { level: 0, x, y: 0 })
    }

    fn put(cache: &TileCache, x: u32) -> Arc<Tile> {
        let fill = u8::try_from(x).unwrap();
        cache.reserve(key(x), 100).keep(Tile::U8(vec![fill; 100]))
    }

    #[test]
    fn the_tile_unused_for_longest_goes_first() {
        let cache = TileCache::new(300);
        for x in 0..3 {
            put(&cache, x);
        }
        assert!(cache.get(key(0)).is_some());
        put(&cache, 3);
        let there: Vec<_> = (0..4).map(|x| cache.get(key(x)).is_some()).collect();
        assert_eq!(there, [true, false, true, true]);
        assert_eq!(cache.bytes(), (300, 300));
    }

    #[test]
    fn a_buffer_is_used_again_unless_someone_still_reads_it() {
        let cache = TileCache::new(200);
        put(&cache, 0);
        let read = put(&cache, 1);
        assert_eq!(cache.reserve(key(2), 100).recycled(), Some(Tile::U8(vec![0; 100])));
        put(&cache, 3);
        assert_eq!(cache.reserve(key(4), 200).recycled(), None);
        assert_eq!(*read, Tile::U8(vec![1; 100]));
    }

    #[test]
    fn room_that_is_not_used_is_given_back() {
        let cache = TileCache::new(100);
        let first = cache.reserve(key(0), 100);
        // No room beside it: the tile is handed out, but not kept.
        let second = cache.reserve(key(1), 100).keep(Tile::U8(vec![1; 100]));
        assert_eq!(*second, Tile::U8(vec![1; 100]));
        assert!(cache.get(key(1)).is_none());
        drop(first);
        assert_eq!(cache.bytes(), (0, 100));
        put(&cache, 1);
        assert!(cache.get(key(1)).is_some());
    }

    #[test]
    fn of_two_threads_that_decode_a_tile_the_first_one_s_stays() {
        let cache = TileCache::new(1000);
        let (first, second) = (cache.reserve(key(0), 100), cache.reserve(key(0), 100));
        let kept = first.keep(Tile::U8(vec![5; 100]));
        assert!(Arc::ptr_eq(&second.keep(Tile::U8(vec![5; 100])), &kept));
        assert_eq!(cache.bytes(), (100, 200));
    }

    #[test]
    fn keys_of_different_tiles_differ() {
        let mut keys: Vec<_> = [0, 1, (1 << 24) - 1]
            .into_iter()
            .flat_map(|slot| [0, 1, 20].map(|level| (slot, level)))
            .flat_map(|(slot, level)| [0, 1, 4095].map(|x| (slot, level, x)))
            .flat_map(|(slot, level, x)| [0, 1, 4095].map(|y| (slot, TileId { level, x, y })))
            .map(|(slot, tile)| Key::new(slot, tile).0)
            .collect();
        let count = keys.len();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), count);
    }
}
