//! Cameras written by the manual's definition are read back to the same pixels.

use std::fmt::Write as _;
use std::fs;

use glam::{DMat3, DVec2, DVec3};

use super::read;
use crate::Result;
use crate::camera::Pose;
use crate::input::cameras::{CameraOptions, Draft};
use crate::input::mutation::damaged;

/// A calibration as Metashape states it.
#[derive(Clone, Copy)]
struct Calibration {
    kind: &'static str,
    f: f64,
    c: [f64; 2],
    b: [f64; 2],
    k: [f64; 4],
    p: [f64; 2],
}

const SIZE: [u32; 2] = [6000, 4000];
const FRAME: Calibration = Calibration {
    kind: "frame",
    f: 4100.25,
    c: [-13.5, 7.25],
    b: [1.75, -0.85],
    k: [-0.11, 0.06, -0.015, 0.004],
    p: [8e-4, -5e-4],
};
const FISHEYE: Calibration =
    Calibration { kind: "fisheye", f: 1900.0, k: [0.02, -0.01, 2e-3, 0.0], ..FRAME };

impl Calibration {
    /// The manual's formulas, term by term: a point in camera axes to pixels from the photo's corner.
    fn project(&self, point: DVec3) -> DVec2 {
        let (mut x, mut y) = (point.x / point.z, point.y / point.z);
        if self.kind != "frame" {
            let r0 = (x * x + y * y).sqrt();
            (x, y) = (x * r0.atan() / r0, y * r0.atan() / r0);
        }
        let ([k1, k2, k3, k4], [p1, p2], [b1, b2]) = (self.k, self.p, self.b);
        let r2 = x * x + y * y;
        let radial = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3) + k4 * r2.powi(4);
        let xd = x * radial + p1 * (r2 + 2.0 * x * x) + 2.0 * p2 * x * y;
        let yd = y * radial + p2 * (r2 + 2.0 * y * y) + 2.0 * p1 * x * y;
        DVec2::new(
            f64::from(SIZE[0]) * 0.5 + self.c[0] + xd * self.f + xd * b1 + yd * b2,
            f64::from(SIZE[1]) * 0.5 + self.c[1] + yd * self.f,
        )
    }

    fn sensor(&self, id: u32) -> String {
        let Self { kind, f, c, b, k, p } = self;
        let [w, h] = SIZE;
        let size = format!("<resolution width=\"{w}\" height=\"{h}\"/>");
        format!(
            "<sensor id=\"{id}\" label=\"s\" type=\"{kind}\">{size}<property name=\"fixed\" value=\"false\"/>\n\
             <calibration type=\"{kind}\" class=\"initial\">{size}<f>1</f></calibration>\n\
             <calibration type=\"{kind}\" class=\"adjusted\">{size}<f>{f}</f><cx>{}</cx><cy>{}</cy><b1>{}</b1><b2>{}</b2>\n\
             <k1>{}</k1><k2>{}</k2><k3>{}</k3><k4>{}</k4><p1>{}</p1><p2>{}</p2></calibration>\n\
             <covariance><params>f cx</params><coeffs>1 2 3 4</coeffs></covariance></sensor>\n",
            c[0], c[1], b[0], b[1], k[0], k[1], k[2], k[3], p[0], p[1]
        )
    }
}

/// A turn about an axis.
fn turn(axis: DVec3, angle: f64) -> DMat3 {
    DMat3::from_axis_angle(axis.normalize(), angle)
}

/// Ground from chunk: rotation, translation, scale.
fn similarity() -> (DMat3, DVec3, f64) {
    (turn(DVec3::new(1.0, 2.0, -0.5), 0.7), DVec3::new(1200.5, -340.25, 88.0), 3.25)
}

/// Ground from camera: rotation, centre.
fn truth(i: u32) -> (DMat3, DVec3) {
    let t = f64::from(i);
    (turn(DVec3::new(1.0, 0.1 * t, 0.2), -1.5 + 0.1 * t), DVec3::new(1210.0 + t, -350.0, 90.0 - t))
}

fn numbers(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(|v| format!("{v:e}")).collect::<Vec<_>>().join(" ")
}

fn rows(m: DMat3) -> [f64; 9] {
    m.transpose().to_cols_array()
}

fn transform() -> String {
    let (r, t, s) = similarity();
    format!(
        "<transform><rotation locked=\"false\">{}</rotation><translation>{}</translation><scale>{s}</scale></transform>",
        numbers(rows(r)),
        numbers(t.to_array())
    )
}

/// A camera whose pose is `truth(i)` on the ground.
fn camera(i: u32, sensor: u32, label: &str, more: &str) -> String {
    let ((r, t, s), (rotation, centre)) = (similarity(), truth(i));
    let (to_chunk, c) = (r.transpose() * rotation, r.transpose() * (centre - t) / s);
    let m = rows(to_chunk);
    let matrix =
        [&m[0..3], &[c.x], &m[3..6], &[c.y], &m[6..9], &[c.z, 0.0, 0.0, 0.0, 1.0]].concat();
    format!(
        "<camera id=\"{i}\" sensor_id=\"{sensor}\" label=\"{label}\" {more}><transform>{}</transform>\n\
         <rotation_covariance>1 2</rotation_covariance><reference x=\"1\" y=\"2\" z=\"3\"/></camera>\n",
        numbers(matrix)
    )
}

fn document(sensors: &str, components: &str, cameras: &str, rest: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<document version=\"2.0.0\"><chunk label=\"Chunk 1\" enabled=\"true\">\n\
         <sensors next_id=\"2\">{sensors}</sensors>\n{components}<cameras next_id=\"9\">{cameras}</cameras>\n{rest}</chunk></document>\n"
    )
}

fn read_text(text: &str) -> Result<Draft> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cameras.xml");
    fs::write(&path, text).unwrap();
    read(&path, &CameraOptions::default())
}

fn message(text: &str) -> String {
    let e = read_text(text).unwrap_err();
    assert_eq!(e.exit_code(), 2, "{e}");
    e.to_string()
}

/// The photo at `index` sees what the calibration and the pose `truth(i)` say.
fn agrees(draft: &Draft, index: usize, i: u32, calibration: &Calibration) {
    let (lens, pose) = draft.photos[index].orientation.as_ref().unwrap();
    let Pose { rotation, centre_ground } = pose;
    let (ground_from_camera, centre) = truth(i);
    assert!((*centre_ground - centre).length() < 1e-10);
    for (x, y) in [(0.1, 0.2), (-0.6, 0.4), (0.55, -0.45), (-0.3, -0.35)] {
        let point = ground_from_camera * (DVec3::new(x, y, 1.0) * 7.0) + centre;
        let seen = *rotation * (point - *centre_ground);
        let at = lens.photo_from_ray(seen.truncate() / seen.z).unwrap();
        let wanted = calibration.project(ground_from_camera.transpose() * (point - centre));
        assert!((at - wanted).length() < 1e-8, "{at} instead of {wanted}");
    }
}

#[test]
fn cameras_of_frames_and_fisheyes_see_what_they_did() {
    let sensors = FRAME.sensor(0) + &FISHEYE.sensor(1);
    let group = format!("<group id=\"0\" label=\"g\">{}</group>", camera(2, 0, "c", ""));
    let cameras = camera(0, 0, "a.jpg", "") + &camera(1, 1, "b.jpg", "enabled=\"true\"") + &group;
    // In the transform of the chunk, or in that of the component.
    let component = format!(
        "<components><component id=\"0\">{}<partition><camera_ids>0</camera_ids></partition></component></components>",
        transform()
    );
    let of_component = cameras.replace("label=", "component_id=\"0\" label=");
    for text in [
        document(&sensors, "", &cameras, &transform()),
        document(
            &sensors,
            "",
            &cameras,
            &format!("<reference>LOCAL_CS[\"x\"]</reference>{}", transform()),
        ),
        document(&sensors, &component, &of_component, ""),
    ] {
        let draft = read_text(&text).unwrap();
        let names: Vec<_> = draft.photos.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["a.jpg", "b.jpg", "c"]);
        agrees(&draft, 0, 0, &FRAME);
        agrees(&draft, 1, 1, &FISHEYE);
        agrees(&draft, 2, 2, &FRAME);
    }
}

#[test]
fn labels_without_extension_find_their_photos() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cameras.xml");
    fs::create_dir(folder.path().join("west")).unwrap();
    for name in ["a.JPG", "west/b.tif", "c.jpg", "c.png"] {
        fs::write(folder.path().join(name), "").unwrap();
    }
    let cameras: String = ["a", "b", "c"].map(|label| camera(0, 0, label, "")).concat();
    fs::write(&path, document(&FRAME.sensor(0), "", &cameras, "")).unwrap();
    let photos = Some(folder.path().to_path_buf());
    let draft = read(&path, &CameraOptions { photos, ..CameraOptions::default() }).unwrap();
    let found: Vec<_> =
        draft.photos.iter().map(|p| (p.name.as_str(), p.orientation.is_ok())).collect();
    assert_eq!(found, [("a.JPG", true), ("west/b.tif", true), ("c", false)]);
}

#[test]
fn cameras_that_cannot_be_used_are_left_out_with_their_reason() {
    let adjusted = "class=\"adjusted\"";
    let sensor = |id, from: &str, to: &str| FRAME.sensor(id).replace(from, to);
    let sensors = [
        FRAME.sensor(0),
        sensor(1, "<k1>", "<p3>1e-5</p3><p4>0</p4><k1>"),
        sensor(2, "\"frame\"", "\"spherical\""),
        sensor(3, adjusted, "class=\"initial\""),
        sensor(4, "<k1>", "<k5>1</k5><k1>"),
        sensor(
            5,
            "<calibration type=\"frame\" class=\"adjusted\"><resolution width=\"6000\"",
            "<calibration class=\"adjusted\"><resolution width=\"600\"",
        ),
    ]
    .concat();
    let mut cameras = String::from(
        "<camera id=\"8\" sensor_id=\"0\" label=\"x\"/><camera id=\"9\" sensor_id=\"0\" master_id=\"8\" label=\"y\"/>",
    );
    cameras += &camera(0, 0, "off", "enabled=\"false\"");
    cameras += &camera(0, 0, "lost", "component_id=\"1\"");
    for id in 1..6 {
        write!(cameras, "{}", camera(0, id, "s", "")).unwrap();
    }
    let components = format!(
        "<components><component id=\"0\">{}</component><component id=\"1\"/></components>",
        transform()
    );
    let draft = read_text(&document(&sensors, &components, &cameras, "")).unwrap();
    let reasons: Vec<_> =
        draft.photos.iter().map(|p| p.orientation.as_ref().unwrap_err().as_str()).collect();
    for (reason, word) in reasons.iter().zip([
        "not aligned",
        "rig",
        "disabled",
        "component 1",
        "p3 or p4",
        "spherical",
        "no adjusted",
        "<k5>",
        "another size",
    ]) {
        assert!(reason.contains(word), "{reason} instead of {word}");
    }
    assert_eq!(reasons.len(), 9);
    // What was fixed has no adjusted calibration.
    let fixed = sensor(0, adjusted, "class=\"x\"").replace("value=\"false\"", "value=\"true\"");
    let draft = read_text(&document(&fixed, "", &camera(0, 0, "a", ""), "")).unwrap();
    let lens = draft.photos[0].orientation.as_ref().unwrap().0;
    assert_eq!(lens.focal_px(), DVec2::ONE);
}

#[test]
fn what_makes_no_cameras_is_an_error_with_its_place() {
    let good = document(&FRAME.sensor(0), "", &camera(0, 0, "a", ""), &transform());
    assert!(read_text(&good).is_ok());
    for (from, to, what) in [
        ("sensor_id=\"0\"", "sensor_id=\"7\"", "the id of a sensor"),
        ("label=\"a\"", "", "attribute label"),
        ("<sensors", "<sensor", "well-formed"),
        ("<f>4100.25", "<f>nan", "finite number in <f>"),
        ("<f>4100.25", "<f>-5000", "positive focal"),
        ("<scale>3.25", "<scale>0", "scale above 0"),
        ("width=\"6000\"", "width=\"6e9\"", "whole number as attribute width"),
        ("</camera>", "</camera></cameras></chunk><chunk><cameras>", "several chunks"),
        ("<cameras", "<reference>PROJCS[\"UTM\"]</reference><cameras", "PROJCS"),
        ("<document", "<!DOCTYPE document><document", "DOCTYPE"),
    ] {
        assert!(good.contains(from), "{from}");
        let e = message(&good.replace(from, to));
        assert!(e.contains("cameras.xml") && e.contains(what), "{e}");
    }
    let turned = camera(0, 0, "a", "").replacen("<transform>", "<transform>5 ", 1);
    let e = message(&document(&FRAME.sensor(0), "", &turned, ""));
    assert!(e.contains("line ") && e.contains("16 finite numbers"), "{e}");
    assert!(message("<scene/>").contains("<document>"));
}

#[test]
fn a_damaged_document_is_an_error_or_cameras() {
    let sensors = FRAME.sensor(0) + &FISHEYE.sensor(1);
    let cameras = camera(0, 0, "a.jpg", "") + &camera(1, 1, "b.jpg", "");
    let good = document(&sensors, "", &cameras, &transform());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cameras.xml");
    let mut errors = 0;
    for bad in damaged(good.as_bytes(), 3000) {
        fs::write(&path, bad).unwrap();
        match read(&path, &CameraOptions::default()) {
            Ok(draft) => assert!(draft.photos.len() <= 4),
            Err(e) => {
                assert!(e.exit_code() == 2 && e.to_string().contains("cameras.xml"), "{e}");
                errors += 1;
            }
        }
    }
    assert!((1000..3000).contains(&errors), "{errors} errors");
}
