//! [`CogWriter`]: one layer as a Cloud Optimized GeoTIFF, its tiles written in any order.
//!
//! Layout (all little-endian):
//! 1. the header: classic TIFF if the file ends below 4 GiB, else BigTIFF;
//! 2. GDAL's ghost area, which tells readers that what follows is in order;
//! 3. the directories with their values: full resolution, then the overviews, large to small;
//! 4. the tiles: the smallest overview first, full resolution last, each level row by row; before each tile its
//!    length as u32, behind it its last four bytes again.
//!
//! The lengths of all tiles are given beforehand, so every offset is known before the first byte is written, nothing is
//! written twice, and tiles may come as they stand in another file. Memory: 20 to 32 bytes a tile for the tables, and one
//! tile. The bytes are a function of
//! the specification and the tiles: no time, no host, no path. Every tile is stored, undefined ones too.

use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use super::ifd::{Directory, Flavour};
use super::metadata::gdal_metadata;
use super::tile::predictor;
use super::{
    Compression, Georeference, Layer, Meaning, PendingFile, PrintResolution, Pyramid, TileKey,
    resolution,
};
use crate::{Error, Result};

/// Bytes of the buffer in which the directories are written.
const BUFFER: usize = 1 << 20;
/// Bytes beside each tile: its length before and its last four bytes behind.
const LEADER_AND_TRAILER: u64 = 8;
/// The ghost area, as GDAL's COG driver writes it; the blank at the end is where a later editor would write that the
/// order no longer holds.
const GHOST: &str = "LAYOUT=IFDS_BEFORE_DATA\nBLOCK_ORDER=ROW_MAJOR\nBLOCK_LEADER=SIZE_AS_UINT4\n\
    BLOCK_TRAILER=LAST_4_BYTES_REPEATED\nKNOWN_INCOMPATIBLE_EDITION=NO\n ";

/// When a file is a BigTIFF.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BigTiff {
    /// When it would pass 4 GiB.
    #[default]
    IfNeeded,
    /// Always.
    Always,
}

/// What a file holds, apart from its tiles.
#[derive(Debug, Clone, Copy)]
pub struct CogSpec<'a> {
    /// Samples, meaning, metadata.
    pub layer: &'a Layer,
    /// Levels and tiles.
    pub pyramid: Pyramid,
    /// How the tiles are compressed.
    pub compression: Compression,
    /// Where the pixels lie; none for a perspective mosaic.
    pub georeference: Option<&'a Georeference>,
    /// How large the pixels are on paper, if that is stated.
    pub resolution: Option<PrintResolution>,
    /// Classic or BigTIFF.
    pub big_tiff: BigTiff,
}

/// Writes a file, tile after tile, into an unfinished file beside its final place; dropped, it leaves nothing.
#[derive(Debug)]
pub struct CogWriter {
    out: PendingFile,
    lengths: Vec<u32>,
    /// Where the leader of each tile goes; [`WRITTEN`] once it is there.
    leaders: Vec<u64>,
    written: usize,
    /// Leader, tile and trailer.
    record: Vec<u8>,
}

/// No offset of a tile: before it stands a header.
const WRITTEN: u64 = 0;

/// Where everything stands in the file.
struct Layout {
    flavour: Flavour,
    /// Offset and length of the directories, full resolution first.
    directories: Vec<(u64, u64)>,
    /// Offset of the first tile's leader.
    data: u64,
    /// Length of the file.
    end: u64,
}

impl CogWriter {
    /// Begins the file `path`. `lengths` are the bytes of each tile, in the order of [`Pyramid::file_order`].
    ///
    /// # Errors
    /// If the file cannot be created or written.
    ///
    /// # Panics
    /// If the number of lengths is not the number of tiles.
    pub fn create(path: &Path, spec: &CogSpec<'_>, lengths: Vec<u32>) -> Result<Self> {
        let tiles: usize = (0..spec.pyramid.levels()).map(|l| spec.pyramid.tile_count(l)).sum();
        assert_eq!(lengths.len(), tiles, "one length for each tile");
        let layout = Layout::of(spec, &lengths);
        let mut out = PendingFile::create(path)?;
        let mut head = BufWriter::with_capacity(BUFFER, &mut out);
        let result = write_head(&mut head, spec, &layout, &lengths).and_then(|()| head.flush());
        drop(head);
        result.map_err(|e| Error::io(path, e))?;
        let mut next = layout.data;
        let leader = |length: &u32| {
            let leader = next;
            next += u64::from(*length) + LEADER_AND_TRAILER;
            leader
        };
        let leaders = lengths.iter().map(leader).collect();
        Ok(Self { out, lengths, leaders, written: 0, record: Vec::new() })
    }

    /// Writes tile `k` in the order of [`Pyramid::file_order`]; the bytes are those of [`super::encode_tile`].
    ///
    /// # Errors
    /// If the disk refuses.
    ///
    /// # Panics
    /// If there is no such tile, it has not the length that was announced, or comes twice.
    pub fn write_tile(&mut self, k: usize, bytes: &[u8]) -> Result<()> {
        let length = self.lengths[k];
        assert_eq!(bytes.len(), length as usize, "a tile is as long as announced");
        let leader = std::mem::replace(&mut self.leaders[k], WRITTEN);
        assert_ne!(leader, WRITTEN, "a tile comes once");
        self.written += 1;
        // Fewer than four bytes are preceded by zeros.
        let mut last = [0; 4];
        let n = bytes.len().min(4);
        last[4 - n..].copy_from_slice(&bytes[bytes.len() - n..]);
        self.record.clear();
        self.record.reserve(bytes.len() + 8);
        self.record.extend(length.to_le_bytes());
        self.record.extend(bytes);
        self.record.extend(last);
        let written = self.out.seek(SeekFrom::Start(leader));
        let written = written.and_then(|_| self.out.write_all(&self.record));
        written.map_err(|e| Error::io(self.out.target(), e))
    }

    /// The whole file, on the disk but not yet in its place.
    ///
    /// # Errors
    /// If the disk refuses.
    ///
    /// # Panics
    /// If a tile is missing.
    pub fn complete(self) -> Result<PendingFile> {
        assert_eq!(self.written, self.lengths.len(), "every tile is written");
        self.out.sync()?;
        Ok(self.out)
    }

    /// Completes the file and puts it in its place.
    ///
    /// # Errors
    /// If the disk refuses.
    ///
    /// # Panics
    /// If a tile is missing.
    pub fn finish(self) -> Result<()> {
        self.complete()?.commit()
    }
}

impl Layout {
    /// The layout of a file, classic unless that would pass 4 GiB or BigTIFF is asked for.
    fn of(spec: &CogSpec<'_>, lengths: &[u32]) -> Self {
        let classic = Self::new(spec, Flavour::Classic, lengths);
        if spec.big_tiff == BigTiff::Always || u32::try_from(classic.end).is_err() {
            Self::new(spec, Flavour::Big, lengths)
        } else {
            classic
        }
    }

    fn new(spec: &CogSpec<'_>, flavour: Flavour, lengths: &[u32]) -> Self {
        // Values of tables do not change the length of a directory, only their number does.
        let directory_bytes = |level| {
            let tiles = spec.pyramid.tile_count(level);
            directory(spec, flavour, level, &vec![0; tiles], &vec![0; tiles]).len()
        };
        let mut at = (flavour.header(0).len() + ghost_area().len()) as u64;
        at += at % 2;
        let mut directories = Vec::new();
        for level in 0..spec.pyramid.levels() {
            let length = directory_bytes(level);
            directories.push((at, length));
            at += length;
        }
        let tiles: u64 = lengths.iter().map(|n| u64::from(*n) + LEADER_AND_TRAILER).sum();
        Self { flavour, directories, data: at, end: at + tiles }
    }
}

fn ghost_area() -> String {
    format!("GDAL_STRUCTURAL_METADATA_SIZE={:06} bytes\n{GHOST}", GHOST.len())
}

/// Header, ghost area and directories.
fn write_head(
    out: &mut impl Write,
    spec: &CogSpec<'_>,
    layout: &Layout,
    lengths: &[u32],
) -> std::io::Result<()> {
    let mut head = layout.flavour.header(layout.directories[0].0);
    head.extend(ghost_area().bytes());
    head.resize(head.len().next_multiple_of(2), 0);
    out.write_all(&head)?;
    // The tables of a level are a run of the tiles in file order, the coarsest level's first.
    let counts: Vec<usize> =
        (0..spec.pyramid.levels()).map(|l| spec.pyramid.tile_count(l)).collect();
    for (level, (at, length)) in (0..).zip(&layout.directories) {
        let first: usize = counts.iter().skip(level as usize + 1).sum();
        let next = layout.directories.get(level as usize + 1).map_or(0, |d| d.0);
        let mut offset = layout.data + bytes_of(&lengths[..first]);
        let own = &lengths[first..first + counts[level as usize]];
        let offsets: Vec<u64> = own
            .iter()
            .map(|n| {
                let tile = offset + LEADER_AND_TRAILER / 2;
                offset += u64::from(*n) + LEADER_AND_TRAILER;
                tile
            })
            .collect();
        let bytes = directory(spec, layout.flavour, level, &offsets, own).into_bytes(*at, next);
        debug_assert_eq!(bytes.len() as u64, *length);
        out.write_all(&bytes)?;
    }
    Ok(())
}

fn bytes_of(lengths: &[u32]) -> u64 {
    lengths.iter().map(|n| u64::from(*n) + LEADER_AND_TRAILER).sum()
}

/// The directory of a level.
fn directory(
    spec: &CogSpec<'_>,
    flavour: Flavour,
    level: u32,
    offsets: &[u64],
    lengths: &[u32],
) -> Directory {
    let (layer, tile_size) = (spec.layer, spec.pyramid.tile_size());
    let size = spec.pyramid.level_size(level);
    let channels = layer.channels();
    let channels_tag = u16::try_from(channels).expect("at most four channels");
    let mut d = Directory::new(flavour);
    d.longs(254, &[u32::from(level > 0)]); // NewSubfileType: 1 = reduced resolution
    d.longs(256, &[size.width]); // ImageWidth
    d.longs(257, &[size.height]); // ImageLength
    d.shorts(258, &vec![layer.sample().bits(); channels]); // BitsPerSample
    d.shorts(259, &[spec.compression.tag()]); // Compression
    d.shorts(262, &[photometric(layer)]); // PhotometricInterpretation
    d.shorts(277, &[channels_tag]); // SamplesPerPixel
    d.shorts(284, &[1]); // PlanarConfiguration: interleaved
    resolution::add_tags(spec.resolution, level, &mut d);
    d.shorts(317, &[predictor(layer, spec.compression).tag()]); // Predictor
    if layer.meaning() == Meaning::Coverage {
        d.shorts(320, &coverage_colours()); // ColorMap
    }
    d.longs(322, &[tile_size]); // TileWidth
    d.longs(323, &[tile_size]); // TileLength
    d.offsets(324, offsets); // TileOffsets
    d.longs(325, lengths); // TileByteCounts
    if layer.meaning() == Meaning::Mosaic {
        d.shorts(338, &[2]); // ExtraSamples: unassociated alpha
    }
    if let Some(profile) = layer.profile() {
        d.bytes(34675, profile); // ICCProfile
    }
    let format = if layer.sample().is_float() { 3 } else { 1 };
    d.shorts(339, &vec![format; channels]); // SampleFormat
    if let Some(text) = layer.nodata_text() {
        d.ascii(42113, text); // GDAL_NODATA
    }
    if level == 0 {
        d.ascii(270, layer.meaning().description()); // ImageDescription
        d.ascii(305, concat!("groundel ", env!("CARGO_PKG_VERSION"))); // Software
        d.ascii(42112, &gdal_metadata(layer)); // GDAL_METADATA
        if let Some(georeference) = spec.georeference {
            georeference.add_tags(&mut d);
        }
    }
    d
}

fn photometric(layer: &Layer) -> u16 {
    match (layer.meaning(), layer.channels()) {
        (Meaning::Coverage, _) => 3, // palette
        (Meaning::Mosaic, 4) => 2,   // RGB
        _ => 1,                      // black is zero
    }
}

/// Red: no photo; green: one; blue: two; grey: more. All reds, then all greens, then all blues.
fn coverage_colours() -> Vec<u16> {
    const COLOURS: [[u8; 3]; 4] = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [128, 128, 128]];
    let value = |channel: usize, index: usize| {
        COLOURS.get(index).map_or(0, |colour| u16::from(colour[channel]) * 257)
    };
    (0..3).flat_map(|channel| (0..256).map(move |index| value(channel, index))).collect()
}

/// A tile as messages name it.
impl std::fmt::Display for TileKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "tile ({}, {}) of level {}", self.x, self.y, self.level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Size;

    #[test]
    fn a_file_is_a_big_tiff_from_the_first_byte_beyond_32_bits() {
        let layer = Layer::of(Meaning::Count).unwrap();
        let spec = CogSpec {
            layer: &layer,
            pyramid: Pyramid::new(Size::new(32, 16), 16).unwrap(),
            compression: Compression::Deflate,
            georeference: None,
            resolution: None,
            big_tiff: BigTiff::IfNeeded,
        };
        let empty = Layout::of(&spec, &[0, 0, 0]);
        assert_eq!(empty.flavour, Flavour::Classic);
        let room = u32::MAX - u32::try_from(empty.end).unwrap();
        let full = Layout::of(&spec, &[7, room - 7, 0]);
        assert_eq!((full.flavour, full.end), (Flavour::Classic, u64::from(u32::MAX)));
        assert_eq!(Layout::of(&spec, &[7, room - 7, 1]).flavour, Flavour::Big);
        let always = CogSpec { big_tiff: BigTiff::Always, ..spec };
        assert_eq!(Layout::of(&always, &[0, 0, 0]).flavour, Flavour::Big);
    }

    #[test]
    fn a_mosaic_given_up_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let layer = Layer::of(Meaning::Count).unwrap();
        let spec = CogSpec {
            layer: &layer,
            pyramid: Pyramid::new(Size::new(32, 16), 16).unwrap(),
            compression: Compression::None,
            georeference: None,
            resolution: None,
            big_tiff: BigTiff::IfNeeded,
        };
        let path = folder.path().join("a.tif");
        let mut writer = CogWriter::create(&path, &spec, vec![256; 3]).unwrap();
        writer.write_tile(2, &[0; 256]).unwrap();
        drop(writer);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
