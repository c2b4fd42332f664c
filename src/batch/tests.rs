//! Jobs killed, split, damaged and joined, and always the same bytes.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use super::{
    Assembly, Manifest, PartReader, PartState, Progress, Run, TileAddress, assemble, completed,
    curve_order, run,
};
use crate::geom::{PixelRect, Size};
use crate::image::Image;
use crate::output::{
    BigTiff, Colour, Compression, Depth, Georeference, Layer, Meaning, Raster, TileFormat,
};
use crate::{Error, Result};

/// 7 × 5 tiles, three overviews, odd edges everywhere.
fn manifest() -> Manifest {
    let format = TileFormat { tile_size: 16, compression: Compression::Deflate };
    let georeference = Georeference { origin_u: 1.5, origin_v: 2.5, pixel_size: 0.01, epsg: None };
    let layers = vec![
        Layer::mosaic(Colour::Grey, Depth::Eight),
        Layer::of(Meaning::Elevation).unwrap(),
        Layer::of(Meaning::Face).unwrap(),
    ];
    Manifest::new(Size::new(103, 69), format, layers, Some(georeference), "a").unwrap()
}

/// Pixels that depend on their place alone.
fn render(manifest: &Manifest, tile: TileAddress) -> Vec<Raster> {
    let rect = manifest.tile_rect(tile);
    vec![
        Raster::U8(image(rect, 2, |x, y| {
            if (x + y) % 3 == 0 { vec![9, 0] } else { vec![(x * x).wrapping_add(y), 255] }
        })),
        Raster::F32(image(rect, 1, |x, y| {
            vec![if y % 5 == 0 { f32::NAN } else { f32::from(x) / f32::from(y) }]
        })),
        Raster::U32(image(rect, 1, |x, y| vec![u32::from(x) * 1000 + u32::from(y)])),
    ]
}

fn image<T: Copy>(rect: PixelRect, channels: usize, pixel: impl Fn(u8, u8) -> Vec<T>) -> Image<T> {
    let mut data = Vec::new();
    for y in rect.y0..rect.y1 {
        for x in rect.x0..rect.x1 {
            data.extend(pixel(u8::try_from(x % 16).unwrap(), u8::try_from(y % 256).unwrap()));
        }
    }
    let side = |n: usize| u32::try_from(n).unwrap();
    Image::from_data(Size::new(side(rect.width()), side(rect.height())), channels, data)
}

/// Tiles rendered, and tiles that were there before.
#[derive(Debug, PartialEq)]
struct Made {
    rendered: usize,
    reused: usize,
}

fn run_tiles(part: &Path, others: &[PathBuf], tiles: &[TileAddress]) -> Result<Made> {
    let manifest = manifest();
    let renderer = |tile| Ok(render(&manifest, tile));
    let summary =
        run(&Run { manifest: &manifest, part, held: None, others, tiles }, &renderer, &|_| Ok(()))?;
    // The three layers of one tile of 16 × 16 pixels at least: 2, 4 and 4 bytes a pixel.
    assert!(summary.rendered < 2 || summary.peak_bytes >= 16 * 16 * 10, "{summary:?}");
    Ok(Made { rendered: summary.rendered, reused: summary.reused })
}

/// The bytes of the three files of some parts.
fn assembled(folder: &Path, parts: &[PathBuf]) -> Result<Vec<Vec<u8>>> {
    let manifest = manifest();
    let outputs = ["a.tif", "a.elevation.tif", "a.face.tif"].map(|n| folder.join(n));
    let big_tiff = BigTiff::IfNeeded;
    let assembly =
        Assembly { manifest: &manifest, parts, outputs: &outputs, beside: &[], big_tiff };
    assemble(&assembly, &|| Ok(()))?;
    Ok(outputs.iter().map(|path| fs::read(path).unwrap()).collect())
}

fn all_tiles() -> Vec<TileAddress> {
    curve_order(&manifest().pyramid())
}

/// A whole part, and the files made of it.
fn reference(folder: &Path) -> (PathBuf, Vec<Vec<u8>>) {
    let part = folder.join("reference.part");
    assert_eq!(run_tiles(&part, &[], &all_tiles()).unwrap(), Made { rendered: 35, reused: 0 });
    let files = assembled(folder, std::slice::from_ref(&part)).unwrap();
    (part, files)
}

pub(super) fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn files_are_the_same_bytes_for_any_threads_and_order() {
    let folder = tempfile::tempdir().unwrap();
    let (_, files) = reference(folder.path());
    let mut rows = all_tiles();
    rows.sort_by_key(|t| (t.y, t.x));
    let backwards: Vec<_> = all_tiles().into_iter().rev().collect();
    for (threads, tiles) in [(1, all_tiles()), (2, rows.clone()), (4, backwards), (7, rows)] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let part = folder.path().join(format!("{threads}.part"));
        pool.install(|| run_tiles(&part, &[], &tiles)).unwrap();
        assert_eq!(assembled(folder.path(), &[part]).unwrap(), files, "{threads} threads");
    }
}

#[test]
fn a_run_killed_at_any_byte_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, files) = reference(folder.path());
    let bytes = fs::read(&whole).unwrap();
    let part = folder.path().join("cut.part");
    let (mut reused, mut cuts) = (Vec::new(), 0);
    for cut in (0..bytes.len()).step_by(bytes.len() / 60).chain([31, 32, 33, bytes.len() - 1]) {
        fs::write(&part, &bytes[..cut]).unwrap();
        let before = completed(&manifest(), &part).unwrap().len();
        let summary = run_tiles(&part, &[], &all_tiles()).unwrap();
        assert_eq!(summary, Made { rendered: 35 - before, reused: before });
        let own = std::slice::from_ref(&part);
        assert_eq!(assembled(folder.path(), own).unwrap(), files, "cut at {cut}");
        reused.push(before);
        cuts += 1;
    }
    // The cuts really went through the job: from nothing to everything.
    assert!(cuts > 60 && reused.contains(&0) && reused.contains(&35));
    reused.dedup();
    assert!(reused.len() > 20, "{reused:?}");
}

#[test]
fn of_an_unfinished_part_nothing_counts_from_the_first_damage_on() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, files) = reference(folder.path());
    let bytes = fs::read(&whole).unwrap();
    let part = folder.path().join("damaged.part");
    let records = PartReader::open(&whole, &manifest()).unwrap();
    let index = usize::try_from(records.records_end()).unwrap();
    for at in (32..index).step_by(index / 40) {
        let mut damaged = bytes[..index].to_vec();
        damaged[at] ^= 0x10;
        fs::write(&part, damaged).unwrap();
        let left = PartReader::open(&part, &manifest()).unwrap();
        assert!(left.len() < records.len() && left.records_end() <= at as u64);
        run_tiles(&part, &[], &all_tiles()).unwrap();
        let own = std::slice::from_ref(&part);
        assert_eq!(assembled(folder.path(), own).unwrap(), files, "damaged at {at}");
    }
}

#[test]
fn damage_in_a_finished_part_is_an_error_that_names_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, _) = reference(folder.path());
    let mut bytes = fs::read(&whole).unwrap();
    bytes[2000] ^= 1;
    fs::write(&whole, bytes).unwrap();
    let e = assembled(folder.path(), &[whole]).unwrap_err();
    assert!(matches!(e, Error::Corrupt { .. }), "{e}");
    assert!(e.to_string().contains("reference.part: byte "), "{e}");
}

#[test]
fn a_finished_part_is_not_touched_again() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, _) = reference(folder.path());
    let before = (fs::read(&whole).unwrap(), fs::metadata(&whole).unwrap().modified().unwrap());
    let summary = run_tiles(&whole, &[], &all_tiles()).unwrap();
    assert_eq!(summary, Made { rendered: 0, reused: 35 });
    let after = (fs::read(&whole).unwrap(), fs::metadata(&whole).unwrap().modified().unwrap());
    assert!(before == after);
}

#[test]
fn batches_cut_anywhere_and_joined_make_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (_, files) = reference(folder.path());
    let tiles = all_tiles();
    let mut parts = Vec::new();
    for (i, batch) in [&tiles[..3], &tiles[3..22], &tiles[22..]].into_iter().enumerate() {
        let part = folder.path().join(format!("{i}.part"));
        run_tiles(&part, &[], batch).unwrap();
        parts.push(part);
    }
    // Full resolution is all there, but no batch could make the overviews between them.
    let e = assembled(folder.path(), &parts).unwrap_err();
    assert!(e.to_string().contains("overviews"), "{e}");
    let join = folder.path().join("join.part");
    let summary = run_tiles(&join, &parts, &tiles).unwrap();
    assert_eq!(summary, Made { rendered: 0, reused: 35 });
    parts.push(join);
    assert_eq!(assembled(folder.path(), &parts).unwrap(), files);
}

#[test]
fn missing_tiles_are_named_and_what_stood_there_stays() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("a.part");
    let tiles: Vec<_> = all_tiles()
        .into_iter()
        .filter(|t| *t != TileAddress { x: 4, y: 2 } && *t != TileAddress { x: 6, y: 0 })
        .collect();
    run_tiles(&part, &[], &tiles).unwrap();
    fs::write(folder.path().join("a.tif"), b"old").unwrap();
    let e = assembled(folder.path(), &[part]).unwrap_err();
    assert_eq!(e.exit_code(), 2);
    let message = e.to_string();
    assert!(message.contains("2 of 35 tiles are missing: (6, 0), (4, 2)"), "{message}");
    assert_eq!(fs::read(folder.path().join("a.tif")).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["a.part", "a.tif"]);
}

#[test]
fn the_first_error_ends_the_run_and_the_next_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let (_, files) = reference(folder.path());
    let part = folder.path().join("a.part");
    let manifest = manifest();
    let tiles = all_tiles();
    let rendered = AtomicUsize::new(0);
    let failing = |tile: TileAddress| {
        if tile == tiles[20] {
            return Err(Error::usage("the photo is gone"));
        }
        rendered.fetch_add(1, Ordering::Relaxed);
        Ok(render(&manifest, tile))
    };
    let job = Run { manifest: &manifest, part: &part, held: None, others: &[], tiles: &tiles };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let e = pool.install(|| run(&job, &failing, &|_| Ok(()))).unwrap_err();
    assert_eq!(e.to_string(), "the photo is gone");
    let rendered = rendered.into_inner();
    assert!((19..35).contains(&rendered), "{rendered}");
    // Not one finished tile is lost.
    assert_eq!(completed(&manifest, &part).unwrap().len(), rendered);
    let PartState::Own(reader) = PartState::of(&part, &manifest).unwrap() else { panic!() };
    assert!(!reader.is_finished());
    let summary = run_tiles(&part, &[], &tiles).unwrap();
    assert_eq!(summary.reused, rendered);
    assert_eq!(assembled(folder.path(), &[part]).unwrap(), files);
}

#[test]
fn a_part_that_cannot_be_written_ends_the_run_with_the_disks_error() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("no such folder").join("a.part");
    let e = run_tiles(&part, &[], &all_tiles()).unwrap_err();
    assert!(matches!(e, Error::Io { .. }) && e.to_string().contains("a.part"), "{e}");
}

#[test]
fn a_part_of_another_job_is_begun_anew_by_a_run_and_refused_by_an_assembly() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, files) = reference(folder.path());
    let own = manifest();
    let layers = own.layers().to_vec();
    let other = Manifest::new(own.size(), own.format(), layers, None, "b").unwrap();
    let part = folder.path().join("other.part");
    let renderer = |tile| Ok(render(&other, tile));
    let job = Run { manifest: &other, part: &part, held: None, others: &[], tiles: &all_tiles() };
    run(&job, &renderer, &|_| Ok(())).unwrap();
    assert!(completed(&own, &part).unwrap().is_empty());
    let parts = [whole, part.clone()];
    assert!(matches!(assembled(folder.path(), &parts), Err(Error::Corrupt { .. })));
    assert_eq!(run_tiles(&part, &[], &all_tiles()).unwrap().rendered, 35);
    assert_eq!(assembled(folder.path(), &[part]).unwrap(), files);
    // What is no part at all is not overwritten.
    let letter = folder.path().join("letter.txt");
    fs::write(&letter, "dear surveyor, this is a letter, not a part file").unwrap();
    assert_eq!(run_tiles(&letter, &[], &all_tiles()).unwrap_err().exit_code(), 2);
}

#[test]
fn progress_counts_every_tile_once_up_to_the_total() {
    let folder = tempfile::tempdir().unwrap();
    let part = folder.path().join("a.part");
    run_tiles(&part, &[], &all_tiles()[..10]).unwrap();
    let manifest = manifest();
    let seen = std::sync::Mutex::new(Vec::new());
    let tiles = all_tiles();
    let job = Run { manifest: &manifest, part: &part, held: None, others: &[], tiles: &tiles };
    let note = |p: Progress| {
        assert_eq!(p.total, 35);
        seen.lock().unwrap().push(p.done);
        Ok(())
    };
    run(&job, &|tile| Ok(render(&manifest, tile)), &note).unwrap();
    let mut seen = seen.into_inner().unwrap();
    seen.sort_unstable();
    assert_eq!(seen, (11..=35).collect::<Vec<_>>());
}
