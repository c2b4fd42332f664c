//! Little COLMAP models, written by the tests themselves.

use std::fs;
use std::path::Path;

use glam::DVec2;

use crate::camera::{CameraSet, LensModel, PhotoId};
use crate::input::CameraOptions;
use crate::{Error, Result};

const CAMERAS: &str = "# Camera list\n7 PINHOLE 4 3 5 5.5 2 1.5\n\n3000000000 OPENCV 40 30 50 51 20 15 -0.1 0.01 0.001 -0.002\n";
const IMAGES: &str = "# Image list\n# two lines each\n9 1 0 0 0 0 0 5 7 b/a photo.jpg\n1.5 2.5 -1 3 4 17\n2 0.5 0.5 0.5 0.5 1 2 3 3000000000 a.jpg\n\n1000 2 0 0 0 1 2 3 7 B.jpg\n";

fn read_cameras(path: impl AsRef<Path>) -> Result<CameraSet> {
    Ok(crate::input::read_cameras(path, &CameraOptions::default())?.set)
}

fn text(cameras: &str, images: &str) -> Result<CameraSet> {
    files("txt", cameras.as_bytes(), images.as_bytes())
}

fn files(extension: &str, cameras: &[u8], images: &[u8]) -> Result<CameraSet> {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), extension, cameras, images);
    read_cameras(folder.path())
}

fn write(folder: &Path, extension: &str, cameras: &[u8], images: &[u8]) {
    fs::write(folder.join("cameras").with_extension(extension), cameras).unwrap();
    fs::write(folder.join("images").with_extension(extension), images).unwrap();
}

/// `cameras.bin` of cameras (id, model, params), all of 4 × 3 pixels.
fn cameras_bin(cameras: &[(u32, i32, &[f64])]) -> Vec<u8> {
    let mut out = (cameras.len() as u64).to_le_bytes().to_vec();
    for (id, model, params) in cameras {
        out.extend(id.to_le_bytes());
        out.extend(model.to_le_bytes());
        out.extend(4_u64.to_le_bytes());
        out.extend(3_u64.to_le_bytes());
        out.extend(params.iter().flat_map(|p| p.to_le_bytes()));
    }
    out
}

/// `images.bin` of photos (name, camera, keypoints), all with the same pose.
fn images_bin(images: &[(&[u8], u32, u64)]) -> Vec<u8> {
    let mut out = (images.len() as u64).to_le_bytes().to_vec();
    for (name, camera, keypoints) in images {
        out.extend(1_u32.to_le_bytes());
        out.extend([0.5, 0.5, 0.5, 0.5, 1.0, 2.0, 3.0].iter().flat_map(|p: &f64| p.to_le_bytes()));
        out.extend(camera.to_le_bytes());
        out.extend(*name);
        out.push(0);
        out.extend(keypoints.to_le_bytes());
        out.extend((0..*keypoints).flat_map(|_| [7_u8; 24]));
    }
    out
}

const PINHOLE: &[(u32, i32, &[f64])] = &[(7, 1, &[5.0, 5.5, 2.0, 1.5])];

fn message(result: Result<CameraSet>) -> String {
    let error = result.unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    error.to_string()
}

#[test]
fn photos_are_numbered_by_bytewise_name_with_their_own_cameras() {
    let set = text(CAMERAS, IMAGES).unwrap();
    assert_eq!(set.names, ["B.jpg", "a.jpg", "b/a photo.jpg"]);
    let ids: Vec<_> = set.photos.iter().map(|p| (p.id, p.name.as_str())).collect();
    assert_eq!(ids, [(PhotoId(0), "B.jpg"), (PhotoId(1), "a.jpg"), (PhotoId(2), "b/a photo.jpg")]);
    let models: Vec<_> = set.photos.iter().map(|p| p.lens.model()).collect();
    assert_eq!(models, [LensModel::Pinhole, LensModel::OpenCv, LensModel::Pinhole]);
    let photo = set.find("b/a photo.jpg").unwrap();
    assert_eq!(photo.pose.centre_ground, glam::DVec3::new(0.0, 0.0, -5.0));
    let at = photo.lens.photo_from_ray(DVec2::new(0.1, 0.2)).unwrap();
    assert!((at - DVec2::new(2.5, 2.6)).length() < 1e-14);
    assert!(set.left_out.is_empty() && set.find("c").is_none());
}

#[test]
fn windows_line_ends_and_a_byte_order_of_blanks_change_nothing() {
    let expected = text(CAMERAS, IMAGES).unwrap();
    let crlf = |s: &str| s.replace('\n', "\r\n");
    assert_eq!(text(&crlf(CAMERAS), &crlf(IMAGES)).unwrap(), expected);
    let tabs = CAMERAS.replace("7 PINHOLE 4", "  7\tPINHOLE   4");
    assert_eq!(text(&tabs, IMAGES.trim_end()).unwrap(), expected);
}

#[test]
fn binary_is_preferred_and_gives_what_text_gives() {
    let cameras = cameras_bin(PINHOLE);
    let images = images_bin(&[(b"x/b 1.jpg", 7, 2), (b"a.jpg", 7, 0)]);
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "txt", b"nonsense", b"nonsense");
    assert!(read_cameras(folder.path()).is_err());
    fs::write(folder.path().join("cameras.bin"), &cameras).unwrap();
    assert!(read_cameras(folder.path()).is_err(), "half a binary model is none");
    write(folder.path(), "bin", &cameras, &images);
    let binary = read_cameras(folder.path()).unwrap();
    let pose = "0.5 0.5 0.5 0.5 1 2 3 7";
    let lines = format!("1 {pose} x/b 1.jpg\n1 2 3 4 5 6\n2 {pose} a.jpg\n\n");
    assert_eq!(binary, text("7 PINHOLE 4 3 5 5.5 2 1.5", &lines).unwrap());
}

#[test]
fn a_photo_of_a_known_but_unsupported_model_is_left_out_by_name() {
    let cameras = format!("{CAMERAS}5 EUCM 4 3 5 5 2 2 0 0\n");
    let set = text(&cameras, &IMAGES.replace("3000000000 a.jpg", "5 a.jpg")).unwrap();
    assert_eq!((set.names.len(), set.photos.len()), (3, 2));
    let out = &set.left_out[0];
    assert_eq!((out.id, out.name.as_str()), (PhotoId(1), "a.jpg"));
    assert!(out.reason.contains("EUCM"));

    // Every model of COLMAP is stepped over at its right length.
    for id in 0..18 {
        let model = LensModel::from_id(id).unwrap();
        let params = vec![1e-3; model.param_count()];
        let cameras = cameras_bin(&[(1, id, &params), PINHOLE[0]]);
        let set = files("bin", &cameras, &images_bin(&[(b"a", 7, 0), (b"b", 1, 0)])).unwrap();
        assert_eq!(set.photos.len(), 1 + usize::from(model.is_supported()), "{}", model.name());
    }
}

#[test]
fn an_unknown_model_ends_the_reading_with_its_id_and_place() {
    let cameras = cameras_bin(&[PINHOLE[0], (12, 99, &[])]);
    let e = message(files("bin", &cameras, &images_bin(&[])));
    // 8 count + 56 first camera + 4 id
    assert!(e.contains("cameras.bin: byte 68:") && e.contains("99") && e.contains("12"), "{e}");
    let e = message(text(&CAMERAS.replace("OPENCV", "OPENCV9"), IMAGES));
    assert!(e.contains("cameras.txt: line 4:") && e.contains("\"OPENCV9\""), "{e}");
}

#[test]
fn a_binary_file_cut_at_any_byte_is_an_error_with_an_offset() {
    let cameras = cameras_bin(PINHOLE);
    let images = images_bin(&[(b"x/b 1.jpg", 7, 2), (b"a.jpg", 7, 1)]);
    assert!(files("bin", &cameras, &images).is_ok());
    for cut in 0..cameras.len() {
        let e = message(files("bin", &cameras[..cut], &images));
        assert!(e.contains("cameras.bin: byte "), "{e}");
    }
    for cut in 0..images.len() {
        let e = message(files("bin", &cameras, &images[..cut]));
        assert!(e.contains("images.bin: byte "), "{e}");
    }
    let e = message(files("bin", &[&cameras[..], &[0]].concat(), &images));
    assert!(e.contains("the end of the file, found 1 bytes more"), "{e}");
}

#[test]
fn counts_beyond_all_reason_are_refused_before_they_are_believed() {
    let huge = u64::MAX.to_le_bytes();
    let e = files("bin", &huge, &images_bin(&[])).unwrap_err();
    assert!(matches!(e, Error::Limit { .. }), "{e}");
    let cameras = cameras_bin(PINHOLE);
    assert!(matches!(files("bin", &cameras, &huge), Err(Error::Limit { .. })));
    let mut images = images_bin(&[(b"a.jpg", 7, 0)]);
    let at = images.len() - 8;
    images[at..].copy_from_slice(&(u64::MAX / 24).to_le_bytes());
    let e = message(files("bin", &cameras, &images));
    assert!(e.contains("keypoints") && e.contains("0 bytes to the end"), "{e}");
    let long = [b'a'; 5000];
    let e = message(files("bin", &cameras, &images_bin(&[(&long, 7, 0)])));
    assert!(e.contains("4096"), "{e}");
    let e = message(text(CAMERAS, &format!("1 {}", "1".repeat(70_000))));
    assert!(e.contains("images.txt: line 1:") && e.contains("65536"), "{e}");
}

#[test]
fn keypoint_lines_of_any_length_are_passed_over() {
    let keypoints = "1280.407 350.643 -1 ".repeat(20_000);
    let images = IMAGES.replace("1.5 2.5 -1 3 4 17", &keypoints);
    assert_eq!(text(CAMERAS, &images).unwrap(), text(CAMERAS, IMAGES).unwrap());
}

#[test]
fn a_file_without_keypoint_lines_loses_no_photo_unnoticed() {
    let images = IMAGES.replace("1.5 2.5 -1 3 4 17\n", "").replace("\n\n", "\n");
    let e = message(text(CAMERAS, &images));
    assert!(e.contains("images.txt: line 4:") && e.contains("keypoints"), "{e}");
    // Digits alone do not make keypoints: 10 words are no triples.
    let e = message(text(CAMERAS, "1 1 0 0 0 0 0 5 7 1\n2 1 0 0 0 0 0 5 7 2\n"));
    assert!(e.contains("10 numbers"), "{e}");
}

#[test]
fn a_photo_without_its_camera_or_with_a_name_twice_is_an_error() {
    let e = message(text(CAMERAS, &IMAGES.replace("7 B.jpg", "8 B.jpg")));
    assert!(e.contains("line 7:") && e.contains("\"B.jpg\"") && e.contains("found 8"), "{e}");
    let e = message(text(CAMERAS, &IMAGES.replace("7 B.jpg", "7 a.jpg")));
    assert!(e.contains("line 7:") && e.contains("\"a.jpg\" once more"), "{e}");
    let e = message(text(&CAMERAS.replace("3000000000", "7"), IMAGES));
    assert!(e.contains("line 4:") && e.contains("7 once more"), "{e}");
}

#[test]
fn names_that_lead_out_of_the_photo_folder_are_refused() {
    for name in
        ["../a.jpg", "a/../../b.jpg", "/etc/a.jpg", "..", "C:\\a.jpg", "\\\\h\\a", "a\\..\\b", ""]
    {
        let e = message(text(CAMERAS, &IMAGES.replace("B.jpg", name)));
        assert!(e.contains("line 7:") && e.contains("photo"), "{name}: {e}");
    }
    for name in ["..a.jpg", "a..b/c.jpg", "x/...jpg", "å b.jpg"] {
        let set = text(CAMERAS, &IMAGES.replace("B.jpg", name)).unwrap();
        assert!(set.find(name).is_some(), "{name}");
    }
    let bad = files("bin", &cameras_bin(PINHOLE), &images_bin(&[(b"a\xff.jpg", 7, 0)]));
    assert!(message(bad).contains("UTF-8"));
    let bad = files("bin", &cameras_bin(PINHOLE), &images_bin(&[(b"a\n.jpg", 7, 0)]));
    assert!(message(bad).contains("control"));
}

#[test]
fn numbers_that_make_no_camera_or_pose_are_named_with_their_line() {
    for (from, to, what) in [
        ("4 3 5 5.5", "4 3 -5 5.5", "positive focal length"),
        ("4 3 5 5.5", "4 3 nan 5.5", "finite"),
        ("4 3 5 5.5", "4 3 5", "4 parameters"),
        ("4 3 5 5.5", "0 3 5 5.5", "at least one pixel"),
        ("4 3 5 5.5", "99999999999 3 5 5.5", "32 bits"),
        ("4 3 5 5.5", "4 -3 5 5.5", "a height"),
        ("7 PINHOLE", "seven PINHOLE", "a camera id"),
        ("7 PINHOLE 4 3 5 5.5 2 1.5", "7", "the end of the line"),
    ] {
        let e = message(text(&CAMERAS.replace(from, to), IMAGES));
        assert!(e.contains("cameras.txt: line 2:") && e.contains(what), "{e}");
    }
    for (from, to, what) in [
        ("9 1 0 0 0", "9 0 0 0 0", "quaternion"),
        ("0 0 5 7 b", "0 inf 5 7 b", "finite translation"),
        ("9 1 0 0 0", "9 1 0 x 0", "\"x\""),
    ] {
        let e = message(text(CAMERAS, &IMAGES.replace(from, to)));
        assert!(e.contains("images.txt: line 3:") && e.contains(what), "{e}");
    }
}

#[test]
fn a_path_that_is_no_model_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    assert!(message(read_cameras(folder.path())).contains("cameras.bin"));
    let file = folder.path().join("cams.xml");
    fs::write(&file, "x").unwrap();
    assert!(matches!(read_cameras(&file), Err(Error::Unsupported { .. })));
    assert!(matches!(read_cameras(folder.path().join("none")), Err(Error::Io { .. })));
}

#[test]
fn a_damaged_model_is_read_or_refused_but_never_crashes() {
    let cameras = cameras_bin(&[PINHOLE[0], (8, 6, &[5.0; 12])]);
    let images = images_bin(&[(b"x/b 1.jpg", 7, 2), (b"a.jpg", 8, 0)]);
    let forms: [(&str, &[u8], &[u8]); 2] =
        [("bin", &cameras, &images), ("txt", CAMERAS.as_bytes(), IMAGES.as_bytes())];
    let folder = tempfile::tempdir().unwrap();
    // Xorshift (Marsaglia 2003), seeded: the same damage every time.
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        usize::try_from(state % below as u64).unwrap()
    };
    let (mut read, mut refused) = (0, 0);
    for (extension, cameras, images) in forms {
        // The form under test must be the one that is found.
        let folder = folder.path().join(extension);
        fs::create_dir(&folder).unwrap();
        for _ in 0..400 {
            let mut damaged = [cameras.to_vec(), images.to_vec()];
            for _ in 0..=random(3) {
                let bytes = &mut damaged[random(2)];
                let at = random(bytes.len());
                match random(3) {
                    0 => bytes[at] = b" \n\0-9.#\xff"[random(8)],
                    1 => bytes[at] ^= 1 << random(8),
                    _ => drop(bytes.remove(at)),
                }
            }
            write(&folder, extension, &damaged[0], &damaged[1]);
            match read_cameras(&folder) {
                Ok(set) => {
                    read += 1;
                    assert_eq!(set.names.len(), set.photos.len() + set.left_out.len());
                    assert!(set.names.is_sorted());
                }
                Err(e) => {
                    refused += 1;
                    assert_eq!(e.exit_code(), 2, "{e}");
                }
            }
        }
    }
    assert!(read > 50 && refused > 50, "{read} read, {refused} refused");
}
