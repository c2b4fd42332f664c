//! Photos of several formats, depths and numbers of channels in one job. The format is told by the content, so that
//! the photos keep the names that the cameras know them by.

use std::fs::File;
use std::path::Path;

use groundel::geom::Size;
use groundel::image::{Image, Samples};
use groundel::synthetic::{scenes, write_picture};
use tiff::encoder::{Compression, DeflateLevel, TiffEncoder, colortype};

use super::command::{done, layer, ortho, photo, project, said, samples};

/// Bytes of 16-bit numbers that are the upper half of each.
fn grey(rgb: &[u16]) -> Vec<u8> {
    rgb.chunks_exact(3).map(|p| u8::try_from((p[0] + p[1] + p[2]) / 3).unwrap()).collect()
}

/// Writes a picture under a name that ends in another format's ending.
fn write_as(path: &Path, ending: &str, picture: &Samples) {
    let own = path.with_extension(ending);
    write_picture(&own, picture).unwrap();
    std::fs::rename(own, path).unwrap();
}

/// Makes the scene's five photos a grey 8-bit PNG, a 16-bit RGB PNG, a JPEG, an 8-bit RGB TIFF with LZW and a 16-bit
/// grey TIFF with Deflate.
fn mix(paths: &[std::path::PathBuf]) {
    for (k, path) in paths.iter().enumerate() {
        let (size, channels, bits, rgb) = photo(path);
        assert_eq!((channels, bits), (3, 8));
        let narrow: Vec<u8> = rgb.iter().map(|&s| u8::try_from(s).unwrap()).collect();
        // Not only multiples of 257.
        let wide: Vec<u16> = rgb.iter().zip((0..200).cycle()).map(|(&s, k)| s * 256 + k).collect();
        let Size { width, height } = size;
        let encoder = || TiffEncoder::new(File::create(path).unwrap()).unwrap();
        match k {
            0 => write_as(path, "png", &Samples::U8(Image::from_data(size, 1, grey(&rgb)))),
            1 => write_as(path, "png", &Samples::U16(Image::from_data(size, 3, wide))),
            2 => write_as(path, "jpg", &Samples::U8(Image::from_data(size, 3, narrow))),
            3 => encoder()
                .with_compression(Compression::Lzw)
                .write_image::<colortype::RGB8>(width, height, &narrow)
                .unwrap(),
            _ => {
                let wide: Vec<u16> = wide.chunks_exact(3).map(|p| p[1]).collect();
                encoder()
                    .with_compression(Compression::Deflate(DeflateLevel::Fast))
                    .write_image::<colortype::Gray16>(width, height, &wide)
                    .unwrap();
            }
        }
    }
}

/// Writes every photo again as a 16-bit RGB PNG: grey three times, 8 bit × 257.
fn widen(paths: &[std::path::PathBuf]) {
    for path in paths {
        let (size, channels, bits, samples) = photo(path);
        let gain = if bits == 8 { 257 } else { 1 };
        let wide: Vec<u16> = samples
            .chunks_exact(channels)
            .flat_map(|p| (0..3).map(move |c| p[c % channels] * gain))
            .collect();
        write_as(path, "png", &Samples::U16(Image::from_data(size, 3, wide)));
    }
}

#[test]
fn grey_and_colour_8_and_16_bit_jpeg_png_and_tiff_make_one_mosaic() {
    let test = scenes::columns();
    let folder = project(&test);
    let photos: Vec<_> =
        test.shots.iter().map(|s| folder.path().join("photos").join(&s.name)).collect();
    mix(&photos);
    let kinds: Vec<_> = photos.iter().map(|p| photo(p)).map(|(_, c, b, _)| (c, b)).collect();
    assert_eq!(kinds, [(1, 8), (3, 16), (3, 8), (3, 8), (1, 16)]);
    let flags = ["--colour", "paper", "--outliers", "none", "--pixel-size", "0.004"];
    let mixed = done(folder.path(), "mixed", &flags);
    widen(&photos);
    let wide = done(folder.path(), "wide", &flags);
    let ((found, bits), (expected, _)) = (samples(&mixed), samples(&wide));
    assert_eq!((bits, found.len()), (16, 4 * 630 * 485));
    // Interpolated before or after the factor of 257: another rounding at most.
    let worst = found.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(worst <= Some(1), "{worst:?}");
    assert!(samples(&layer(&mixed, "count")) == samples(&layer(&wide, "count")));
    assert!(found.iter().max() > Some(&40_000));
}

#[test]
fn grey_photos_alone_make_a_grey_mosaic() {
    let test = scenes::columns();
    let folder = project(&test);
    for shot in &test.shots {
        let path = folder.path().join("photos").join(&shot.name);
        let (size, _, _, rgb) = photo(&path);
        write_as(&path, "png", &Samples::U8(Image::from_data(size, 1, grey(&rgb))));
    }
    let (grey, bits) = samples(&done(folder.path(), "grey", &[]));
    assert_eq!((bits, grey.len() as u64), (8, 2 * test.plane.size().area()));
}

#[test]
fn a_tiff_cut_short_and_a_cmyk_jpeg_are_named_and_left_out() {
    let test = scenes::columns();
    let folder = project(&test);
    let path = |k: usize| folder.path().join("photos").join(&test.shots[k].name);
    let (size, _, _, rgb) = photo(&path(0));
    let narrow: Vec<u8> = rgb.iter().map(|&s| u8::try_from(s).unwrap()).collect();
    TiffEncoder::new(File::create(path(0)).unwrap())
        .unwrap()
        .write_image::<colortype::RGB8>(size.width, size.height, &narrow)
        .unwrap();
    let bytes = std::fs::read(path(0)).unwrap();
    std::fs::write(path(0), &bytes[..bytes.len() / 2]).unwrap();
    let sof = [0xFF, 0xC0, 0, 20, 8, 0, 240, 1, 64, 4];
    let components = [1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0, 4, 0x11, 0];
    std::fs::write(path(1), [&[0xFF, 0xD8][..], &sof, &components].concat()).unwrap();
    let (run, mosaic) = ortho(folder.path(), "out", &[]);
    assert_eq!(run.status.code(), Some(1), "{}", said(&run));
    assert!(mosaic.exists());
    let said = said(&run);
    assert!(said.contains("a.png is left out: photos/a.png: "), "{said}");
    assert!(
        said.contains("b.png is left out: photos/b.png: a CMYK or YCCK JPEG is not supported (convert it to RGB)"),
        "{said}"
    );
}
