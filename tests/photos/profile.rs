//! Colour profiles from the photos into the mosaic.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use groundel::image::{Image, Samples};
use groundel::synthetic::{TestScene, scenes, write_picture};
use serde_json::json;
use tiff::decoder::Decoder;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;

use super::command::{assert_same_files, done, layer, ortho, photo, project, report, said};
use super::gdal::python;

/// An RGB profile, as far as its header tells.
fn profile(mark: u8) -> Vec<u8> {
    let mut profile = vec![mark; 3000];
    profile[..4].copy_from_slice(&3000_u32.to_be_bytes());
    profile[16..20].copy_from_slice(b"RGB ");
    profile[36..40].copy_from_slice(b"acsp");
    profile
}

/// Adds an `iCCP` chunk behind the header of a PNG.
fn add_to_png(path: &Path, profile: &[u8]) {
    let level = flate2::Compression::default();
    let mut chunk = flate2::write::ZlibEncoder::new(b"iCCPany name\0\0".to_vec(), level);
    std::io::Write::write_all(&mut chunk, profile).unwrap();
    let chunk = chunk.finish().unwrap();
    let length = u32::try_from(chunk.len() - 4).unwrap().to_be_bytes();
    let crc = crc32fast::hash(&chunk).to_be_bytes();
    let plain = std::fs::read(path).unwrap();
    std::fs::write(path, [&plain[..33], &length, &chunk, &crc, &plain[33..]].concat()).unwrap();
}

/// Makes a photo a JPEG with the profile in two APP2 segments.
fn make_jpeg(path: &Path, profile: &[u8]) {
    let (size, _, _, rgb) = photo(path);
    let narrow = rgb.iter().map(|&s| u8::try_from(s).unwrap()).collect();
    let jpeg = path.with_extension("jpg");
    write_picture(&jpeg, &Samples::U8(Image::from_data(size, 3, narrow))).unwrap();
    let plain = std::fs::read(&jpeg).unwrap();
    let segment = |number: u8, part: &[u8]| {
        let length = u16::try_from(part.len() + 16).unwrap().to_be_bytes();
        [&[0xFF, 0xE2], &length[..], b"ICC_PROFILE\0", &[number, 2], part].concat()
    };
    let (a, b) = profile.split_at(1000);
    let bytes = [&plain[..2], &segment(1, a), &segment(2, b), &plain[2..]].concat();
    std::fs::write(path, bytes).unwrap();
    std::fs::remove_file(jpeg).unwrap();
}

/// Makes a photo a TIFF with the profile in tag 34675.
fn make_tiff(path: &Path, profile: &[u8]) {
    let (size, _, _, rgb) = photo(path);
    let narrow: Vec<u8> = rgb.iter().map(|&s| u8::try_from(s).unwrap()).collect();
    let mut encoder = TiffEncoder::new(File::create(path).unwrap()).unwrap();
    let mut image = encoder.new_image::<colortype::RGB8>(size.width, size.height).unwrap();
    image.encoder().write_tag(Tag::IccProfile, profile).unwrap();
    image.write_data(&narrow).unwrap();
}

fn add_profiles(test: &TestScene, folder: &Path, profile: &[u8]) {
    for (k, shot) in test.shots.iter().enumerate() {
        let path = folder.join("photos").join(&shot.name);
        match k {
            0 => make_jpeg(&path, profile),
            1 => make_tiff(&path, profile),
            _ => add_to_png(&path, profile),
        }
    }
}

/// The profile in each directory of a file.
fn in_directories(path: &Path) -> Vec<Option<Vec<u8>>> {
    let mut decoder = Decoder::new(BufReader::new(File::open(path).unwrap())).unwrap();
    let mut profiles = Vec::new();
    loop {
        let value = decoder.find_tag(Tag::IccProfile).unwrap();
        profiles.push(value.map(|v| v.into_u8_vec().unwrap()));
        if !decoder.more_images() {
            return profiles;
        }
        decoder.next_image().unwrap();
    }
}

#[test]
fn a_profile_that_all_photos_carry_is_the_mosaic_s() {
    let test = scenes::columns();
    let folder = project(&test);
    let profile = profile(5);
    add_profiles(&test, folder.path(), &profile);
    let flags = ["--tile-size", "16"];
    let mosaic = done(folder.path(), "out", &flags);
    assert_eq!(report(&mosaic)["warnings"], json!([]));
    let found = in_directories(&mosaic);
    assert!(found.len() > 2, "with overviews");
    assert!(found.iter().all(|p| p.as_ref() == Some(&profile)));
    let count = layer(&mosaic, "count");
    assert!(in_directories(&count).iter().all(Option::is_none));
    let answers = python("check_profile.py", &json!([mosaic, count]));
    assert_eq!(answers[0]["faults"], json!([]), "{answers}");
    assert_eq!(answers[0]["profile"], json!(base64(&profile)), "{answers}");
    assert_eq!(answers[1], json!({"profile": null, "faults": []}), "{answers}");
    let again = done(folder.path(), "again", &[&flags[..], &["--threads", "1"]].concat());
    assert_same_files(&mosaic, &again);
}

#[test]
fn profiles_that_differ_are_not_carried_and_two_photos_are_named() {
    let test = scenes::columns();
    let folder = project(&test);
    add_profiles(&test, folder.path(), &profile(5));
    make_tiff(&folder.path().join("photos/c.png"), &profile(6));
    let (run, mosaic) = ortho(folder.path(), "out", &[]);
    assert_eq!(run.status.code(), Some(0));
    let warning = "the photos' colour profiles differ (a.png: one of 3000 bytes, c.png: one of 3000 bytes), \
                   the mosaic carries none";
    assert_eq!(said(&run), format!("groundel: warning: {warning}\n"));
    assert_eq!(report(&mosaic)["warnings"], json!([warning]));
    assert!(in_directories(&mosaic).iter().all(Option::is_none));
    // A photo that is not used has no say.
    let mosaic = done(folder.path(), "without", &["--exclude", "c.png"]);
    assert!(in_directories(&mosaic).iter().all(Option::is_some));
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    // The profile's length is a multiple of three.
    let digits = bytes.chunks_exact(3).flat_map(|b| {
        let word = u32::from_be_bytes([0, b[0], b[1], b[2]]);
        [18, 12, 6, 0].map(|shift| char::from(DIGITS[(word >> shift & 63) as usize]))
    });
    digits.collect()
}
