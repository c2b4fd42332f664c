//! What is in the folder of a job.

use std::path::Path;

use super::super::job::{JobFolder, JobRecord};
use crate::Result;

/// Whether `path` is the folder of a job.
pub(super) fn is_job(path: &Path) -> bool {
    path.is_dir() && JobFolder::new(path).manifest().is_file()
}

/// Mosaic, layers, photos and batches of a job, and how far it is.
///
/// # Errors
/// What reading its manifest and parts gives.
pub(super) fn describe(path: &Path) -> Result<String> {
    let folder = JobFolder::new(path);
    let record = JobRecord::load(&folder)?;
    let manifest = &record.manifest;
    let (size, tile) = (manifest.size(), manifest.format().tile_size);
    let layers: Vec<_> = manifest.layers().iter().map(|layer| layer.meaning().name()).collect();
    let parts = folder.parts()?;
    let mut missing = 0;
    for batch in 0..record.batch_count() {
        missing += u32::from(!parts.is_finished(manifest, batch)?);
    }
    let faces: u64 = record.inputs.meshes.iter().map(|mesh| mesh.faces).sum();
    let (used, all) = (record.photos.len(), record.names.len());
    let tiles = manifest.pyramid().tile_count(0);
    let lines = [
        format!("{}: job of groundel {}", path.display(), record.groundel),
        format!("mosaic: {} × {} pixels, {tiles} tiles of {tile}", size.width, size.height),
        format!("layers: {}", layers.join(", ")),
        format!("mesh: {faces} faces; photos: {used} of {all} used"),
        format!("batches: {}, of which {missing} are missing", record.batch_count()),
    ];
    Ok(lines.join("\n") + "\n")
}
