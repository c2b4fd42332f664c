//! Tests of headers and decoding, on the small photos in `tests/data/photo`.

use std::path::{Path, PathBuf};

use super::{JpegCoding, PhotoFormat, PhotoHeader, Rows, decode_photo, read_photo_header};
use crate::geom::Size;
use crate::{Error, Result};

fn asset(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/photo").join(name)
}

/// All samples of a photo, widened.
fn decode(path: &Path) -> Result<(PhotoHeader, Vec<u16>)> {
    let header = read_photo_header(path)?;
    let mut samples = Vec::new();
    decode_photo(path, &header, &mut |rows| {
        match rows {
            Rows::U8(rows) => samples.extend(rows.iter().map(|&s| u16::from(s))),
            Rows::U16(rows) => samples.extend_from_slice(rows),
        }
        Ok(())
    })?;
    Ok((header, samples))
}

/// Writes bytes to a file of a folder that is deleted with the first value.
fn file_of(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photo.bin");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn decode_bytes(bytes: &[u8]) -> Result<(PhotoHeader, Vec<u16>)> {
    let (_folder, path) = file_of(bytes);
    decode(&path)
}

fn png_bytes(
    (width, height): (u32, u32),
    colour: png::ColorType,
    depth: png::BitDepth,
    data: &[u8],
    palette: Option<&[u8]>,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    if let Some(palette) = palette {
        encoder.set_palette(palette.to_vec());
    }
    encoder.write_header().unwrap().write_image_data(data).unwrap();
    bytes
}

#[test]
fn the_header_tells_size_channels_and_coding_of_a_jpeg() {
    let of = |name| read_photo_header(&asset(name)).unwrap();
    let size = Size::new(45, 37);
    for (name, coding, channels, quarter_coefficients) in [
        ("sequential.jpg", JpegCoding::Sequential, 3, 6),
        ("restarts.jpg", JpegCoding::Sequential, 3, 6),
        ("progressive.jpg", JpegCoding::Progressive, 3, 6),
        ("scans_422.jpg", JpegCoding::SequentialScans, 3, 8),
        ("grey.jpg", JpegCoding::Sequential, 1, 4),
    ] {
        let header = of(name);
        assert_eq!(header.format, PhotoFormat::Jpeg { coding, quarter_coefficients }, "{name}");
        assert_eq!((header.size, header.channels, header.bits), (size, channels, 8), "{name}");
    }
    assert_eq!(of("grey.jpg").file_bytes, 445);
    assert_eq!(of("sequential.jpg").decoded_bytes(), 45 * 37 * 3);
}

#[test]
fn a_jpeg_decodes_as_an_independent_decoder_says() {
    for name in ["sequential", "sequential_422"] {
        let (_, ours) = decode(&asset(&format!("{name}.jpg"))).unwrap();
        let (_, theirs) = decode(&asset(&format!("{name}_by_libjpeg.png"))).unwrap();
        assert_eq!(ours.len(), theirs.len());
        let worst = ours.iter().zip(&theirs).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(4), "{name}: {worst:?}");
        assert!(ours.iter().max() > ours.iter().min().map(|m| m + 200).as_ref());
    }
}

#[test]
fn the_layout_of_the_scans_does_not_change_a_sample() {
    for (name, twin) in [
        ("progressive.jpg", "sequential.jpg"),
        ("restarts.jpg", "sequential.jpg"),
        ("scans_422.jpg", "sequential_422.jpg"),
    ] {
        let (_, samples) = decode(&asset(name)).unwrap();
        let (_, expected) = decode(&asset(twin)).unwrap();
        assert!(samples == expected, "{name}");
    }
}

#[test]
fn scans_that_the_decoder_gets_wrong_are_refused() {
    let e = read_photo_header(&asset("scans_420.jpg")).unwrap_err();
    assert!(matches!(&e, Error::Unsupported { .. }), "{e}");
    assert!(e.to_string().contains("several scans with vertical subsampling"), "{e}");
}

#[test]
fn every_jpeg_cut_short_is_an_error_that_names_the_file() {
    for name in ["sequential.jpg", "progressive.jpg", "restarts.jpg", "scans_422.jpg", "grey.jpg"] {
        let bytes = std::fs::read(asset(name)).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.jpg");
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let e = decode(&path).expect_err(&format!("{name} cut at {length} decodes"));
            assert!(e.to_string().contains("cut.jpg") && e.exit_code() == 2, "{e}");
        }
    }
}

#[test]
fn every_png_cut_short_is_an_error() {
    for name in ["plain.png", "interlaced.png"] {
        let bytes = std::fs::read(asset(name)).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cut.png");
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let e = decode(&path).expect_err(&format!("{name} cut at {length} decodes"));
            assert!(e.to_string().contains("cut.png") && e.exit_code() == 2, "{e}");
        }
    }
}

#[test]
fn a_jpeg_cut_and_closed_is_found_where_it_has_restart_markers() {
    let mut bytes = std::fs::read(asset("restarts.jpg")).unwrap();
    bytes.truncate(bytes.len() * 3 / 4);
    bytes.extend_from_slice(b"\xFF\xD9");
    let e = decode_bytes(&bytes).unwrap_err();
    assert!(e.to_string().contains("restart markers"), "{e}");
}

#[test]
fn a_jpeg_that_lacks_a_component_s_scan_is_an_error() {
    let bytes = std::fs::read(asset("scans_422.jpg")).unwrap();
    let last_scan = bytes.windows(2).rposition(|w| w == b"\xFF\xDA").unwrap();
    let mut cut = bytes[..last_scan].to_vec();
    cut.extend_from_slice(b"\xFF\xD9");
    let e = decode_bytes(&cut).unwrap_err();
    assert!(e.to_string().contains("scans for component 2"), "{e}");
}

#[test]
fn what_follows_the_end_of_a_photo_is_not_looked_at() {
    for name in ["sequential.jpg", "progressive.jpg", "plain.png"] {
        let mut bytes = std::fs::read(asset(name)).unwrap();
        bytes.extend_from_slice(b"\xFF\xD8\xFFgarbage");
        let (_, samples) = decode_bytes(&bytes).unwrap();
        assert!(samples == decode(&asset(name)).unwrap().1, "{name}");
    }
}

#[test]
fn what_is_no_photo_is_named() {
    let message = |bytes: &[u8]| decode_bytes(bytes).unwrap_err().to_string();
    assert!(message(b"").contains("an empty file"));
    assert!(message(b"ply\nformat ascii").contains("found the bytes 70 6C 79 0A"));
    assert!(message(b"\xFF\xD8").contains("found the bytes FF D8"));
    assert!(message(b"II*\0........").contains("byte 774778414: expected 2 bytes, found the end"));
    assert!(
        message(b"8BPS\0\x01").contains("a Photoshop document is not supported (convert it to")
    );
    assert!(message(b"RIFF\0\0\0\0WEBPVP8 ").contains("WebP"));
    assert!(message(b"\0\0\0\x18ftypheic").contains("HEIF"));
    let folder = tempfile::tempdir().unwrap();
    assert!(matches!(read_photo_header(folder.path()), Err(Error::Io { .. })));
    assert_eq!(read_photo_header(&folder.path().join("none.jpg")).unwrap_err().exit_code(), 2);
}

/// A JPEG that ends after its frame header and the beginning of a scan.
fn jpeg_with_frame(marker: u8, precision: u8, size: (u16, u16), components: &[[u8; 3]]) -> Vec<u8> {
    let count = u8::try_from(components.len()).unwrap();
    let mut bytes = vec![0xFF, 0xD8, 0xFF, marker, 0, 8 + 3 * count, precision];
    bytes.extend_from_slice(&size.1.to_be_bytes());
    bytes.extend_from_slice(&size.0.to_be_bytes());
    bytes.push(count);
    bytes.extend(components.iter().flatten());
    bytes.extend_from_slice(&[0xFF, 0xDA, 0, 6 + 2 * count, count]);
    bytes.extend(components.iter().flat_map(|c| [c[0], 0]));
    bytes.extend_from_slice(&[0, 63, 0]);
    bytes
}

#[test]
fn jpegs_of_other_kinds_are_refused_by_name() {
    let message = |marker, precision, components: &[[u8; 3]]| {
        let (_folder, path) = file_of(&jpeg_with_frame(marker, precision, (16, 16), components));
        match read_photo_header(&path) {
            Ok(header) => format!("{header:?}"),
            Err(e) => e.to_string(),
        }
    };
    let colour = [[1, 0x22, 0], [2, 0x11, 1], [3, 0x11, 1]];
    assert!(message(0xC0, 8, &colour).contains("Sequential"));
    assert!(message(0xC0, 12, &colour).contains("12 bits a sample is not supported"));
    assert!(message(0xC3, 8, &colour).contains("lossless"));
    for marker in [0xC9, 0xCA, 0xCC] {
        assert!(message(marker, 8, &colour).contains("an arithmetic-coded JPEG is not supported"));
    }
    for marker in [0xC5, 0xC6, 0xCD, 0xCE] {
        assert!(message(marker, 8, &colour).contains("a hierarchical JPEG is not supported"));
    }
    for marker in [0xC7, 0xCB, 0xCF] {
        assert!(message(marker, 8, &colour).contains("a lossless JPEG is not supported"));
    }
    assert!(
        message(0xC0, 8, &[[1, 0x11, 0]; 4])
            .contains("a CMYK or YCCK JPEG is not supported (convert it to RGB)")
    );
    assert!(message(0xC0, 8, &[[1, 0x11, 0], [2, 0x11, 0]]).contains("2 components"));
    assert!(message(0xC0, 8, &[[1, 0x31, 0], [2, 0x11, 1], [3, 0x11, 1]]).contains("3×1 1×1 1×1"));
    assert!(
        message(0xC0, 8, &[[1, 0x11, 0], [2, 0x22, 1], [3, 0x22, 1]]).contains("not supported")
    );
    assert!(message(0xC0, 8, &[[1, 0x51, 0], [2, 0x11, 1], [3, 0x11, 1]]).contains("from 1 to 4"));
}

#[test]
fn the_largest_jpeg_passes_the_header_and_allocates_nothing() {
    let mut bytes = jpeg_with_frame(0xC0, 8, (65535, 65535), &[[1, 0x11, 0]]);
    let (_folder, path) = file_of(&bytes);
    let e = read_photo_header(&path).unwrap_err();
    assert!(e.to_string().contains("expected at least 8388608 bytes"), "{e}");
    bytes.resize(8 << 20, 0);
    let (_folder, path) = file_of(&bytes);
    assert_eq!(read_photo_header(&path).unwrap().size, Size::new(65535, 65535));
}

#[test]
fn a_png_beyond_the_limits_is_refused_from_its_header() {
    let of = |width: u32, height: u32| {
        let mut bytes = std::fs::read(asset("plain.png")).unwrap();
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        let crc = crc32fast::hash(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        let (_folder, path) = file_of(&bytes);
        read_photo_header(&path)
    };
    let e = of(32768, 32768).unwrap_err();
    assert!(e.to_string().contains("expected at least 4161790 bytes"), "{e}");
    assert!(of(64, 64).is_ok());
    assert!(matches!(of(32769, 32768), Err(Error::Limit { limit: 0x4000_0000, .. })));
    assert!(matches!(of(0x10_0001, 1), Err(Error::Limit { limit: 0x10_0000, .. })));
    assert!(matches!(of(0, 5), Err(Error::Corrupt { .. })));
}

#[test]
fn an_interlaced_png_has_the_samples_of_its_twin_without_alpha() {
    let (header, plain) = decode(&asset("plain.png")).unwrap();
    let (twin, interlaced) = decode(&asset("interlaced.png")).unwrap();
    assert_eq!(header.format, PhotoFormat::Png { interlaced: false });
    assert_eq!(twin.format, PhotoFormat::Png { interlaced: true });
    assert_eq!((header.channels, header.bits, header.size), (3, 8, Size::new(13, 11)));
    assert_eq!(plain[3 * (2 * 13 + 1)..][..3], [33, 17, 193]);
    assert!(plain == interlaced);
}

#[test]
fn every_kind_of_png_becomes_grey_or_rgb() {
    use png::{BitDepth, ColorType};
    let check = |bytes: &[u8], channels, bits, expected: &[u16]| {
        let (header, samples) = decode_bytes(bytes).unwrap();
        assert_eq!((header.channels, header.bits), (channels, bits));
        assert_eq!(samples, expected);
    };
    let one_bit =
        png_bytes((3, 2), ColorType::Grayscale, BitDepth::One, &[0b1010_0000, 0b0110_0000], None);
    check(&one_bit, 1, 8, &[255, 0, 255, 0, 255, 255]);
    let grey_alpha =
        png_bytes((2, 1), ColorType::GrayscaleAlpha, BitDepth::Eight, &[7, 0, 9, 255], None);
    check(&grey_alpha, 1, 8, &[7, 9]);
    let words = [1, 2, 3, 4, 5, 6, 255, 255, 0, 1, 0, 2, 0, 3, 0, 0];
    let rgba16 = png_bytes((2, 1), ColorType::Rgba, BitDepth::Sixteen, &words, None);
    check(&rgba16, 3, 16, &[0x0102, 0x0304, 0x0506, 1, 2, 3]);
    let palette: &[u8] = &[10, 20, 30, 40, 50, 60];
    let indexed = png_bytes((2, 1), ColorType::Indexed, BitDepth::Four, &[0x10], Some(palette));
    check(&indexed, 3, 8, &[40, 50, 60, 10, 20, 30]);
}

#[test]
fn a_damaged_photo_never_gives_samples_of_another_shape() {
    let mut random = 1_u64;
    let mut next = move || {
        random =
            random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(random >> 40).unwrap()
    };
    for name in ["sequential.jpg", "progressive.jpg", "restarts.jpg", "scans_422.jpg", "plain.png"]
    {
        let bytes = std::fs::read(asset(name)).unwrap();
        let mut decoded = 0;
        for _ in 0..600 {
            let mut damaged = bytes.clone();
            for _ in 0..=next() % 3 {
                let at = next() % damaged.len();
                damaged[at] = u8::try_from(next() & 255).unwrap();
            }
            if let Ok((header, samples)) = decode_bytes(&damaged) {
                assert_eq!(samples.len() as u64, header.size.area() * header.channels as u64);
                decoded += 1;
            }
        }
        assert!(decoded < 600, "{name}: no damage was found");
    }
}
