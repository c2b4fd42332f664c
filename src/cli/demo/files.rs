//! Writes the demo's input: mesh, cameras, photos and project file, in the formats that users bring.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use ::image::ExtendedColorType;
use ::image::codecs::jpeg::JpegEncoder;

use super::super::progress::Progress;
use super::set::{DemoSet, EDGE_M};
use crate::image::Image;
use crate::output::{Meaning, write_atomically};
use crate::synthetic::{
    Caster, PlyOptions, Refinement, Sampling, Shot, photograph, photos, write_ply,
};
use crate::{Error, Result};

/// Rays a pixel where it shows an edge: 3 × 3.
const EDGE_RAYS: u32 = 3;
/// Quality of the photos, of 100: as cameras store them at their best.
const JPEG_QUALITY: u8 = 95;
/// Name of the project file.
const PROJECT: &str = "facade.toml";

/// Writes the input of the demo into the folder `dir` and returns the project file.
///
/// # Errors
/// If a file cannot be written.
pub(super) fn write(dir: &Path, set: &DemoSet, caster: &Caster, quiet: bool) -> Result<PathBuf> {
    make_folder(&dir.join("sparse"))?;
    let mesh = Refinement::by_edge_length(&set.scene, EDGE_M)?;
    write_ply(&dir.join("mesh.ply"), &mesh, &PlyOptions::default())?;
    for (name, text) in colmap_model(&set.shots) {
        write_atomically(dir.join("sparse").join(name), text.as_bytes())?;
    }
    let cameras = photos(&set.shots)?;
    let progress = Progress::start("photographing", "photos", cameras.photos.len() as u64, quiet);
    for photo in &cameras.photos {
        let path = dir.join("photos").join(&photo.name);
        make_folder(path.parent().unwrap_or(dir))?;
        let picture = photograph::<u8>(caster, photo, Sampling::Edges(EDGE_RAYS), 3);
        write_atomically(&path, &jpeg(&picture, &path)?)?;
        progress.add(1);
    }
    progress.finish();
    let project = dir.join(PROJECT);
    write_atomically(&project, project_text(set).as_bytes())?;
    Ok(project)
}

fn make_folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(|e| Error::io(path, e))
}

fn jpeg(picture: &Image<u8>, path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let (size, samples) = (picture.size(), picture.data());
    JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY)
        .encode(samples, size.width, size.height, ExtendedColorType::Rgb8)
        .map_err(|e| Error::io(path, std::io::Error::other(e)))?;
    Ok(bytes)
}

/// The files of a COLMAP model in text form, without tie points: name and content.
fn colmap_model(shots: &[Shot]) -> [(&'static str, String); 3] {
    let mut cameras = String::from("# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n");
    let mut images = String::from("# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[]\n");
    let list = |numbers: &[f64]| {
        let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
        numbers.join(" ")
    };
    for (shot, id) in shots.iter().zip(1..) {
        let camera = &shot.camera;
        let (model, size) = (camera.model.name(), camera.size);
        let params = list(&camera.params);
        writeln!(cameras, "{id} {model} {} {} {params}", size.width, size.height)
            .expect("a string takes all");
        let pose = list(&[&shot.quaternion[..], &shot.translation.to_array()].concat());
        // The second line of a photo lists its tie points: none.
        writeln!(images, "{id} {pose} {id} {}\n", shot.name).expect("a string takes all");
    }
    let points = "# POINT3D_ID X Y Z R G B ERROR TRACK[]\n".to_string();
    [("cameras.txt", cameras), ("images.txt", images), ("points3D.txt", points)]
}

fn project_text(set: &DemoSet) -> String {
    let layers = Meaning::ALL.into_iter().filter(|layer| *layer != Meaning::Mosaic);
    let layers: Vec<_> = layers.map(|layer| format!("\"{}\"", layer.name())).collect();
    format!(
        "# Render it again with: groundel ortho {PROJECT}\n\
         mesh = [\"mesh.ply\"]\ncameras = \"sparse\"\nphotos = \"photos\"\nout = \"mosaic.tif\"\n\
         layers = [{}]\nreport = \"report.json\"\n\n[frame]\n{}",
        layers.join(", "),
        set.frame.to_toml()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::{Project, read_cameras};

    #[test]
    fn the_written_model_reads_back_to_the_same_photos() {
        let set = DemoSet::new();
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in colmap_model(&set.shots) {
            fs::write(folder.path().join(name), text).unwrap();
        }
        let (read, made) = (read_cameras(folder.path()).unwrap(), photos(&set.shots).unwrap());
        assert_eq!(read, made);
        assert_eq!(read.names[0], "ground/IMG 01.jpg");
    }

    #[test]
    fn the_project_file_is_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(PROJECT);
        fs::write(&path, project_text(&DemoSet::new())).unwrap();
        let project = Project::read(&path).unwrap();
        assert_eq!(project.layers.len(), 6);
        assert_eq!(project.out, Some(folder.path().join("mosaic.tif")));
    }
}
