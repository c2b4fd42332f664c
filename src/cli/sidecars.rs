//! The small files beside the mosaic: its frame, and those that were asked for.

use std::path::{Path, PathBuf};

use super::args::OrthoArgs;
use super::frame_choice::FrameChoice;
use super::job;
use super::settings::Cad;
use crate::batch::Manifest;
use crate::frame::{FrameSpec, Mosaic, frame_toml};
use crate::output::{Sidecar, dxf_name, image_dxf, world_file};
use crate::{Error, Result};

/// What the flags, merged with the project file, ask for.
///
/// # Errors
/// [`Error::Usage`] for a file that cannot say where a mosaic on this frame lies.
pub(super) fn asked(args: &OrthoArgs, frame: &FrameChoice) -> Result<Vec<Sidecar>> {
    let what = match frame {
        FrameChoice::Stated(FrameSpec::Perspective(_)) => "a perspective view",
        FrameChoice::Stated(FrameSpec::Cylinder(_)) => "a development of a cylinder",
        FrameChoice::Stated(FrameSpec::Plane(_)) | FrameChoice::Fit(_) => "a plane",
    };
    let refusal =
        |flag: &str, why: &str| Err(Error::usage(format!("{flag} does not go with {what}: {why}")));
    let mut sidecars = Vec::new();
    if args.world_file {
        if matches!(frame, FrameChoice::Stated(FrameSpec::Perspective(_))) {
            return refusal("--world-file", "it has no coordinates in metres");
        }
        sidecars.push(Sidecar::WorldFile);
    }
    if args.cad == Some(Cad::Dxf) {
        if what != "a plane" {
            return refusal("--cad dxf", "a drawing shows pictures on planes");
        }
        args.out.as_deref().map(dxf_name).transpose()?;
        sidecars.push(Sidecar::Dxf);
    }
    Ok(sidecars)
}

/// The files that lie beside the mosaic `out` of a job, with their bytes.
///
/// # Errors
/// [`Error::Usage`] for a mosaic that a drawing cannot show, or whose file's name it cannot hold.
pub(super) fn beside(
    manifest: &Manifest,
    mosaic: &Mosaic,
    out: &Path,
) -> Result<Vec<(PathBuf, Vec<u8>)>> {
    let mut files = vec![(job::frame_file(out), frame_toml(mosaic).into_bytes())];
    for &sidecar in manifest.sidecars() {
        let text = match (sidecar, manifest.georeference()) {
            (Sidecar::WorldFile, Some(georeference)) => world_file(georeference),
            (Sidecar::WorldFile, None) => continue,
            (Sidecar::Dxf, _) => image_dxf(mosaic, out)?,
        };
        files.push((job::sidecar_file(out, sidecar), text.into_bytes()));
    }
    Ok(files)
}
