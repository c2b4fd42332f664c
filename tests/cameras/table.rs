//! The plain table: angles, units, lens conventions, and its proof by the mesh.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec2, DVec3};
use groundel::geom::Bounds3;
use groundel::input::{AngleUnit, CameraFormat, CameraOptions, MeshProof, TableLens, read_cameras};

use crate::rig::{Camera, Rig};
use crate::writers;

pub(crate) const HEADER: &str = "name,X0,Y0,Z0,omega,phi,kappa,c,x0,y0,k1,k2,k3,p1,p2\n";

/// ω, φ, κ of `R = Rx Ry Rz`, radians, for axes with y up and z backward.
pub(crate) fn angles(camera: &Camera) -> [f64; 3] {
    let turn = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let r = (camera.rotation.transpose() * turn).transpose().to_cols_array_2d();
    [(-r[1][2]).atan2(r[2][2]), r[0][2].asin(), (-r[0][1]).atan2(r[0][0])]
}

/// The rig as a table: angles in units of `unit` radians, lengths in units of `pixel` pixels, coefficients on
/// positions in units of `scale` focal lengths.
fn table(rig: &Rig, folder: &Path, [unit, pixel]: [f64; 2], lens: TableLens) -> PathBuf {
    let mut text = HEADER.to_owned();
    for camera in &rig.cameras {
        let ([k1, k2, k3], [p1, p2]) = camera.brown();
        let c = camera.focal / pixel;
        let s = if lens == TableLens::Classical { c } else { 1.0 };
        let [omega, phi, kappa] = angles(camera).map(|a| a / unit);
        let inner = [
            (camera.principal.x - 320.0) / pixel,
            (240.0 - camera.principal.y) / pixel,
            k1 / s.powi(2),
            k2 / s.powi(4),
            k3 / s.powi(6),
            p1 / s,
            p2 / s,
        ];
        let pose = [&camera.centre.to_array()[..], &[omega, phi, kappa, c], &inner].concat();
        let numbers: Vec<_> = pose.iter().map(f64::to_string).collect();
        writeln!(text, "{},{}", camera.name, numbers.join(",")).unwrap();
    }
    let path = folder.join("cameras.csv");
    std::fs::write(&path, text).unwrap();
    path
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const GON: f64 = std::f64::consts::PI / 200.0;

#[test]
fn a_table_is_read_to_a_hundredth_of_a_pixel_in_every_unit() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::brown();
    rig.write_photos(&folder.path().join("photos"));
    for (angle_unit, unit) in
        [(AngleUnit::Degrees, DEGREE), (AngleUnit::Gon, GON), (AngleUnit::Radians, 1.0)]
    {
        for (pitch, pixel) in [(None, 1.0), (Some(0.0045), 1.0 / 0.0045)] {
            for lens in [TableLens::OpenCv, TableLens::Classical] {
                let path = table(&rig, folder.path(), [unit, pixel], lens);
                let options = CameraOptions {
                    angle_unit: Some(angle_unit),
                    pixel_pitch_mm: pitch,
                    lens,
                    ..writers::options(folder.path())
                };
                let cameras = read_cameras(&path, &options).unwrap();
                assert_eq!((cameras.format, cameras.proof), (CameraFormat::Table, None));
                let error = rig.greatest_error(&cameras.set);
                assert!(error < 0.01, "{angle_unit:?} {pitch:?} {lens:?}: {error} px");
            }
        }
    }
}

/// Where a measured position from the principal point, pixels, y up, is put by corrections in units of pixels.
fn corrected(k: [f64; 3], [p1, p2]: [f64; 2], DVec2 { x, y }: DVec2) -> DVec2 {
    let s = x * x + y * y;
    let g = 1.0 + k[0] * s + k[1] * s * s + k[2] * s * s * s;
    DVec2::new(
        x * g + p1 * (s + 2.0 * x * x) + 2.0 * p2 * x * y,
        y * g + p2 * (s + 2.0 * y * y) + 2.0 * p1 * x * y,
    )
}

#[test]
fn corrections_of_measured_positions_are_undone_to_a_hundredth_of_a_pixel() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::brown();
    rig.write_photos(&folder.path().join("photos"));
    let (k, p) = ([3.1e-7, -2.0e-13, 1.0e-19], [1.0e-7, -1.5e-7]);
    for pitch in [None, Some(0.0045)] {
        let pixel = 1.0 / pitch.unwrap_or(1.0);
        let mut text = HEADER.to_owned();
        for camera in &rig.cameras {
            let inner = [
                camera.focal / pixel,
                (camera.principal.x - 320.0) / pixel,
                (240.0 - camera.principal.y) / pixel,
                k[0] * pixel.powi(2),
                k[1] * pixel.powi(4),
                k[2] * pixel.powi(6),
                p[0] * pixel,
                p[1] * pixel,
            ];
            let values = [&camera.centre.to_array()[..], &angles(camera), &inner].concat();
            let numbers: Vec<_> = values.iter().map(f64::to_string).collect();
            writeln!(text, "{},{}", camera.name, numbers.join(",")).unwrap();
        }
        let path = folder.path().join("cameras.csv");
        std::fs::write(&path, text).unwrap();
        let options = CameraOptions {
            angle_unit: Some(AngleUnit::Radians),
            pixel_pitch_mm: pitch,
            lens: TableLens::Corrections,
            ..writers::options(folder.path())
        };
        let set = read_cameras(&path, &options).unwrap().set;
        assert_eq!(set.photos.len(), 6, "{:?}", set.left_out);
        let mut bent = 0.0_f64;
        for camera in &rig.cameras {
            let photo = set.find(&camera.name).unwrap();
            for at in (0..=12).map(|i| DVec2::new(53.3 * f64::from(i), 40.0 * f64::from(12 - i))) {
                let up = DVec2::new(at.x - camera.principal.x, camera.principal.y - at.y);
                let truth = corrected(k, p, up);
                let ray = DVec2::new(truth.x, -truth.y) / camera.focal;
                let seen = photo.lens.photo_from_ray(ray).unwrap();
                assert!((seen - at).length() < 0.01, "{seen} instead of {at}");
                bent = bent.max((truth - up).length());
            }
        }
        assert!(bent > 10.0, "{bent} px of distortion");
    }
}

#[test]
fn angles_in_another_unit_than_declared_are_detected_by_the_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::brown();
    rig.write_photos(&folder.path().join("photos"));
    let bounds = Bounds3::of(rig.points.iter().copied());
    for (unit, declared, better) in [
        (DEGREE, AngleUnit::Degrees, None),
        (GON, AngleUnit::Gon, None),
        (DEGREE, AngleUnit::Gon, Some(AngleUnit::Degrees)),
        (GON, AngleUnit::Degrees, Some(AngleUnit::Gon)),
    ] {
        let path = table(&rig, folder.path(), [unit, 1.0], TableLens::OpenCv);
        let options =
            CameraOptions { angle_unit: Some(declared), ..writers::options(folder.path()) };
        let set = read_cameras(&path, &options).unwrap().set;
        let proof =
            MeshProof::of((&path, CameraFormat::Table, &options), &set.photos, &bounds).unwrap();
        assert_eq!(proof.better, better, "{proof:?}");
        assert_eq!(proof.warnings().is_empty(), better.is_none(), "{:?}", proof.warnings());
    }
}

#[test]
fn a_table_without_unit_or_photos_is_a_usage_error() {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::brown();
    let path = table(&rig, folder.path(), [1.0, 1.0], TableLens::OpenCv);
    let e = read_cameras(&path, &CameraOptions::default()).unwrap_err();
    assert!(e.exit_code() == 2 && e.to_string().contains("--angle-unit"), "{e}");
    let options =
        CameraOptions { angle_unit: Some(AngleUnit::Radians), ..CameraOptions::default() };
    let e = read_cameras(&path, &options).unwrap_err();
    assert!(e.exit_code() == 2 && e.to_string().contains("--photos"), "{e}");
    let options =
        CameraOptions { angle_unit: options.angle_unit, ..writers::options(folder.path()) };
    let set = read_cameras(&path, &options).unwrap().set;
    assert_eq!((set.photos.len(), set.left_out.len()), (0, 6), "no photo is there");
    assert!(set.left_out[0].reason.contains("size"), "{:?}", set.left_out[0]);
}
