//! What is written is what independent readers read: GDAL (through rasterio), rio-cogeo and the `tiff` crate, for
//! every layer, compression, size, georeference and flavour of TIFF.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod gdal;

use std::fs;
use std::path::{Path, PathBuf};

use groundel::batch::{Assembly, Manifest, Run, TileAddress, assemble, curve_order, run};
use groundel::geom::{PixelRect, Size};
use groundel::image::Image;
use groundel::output::{
    BigTiff, Colour, Compression, Depth, Georeference, Layer, Meaning, Raster, SampleType,
    TileFormat,
};
use serde_json::{Value, json};

/// A text that XML, TIFF and Unicode each could spoil.
const AWKWARD: &str = "<a href=\"x\">Ä & 'b'</a>\n  kind = \"plane\"  ]]>";

fn hash(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A random number for a sample, the same whatever tile it is in; a third of the pixels are undefined, and so are
/// whole areas, so that overviews have holes too.
fn sample(layer: &Layer, x: i64, y: i64, channel: usize) -> u64 {
    let place = x.cast_unsigned() << 32 | y.cast_unsigned();
    let area = hash((x / 8).cast_unsigned() << 32 | (y / 8).cast_unsigned());
    let undefined = hash(place).is_multiple_of(3) || area.is_multiple_of(5);
    let random = hash(place ^ hash(channel as u64));
    let alpha = channel + 1 == layer.channels();
    match (layer.meaning(), undefined) {
        (Meaning::Mosaic, true) => {
            if alpha {
                0
            } else {
                77 + channel as u64
            }
        }
        (Meaning::Mosaic, false) => {
            if alpha {
                u64::MAX
            } else {
                random
            }
        }
        (Meaning::Coverage, false) => random % 4,
        (_, true) => u64::MAX,
        (_, false) => random,
    }
}

fn pixels<T: Copy>(layer: &Layer, rect: PixelRect, of: impl Fn(u64) -> T) -> Image<T> {
    let mut data = Vec::with_capacity(rect.area() * layer.channels());
    for y in rect.y0..rect.y1 {
        for x in rect.x0..rect.x1 {
            data.extend((0..layer.channels()).map(|c| of(sample(layer, x, y, c))));
        }
    }
    let side = |n: usize| u32::try_from(n).unwrap();
    Image::from_data(Size::new(side(rect.width()), side(rect.height())), layer.channels(), data)
}

/// The lowest bits of a number.
fn low<const N: usize>(v: u64) -> [u8; N] {
    v.to_le_bytes()[..N].try_into().unwrap()
}

fn elevation(v: u64) -> f32 {
    if v == u64::MAX { f32::NAN } else { f32::from(u16::from_le_bytes(low(v))) * 0.01 - 300.0 }
}

fn raster(layer: &Layer, rect: PixelRect) -> Raster {
    match layer.sample() {
        SampleType::U8 => Raster::U8(pixels(layer, rect, |v| low::<1>(v)[0])),
        SampleType::U16 => Raster::U16(pixels(layer, rect, |v| u16::from_le_bytes(low(v)))),
        SampleType::U32 => Raster::U32(pixels(layer, rect, |v| u32::from_le_bytes(low(v)))),
        SampleType::F32 => Raster::F32(pixels(layer, rect, elevation)),
    }
}

fn raw_bytes(raster: &Raster) -> Vec<u8> {
    match raster {
        Raster::U8(i) => i.data().to_vec(),
        Raster::U16(i) => i.data().iter().flat_map(|v| v.to_le_bytes()).collect(),
        Raster::U32(i) => i.data().iter().flat_map(|v| v.to_le_bytes()).collect(),
        Raster::F32(i) => i.data().iter().flat_map(|v| v.to_le_bytes()).collect(),
    }
}

/// The layers of a job: one of the four mosaics, and with the first the six others.
fn layers(mosaic: usize) -> Vec<Layer> {
    let (colour, depth) = [
        (Colour::Rgb, Depth::Eight),
        (Colour::Grey, Depth::Eight),
        (Colour::Rgb, Depth::Sixteen),
        (Colour::Grey, Depth::Sixteen),
    ][mosaic];
    let mut layers = vec![Layer::mosaic(colour, depth)];
    if mosaic == 0 {
        layers.extend(Meaning::ALL.into_iter().filter_map(Layer::of));
    }
    layers.into_iter().map(|l| l.with_item("FRAME", AWKWARD).with_item("N", "1")).collect()
}

struct Case {
    size: Size,
    format: TileFormat,
    georeference: Option<Georeference>,
    big_tiff: BigTiff,
    mosaic: usize,
}

/// Sizes: one pixel; no multiple of anything with three overviews; one that needs overviews by the validator's rule.
fn cases() -> Vec<Case> {
    let place = |origin_u, origin_v, pixel_size, epsg| {
        Some(Georeference { origin_u, origin_v, pixel_size, epsg })
    };
    let settings = [
        (Compression::Deflate, place(-12.345, 0.1 + 0.2, 0.002, None), BigTiff::IfNeeded),
        (Compression::Zstd, place(4e6 / 7.0, 1e7 / 3.0, 0.01, Some(32634)), BigTiff::Always),
        (
            Compression::Lzw,
            place(155_000.07, 463_000.01, 1.0 / 3.0, Some(28992)),
            BigTiff::IfNeeded,
        ),
        (Compression::None, None, BigTiff::IfNeeded),
    ];
    let mut cases = Vec::new();
    for (compression, georeference, big_tiff) in settings {
        for (width, height, tile_size) in [(1, 1, 16), (101, 37, 16), (601, 530, 128)] {
            for mosaic in 0..4 {
                let format = TileFormat { tile_size, compression };
                let size = Size::new(width, height);
                cases.push(Case { size, format, georeference, big_tiff, mosaic });
            }
        }
    }
    cases
}

/// Writes the files of a case and says what each should hold.
fn write(case: &Case, folder: &Path) -> Vec<(Layer, Value)> {
    fs::create_dir(folder).unwrap();
    let layers = layers(case.mosaic);
    let manifest =
        Manifest::new(case.size, case.format, layers.clone(), case.georeference, "test").unwrap();
    let part = folder.join("a.part");
    let tiles = curve_order(&manifest.pyramid());
    let job = Run { manifest: &manifest, part: &part, held: None, others: &[], tiles: &tiles };
    let render = |tile: TileAddress| {
        Ok(layers.iter().map(|l| raster(l, manifest.tile_rect(tile))).collect())
    };
    run(&job, &render, &|_| Ok(())).unwrap();
    let outputs: Vec<PathBuf> =
        layers.iter().map(|l| folder.join(l.meaning().name()).with_extension("tif")).collect();
    let parts = [part];
    let assembly = Assembly {
        manifest: &manifest,
        parts: &parts,
        outputs: &outputs,
        beside: &[],
        big_tiff: case.big_tiff,
    };
    assemble(&assembly, &|| Ok(())).unwrap();
    for (layer, path) in layers.iter().zip(&outputs) {
        check_with_tiff_crate(&manifest, layer, path);
    }
    let expect = |(layer, path): (Layer, &PathBuf)| {
        let whole = raster(&layer, case.size.rect());
        let raw = path.with_extension("raw");
        fs::write(&raw, raw_bytes(&whole)).unwrap();
        let expectation = expectation(case, &layer, path, &raw);
        (layer, expectation)
    };
    layers.into_iter().zip(&outputs).map(expect).collect()
}

fn expectation(case: &Case, layer: &Layer, path: &Path, raw: &Path) -> Value {
    let bits = |v: f64| v.to_le_bytes().map(|b| format!("{b:02x}")).concat();
    let transform = case.georeference.map(|g| [g.origin_u, g.origin_v, g.pixel_size].map(bits));
    json!({
        "path": path, "raw": raw,
        "kind": layer.meaning().name(),
        "dtype": match layer.sample() {
            SampleType::U8 => "uint8",
            SampleType::U16 => "uint16",
            SampleType::U32 => "uint32",
            SampleType::F32 => "float32",
        },
        "channels": layer.channels(),
        "width": case.size.width, "height": case.size.height,
        "tile_size": case.format.tile_size,
        "compression": case.format.compression.name(),
        "nodata": match layer.meaning() {
            Meaning::Mosaic | Meaning::Elevation => None,
            Meaning::Face => Some(4_294_967_295_u32),
            Meaning::Count | Meaning::Used | Meaning::Coverage => Some(255),
            Meaning::Best => Some(65535),
        },
        "transform": transform,
        "epsg": case.georeference.and_then(|g| g.epsg),
        "items": { "FRAME": AWKWARD, "N": "1" },
        "big_tiff": case.big_tiff == BigTiff::Always,
    })
}

/// Compares the tiles of full resolution with the expected samples through the `tiff` crate.
fn check_with_tiff_crate(manifest: &Manifest, layer: &Layer, path: &Path) {
    use tiff::decoder::{Decoder, DecodingResult};
    let mut decoder = Decoder::new(fs::File::open(path).unwrap()).unwrap();
    let pyramid = manifest.pyramid();
    for (i, tile) in (0..).zip(pyramid.level_tiles(0)) {
        let whole = pyramid.tile_pixels(tile).width == manifest.format().tile_size;
        let bytes: Vec<u8> = match decoder.read_chunk(i) {
            Ok(DecodingResult::U8(v)) => v,
            Ok(DecodingResult::U16(v)) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Ok(DecodingResult::U32(v)) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Ok(DecodingResult::F32(v)) => v.iter().flat_map(|v| v.to_le_bytes()).collect(),
            // Palettes are beyond that crate …
            Err(tiff::TiffError::UnsupportedError(_)) if layer.meaning() == Meaning::Coverage => {
                continue;
            }
            // … and when it reads the rows of an LZW tile in two pieces, to drop the second, it may miss the end.
            Err(tiff::TiffError::IoError(_))
                if manifest.format().compression == Compression::Lzw && !whole =>
            {
                continue;
            }
            other => panic!("{}: {tile}: {other:?}", path.display()),
        };
        let want = raw_bytes(&raster(layer, pyramid.tile_rect(tile)));
        assert!(bytes == want, "{}: {tile}", path.display());
    }
}

#[test]
fn independent_readers_read_every_layer_compression_size_and_georeference() {
    let folder = tempfile::tempdir().unwrap();
    let mut expectations = Vec::new();
    for (i, case) in cases().iter().enumerate() {
        for (_, expectation) in write(case, &folder.path().join(i.to_string())) {
            expectations.push(expectation);
        }
    }
    assert_eq!(expectations.len(), 4 * 3 * 10);
    let faults = faults_of(&expectations);
    assert!(faults.iter().all(Vec::is_empty), "{}", faults.concat().join("\n"));
}

/// What GDAL and rio-cogeo find wrong with each file.
fn faults_of(expectations: &[Value]) -> Vec<Vec<String>> {
    let found = gdal::python("check_cog.py", &json!({ "files": expectations }));
    let faults: Vec<Vec<String>> = serde_json::from_value(found).unwrap();
    assert_eq!(faults.len(), expectations.len());
    faults
}

#[test]
fn the_readers_find_each_thing_that_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let cases = cases();
    // 101 × 37: Deflate in the local frame; Zstandard, BigTIFF, in EPSG:32634.
    let local = write(&cases[4], &folder.path().join("local"));
    let projected = write(&cases[16], &folder.path().join("projected"));
    let of = |files: &[(Layer, Value)], meaning: Meaning| {
        files.iter().find(|(l, _)| l.meaning() == meaning).unwrap().1.clone()
    };
    let wrong = |mut expectation: Value, key: &str, value: Value| {
        assert_ne!(expectation[key], value);
        expectation[key] = value;
        expectation
    };
    let mosaic = of(&local, Meaning::Mosaic);
    let nudged = |i: usize| {
        let mut transform = mosaic["transform"].clone();
        let text = transform[i].as_str().unwrap();
        let last = u8::from_str_radix(&text[..2], 16).unwrap() ^ 1;
        transform[i] = format!("{last:02x}{}", &text[2..]).into();
        transform
    };
    // One sample of the last pixel, which only full resolution and, in part, its overview show.
    let altered = folder.path().join("altered.raw");
    let mut bytes = fs::read(mosaic["raw"].as_str().unwrap()).unwrap();
    *bytes.last_mut().unwrap() ^= 255;
    fs::write(&altered, bytes).unwrap();
    let files = vec![
        wrong(mosaic.clone(), "raw", json!(altered)),
        wrong(mosaic.clone(), "transform", nudged(0)),
        wrong(mosaic.clone(), "transform", nudged(1)),
        wrong(mosaic.clone(), "transform", nudged(2)),
        wrong(mosaic.clone(), "epsg", json!(32634)),
        wrong(mosaic.clone(), "items", json!({ "FRAME": "other" })),
        wrong(mosaic.clone(), "compression", json!("lzw")),
        wrong(mosaic.clone(), "tile_size", json!(32)),
        wrong(mosaic.clone(), "big_tiff", json!(true)),
        wrong(of(&local, Meaning::Face), "nodata", json!(0)),
        // The overviews of a mean are not those of a category.
        wrong(of(&local, Meaning::Elevation), "kind", json!("face")),
        wrong(of(&projected, Meaning::Best), "epsg", json!(32635)),
        wrong(of(&projected, Meaning::Count), "transform", Value::Null),
        wrong(of(&projected, Meaning::Used), "kind", json!("coverage")),
    ];
    for (i, faults) in faults_of(&files).iter().enumerate() {
        assert!(!faults.is_empty(), "expectation {i} passed: {}", files[i]);
    }
}
