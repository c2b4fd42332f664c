//! Windows of JPEGs made here, compared with the full decode.

use std::path::{Path, PathBuf};

use super::super::tests::{Naive, Random};
use super::super::{Demand, PhotoSource, PhotoStore, Preparation, Reading, prepare_photos};
use super::frame::{DC_CODES, DC_COUNTS};
use crate::geom::{PixelRect, Size};
use crate::input::photo::{decode_photo, read_photo_header};

/// How a test JPEG is coded.
#[derive(Debug, Clone, Copy)]
struct Coding {
    size: Size,
    /// Factors across and down of brightness; empty: grey.
    factors: Option<(u32, u32)>,
    restart: u32,
    /// The transform of an Adobe segment.
    adobe: Option<u8>,
    marker: u8,
    /// Fill bytes before markers.
    fill: bool,
    seed: u64,
}

const PLAIN: Coding = Coding {
    size: Size { width: 611, height: 403 },
    factors: Some((2, 2)),
    restart: 0,
    adobe: None,
    marker: 0xC0,
    fill: false,
    seed: 1,
};

/// Bits to bytes, an FF stuffed.
#[derive(Default)]
struct Bits {
    out: Vec<u8>,
    byte: u8,
    count: u32,
}

impl Bits {
    fn put(&mut self, value: u64, bits: u32) {
        for k in (0..bits).rev() {
            self.byte = self.byte << 1 | u8::from(value >> k & 1 == 1);
            self.count += 1;
            if self.count == 8 {
                self.out.push(self.byte);
                if self.byte == 0xFF {
                    self.out.push(0);
                }
                (self.byte, self.count) = (0, 0);
            }
        }
    }

    fn align(&mut self) {
        while self.count > 0 {
            self.put(1, 1);
        }
    }
}

/// AC codes of 8 bits for every run and magnitude, but those that would be all ones: runs to 15, magnitudes to 10.
const AC_COUNT: u8 = 162;

fn ac_values() -> Vec<u8> {
    let values = (0..16_u8).flat_map(|run| (1..=10).map(move |size| run << 4 | size));
    [0x00, 0xF0].into_iter().chain(values).collect()
}

fn segment(out: &mut Vec<u8>, coding: &Coding, code: u8, payload: &[u8]) {
    if coding.fill {
        out.extend([0xFF; 3]);
    }
    out.extend([0xFF, code]);
    out.extend(u16::try_from(payload.len() + 2).unwrap().to_be_bytes());
    out.extend(payload);
}

/// A JPEG of random coefficients, valid in every bit.
fn jpeg(coding: &Coding) -> Vec<u8> {
    let mut random = Random(coding.seed);
    let (width, height) = (coding.size.width, coding.size.height);
    let (across, down) = coding.factors.unwrap_or((1, 1));
    let colours = if coding.factors.is_some() { 3_u8 } else { 1 };
    let mut out = vec![0xFF, 0xD8];
    if let Some(transform) = coding.adobe {
        segment(&mut out, coding, 0xEE, &[b"Adobe\0d\0\0\0\0".as_slice(), &[transform]].concat());
    }
    segment(&mut out, coding, 0xFE, b"a comment");
    let quantisation: Vec<u8> = [0].into_iter().chain((0..64).map(|k| 3 + k / 4)).collect();
    segment(&mut out, coding, 0xDB, &quantisation);
    let side = |side: u32| u16::try_from(side).unwrap().to_be_bytes();
    let mut frame = [&[8][..], &side(height), &side(width), &[colours]].concat();
    for id in 1..=colours {
        let factors = if id == 1 { across << 4 | down } else { 0x11 };
        frame.extend([id, u8::try_from(factors).unwrap(), 0]);
    }
    segment(&mut out, coding, coding.marker, &frame);
    let dc: Vec<u8> = (0..13).collect();
    segment(&mut out, coding, 0xC4, &[&[0][..], &DC_COUNTS, &dc].concat());
    let mut counts = [0; 16];
    counts[7] = AC_COUNT;
    segment(&mut out, coding, 0xC4, &[&[0x10][..], &counts, &ac_values()].concat());
    if coding.restart > 0 {
        segment(&mut out, coding, 0xDD, &side(coding.restart));
    }
    let mut scan = vec![colours];
    (1..=colours).for_each(|id| scan.extend([id, 0]));
    scan.extend([0, 63, 0]);
    segment(&mut out, coding, 0xDA, &scan);
    let units = width.div_ceil(8 * across) * height.div_ceil(8 * down);
    let mut bits = Bits::default();
    let mut last = [0_i32; 3];
    for unit in 0..units {
        if coding.restart > 0 && unit > 0 && unit.is_multiple_of(coding.restart) {
            bits.align();
            bits.out.extend(if coding.fill { &[0xFF, 0xFF][..] } else { &[0xFF] });
            bits.out.push(0xD0 + u8::try_from((unit / coding.restart - 1) % 8).unwrap());
            last = [0; 3];
        }
        for (colour, last) in last.iter_mut().take(colours.into()).enumerate() {
            let blocks = if colour == 0 { across * down } else { 1 };
            (0..blocks).for_each(|_| block(&mut bits, &mut random, last));
        }
    }
    bits.align();
    out.extend(bits.out);
    out.extend([0xFF, 0xD9]);
    out
}

/// A block: brightness near the one before, a few coefficients.
fn block(bits: &mut Bits, random: &mut Random, last: &mut i32) {
    let signed = |v: u64| i32::try_from(v).unwrap();
    let value = (*last + signed(random.below(61)) - 30).clamp(-250, 250);
    put_dc(bits, value - std::mem::replace(last, value));
    let mut place = 1;
    for _ in 0..random.below(12) {
        let longest = if random.below(4) == 0 { 40 } else { 4 };
        let run = random.below(longest);
        if place + run > 63 {
            break;
        }
        place += run + 1;
        (0..run / 16).for_each(|_| bits.put(1, 8));
        let greatest = if random.below(9) == 0 { 10 } else { 4 };
        let size = 1 + random.below(greatest);
        bits.put(2 + (run % 16) * 10 + size - 1, 8);
        bits.put(random.below(1 << size), u32::try_from(size).unwrap());
    }
    if place < 64 {
        bits.put(0, 8);
    }
}

fn put_dc(bits: &mut Bits, difference: i32) {
    let size = 32 - difference.unsigned_abs().leading_zeros();
    let (code, length) = DC_CODES[size as usize];
    bits.put(code, length);
    let value = if difference < 0 { difference - 1 } else { difference };
    bits.put(u64::from(value.cast_unsigned()) & ((1 << size) - 1), size);
}

/// Prepares a photo by an index, if it has one; how it is read, or why it is left out.
fn prepare(path: &Path) -> Result<(PhotoStore, bool), String> {
    let folder = path.with_extension("store");
    let source = PhotoSource {
        name: "a".into(),
        path: path.to_path_buf(),
        expected: None,
        demand: Some(Demand::ALL),
    };
    let preparation = Preparation {
        folder: &folder,
        budget_bytes: 1 << 30,
        beside_bytes: 0,
        threads: 1,
        memory_bytes: 0,
        reading: Reading::Index,
    };
    let ready = prepare_photos(&[source], &preparation, &|_| Ok(())).unwrap().remove(0);
    let ready = ready.map_err(|left_out| left_out.reason.to_string())?;
    let is_indexed = ready.is_indexed();
    Ok((PhotoStore::new([(0, ready)], 1 << 20).unwrap(), is_indexed))
}

/// Compares windows of all levels with the full decode.
fn compare(path: &Path, store: &PhotoStore, random: &mut Random, windows: u32) {
    let mut level = Naive::decode(path);
    for number in 0..store.levels(0) {
        let (width, height) = (i64::from(level.size.width), i64::from(level.size.height));
        for _ in 0..windows {
            let (x, y) = (random.between(-20, width), random.between(-20, height));
            let (w, h) = (random.between(1, 300), random.between(1, 300));
            let rect = PixelRect::new(x, y, x + w, y + h);
            level.assert_equals(&store.window(0, number, rect).unwrap());
        }
        level.assert_equals(&store.window(0, number, level.size.rect()).unwrap());
        level = level.halved();
    }
}

fn write(folder: &Path, coding: &Coding) -> PathBuf {
    let path = folder.join("a.jpg");
    std::fs::write(&path, jpeg(coding)).unwrap();
    path
}

#[test]
fn windows_of_every_sampling_restart_interval_and_size_are_those_of_a_full_decode() {
    let mut random = Random(3);
    let factors = [(1, 1), (2, 1), (1, 2), (2, 2), (4, 1), (1, 4), (4, 2), (2, 4), (4, 4)];
    let sizes = [(611, 403), (512, 256), (257, 259), (1, 1), (7, 300), (300, 5), (273, 17)];
    let mut number = 0;
    for factors in factors.map(Some).into_iter().chain([None]) {
        for (width, height) in sizes {
            for restart in [0, 1, 7, 16, 40] {
                number += 1;
                // Every size with some restart interval, every interval with some size.
                if number % 3 != 0 && (width, height) != (611, 403) {
                    continue;
                }
                let size = Size::new(width, height);
                let seed = random.below(1 << 20);
                let marker = if number % 2 == 0 { 0xC0 } else { 0xC1 };
                let fill = number % 5 == 0;
                let coding = Coding { size, factors, restart, marker, fill, seed, ..PLAIN };
                let folder = tempfile::tempdir().unwrap();
                let path = write(folder.path(), &coding);
                let (store, is_indexed) = prepare(&path).unwrap();
                assert!(is_indexed, "{coding:?}");
                compare(&path, &store, &mut random, 3);
            }
        }
    }
}

#[test]
fn the_colours_that_an_adobe_segment_tells_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    for adobe in [None, Some(1)] {
        let path = write(folder.path(), &Coding { adobe, ..PLAIN });
        let (store, is_indexed) = prepare(&path).unwrap();
        assert!(is_indexed);
        compare(&path, &store, &mut Random(4), 2);
    }
}

#[test]
fn single_tiles_in_any_order_and_a_small_cache_change_no_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), &Coding { size: Size::new(1100, 900), ..PLAIN });
    let (store, _) = prepare(&path).unwrap();
    let naive = Naive::decode(&path);
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let (store, naive) = (&store, &naive);
            scope.spawn(move || {
                let mut random = Random(thread);
                for _ in 0..40 {
                    let (x, y) = (random.between(-40, 1090), random.between(-40, 890));
                    let rect = PixelRect::new(x, y, x + 60, y + 50);
                    naive.assert_equals(&store.window(0, 0, rect).unwrap());
                }
            });
        }
    });
    let found = store.statistics();
    assert!(found.peak_bytes <= 1 << 20, "{found:?}");
    assert_eq!(found.pixels_needed, 1100 * 900);
    assert!(found.pixels_decoded >= found.pixels_needed, "{found:?}");
}

#[test]
fn an_index_is_small_is_used_again_and_is_made_again_when_it_does_not_match() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), &PLAIN);
    prepare(&path).unwrap();
    let files = || {
        let all = std::fs::read_dir(path.with_extension("store")).unwrap();
        all.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "index"))
    };
    let index = files().next().unwrap();
    assert_eq!(
        (files().count(), std::fs::read_dir(path.with_extension("store")).unwrap().count()),
        (1, 2)
    );
    let written = std::fs::read(&index).unwrap();
    let age = || std::fs::metadata(&index).unwrap().modified().unwrap();
    let before = age();
    prepare(&path).unwrap();
    assert_eq!(age(), before, "it was made again");
    let mut damaged: Vec<Vec<u8>> = vec![written[..written.len() - 1].to_vec(), Vec::new()];
    for at in (0..written.len()).step_by(97).chain([9, 60, 120, written.len() - 1]) {
        let mut bytes = written.clone();
        bytes[at] ^= 8;
        damaged.push(bytes);
    }
    for bytes in damaged {
        std::fs::write(&index, bytes).unwrap();
        assert!(prepare(&path).unwrap().1);
        assert_eq!(std::fs::read(&index).unwrap(), written);
    }
}

#[test]
fn a_photo_or_an_index_that_changes_while_it_is_read_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), &PLAIN);
    let rect = PixelRect::new(0, 0, 9, 9);
    let (store, _) = prepare(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
    let e = store.window(0, 0, rect).unwrap_err().to_string();
    assert!(e.contains("a.jpg") && e.contains("as it was when its index was made"), "{e}");
    // The same length and time, other bits.
    let path = write(folder.path(), &Coding { seed: 2, ..PLAIN });
    let (store, _) = prepare(&path).unwrap();
    store.window(0, 0, rect).unwrap();
    let file = std::fs::File::options().write(true).open(&path).unwrap();
    file.set_len(500).unwrap();
    let e = store.window(0, 0, PixelRect::new(500, 300, 600, 400)).unwrap_err().to_string();
    assert!(e.contains("a.jpg"), "{e}");
}

#[test]
fn what_an_index_takes_the_full_decode_takes_too_and_shows_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(77);
    let (mut taken, mut refused) = (0, 0);
    for round in 0..600 {
        let size = Size::new(90, 70);
        let restart = [0, 3][round % 2];
        let mut bytes = jpeg(&Coding { size, restart, seed: 5, ..PLAIN });
        let at = usize::try_from(random.below(bytes.len() as u64)).unwrap();
        match random.below(4) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes.truncate(at),
            2 => drop(bytes.remove(at)),
            _ => bytes.insert(at, u8::try_from(random.below(256)).unwrap()),
        }
        let path = folder.path().join(format!("{round}.jpg"));
        std::fs::write(&path, &bytes).unwrap();
        let Ok(header) = read_photo_header(&path) else { continue };
        let decoded = decode_photo(&path, &header, &mut |_| Ok(()));
        match (prepare(&path), decoded) {
            (Ok((store, is_indexed)), Ok(())) => {
                taken += u32::from(is_indexed);
                compare(&path, &store, &mut random, 2);
            }
            (Err(_), Err(_)) => refused += 1,
            (ours, decoded) => panic!("{round}: {:?} {decoded:?}", ours.map(|o| o.1)),
        }
        std::fs::remove_dir_all(path.with_extension("store")).unwrap();
    }
    assert!(taken > 50 && refused > 50, "{taken} {refused}");
}

#[test]
fn files_open_stay_few() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), &Coding { size: Size::new(40, 30), ..PLAIN });
    let folder = path.with_extension("store");
    let demand = Some(Demand::ALL);
    let source =
        |k: usize| PhotoSource { name: k.to_string(), path: path.clone(), expected: None, demand };
    let sources: Vec<_> = (0..80).map(source).collect();
    let preparation = Preparation {
        folder: &folder,
        budget_bytes: 1 << 30,
        beside_bytes: 0,
        threads: 2,
        memory_bytes: 0,
        reading: Reading::Index,
    };
    let ready = prepare_photos(&sources, &preparation, &|_| Ok(())).unwrap();
    let store = PhotoStore::new(ready.into_iter().map(Result::unwrap).enumerate(), 0).unwrap();
    (0..80).for_each(|k| drop(store.window(k, 0, PixelRect::new(0, 0, 9, 9)).unwrap()));
    assert_eq!(store.indexed.open_count(), 64);
}

#[test]
fn a_point_of_a_coarse_level_is_made_of_the_pixels_around_it_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), &Coding { size: Size::new(3000, 2200), ..PLAIN });
    let mut full = Naive::decode(&path);
    for level in 1..=6 {
        full = full.halved();
        let (store, is_indexed) = prepare(&path).unwrap();
        assert!(is_indexed);
        // The taps of one bicubic sample, near a corner.
        let window = store.window(0, level, PixelRect::new(3, 3, 7, 7)).unwrap();
        full.assert_equals(&window);
        // Four pixels a side, grown to whole tiles of 256 and a margin.
        let side = (4_u64 << level) + 2 * 256 + 64;
        let decoded = store.statistics().pixels_decoded;
        assert!(decoded > 0 && decoded <= side * side, "level {level}: {decoded}");
        assert!(decoded < 3000 * 2200 / 2, "level {level}: {decoded}");
    }
}
