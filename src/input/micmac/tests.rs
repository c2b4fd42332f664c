//! Orientations written by `MicMac`'s own definition are read back to the same pixels.

use std::fmt::Write as _;
use std::fs;

use glam::{DMat3, DVec2, DVec3};

use super::{is_folder, read};
use crate::Result;
use crate::input::cameras::{CameraOptions, Draft};
use crate::input::mutation::damaged;

const F: f64 = 4231.5;
const PP: [f64; 2] = [2310.25, 1544.75];
const CDIST: [f64; 2] = [2298.5, 1551.0];
const K: [f64; 3] = [-6.1e-9, 4.2e-16, -1.1e-23];
const P: [f64; 2] = [2.1e-7, -1.4e-7];

const STANDARD: &str =
    "<ModPhgrStd><RadialePart>RADIAL</RadialePart><P1>2.1e-7</P1><P2>-1.4e-7</P2></ModPhgrStd>";

fn calibration(model: &str) -> String {
    let radial = format!(
        "<CDist>{} {}</CDist><CoeffDist>{:e}</CoeffDist><CoeffDist>{:e}</CoeffDist><CoeffDist>{:e}</CoeffDist>",
        CDIST[0], CDIST[1], K[0], K[1], K[2]
    );
    format!(
        "<?xml version=\"1.0\" ?>\n<ExportAPERO>\n<CalibrationInternConique>\n<KnownConv>eConvApero_DistM2C</KnownConv>\n\
         <PP>{} {}</PP>\n<F>{F}</F>\n<SzIm>4608 3072</SzIm>\n<CalibDistortion>{}</CalibDistortion>\n\
         </CalibrationInternConique></ExportAPERO>\n",
        PP[0],
        PP[1],
        model.replace("RADIAL", &radial)
    )
}

fn truth() -> (DMat3, DVec3) {
    let rotation = DMat3::from_axis_angle(DVec3::new(1.0, 0.2, 0.1).normalize(), 2.6);
    (rotation, DVec3::new(651_200.5, 6_862_300.25, 120.0))
}

/// `MicMac`'s own formula, term by term in pixels; whole coordinates are the centres of pixels.
fn project(q: DVec3, [p1, p2]: [f64; 2]) -> DVec2 {
    let ideal = DVec2::from(PP) + F * q.truncate() / q.z;
    let d = ideal - DVec2::from(CDIST);
    let r2 = d.length_squared();
    let radial = DVec2::from(CDIST) + d * (1.0 + K[0] * r2 + K[1] * r2 * r2 + K[2] * r2 * r2 * r2);
    let x = (2.0 * d.x * d.x + r2) * p1 + 2.0 * d.x * d.y * p2;
    let y = (2.0 * d.y * d.y + r2) * p2 + 2.0 * d.x * d.y * p1;
    radial + DVec2::new(x, y)
}

const RAYS: [[f64; 2]; 4] = [[0.1, 0.2], [-0.4, 0.15], [0.3, -0.3], [-0.5, -0.3]];

fn orientation(interior: &str, p: [f64; 2]) -> String {
    let (rotation, centre) = truth();
    let words = |v: DVec3| format!("{:e} {:e} {:e}", v.x, v.y, v.z);
    let mut points = String::new();
    for [x, y] in RAYS {
        let q = DVec3::new(x, y, 1.0) * 30.0;
        let at = project(q, p);
        writeln!(
            points,
            "<Appuis><Num>1</Num><Im>{:e} {:e}</Im><Ter>{}</Ter></Appuis>",
            at.x,
            at.y,
            words(rotation * q + centre)
        )
        .unwrap();
    }
    format!(
        "<?xml version=\"1.0\" ?>\n<ExportAPERO>\n<OrientationConique>\n<OrIntImaM2C><I00>0 0</I00><V10>1 0</V10><V01>0 1</V01></OrIntImaM2C>\n\
         <TypeProj>eProjStenope</TypeProj>\n{interior}\n<Externe><KnownConv>eConvApero_DistM2C</KnownConv>\n<Centre>{}</Centre>\n\
         <ParamRotation><CodageMatr><L1>{}</L1><L2>{}</L2><L3>{}</L3><TrueRot>true</TrueRot></CodageMatr></ParamRotation></Externe>\n\
         <Verif><Tol>0.001</Tol>{points}</Verif>\n<ConvOri><KnownConv>eConvApero_DistM2C</KnownConv></ConvOri>\n\
         </OrientationConique></ExportAPERO>\n",
        words(centre),
        words(rotation.row(0)),
        words(rotation.row(1)),
        words(rotation.row(2)),
    )
}

const BESIDE: &str =
    "<FileInterne>Ori-All/AutoCal.xml</FileInterne><RelativeNameFI>true</RelativeNameFI>";

fn read_files(files: &[(&str, &str)]) -> Result<Draft> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    read(folder.path(), &CameraOptions::default())
}

fn agrees(draft: &Draft, index: usize, p: [f64; 2]) {
    let (lens, pose) = draft.photos[index].orientation.as_ref().unwrap();
    let (rotation, centre) = truth();
    for [x, y] in RAYS {
        let q = DVec3::new(x, y, 1.0) * 30.0;
        let seen = pose.camera_from_ground(rotation * q + centre);
        let at = lens.photo_from_ray(seen.truncate() / seen.z).unwrap();
        let wanted = project(q, p) + 0.5;
        assert!((at - wanted).length() < 1e-4, "{at} instead of {wanted}");
    }
}

#[test]
fn orientations_see_what_micmac_does() {
    let beside = orientation(BESIDE, P);
    let interior = calibration("<ModRad>RADIAL</ModRad>");
    let interior = interior
        .replace("<?xml version=\"1.0\" ?>\n<ExportAPERO>\n<CalibrationInternConique>", "<Interne>")
        .replace("</CalibrationInternConique></ExportAPERO>", "</Interne>");
    let draft = read_files(&[
        ("Orientation-a b.JPG.xml", &beside),
        ("Orientation-c.tif.xml", &orientation(&interior, [0.0; 2])),
        ("AutoCal.xml", &calibration(STANDARD)),
    ])
    .unwrap();
    let names: Vec<_> = draft.photos.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["a b.JPG", "c.tif"]);
    agrees(&draft, 0, P);
    agrees(&draft, 1, [0.0; 2]);
    // What the check of the files says, each photo sees too.
    assert_eq!(draft.ties.len(), 8);
    for tie in &draft.ties {
        let (lens, pose) = draft.photos[tie.photo].orientation.as_ref().unwrap();
        let seen = pose.camera_from_ground(tie.point_ground);
        let at = lens.photo_from_ray(seen.truncate() / seen.z).unwrap();
        assert!((at - tie.position_px).length() < 1e-4, "{at} instead of {}", tie.position_px);
    }
}

#[test]
fn what_cannot_be_computed_is_left_out_with_its_reason() {
    let good = orientation(BESIDE, P);
    for (calibration, orientation, word) in [
        (calibration(STANDARD).replace("<P1>", "<b1>1e-5</b1><P1>"), good.clone(), "b1 or b2"),
        (
            calibration("<ModUnif><TypeModele>eModele_FishEye_10_5_5</TypeModele></ModUnif>"),
            good.clone(),
            "FishEye",
        ),
        (calibration(STANDARD).replace("DistM2C", "DistC2M"), good.clone(), "DistC2M"),
        (calibration(STANDARD), good.replace("<V10>1 0", "<V10>2 0"), "OrIntImaM2C"),
        (calibration(STANDARD), good.replace("eProjStenope", "eProjOrtho"), "eProjOrtho"),
        (calibration(STANDARD), good.replace("CodageMatr", "CodageAngulaire"), "CodageMatr"),
        (
            calibration(STANDARD),
            good.replace(
                "<ConvOri><KnownConv>eConvApero_DistM2C",
                "<ConvOri><KnownConv>eConvOriLib",
            ),
            "eConvOriLib",
        ),
    ] {
        let draft =
            read_files(&[("Orientation-a.xml", &orientation), ("AutoCal.xml", &calibration)]);
        let draft = draft.unwrap();
        let reason = draft.photos[0].orientation.as_ref().unwrap_err();
        assert!(reason.contains(word) && draft.ties.is_empty(), "{reason}");
    }
}

#[test]
fn what_makes_no_cameras_is_an_error_with_file_and_line() {
    let (orientation, calibration) = (orientation(BESIDE, P), calibration(STANDARD));
    for (in_calibration, from, to, what) in [
        (false, "<L3>", "<L4>", "well-formed"),
        (
            false,
            "<Centre>",
            "<Centre>1 ",
            "Orientation-a.xml: line 8: expected 3 finite numbers in <Centre>",
        ),
        (false, "AutoCal", "Other", "no \"Other.xml\""),
        (false, "OrientationConique", "Orientation", "<OrientationConique>"),
        (false, "<L1>", "<L1>0 0 0</L1><L1>", "rotation matrix"),
        (true, "4608 3072", "4608.5 3072", "AutoCal.xml: line 7"),
        (true, "<F>", "<F>-", "positive focal"),
        (true, "CalibrationInternConique", "Calibration", "<CalibrationInternConique>"),
    ] {
        let edit =
            |text: &str, is_it: bool| if is_it { text.replace(from, to) } else { text.to_owned() };
        let files = [
            ("Orientation-a.xml", &*edit(&orientation, !in_calibration)),
            ("AutoCal.xml", &*edit(&calibration, in_calibration)),
        ];
        let e = read_files(&files).unwrap_err();
        assert!(e.exit_code() == 2 && e.to_string().contains(what), "{what}: {e}");
    }
    let folder = tempfile::tempdir().unwrap();
    assert!(!is_folder(folder.path()).unwrap());
    assert!(read(folder.path(), &CameraOptions::default()).is_err());
}

#[test]
fn a_damaged_file_is_an_error_or_cameras() {
    let good =
        [("Orientation-a.xml", orientation(BESIDE, P)), ("AutoCal.xml", calibration(STANDARD))];
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in &good {
        for bad in damaged(text.as_bytes(), 1500) {
            for (name, text) in &good {
                fs::write(folder.path().join(name), text).unwrap();
            }
            fs::write(folder.path().join(name), bad).unwrap();
            if let Err(e) = read(folder.path(), &CameraOptions::default()) {
                assert_eq!(e.exit_code(), 2, "{e}");
            }
        }
    }
}
