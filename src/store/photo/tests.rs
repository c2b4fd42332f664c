//! Tests of the store as a whole: photos made here, windows compared with a full decode and a naive pyramid.

use std::path::{Path, PathBuf};

use super::{PhotoFingerprint, PhotoStore, PhotoTiles};
use crate::Error;
use crate::geom::{PixelRect, Size};
use crate::image::{Samples, Window};
use crate::input::photo::{Rows, decode_photo, read_photo_header};

/// A small generator of numbers (Knuth's linear congruence), the same in every run.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn below(&mut self, limit: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }

    pub(super) fn between(&mut self, low: i64, high: i64) -> i64 {
        low + i64::try_from(self.below(u64::try_from(high - low).unwrap())).unwrap()
    }
}

/// Noise over a ramp, as bytes.
fn noise(length: usize, seed: u64) -> Vec<u8> {
    let mut random = Random(seed);
    (0..length).map(|i| u8::try_from((i as u64 / 3 + random.below(90)) % 256).unwrap()).collect()
}

/// Writes a photo of noise, of the kind its extension and the arguments say.
pub(super) fn write_photo(path: &Path, size: Size, colour: image::ExtendedColorType) {
    let bytes = size.area() * u64::from(colour.bits_per_pixel()) / 8;
    let samples = noise(usize::try_from(bytes).unwrap(), size.area());
    image::save_buffer(path, &samples, size.width, size.height, colour).unwrap();
}

/// Builds the store of a photo beside it.
pub(super) fn build(photo: &Path) -> crate::Result<PhotoTiles> {
    let header = read_photo_header(photo)?;
    let fingerprint = PhotoFingerprint::of("photo", photo)?;
    PhotoTiles::build(photo, &header, fingerprint, &photo.with_extension("tiles"))
}

/// A level of a photo, decoded as a whole and reduced pixel by pixel.
pub(super) struct Naive {
    pub(super) size: Size,
    channels: usize,
    samples: Vec<u32>,
}

impl Naive {
    pub(super) fn decode(path: &Path) -> Self {
        let header = read_photo_header(path).unwrap();
        let mut samples = Vec::new();
        decode_photo(path, &header, &mut |rows| {
            match rows {
                Rows::U8(rows) => samples.extend(rows.iter().map(|&s| u32::from(s))),
                Rows::U16(rows) => samples.extend(rows.iter().map(|&s| u32::from(s))),
            }
            Ok(())
        })
        .unwrap();
        Self { size: header.size, channels: header.channels, samples }
    }

    fn at(&self, x: i64, y: i64, channel: usize) -> u32 {
        let x = usize::try_from(x.clamp(0, i64::from(self.size.width) - 1)).unwrap();
        let y = usize::try_from(y.clamp(0, i64::from(self.size.height) - 1)).unwrap();
        self.samples[(y * self.size.width as usize + x) * self.channels + channel]
    }

    pub(super) fn halved(&self) -> Self {
        let (width, height) = (i64::from(self.size.width), i64::from(self.size.height));
        let size = Size::new(self.size.width.div_ceil(2), self.size.height.div_ceil(2));
        let mut samples = Vec::new();
        for y in 0..i64::from(size.height) {
            for x in 0..i64::from(size.width) {
                for channel in 0..self.channels {
                    let (mut sum, mut count) = (0, 0);
                    for (x, y) in [
                        (2 * x, 2 * y),
                        (2 * x + 1, 2 * y),
                        (2 * x, 2 * y + 1),
                        (2 * x + 1, 2 * y + 1),
                    ] {
                        if x < width && y < height {
                            sum += self.at(x, y, channel);
                            count += 1;
                        }
                    }
                    // Half up: floor(mean + ½).
                    samples.push((2 * sum + count) / (2 * count));
                }
            }
        }
        Self { size, channels: self.channels, samples }
    }

    pub(super) fn assert_equals(&self, window: &Window) {
        let rect = window.rect;
        let samples: Vec<u32> = match &window.samples {
            Samples::U8(image) => image.data().iter().map(|&s| s.into()).collect(),
            Samples::U16(image) => image.data().iter().map(|&s| s.into()).collect(),
        };
        assert_eq!(window.samples.channels(), self.channels);
        assert_eq!(window.samples.size().area(), rect.area() as u64);
        let mut at = samples.iter();
        for y in rect.y0..rect.y1 {
            for x in rect.x0..rect.x1 {
                for channel in 0..self.channels {
                    assert_eq!(at.next(), Some(&self.at(x, y, channel)), "{x} {y} in {rect:?}");
                }
            }
        }
    }
}

const KINDS: [(&str, image::ExtendedColorType); 6] = [
    ("grey.png", image::ExtendedColorType::L8),
    ("rgb.png", image::ExtendedColorType::Rgb8),
    ("grey16.png", image::ExtendedColorType::L16),
    ("rgb16.png", image::ExtendedColorType::Rgb16),
    ("grey.jpg", image::ExtendedColorType::L8),
    ("rgb.jpg", image::ExtendedColorType::Rgb8),
];

#[test]
fn a_window_is_what_a_full_decode_shows_at_any_level_and_overhang() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(7);
    for (name, colour) in KINDS {
        let path = folder.path().join(name);
        write_photo(&path, Size::new(613, 421), colour);
        let tiles = build(&path).unwrap();
        let store = PhotoStore::open([(5, tiles.path().to_path_buf())], 1 << 20).unwrap();
        let mut level = Naive::decode(&path);
        let mut window = store.window(5, 0, PixelRect::new(0, 0, 1, 1)).unwrap();
        for number in 0..store.levels(5) {
            assert_eq!(store.level_size(5, number), level.size, "{name}");
            let (width, height) = (i64::from(level.size.width), i64::from(level.size.height));
            for _ in 0..25 {
                let (x, y) = (random.between(-70, width + 40), random.between(-70, height + 40));
                let (w, h) = (random.between(0, 160), random.between(0, 160));
                let rect = PixelRect::new(x, y, x + w, y + h);
                store.window_into(5, number, rect, &mut window).unwrap();
                assert_eq!((window.level, window.rect), (number, rect));
                level.assert_equals(&window);
            }
            let all = PixelRect::new(-3, -2, width + 2, height + 3);
            level.assert_equals(&store.window(5, number, all).unwrap());
            level = level.halved();
        }
    }
}

#[test]
fn the_pyramid_is_the_naive_one_at_odd_sizes() {
    let folder = tempfile::tempdir().unwrap();
    let sizes = [
        (1, 1),
        (3, 1),
        (1, 40),
        (17, 17),
        (16, 300),
        (255, 257),
        (256, 512),
        (513, 259),
        (1031, 33),
    ];
    for (width, height) in sizes {
        for (name, colour) in &KINDS[1..3] {
            let path = folder.path().join(format!("{width}x{height}{name}"));
            write_photo(&path, Size::new(width, height), *colour);
            let store = PhotoStore::open([(0, build(&path).unwrap().path().into())], 0).unwrap();
            let mut level = Naive::decode(&path);
            for number in 0..store.levels(0) {
                level.assert_equals(&store.window(0, number, level.size.rect()).unwrap());
                let is_last = level.size.width <= 16 || level.size.height <= 16;
                assert_eq!(is_last, number + 1 == store.levels(0));
                level = level.halved();
            }
        }
    }
}

#[test]
fn what_is_not_in_the_store_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    write_photo(&path, Size::new(40, 40), image::ExtendedColorType::L8);
    let store = PhotoStore::open([(2, build(&path).unwrap().path().into())], 1 << 20).unwrap();
    let rect = PixelRect::new(0, 0, 4, 4);
    assert!(matches!(store.window(0, 0, rect), Err(Error::Usage(_))));
    assert!(matches!(store.window(9, 0, rect), Err(Error::Usage(_))));
    assert!(matches!(store.window(2, 3, rect), Err(Error::Limit { limit: 2, found: 3, .. })));
    let huge = PixelRect::new(0, 0, 1 << 20, 1 << 20);
    assert!(matches!(store.window(2, 0, huge), Err(Error::Limit { .. })));
    let empty = store.window(2, 0, PixelRect::new(5, 5, 5, 9)).unwrap();
    assert_eq!(empty.samples.size().area(), 0);
    assert!((store.has(2), store.has(0), store.has(3)) == (true, false, false));
}

/// A store file whose every byte can be damaged, and the pixels it should give.
fn small_store() -> (tempfile::TempDir, PathBuf, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let photo = folder.path().join("a.png");
    write_photo(&photo, Size::new(300, 40), image::ExtendedColorType::L8);
    let path = build(&photo).unwrap().path().to_path_buf();
    let bytes = std::fs::read(&path).unwrap();
    (folder, path, bytes)
}

/// All pixels of all levels, or the first error.
fn read_all(path: &Path) -> crate::Result<Vec<Window>> {
    let store = PhotoStore::open([(0, path.to_path_buf())], 1 << 20)?;
    (0..store.levels(0)).map(|l| store.window(0, l, store.level_size(0, l).rect())).collect()
}

#[test]
fn a_flipped_bit_anywhere_in_a_store_file_is_an_error() {
    let (_folder, path, bytes) = small_store();
    assert!(read_all(&path).is_ok());
    let mut random = Random(3);
    let index_end = 64 + 16 * 4;
    let mut positions: Vec<_> = (0..index_end).collect();
    let length = bytes.len() as u64;
    positions.extend((0..400).map(|_| usize::try_from(random.below(length)).unwrap()));
    for at in positions {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << random.below(8);
        std::fs::write(&path, &damaged).unwrap();
        let e = read_all(&path).expect_err("a damaged store gives pixels");
        assert!(matches!(e, Error::Corrupt { .. }), "byte {at}: {e}");
        assert!(e.to_string().contains("a.tiles"), "{e}");
        if (0..index_end).contains(&at) {
            assert!(PhotoTiles::open_checked(&path).is_err(), "byte {at}");
        }
    }
}

#[test]
fn a_store_file_cut_or_lengthened_is_an_error() {
    let (_folder, path, bytes) = small_store();
    for length in (0..bytes.len()).step_by(37).chain([bytes.len() - 1]) {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(matches!(PhotoStore::open([(0, path.clone())], 0), Err(Error::Corrupt { .. })));
    }
    let mut longer = bytes.clone();
    longer.push(0);
    std::fs::write(&path, &longer).unwrap();
    assert!(matches!(PhotoTiles::open(&path), Err(Error::Corrupt { .. })));
    std::fs::write(&path, &bytes).unwrap();
    assert!(PhotoTiles::open_checked(&path).is_ok());
}

#[test]
fn a_file_cut_while_the_store_is_open_is_an_error() {
    let (_folder, path, bytes) = small_store();
    let store = PhotoStore::open([(0, path.clone())], 1 << 20).unwrap();
    std::fs::write(&path, &bytes[..200]).unwrap();
    let e = store.window(0, 0, PixelRect::new(0, 0, 300, 40)).unwrap_err();
    assert!(matches!(e, Error::Corrupt { .. }), "{e}");
}

#[test]
fn a_store_file_replaced_while_the_store_is_open_is_an_error() {
    let (folder, path, _) = small_store();
    let store = PhotoStore::open([(0, path.clone())], 1 << 20).unwrap();
    // The same shape, other pixels.
    let other = folder.path().join("b.png");
    image::save_buffer(&other, &[7; 300 * 40], 300, 40, image::ExtendedColorType::L8).unwrap();
    std::fs::rename(build(&other).unwrap().path(), &path).unwrap();
    let e = store.window(0, 0, PixelRect::new(0, 0, 9, 9)).unwrap_err();
    assert!(e.to_string().contains("expected the photo of the job, found another one"), "{e}");
}

#[test]
fn more_photos_than_files_are_kept_open() {
    let folder = tempfile::tempdir().unwrap();
    let photo = folder.path().join("a.png");
    write_photo(&photo, Size::new(40, 30), image::ExtendedColorType::L8);
    let path = build(&photo).unwrap().path().to_path_buf();
    let store = PhotoStore::open((0..150).map(|i| (i, path.clone())), 0).unwrap();
    let naive = Naive::decode(&photo);
    for number in [0, 149, 3, 0].into_iter().chain(0..150) {
        naive.assert_equals(&store.window(number, 0, PixelRect::new(2, 2, 9, 9)).unwrap());
        assert!(store.files.files.len() <= 64);
    }
    assert_eq!(store.files.files.len(), 64);
}

#[test]
fn a_photo_that_breaks_half_way_leaves_no_store_and_no_rest() {
    let folder = tempfile::tempdir().unwrap();
    let photo = folder.path().join("a.png");
    write_photo(&photo, Size::new(600, 700), image::ExtendedColorType::Rgb8);
    let bytes = std::fs::read(&photo).unwrap();
    std::fs::write(&photo, &bytes[..bytes.len() * 19 / 20]).unwrap();
    let e = build(&photo).unwrap_err();
    assert!(matches!(&e, Error::Corrupt { path, .. } if *path == photo), "{e}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn the_cache_stays_in_its_budget_and_changes_no_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let mut entries = Vec::new();
    let mut naive = Vec::new();
    for (number, (name, colour)) in KINDS[..4].iter().enumerate() {
        let path = folder.path().join(name);
        write_photo(&path, Size::new(1100, 900), *colour);
        entries.push((number, build(&path).unwrap().path().to_path_buf()));
        naive.push(Naive::decode(&path));
    }
    // Nothing fits; one tile of the largest kind fits; some fit; in several parts; all fit.
    for budget in [0, 400 << 10, 3 << 20, 17 << 20, 64 << 20] {
        let store = PhotoStore::open(entries.clone(), budget).unwrap();
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let (store, naive) = (&store, &naive);
                scope.spawn(move || {
                    let mut random = Random(thread);
                    let mut window = store.window(0, 0, PixelRect::new(0, 0, 1, 1)).unwrap();
                    for _ in 0..25 {
                        let photo = usize::try_from(random.below(4)).unwrap();
                        let (x, y) = (random.between(-40, 1090), random.between(-40, 890));
                        let rect = PixelRect::new(x, y, x + 60, y + 50);
                        store.window_into(photo, 0, rect, &mut window).unwrap();
                        naive[photo].assert_equals(&window);
                        assert!(store.statistics().bytes <= budget);
                    }
                });
            }
        });
        let statistics = store.statistics();
        assert!(statistics.peak_bytes <= budget, "{statistics:?}");
        assert!(statistics.tiles_decoded > 0);
        // Whether the room of a single tile serves twice depends on how the threads take turns.
        if budget != 400 << 10 {
            assert_eq!(statistics.tile_hits > 0, budget > 0, "{statistics:?}");
        }
        if budget == 64 << 20 {
            let all = 20 * (1 + 3 + 1 + 3);
            assert!(statistics.tiles_decoded < all, "{statistics:?}");
        }
    }
}

#[test]
fn a_cache_of_one_tile_serves_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    write_photo(&path, Size::new(600, 300), KINDS[3].1);
    let store =
        PhotoStore::open([(0, build(&path).unwrap().path().to_path_buf())], 400 << 10).unwrap();
    for _ in 0..3 {
        store.window(0, 0, PixelRect::new(10, 10, 70, 60)).unwrap();
    }
    let statistics = store.statistics();
    assert_eq!((statistics.tiles_decoded, statistics.tile_hits), (1, 2), "{statistics:?}");
}
