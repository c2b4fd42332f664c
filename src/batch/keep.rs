//! [`keep`]: tiles of an earlier plan that hold in a new one.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::known::Known;
use super::notes::note_layer;
use super::{Manifest, PartReader, PartWriter, TileAddress};
use crate::Result;
use crate::output::TileKey;

/// Copies the tiles for which `holds` says yes from the parts of the manifest `old` into a part `to` of the manifest `new`,
/// as they are, with their notes, and the overviews of nothing but such tiles. The number of tiles; without any, no file
/// is written.
///
/// The manifests differ in their settings' fingerprint alone: see [`Manifest::is_like`].
///
/// # Errors
/// If a part cannot be read, is damaged or of another job; if the disk refuses.
///
/// # Panics
/// If the manifests differ in more.
pub fn keep(
    (old, parts): (&Manifest, &[PathBuf]),
    (new, to): (&Manifest, &Path),
    holds: &dyn Fn(TileAddress) -> bool,
) -> Result<usize> {
    assert!(old.is_like(new), "only the settings differ");
    let parts: Result<Vec<_>> = parts.iter().map(|path| PartReader::open(path, old)).collect();
    let known = Known::new(old, parts?);
    let pyramid = new.pyramid();
    let is_kept = |tile: TileKey| known.has(tile) && holds(TileAddress { x: tile.x, y: tile.y });
    let tiles: Vec<_> = pyramid.level_tiles(0).filter(|tile| is_kept(*tile)).collect();
    if tiles.is_empty() {
        return Ok(0);
    }
    let mut writer = PartWriter::create(to, None, new.fingerprint())?;
    let mut bytes = Vec::new();
    let mut copy = |tile: TileKey, layers: usize, writer: &mut PartWriter| {
        (0..layers).try_for_each(|layer| {
            let Some(found) = known.find(layer, tile) else { return Ok(()) };
            known.read(found, &mut bytes)?;
            writer.append(layer, tile, &bytes)
        })
    };
    for tile in &tiles {
        copy(*tile, note_layer(new) + 1, &mut writer)?;
    }
    let mut below: BTreeSet<_> = tiles.iter().copied().collect();
    for _ in 1..pyramid.levels() {
        let is_whole = |tile: &TileKey| {
            known.has(*tile) && pyramid.children(*tile).all(|quarter| below.contains(&quarter))
        };
        let parents: BTreeSet<_> = below.iter().map(|tile| tile.parent()).collect();
        let kept: BTreeSet<_> = parents.into_iter().filter(is_whole).collect();
        for tile in &kept {
            copy(*tile, note_layer(new), &mut writer)?;
        }
        below = kept;
    }
    writer.finish()?;
    Ok(tiles.len())
}
