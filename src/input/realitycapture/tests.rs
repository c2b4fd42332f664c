//! Cameras written by the program's own definition are read back to the same pixels.

use std::fs;

use glam::DVec2;
use image::{GrayImage, ImageFormat};

use super::*;

const K: [f64; 6] = [-0.12, 0.1, -0.02, 0.005, 8e-4, -6e-4];

/// An XMP file with attributes and children as the program mixes them.
fn xmp(model: &str, extra: &str, rotation: DMat3, centre: DVec3) -> String {
    let words =
        |values: &[f64]| values.iter().map(|v| format!("{v:e}")).collect::<Vec<_>>().join(" ");
    format!(
        "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\">\n<rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\n\
         <rdf:Description xcr:Version=\"3\" xcr:PosePrior=\"exact\" xcr:Coordinates=\"absolute\" xcr:DistortionModel=\"{model}\"\n\
         xcr:FocalLength35mm=\"27.5\" {extra} xcr:PrincipalPointU=\"0.0125\" xcr:PrincipalPointV=\"-0.02\"\n\
         xmlns:xcr=\"http://www.capturingreality.com/ns/xcr/1.1#\">\n<xcr:Rotation>{}</xcr:Rotation>\n\
         <xcr:Position>{}</xcr:Position>\n<xcr:DistortionCoeficients>{}</xcr:DistortionCoeficients>\n\
         </rdf:Description></rdf:RDF></x:xmpmeta>\n",
        words(&rotation.transpose().to_cols_array()),
        words(&centre.to_array()),
        words(&K),
    )
}

/// A folder with photos of 60 × 40 pixels.
fn photos(names: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in names {
        let photo = GrayImage::new(60, 40);
        photo.save_with_format(folder.path().join(name), ImageFormat::Png).unwrap();
    }
    folder
}

fn options(folder: &tempfile::TempDir) -> CameraOptions {
    CameraOptions { photos: Some(folder.path().to_path_buf()), ..CameraOptions::default() }
}

fn truth() -> (DMat3, DVec3) {
    let rotation = DMat3::from_axis_angle(DVec3::new(1.0, 0.3, -0.2).normalize(), 1.9);
    (rotation, DVec3::new(66.885, 45.255, 5.4538))
}

/// The projection by the program's definition: lengths in parts of the longer side.
fn project(q: DVec3, [k1, k2, k3, k4, t1, t2]: [f64; 6], aspect: f64) -> DVec2 {
    let (x, y) = (q.x / q.z, q.y / q.z);
    let s = x * x + y * y;
    let g = 1.0 + k1 * s + k2 * s.powi(2) + k3 * s.powi(3) + k4 * s.powi(4);
    let xd = x * g + t1 * (s + 2.0 * x * x) + 2.0 * t2 * x * y;
    let yd = y * g + t2 * (s + 2.0 * y * y) + 2.0 * t1 * x * y;
    let f = 27.5 / 36.0;
    DVec2::new(60.0 * (f * xd + 0.0125) + 30.0, 60.0 * (f * aspect * yd - 0.02) + 20.0)
}

fn agrees(photo: &DraftPhoto, k: [f64; 6], aspect: f64) {
    let (lens, pose) = photo.orientation.as_ref().unwrap();
    let (rotation, centre) = truth();
    for ray in [DVec3::new(0.3, 0.2, 1.0), DVec3::new(-0.5, 0.1, 1.0), DVec3::new(0.2, -0.4, 1.0)] {
        let seen = pose.camera_from_ground(rotation.transpose() * (ray * 4.0) + centre);
        let at = lens.photo_from_ray(seen.truncate() / seen.z).unwrap();
        let wanted = project(ray, k, aspect);
        assert!((at - wanted).length() < 1e-9, "{at} instead of {wanted}");
    }
}

#[test]
fn xmp_files_beside_their_photos_give_cameras() {
    let folder = photos(&["a.png", "b.png", "c.png", "d.png", "e.png", "f.png"]);
    let (rotation, centre) = truth();
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    let good = xmp("brown4t2", "xcr:AspectRatio=\"1.01\"", rotation, centre);
    write("a.xmp", good.clone());
    write("b.XMP", xmp("brown3", "xcr:Skew=\"0\"", rotation, centre));
    write("c.xmp", xmp("division", "", rotation, centre));
    write("d.xmp", xmp("brown3", "xcr:Skew=\"0.1\"", rotation, centre));
    write("e.xmp", good.replace("Rotation", "Turn"));
    write("gone.xmp", good.clone());
    assert!(is_folder(folder.path()).unwrap());
    let draft = read(folder.path(), &options(&folder)).unwrap();
    let names: Vec<_> = draft.photos.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["a.png", "b.png", "c.png", "d.png", "e.png", "gone"]);
    agrees(&draft.photos[0], K, 1.01);
    let [k1, k2, k3, ..] = K;
    agrees(&draft.photos[1], [k1, k2, k3, 0.0, 0.0, 0.0], 1.0);
    for (photo, word) in draft.photos[2..].iter().zip(["division", "skew", "no pose", "size"]) {
        let reason = photo.orientation.as_ref().unwrap_err();
        assert!(reason.contains(word), "{reason}");
    }
    let e = read(folder.path(), &CameraOptions::default()).unwrap_err();
    assert!(e.to_string().contains("--photos"), "{e}");
    write("f.xmp", good.replace("<xcr:Position>", "<xcr:Position>1 "));
    let e = read(folder.path(), &options(&folder)).unwrap_err().to_string();
    assert!(e.contains("f.xmp: line ") && e.contains("3 finite numbers"), "{e}");
}

#[test]
fn the_table_gives_cameras() {
    let folder = photos(&["a.png"]);
    let path = folder.path().join("cameras.csv");
    let header = format!("#name,{}\n", COLUMNS.join(","));
    assert!(is_table(&header));
    let row = "a.png,1,2,3,90,0,0,27.5,0.0125,-0.02,-0.12,0.1,-0.02,0.005,8e-4,-6e-4\n";
    fs::write(&path, format!("{header}{row}")).unwrap();
    let draft = read(&path, &options(&folder)).unwrap();
    let (lens, pose) = draft.photos[0].orientation.as_ref().unwrap();
    // Pitch 0 looks straight down; heading 90° has the photo's top in the east.
    assert!((pose.rotation * DVec3::NEG_Z - DVec3::Z).length() < 1e-12);
    assert!((pose.rotation * DVec3::X - DVec3::NEG_Y).length() < 1e-12);
    assert_eq!(pose.centre_ground, DVec3::new(1.0, 2.0, 3.0));
    let at = lens.photo_from_ray(DVec2::new(0.3, 0.2)).unwrap();
    assert!((at - project(DVec3::new(0.3, 0.2, 1.0), K, 1.0)).length() < 1e-9);
    // Pitch 90° looks to the horizon, at heading 0 to the north.
    fs::write(&path, format!("{header}{}", row.replace("90,0,0", "0,90,0"))).unwrap();
    let draft = read(&path, &options(&folder)).unwrap();
    let pose = &draft.photos[0].orientation.as_ref().unwrap().1;
    assert!((pose.rotation * DVec3::Y - DVec3::Z).length() < 1e-12);
    assert!((pose.rotation * DVec3::Z - DVec3::NEG_Y).length() < 1e-12);
    for (from, to, what) in [
        ("27.5", "x", "line 2: expected a finite number as f"),
        ("-6e-4", "-6e-4,1", "16 columns"),
        ("27.5", "-1", "positive focal"),
        ("#name", "name", "line 1"),
    ] {
        fs::write(&path, format!("{header}{row}").replace(from, to)).unwrap();
        let e = read(&path, &options(&folder)).unwrap_err().to_string();
        assert!(e.contains("cameras.csv") && e.contains(what), "{e}");
    }
}

#[test]
fn a_damaged_file_is_an_error_or_cameras() {
    let folder = photos(&["a.png"]);
    let (rotation, centre) = truth();
    let good = xmp("brown4t2", "xcr:AspectRatio=\"1.01\"", rotation, centre);
    let row =
        format!("#name,{}\na,1,2,3,90,0,0,27.5,0.01,-0.02,-0.12,0.1,0,0,0,0\n", COLUMNS.join(","));
    let table = folder.path().join("cameras.csv");
    let check = |path: &Path| {
        if let Err(e) = read(path, &options(&folder)) {
            assert_eq!(e.exit_code(), 2, "{e}");
        }
    };
    for bad in crate::input::mutation::damaged(good.as_bytes(), 1500) {
        fs::write(folder.path().join("a.xmp"), bad).unwrap();
        check(folder.path());
    }
    for bad in crate::input::mutation::damaged(row.as_bytes(), 1500) {
        fs::write(&table, bad).unwrap();
        check(&table);
    }
}
