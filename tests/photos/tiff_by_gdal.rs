//! TIFF photos written by GDAL (libtiff, libjpeg), sample by sample.

use std::path::Path;

use groundel::input::photo::{Rows, decode_photo, read_photo_header};
use serde_json::{Value, json};

use super::gdal::python;

const SIZE: [u32; 2] = [131, 77];

/// A case: samples, bands, creation options, and by how much samples may differ.
fn case(name: &str, dtype: &str, bands: usize, options: &Value, room: u16) -> (Value, u16) {
    let json = json!({
        "name": name, "dtype": dtype, "bands": bands, "size": SIZE, "options": options,
    });
    (json, room)
}

fn cases() -> Vec<(Value, u16)> {
    let mut cases = Vec::new();
    for compress in ["none", "lzw", "deflate", "zstd", "packbits"] {
        for (layout, options) in [
            ("strips", json!({"blockysize": 10})),
            ("one_strip", json!({"blockysize": 77})),
            ("tiles", json!({"tiled": true, "blockxsize": 48, "blockysize": 32})),
        ] {
            for (dtype, bands) in [("uint8", 3), ("uint8", 1), ("uint16", 3), ("uint8", 4)] {
                let mut options = options.clone();
                options["interleave"] = json!("pixel");
                options["compress"] = json!(compress);
                options["photometric"] = json!(if bands < 3 { "minisblack" } else { "rgb" });
                if bands == 4 {
                    options["alpha"] = json!("unspecified");
                }
                if matches!(compress, "lzw" | "deflate" | "zstd") && layout != "one_strip" {
                    options["predictor"] = json!(2);
                }
                let name = format!("{compress}_{layout}_{dtype}_{bands}");
                cases.push(case(&name, dtype, bands, &options, 0));
            }
        }
    }
    let pixel = |mut options: Value| {
        options["interleave"] = json!("pixel");
        options
    };
    let rgb = pixel(json!({"compress": "deflate", "photometric": "rgb", "predictor": 2}));
    for (key, value) in [("BIGTIFF", "YES"), ("ENDIANNESS", "BIG")] {
        let mut options = rgb.clone();
        options[key] = json!(value);
        cases.push(case(key, "uint16", 3, &options, 0));
    }
    cases.push(case("white_is_zero", "uint8", 1, &json!({"photometric": "miniswhite"}), 0));
    let jpeg = pixel(json!({"compress": "jpeg", "jpeg_quality": 95, "photometric": "rgb"}));
    cases.push(case("jpeg_rgb", "uint8", 3, &jpeg, 4));
    let mut ycbcr = pixel(json!({"compress": "jpeg", "jpeg_quality": 95}));
    ycbcr["photometric"] = json!("ycbcr");
    cases.push(case("jpeg_ycbcr", "uint8", 3, &ycbcr, 8));
    let mut tiled = ycbcr.clone();
    (tiled["tiled"], tiled["blockxsize"], tiled["blockysize"]) =
        (json!(true), json!(64), json!(32));
    cases.push(case("jpeg_ycbcr_tiles", "uint8", 3, &tiled, 8));
    let grey = json!({"compress": "jpeg", "jpeg_quality": 95, "photometric": "minisblack"});
    cases.push(case("jpeg_grey", "uint8", 1, &grey, 4));
    cases
}

/// The raw samples of a case, without the bands that are dropped, widened.
fn raw(folder: &Path, case: &Value, kept: usize) -> Vec<u16> {
    let name = case["name"].as_str().unwrap();
    let bytes = std::fs::read(folder.join(format!("{name}.raw"))).unwrap();
    let all: Vec<u16> = if case["dtype"] == "uint16" {
        bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect()
    } else {
        bytes.into_iter().map(u16::from).collect()
    };
    let bands = usize::try_from(case["bands"].as_u64().unwrap()).unwrap();
    let inverted = |s: u16| if name == "white_is_zero" { 255 - s } else { s };
    all.chunks_exact(bands).flat_map(|p| p[..kept].iter().map(|&s| inverted(s))).collect()
}

#[test]
fn tiffs_written_by_gdal_read_as_gdal_reads_them() {
    let folder = tempfile::tempdir().unwrap();
    let cases = cases();
    let all: Vec<_> = cases.iter().map(|(case, _)| case).collect();
    python("write_tiffs.py", &json!({"folder": folder.path(), "cases": all}));
    for (case, room) in &cases {
        let name = case["name"].as_str().unwrap();
        let path = folder.path().join(format!("{name}.tif"));
        let header = read_photo_header(&path).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!([header.size.width, header.size.height], SIZE, "{name}");
        let mut samples = Vec::new();
        let decoded = decode_photo(&path, &header, &mut |rows| {
            match rows {
                Rows::U8(rows) => samples.extend(rows.iter().map(|&s| u16::from(s))),
                Rows::U16(rows) => samples.extend_from_slice(rows),
            }
            Ok(())
        });
        decoded.unwrap_or_else(|e| panic!("{e}"));
        let want = raw(folder.path(), case, header.channels);
        assert_eq!(samples.len(), want.len(), "{name}");
        let differences = samples.iter().zip(&want).map(|(a, b)| a.abs_diff(*b));
        let (worst, sum) =
            differences.fold((0, 0), |(worst, sum), d| (d.max(worst), sum + u64::from(d)));
        // Decoders of JPEG differ a little, most where chrominance is upsampled.
        let mean = sum as f64 / samples.len() as f64;
        assert!(worst <= *room && mean < 0.6, "{name}: {worst}, {mean} on average");
    }
}
