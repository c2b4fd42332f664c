//! [`assemble`]: the parts of a job become its files.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::known::Known;
use super::part::name_tiles;
use super::{Manifest, PartReader, Run, TileAddress, curve_order, run};
use crate::output::{BigTiff, CogSpec, CogWriter, Meaning, PendingFile, Raster};
use crate::{Error, Result};

/// What is to be assembled, and into what.
#[derive(Debug, Clone, Copy)]
pub struct Assembly<'a> {
    /// The job.
    pub manifest: &'a Manifest,
    /// Its parts, in any order.
    pub parts: &'a [PathBuf],
    /// The file of each layer of the manifest, in its order; their folders exist.
    pub outputs: &'a [PathBuf],
    /// Small files that belong to the mosaic, with their bytes: its frame, and what else lies beside it.
    pub beside: &'a [(PathBuf, Vec<u8>)],
    /// Classic TIFF or BigTIFF.
    pub big_tiff: BigTiff,
}

/// Writes the files of all layers and those beside the mosaic, and when all are whole, puts them in their places: the
/// layers, what lies beside the mosaic, the mosaic. What stood there is replaced, each file at once. Compressed tiles
/// are copied as they are, in the order in which they stand in the parts: these are read from start to end, once, whatever
/// the order of the files. Memory is the parts' indexes, some 50 bytes a tile of each layer, and one tile. `progress` is
/// called once a tile, overviews and layers counted.
///
/// # Errors
/// If tiles are missing (they are named), a part is damaged, the disk refuses, or `progress` says so. Unless the last step, the renaming,
/// fails, all files that stood there stay.
///
/// # Panics
/// If there is not one output for each layer.
pub fn assemble(assembly: &Assembly<'_>, progress: &dyn Fn() -> Result<()>) -> Result<()> {
    let manifest = assembly.manifest;
    assert_eq!(assembly.outputs.len(), manifest.layers().len(), "one output a layer");
    let parts: Result<Vec<_>> =
        assembly.parts.iter().map(|path| PartReader::open(path, manifest)).collect();
    let known = Known::new(manifest, parts?);
    refuse_gaps(&known, manifest, manifest.pyramid().levels())?;
    let (mut layers, mut mosaic) = (Vec::new(), Vec::new());
    for (layer, file) in write_layers(assembly, &known, progress)?.into_iter().enumerate() {
        let is_mosaic = manifest.layers()[layer].meaning() == Meaning::Mosaic;
        if is_mosaic { mosaic.push(file) } else { layers.push(file) }
    }
    let beside: Result<Vec<_>> = assembly.beside.iter().map(write_beside).collect();
    // Readers wait for the mosaic; when it is there, so is all that belongs to it.
    layers.into_iter().chain(beside?).chain(mosaic).try_for_each(PendingFile::commit)
}

/// Makes the overviews that no part holds, because their tiles are in several, as the part `joined`; the parts that then
/// hold all of the job. Tiles of full resolution are read where an overview needs them, and none is rendered.
///
/// # Errors
/// If tiles are missing (they are named), a part is damaged, or the disk refuses.
pub fn join(manifest: &Manifest, parts: &[PathBuf], joined: &Path) -> Result<Vec<PathBuf>> {
    let opened: Result<Vec<_>> = parts.iter().map(|p| PartReader::open(p, manifest)).collect();
    let known = Known::new(manifest, opened?);
    refuse_gaps(&known, manifest, 1)?;
    let tiles = curve_order(&manifest.pyramid());
    let mut all = parts.to_vec();
    if known.work(&tiles).is_empty() {
        return Ok(all);
    }
    drop(known);
    let renderer = |tile: TileAddress| -> Result<Vec<Raster>> {
        Err(Error::usage(format!("tile ({}, {}) is missing", tile.x, tile.y)))
    };
    let job = Run { manifest, part: joined, held: None, others: parts, tiles: &tiles };
    run(&job, &renderer, &|_| Ok(()))?;
    all.push(joined.to_path_buf());
    Ok(all)
}

/// Refuses a job of which not all tiles of the first `levels` levels are there.
fn refuse_gaps(known: &Known<'_>, manifest: &Manifest, levels: u32) -> Result<()> {
    let pyramid = manifest.pyramid();
    for level in 0..levels {
        let missing = known.missing(&pyramid, level);
        if !missing.is_empty() {
            let what = if level == 0 { "tiles".into() } else { format!("overviews {level}") };
            let names = name_tiles(&missing);
            let of = pyramid.tile_count(level);
            let found = format!("{} of {of} {what} are missing: {names}", missing.len());
            return Err(Error::usage(format!("the job is not finished: {found}")));
        }
    }
    Ok(())
}

/// A small file, whole, but not yet in its place.
fn write_beside((path, bytes): &(PathBuf, Vec<u8>)) -> Result<PendingFile> {
    let mut file = PendingFile::create(path)?;
    file.write_all(bytes).map_err(|e| Error::io(path, e))?;
    file.sync()?;
    Ok(file)
}

/// The files of all layers, whole, but not yet in their places.
fn write_layers(
    assembly: &Assembly<'_>,
    known: &Known<'_>,
    progress: &dyn Fn() -> Result<()>,
) -> Result<Vec<PendingFile>> {
    let manifest = assembly.manifest;
    let pyramid = manifest.pyramid();
    let (mut writers, mut tiles) = (Vec::new(), Vec::new());
    for (layer, path) in assembly.outputs.iter().enumerate() {
        let spec = CogSpec {
            layer: &manifest.layers()[layer],
            pyramid,
            compression: manifest.format().compression,
            georeference: manifest.georeference(),
            resolution: manifest.resolution(),
            big_tiff: assembly.big_tiff,
        };
        let first = tiles.len();
        let found = pyramid.file_order().filter_map(|tile| known.find(layer, tile));
        tiles.extend(found.enumerate().map(|(k, found)| (layer, k, found)));
        let lengths = tiles[first..].iter().map(|(.., (entry, _))| entry.length).collect();
        writers.push(CogWriter::create(path, &spec, lengths)?);
    }
    tiles.sort_unstable_by_key(|(.., (entry, part))| (*part, entry.offset));
    let mut bytes = Vec::new();
    for (layer, k, found) in tiles {
        known.read(found, &mut bytes)?;
        writers[layer].write_tile(k, &bytes)?;
        progress()?;
    }
    writers.into_iter().map(CogWriter::complete).collect()
}
