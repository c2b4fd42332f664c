//! [`notes`]: what was found on each tile, kept in the parts beside its layers.
//!
//! So a run that goes on, or a job of many runs, reports on all tiles, whoever rendered them.

use std::path::PathBuf;

use super::known::Known;
use super::{Manifest, PartReader};
use crate::Result;

/// The number that notes bear in place of a layer's.
pub(super) fn note_layer(manifest: &Manifest) -> usize {
    manifest.layers().len()
}

/// Gives the note of every tile that the parts hold to `take`, in rows from the top.
///
/// # Errors
/// If a part cannot be read, is of another job or damaged; what `take` returns.
pub fn notes(
    manifest: &Manifest,
    parts: &[PathBuf],
    take: &mut dyn FnMut(&[u8]) -> Result<()>,
) -> Result<()> {
    let parts: Result<Vec<_>> = parts.iter().map(|p| PartReader::open(p, manifest)).collect();
    let known = Known::new(manifest, parts?);
    let mut bytes = Vec::new();
    for tile in manifest.pyramid().level_tiles(0) {
        if let Some(found) = known.find(note_layer(manifest), tile) {
            known.read(found, &mut bytes)?;
            take(&bytes)?;
        }
    }
    Ok(())
}
