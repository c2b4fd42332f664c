//! The rig in the formats of photogrammetric suites: Metashape, `Pix4D`, `RealityCapture`, `MicMac`.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};

use crate::rig::{Bend, Camera, Rig};
use crate::writers::{H, W, rows, words, written};

/// Ground from chunk: rotation, translation, scale.
fn chunk() -> (DMat3, DVec3, f64) {
    let rotation = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
    (rotation, DVec3::new(512_010.5, -2_340.25, 88.0), 3.25)
}

/// Metashape's XML with markers, by appendix C of its manual: one with coordinates for each of the rig's points.
pub(crate) fn metashape(rig: &Rig, folder: &Path) -> PathBuf {
    let (turn, shift, scale) = chunk();
    let (mut sensors, mut cameras) = (String::new(), String::new());
    for (k, camera) in rig.cameras.iter().enumerate() {
        let (kind, k4, [p1, p2]) = match camera.bend {
            Bend::Brown([k1, k2, k3], p) => ("frame", [k1, k2, k3, 0.0], p),
            Bend::Fisheye(k) => ("fisheye", k, [0.0; 2]),
            other => panic!("Metashape has no {other:?}"),
        };
        let size = format!("<resolution width=\"{W}\" height=\"{H}\"/>");
        let terms = [
            ("f", camera.focal),
            ("cx", camera.principal.x - 0.5 * W),
            ("cy", camera.principal.y - 0.5 * H),
            ("k1", k4[0]),
            ("k2", k4[1]),
            ("k3", k4[2]),
            ("k4", k4[3]),
            // In the manual's formulas p1 belongs to x, p2 to y.
            ("p1", p2),
            ("p2", p1),
        ];
        let terms = terms.map(|(name, v)| format!("<{name}>{v}</{name}>")).concat();
        writeln!(
            sensors,
            "<sensor id=\"{k}\" label=\"unknown\" type=\"{kind}\">{size}<calibration type=\"{kind}\" \
             class=\"adjusted\">{size}{terms}</calibration></sensor>"
        )
        .unwrap();
        let centre = turn.transpose() * (camera.centre - shift) / scale;
        let m = rows(turn.transpose() * camera.rotation.transpose());
        let matrix =
            [&m[0][..], &[centre.x], &m[1], &[centre.y], &m[2], &[centre.z, 0.0, 0.0, 0.0, 1.0]];
        let (matrix, label) = (words(&matrix.concat()), camera.name.trim_end_matches(".png"));
        writeln!(
            cameras,
            "<camera id=\"{k}\" sensor_id=\"{k}\" component_id=\"0\" label=\"{label}\"><transform>{matrix}</transform></camera>"
        )
        .unwrap();
    }
    let transform = format!(
        "<transform><rotation locked=\"true\">{}</rotation><translation locked=\"true\">{}</translation>\
         <scale locked=\"true\">{scale}</scale></transform>",
        words(&rows(turn).concat()),
        words(&shift.to_array())
    );
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<document version=\"2.0.0\">\n<chunk label=\"Chunk 1\" enabled=\"true\">\n\
         <sensors next_id=\"6\">{sensors}</sensors>\n<components next_id=\"1\" active_id=\"0\"><component id=\"0\" \
         label=\"Component 1\">{transform}</component></components>\n<cameras next_id=\"6\" next_group_id=\"0\">{cameras}\
         </cameras>\n{}</chunk>\n</document>\n",
        markers(rig)
    );
    written(folder.join("metashape.xml"), &text)
}

/// The markers with their coordinates, and where each frame's photos show them.
fn markers(rig: &Rig) -> String {
    let (mut points, mut seen) = (String::new(), String::new());
    for (p, DVec3 { x, y, z }) in rig.points.iter().enumerate() {
        writeln!(
            points,
            "<marker id=\"{p}\" label=\"target {p}\"><reference x=\"{x}\" y=\"{y}\" z=\"{z}\" sx=\"0.005\" enabled=\"true\"/></marker>"
        )
        .unwrap();
        write!(seen, "<marker marker_id=\"{p}\">").unwrap();
        for (k, of) in rig.seen.iter().enumerate() {
            let at = of[p];
            write!(
                seen,
                "<location camera_id=\"{k}\" pinned=\"true\" x=\"{}\" y=\"{}\"/>",
                at.x, at.y
            )
            .unwrap();
        }
        seen += "</marker>\n";
    }
    // One without coordinates, and one whose coordinates are not to be believed.
    points += "<marker id=\"98\" label=\"point 98\"/><marker id=\"99\" label=\"lost\"><reference x=\"0\" y=\"0\" z=\"0\" enabled=\"false\"/></marker>";
    for id in [98, 99] {
        write!(
            seen,
            "<marker marker_id=\"{id}\"><location camera_id=\"0\" x=\"3\" y=\"4\"/></marker>"
        )
        .unwrap();
    }
    format!(
        "<markers next_id=\"100\">{points}</markers>\n<frames next_id=\"1\"><frame id=\"0\"><markers>{seen}</markers></frame></frames>\n"
    )
}

/// `Pix4D`'s `calibrated_camera_parameters.txt` with its offset, by the file's own header.
pub(crate) fn pix4d(rig: &Rig, folder: &Path) -> PathBuf {
    let offset = DVec3::new(512_000.0, -2_000.0, 100.0);
    let mut text = String::from(
        "fileName imageWidth imageHeight \ncamera matrix K [3x3]\nradial distortion [3x1]\ntangential distortion [2x1]\n\
         camera position t [3x1]\ncamera rotation R [3x3]\ncamera model m = K [R|-Rt] X\n\n",
    );
    for camera in &rig.cameras {
        let (k, p) = camera.brown();
        let (f, c) = (camera.focal, camera.principal);
        writeln!(text, "{} {W} {H}\n{f} 0 {}\n0 {f} {}\n0 0 1", camera.name, c.x, c.y).unwrap();
        writeln!(text, "{}\n{}", words(&k), words(&p)).unwrap();
        writeln!(text, "{}", words(&(camera.centre - offset).to_array())).unwrap();
        for row in rows(camera.rotation) {
            writeln!(text, "{}", words(&row)).unwrap();
        }
    }
    written(folder.join("site_offset.xyz"), &words(&offset.to_array()));
    written(folder.join("site_calibrated_camera_parameters.txt"), &text)
}

/// Lengths in parts of the longer side, `k1 … k4, t1, t2`, as `RealityCapture` states a camera.
fn reality(camera: &Camera) -> ([f64; 3], [f64; 6]) {
    let ([k1, k2, k3], [p1, p2]) = camera.brown();
    let offset = (camera.principal - glam::DVec2::new(0.5 * W, 0.5 * H)) / W;
    ([camera.focal / W * 36.0, offset.x, offset.y], [k1, k2, k3, 0.0, p2, p1])
}

/// A folder of `RealityCapture`'s XMP files.
pub(crate) fn reality_xmp(rig: &Rig, folder: &Path) -> PathBuf {
    let xmp = folder.join("xmp");
    fs::create_dir_all(&xmp).unwrap();
    for camera in &rig.cameras {
        let ([f, u, v], coefficients) = reality(camera);
        let text = format!(
            "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\
             <rdf:Description xcr:Version=\"3\" xcr:DistortionModel=\"brown3t2\" xcr:FocalLength35mm=\"{f}\" xcr:Skew=\"0\"\n\
             xcr:AspectRatio=\"1\" xcr:PrincipalPointU=\"{u}\" xcr:PrincipalPointV=\"{v}\"\n\
             xmlns:xcr=\"http://www.capturingreality.com/ns/xcr/1.1#\"><xcr:Rotation>{}</xcr:Rotation>\n\
             <xcr:Position>{}</xcr:Position><xcr:DistortionCoeficients>{}</xcr:DistortionCoeficients>\n\
             </rdf:Description></rdf:RDF></x:xmpmeta>\n",
            words(&rows(camera.rotation).concat()),
            words(&camera.centre.to_array()),
            words(&coefficients)
        );
        written(xmp.join(&camera.name).with_extension("xmp"), &text);
    }
    xmp
}

/// `RealityCapture`'s table; `Rz(−heading) Rx(pitch) Ry(roll)` turns axes with y up and z backward to the ground.
pub(crate) fn reality_table(rig: &Rig, folder: &Path) -> PathBuf {
    let turn = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let mut text = "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n".to_owned();
    for camera in &rig.cameras {
        let r = rows(camera.rotation.transpose() * turn);
        let angles = [r[0][1].atan2(r[1][1]), r[2][1].asin(), (-r[2][0]).atan2(r[2][2])];
        let (inner, coefficients) = reality(camera);
        let angles = angles.map(f64::to_degrees);
        let values = [&camera.centre.to_array()[..], &angles, &inner, &coefficients].concat();
        writeln!(text, "{},{}", camera.name, words(&values).replace(' ', ",")).unwrap();
    }
    written(folder.join("reality.csv"), &text)
}

/// `MicMac`'s folder, a calibration a photo: `ModPhgrStd` in pixels, whose first pixel's centre is (0, 0), with the
/// points of the check.
pub(crate) fn micmac(rig: &Rig, folder: &Path) -> PathBuf {
    let ori = folder.join("Ori-Rig");
    fs::create_dir_all(&ori).unwrap();
    let convention = "<KnownConv>eConvApero_DistM2C</KnownConv>";
    for (k, camera) in rig.cameras.iter().enumerate() {
        let ([k1, k2, k3], [p1, p2]) = camera.brown();
        let (f, pp) = (camera.focal, camera.principal - 0.5);
        let calibration = format!(
            "<ExportAPERO><CalibrationInternConique>{convention}<PP>{x} {y}</PP><F>{f}</F><SzIm>{W} {H}</SzIm>\n\
             <CalibDistortion><ModPhgrStd><RadialePart><CDist>{x} {y}</CDist><CoeffDist>{:e}</CoeffDist>\
             <CoeffDist>{:e}</CoeffDist><CoeffDist>{:e}</CoeffDist></RadialePart><P1>{:e}</P1><P2>{:e}</P2></ModPhgrStd>\n\
             </CalibDistortion></CalibrationInternConique></ExportAPERO>\n",
            k1 / f.powi(2),
            k2 / f.powi(4),
            k3 / f.powi(6),
            p2 / f,
            p1 / f,
            x = pp.x,
            y = pp.y,
        );
        written(ori.join(format!("AutoCal-{k}.xml")), &calibration);
        let r = rows(camera.rotation.transpose());
        let check = |(at, point): (&glam::DVec2, &DVec3)| {
            let (im, ter) = (words(&(*at - 0.5).to_array()), words(&point.to_array()));
            format!("<Appuis><Num>1</Num><Im>{im}</Im><Ter>{ter}</Ter></Appuis>\n")
        };
        let checks: String = rig.seen[k].iter().zip(&rig.points).map(check).collect();
        let text = format!(
            "<ExportAPERO><OrientationConique><TypeProj>eProjStenope</TypeProj><FileInterne>Ori-Rig/AutoCal-{k}.xml\
             </FileInterne><Externe>{convention}<Centre>{}</Centre><ParamRotation><CodageMatr><L1>{}</L1><L2>{}</L2>\
             <L3>{}</L3></CodageMatr></ParamRotation></Externe><Verif><Tol>0.1</Tol>{checks}</Verif>\n\
             <ConvOri>{convention}</ConvOri></OrientationConique></ExportAPERO>\n",
            words(&camera.centre.to_array()),
            words(&r[0]),
            words(&r[1]),
            words(&r[2])
        );
        written(ori.join(format!("Orientation-{}.xml", camera.name)), &text);
    }
    ori
}
