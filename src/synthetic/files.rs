//! Writes a scene's files: photographs, the COLMAP model, the mesh, the project file.
//!
//! In: shots, pictures, triangles. Out: a folder that `groundel ortho project.toml` takes: `mesh.ply`, `photos/`,
//! `sparse/` (COLMAP text), `project.toml` and the frame on its own, `frame.toml`. Nothing is read.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::{BufWriter, Write};
use std::path::Path;

use ::image::codecs::jpeg::JpegEncoder;
use ::image::codecs::png::PngEncoder;
use ::image::{ExtendedColorType, ImageEncoder};
use glam::DVec3;

use super::shot::CameraSpec;
use super::{PlaneSpec, Shot};
use crate::image::{Image, Samples};
use crate::{Error, Result};

/// Quality of JPEG photographs; chroma is not subsampled.
const JPEG_QUALITY: u8 = 95;

/// Names of files and folders within a project's folder.
pub mod names {
    /// The mesh.
    pub const MESH: &str = "mesh.ply";
    /// The photographs' folder.
    pub const PHOTOS: &str = "photos";
    /// The COLMAP model's folder.
    pub const CAMERAS: &str = "sparse";
    /// The project file.
    pub const PROJECT: &str = "project.toml";
    /// The frame on its own.
    pub const FRAME: &str = "frame.toml";
    /// The mosaic that the project file asks for.
    pub const MOSAIC: &str = "mosaic.tif";
}

/// Writes a picture as its name ends: `.jpg` (quality 95, 4:4:4) or `.png`; folders are made.
///
/// # Errors
/// [`Error::Io`] if it cannot be written; [`Error::Usage`] for another ending, or a JPEG of 16 bits.
pub fn write_picture(path: &Path, picture: &Samples) -> Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    }
    let file = fs::File::create(path).map_err(|e| Error::io(path, e))?;
    let mut out = BufWriter::new(file);
    let encoded = match (ending(path), picture) {
        ("png", Samples::U8(image)) => {
            encode(PngEncoder::new(&mut out), image, image.data(), ColourDepth::Eight)
        }
        ("png", Samples::U16(image)) => {
            // The encoder takes the bytes of this machine's integers and writes the file's order itself.
            let bytes = bytemuck::cast_slice(image.data());
            encode(PngEncoder::new(&mut out), image, bytes, ColourDepth::Sixteen)
        }
        ("jpg", Samples::U8(image)) => {
            let encoder = JpegEncoder::new_with_quality(&mut out, JPEG_QUALITY);
            encode(encoder, image, image.data(), ColourDepth::Eight)
        }
        _ => {
            let path = path.display();
            let message =
                format!("{path}: a picture of {} bits has no such format", picture.bits());
            return Err(Error::usage(message));
        }
    };
    let encoded = encoded.map_err(std::io::Error::other).and_then(|()| out.flush());
    encoded.map_err(|e| Error::io(path, e))
}

/// Bits of a sample.
#[derive(Debug, Clone, Copy)]
enum ColourDepth {
    Eight,
    Sixteen,
}

fn encode<T: Copy>(
    encoder: impl ImageEncoder,
    image: &Image<T>,
    bytes: &[u8],
    depth: ColourDepth,
) -> ::image::ImageResult<()> {
    let colour = match (image.channels(), depth) {
        (1, ColourDepth::Eight) => ExtendedColorType::L8,
        (1, ColourDepth::Sixteen) => ExtendedColorType::L16,
        (_, ColourDepth::Eight) => ExtendedColorType::Rgb8,
        (_, ColourDepth::Sixteen) => ExtendedColorType::Rgb16,
    };
    encoder.write_image(bytes, image.size().width, image.size().height, colour)
}

/// The name's last part in lower case, such as `png`; empty for anything that is written by no encoder here.
fn ending(path: &Path) -> &'static str {
    let is = |word: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(word));
    if is("png") {
        "png"
    } else if is("jpg") || is("jpeg") {
        "jpg"
    } else {
        ""
    }
}

/// Writes a COLMAP text model of some shots into `folder`: `cameras.txt`, `images.txt` with empty lines of
/// keypoints, `points3D.txt` without points. Equal cameras are written once. All numbers read back to the same bits.
///
/// # Errors
/// [`Error::Io`] if a file cannot be written.
pub fn write_colmap(folder: &Path, shots: &[Shot]) -> Result<()> {
    let mut cameras: Vec<&CameraSpec> = Vec::new();
    let mut images = "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, POINT3D_ID)\n"
        .to_owned();
    for (shot, id) in shots.iter().zip(1..) {
        let known = cameras.iter().position(|c| **c == shot.camera);
        let camera = known.unwrap_or_else(|| {
            cameras.push(&shot.camera);
            cameras.len() - 1
        });
        let numbers = shot.quaternion.iter().chain(shot.translation.as_ref()).map(f64::to_string);
        let numbers: Vec<String> = numbers.collect();
        // An empty line of keypoints follows.
        line(&mut images, &format!("{id} {} {} {}\n", numbers.join(" "), camera + 1, shot.name));
    }
    let mut text = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n".to_owned();
    for (camera, id) in cameras.iter().zip(1..) {
        let CameraSpec { model, size, params } = camera;
        let params: Vec<String> = params.iter().map(f64::to_string).collect();
        let (name, params) = (model.name(), params.join(" "));
        line(&mut text, &format!("{id} {name} {} {} {params}", size.width, size.height));
    }
    write_text(&folder.join("cameras.txt"), &text)?;
    write_text(&folder.join("images.txt"), &images)?;
    write_text(&folder.join("points3D.txt"), "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]\n")
}

/// Writes triangles as binary PLY with double coordinates, in their order; equal corners become one vertex.
///
/// # Errors
/// [`Error::Io`] if the file cannot be written.
///
/// # Panics
/// If there are 2³² corners or more.
pub fn write_triangles(path: &Path, triangles: &[[DVec3; 3]]) -> Result<()> {
    let mut index = BTreeMap::new();
    let mut vertices = Vec::new();
    let mut faces = Vec::with_capacity(triangles.len() * 13);
    for corner in triangles.as_flattened().chunks_exact(3) {
        faces.push(3);
        for p in corner {
            let next = u32::try_from(index.len()).expect("a test's mesh is small");
            let k = *index.entry(p.to_array().map(f64::to_bits)).or_insert_with(|| {
                vertices.extend(p.to_array().iter().flat_map(|c| c.to_le_bytes()));
                next
            });
            faces.extend(k.to_le_bytes());
        }
    }
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
         property double z\nelement face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        index.len(),
        triangles.len()
    );
    let bytes = [header.into_bytes(), vertices, faces].concat();
    write_bytes(path, &bytes)
}

/// Writes `frame.toml`, and `project.toml` with the folder's mesh, cameras, photos and frame, the mosaic
/// `mosaic.tif` and the given layers.
///
/// # Errors
/// [`Error::Io`] if a file cannot be written.
pub fn write_project(folder: &Path, frame: &PlaneSpec, layers: &[&str]) -> Result<()> {
    let frame = frame.to_toml();
    let layers: Vec<String> = layers.iter().map(|l| format!("{l:?}")).collect();
    let text = format!(
        "mesh = [{:?}]\ncameras = {:?}\nphotos = {:?}\nout = {:?}\nlayers = [{}]\n\n[frame]\n{frame}",
        names::MESH,
        names::CAMERAS,
        names::PHOTOS,
        names::MOSAIC,
        layers.join(", "),
    );
    write_text(&folder.join(names::FRAME), &frame)?;
    write_text(&folder.join(names::PROJECT), &text)
}

fn line(text: &mut String, line: &str) {
    writeln!(text, "{line}").expect("a string takes all");
}

fn write_text(path: &Path, text: &str) -> Result<()> {
    write_bytes(path, text.as_bytes())
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    }
    fs::write(path, bytes).map_err(|e| Error::io(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameSpec;
    use crate::geom::Size;
    use crate::input::{CameraOptions, Project, read_cameras};
    use crate::synthetic::{Random, photos, scenes};

    #[test]
    fn the_written_cameras_read_back_to_the_same_photos_bit_by_bit() {
        let folder = tempfile::tempdir().unwrap();
        for scene in scenes::all() {
            let path = folder.path().join(scene.name);
            write_colmap(&path, &scene.shots).unwrap();
            assert_eq!(
                read_cameras(&path, &CameraOptions::default()).unwrap().set,
                photos(&scene.shots).unwrap(),
                "{}",
                scene.name
            );
        }
    }

    #[test]
    fn the_written_project_names_its_files_and_holds_its_frame() {
        let folder = tempfile::tempdir().unwrap();
        for scene in [scenes::oblique(), scenes::hidden_section()] {
            write_project(folder.path(), &scene.plane, &["face", "count"]).unwrap();
            let project = Project::read(folder.path().join(names::PROJECT)).unwrap();
            assert_eq!(project.mesh, [folder.path().join("mesh.ply")]);
            assert_eq!(project.photos, Some(folder.path().join("photos")));
            assert_eq!(project.cameras, Some(folder.path().join("sparse")));
            assert_eq!(project.layers, ["face", "count"]);
            let Some(FrameSpec::Plane(plane)) = project.frame else { panic!("a plane") };
            assert_eq!(
                (plane.origin, plane.u, plane.v),
                (scene.plane.origin, scene.plane.u_axis, scene.plane.v_axis)
            );
            assert_eq!(plane.extent, Some(scene.plane.extent));
            assert_eq!(plane.elevation, scene.plane.elevation);
        }
    }

    fn noise<T: Copy>(channels: usize, of: impl Fn(u64) -> T) -> Image<T> {
        let (size, mut r) = (Size::new(19, 11), Random::new(4));
        Image::from_data(size, channels, (0..19 * 11 * channels).map(|_| of(r.bits())).collect())
    }

    #[test]
    fn a_png_holds_every_sample_of_8_and_16_bits_in_grey_and_colour() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sub folder/a.PNG");
        for channels in [1, 3] {
            let eight = noise(channels, |b| b.to_le_bytes()[7]);
            write_picture(&path, &Samples::U8(eight.clone())).unwrap();
            assert_eq!(::image::open(&path).unwrap().as_bytes(), eight.data());
            let sixteen =
                noise(channels, |b| u16::from_le_bytes([b.to_le_bytes()[6], b.to_le_bytes()[7]]));
            write_picture(&path, &Samples::U16(sixteen.clone())).unwrap();
            let read = ::image::open(&path).unwrap();
            let read = if channels == 1 {
                read.into_luma16().into_raw()
            } else {
                read.into_rgb16().into_raw()
            };
            assert_eq!(read, sixteen.data());
        }
    }

    #[test]
    fn a_jpeg_is_not_subsampled_and_comes_near_and_16_bits_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.jpg");
        let mut picture = Image::filled(Size::new(32, 16), 3, 90_u8);
        for x in 16..32 {
            picture.pixel_mut(x, 5)[0] = 160;
        }
        write_picture(&path, &Samples::U8(picture.clone())).unwrap();
        let bytes = fs::read(&path).unwrap();
        let frame = bytes.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
        // Sampling factors of the three components.
        assert!([11, 14, 17].iter().all(|k| bytes[frame + k] == 0x11));
        let read = ::image::open(&path).unwrap().into_rgb8().into_raw();
        assert!(read.iter().zip(picture.data()).all(|(a, b)| a.abs_diff(*b) < 24));
        let deep = Samples::U16(Image::filled(Size::new(2, 2), 1, 7));
        assert!(matches!(write_picture(&path, &deep), Err(Error::Usage(_))));
        assert!(write_picture(&folder.path().join("a.gif"), &Samples::U8(picture)).is_err());
    }
}
