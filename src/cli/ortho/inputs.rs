//! What a job reads: meshes and oriented photos.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::super::config::Config;
use super::masks::{self, Mask};
use super::points::Clouds;
use crate::camera::{CameraSet, Photo};
use crate::geom::{Bounds3, MeshSource};
use crate::input::{CameraFormat, Cameras, MeshProof, Proof, open_mesh, read_cameras, shifted};
use crate::report::LeftOut;
use crate::{Error, Result};

/// The meshes and the photos that were chosen.
#[derive(Debug)]
pub(in crate::cli) struct Inputs {
    pub(in crate::cli) meshes: Vec<Box<dyn MeshSource>>,
    pub(in crate::cli) clouds: Clouds,
    pub(in crate::cli) cameras: CameraSet,
    /// The format that they came in.
    pub(in crate::cli) format: CameraFormat,
    /// What their tie points say.
    pub(in crate::cli) proof: Option<Proof>,
    /// The photos to use, by id.
    pub(in crate::cli) photos: Vec<Photo>,
    /// The masks of those that have one, by id.
    pub(in crate::cli) masks: Vec<Mask>,
    /// Photos that were chosen but cannot be used, by id.
    pub(in crate::cli) left_out: Vec<LeftOut>,
}

impl Inputs {
    /// Reads the cameras and the heads of the meshes, point clouds and masks.
    pub(in crate::cli) fn read(config: &Config) -> Result<Self> {
        let shift = DVec3::from_array(config.shift);
        let open = |path: &PathBuf| Ok(shifted(open_mesh(path)?, shift));
        let meshes = config.meshes.iter().map(open).collect::<Result<_>>()?;
        let clouds = Clouds::open(config)?;
        check_folder(&config.photos)?;
        let Cameras { set: cameras, format, proof } =
            read_cameras(&config.cameras, &config.camera_options)?;
        if let Some(pattern) = config.choice.idle_pattern(&cameras.names) {
            let message =
                format!("no photo of {} is named like {pattern:?}", config.cameras.display());
            return Err(Error::usage(format!("--include or --exclude: {message}")));
        }
        let chosen = |name: &str| config.choice.wants(name);
        let photos: Vec<_> = cameras.photos.iter().filter(|p| chosen(&p.name)).cloned().collect();
        let left_out: Vec<_> = cameras
            .left_out
            .iter()
            .filter(|p| chosen(&p.name))
            .map(|p| LeftOut { photo: p.name.clone(), reason: p.reason.clone() })
            .collect();
        if photos.is_empty() {
            return Err(Error::usage(no_photo(config, &cameras, &left_out)));
        }
        let masks = masks::find(config, &photos)?;
        Ok(Self { meshes, clouds, cameras, format, proof, photos, masks, left_out })
    }

    /// What the cameras' tie points and the bounds of the mesh, ground, say against the cameras.
    pub(in crate::cli) fn doubts(
        &self,
        config: &Config,
        bounds_ground: &Bounds3,
    ) -> Result<Vec<String>> {
        let read = (&*config.cameras, self.format, &config.camera_options);
        let by_mesh = MeshProof::of(read, &self.photos, bounds_ground)?;
        let by_ties = self.proof.and_then(|proof| proof.warning());
        Ok(by_ties.into_iter().chain(by_mesh.warnings()).collect())
    }
}

fn check_folder(path: &Path) -> Result<()> {
    let found = std::fs::metadata(path).map_err(|e| Error::io(path, e))?;
    if found.is_dir() {
        Ok(())
    } else {
        Err(Error::corrupt(path, "--photos", "a folder of photos", "a file"))
    }
}

/// Why there is no photo to use.
fn no_photo(config: &Config, cameras: &CameraSet, left_out: &[LeftOut]) -> String {
    let set = config.cameras.display();
    match left_out.first() {
        Some(first) => format!(
            "no photo of {set} can be used: {} are left out, the first is {}: {}",
            left_out.len(),
            first.photo,
            first.reason
        ),
        None if cameras.names.is_empty() => format!("{set} holds no oriented photo"),
        None => format!(
            "--include and --exclude leave none of the {} photos of {set}",
            cameras.names.len()
        ),
    }
}
