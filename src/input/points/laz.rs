//! LAZ: the chunks of a compressed LAS file, one after the other.
//!
//! M. Isenburg (2013), "`LASzip`: lossless compression of `LiDAR` data", Photogrammetric Engineering & Remote Sensing 79(2),
//! 209–217, doi:10.14358/PERS.79.2.209. A chunk is read into memory as a whole, its lengths are compared with what is there,
//! and only then is it given to the crate `laz`, which believes them.

use std::fs::File;
use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use glam::DVec3;
use laz::laszip::{ChunkTable, CompressorType};
use laz::record::{
    LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor,
};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr};

use super::super::byte_reader::ByteReader;
use super::guard::guarded;
use super::las::{LasHeader, u16_at, u32_at, u64_at};
use crate::geom::{PointSource, PointStream};
use crate::{Error, Result};

/// Bytes of the head of a variable length record.
const RECORD_HEAD: usize = 54;
/// Most chunks of a file: at the usual 50,000 points each, five times 10¹⁰ points.
const MOST_CHUNKS: u64 = 1 << 20;
/// Most bytes of a chunk: those of 50,000 points are a megabyte or two.
const MOST_CHUNK_BYTES: u64 = 64 << 20;
/// Bytes of the place of the chunk table, in front of the first chunk.
const PLACE_BYTES: u64 = 8;
/// Where the chunk table's count of chunks stands in it.
const COUNT_AT: u64 = 4;
/// Layers of an item `Point14`.
const POINT14_LAYERS: usize = 9;

/// A chunk: where it lies in the file, and how many points it holds.
#[derive(Debug, Clone, Copy)]
struct Chunk {
    at: u64,
    bytes: u64,
    points: u64,
}

/// A LAZ file whose table of chunks has been checked.
#[derive(Debug)]
pub(super) struct LazFile {
    path: PathBuf,
    header: LasHeader,
    items: Vec<LazItem>,
    chunks: Vec<Chunk>,
}

impl LazFile {
    /// The file of which `header` was read from `reader`, which stands at its start.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if a length contradicts another or the file; [`Error::Unsupported`] for points that are not in
    /// chunks; [`Error::Limit`] for too many chunks, or too large ones; [`Error::Io`].
    pub(super) fn open(mut reader: ByteReader<'_>, header: LasHeader) -> Result<Self> {
        let path = reader.path();
        let vlr = laszip_record(&mut reader, &header)?;
        let vlr = LazVlr::read_from(&vlr[..]).map_err(|e| bad_record(path, &e.to_string()))?;
        check_items(path, &vlr, &header)?;
        let chunks = chunks(path, &vlr, &header)?;
        Ok(Self { path: path.to_path_buf(), header, items: vlr.items().clone(), chunks })
    }
}

fn bad_record(path: &Path, found: &str) -> Error {
    Error::corrupt(path, "LASzip record", "a description of LAZ items", found)
}

/// The content of the variable length record that describes the compression.
fn laszip_record(reader: &mut ByteReader<'_>, header: &LasHeader) -> Result<Vec<u8>> {
    reader.skip(header.records_at)?;
    for _ in 0..header.records {
        let head = reader.fill(RECORD_HEAD)?;
        if head.len() < RECORD_HEAD {
            break;
        }
        let length = usize::from(u16_at(head, 20));
        let user = head[2..18].split(|&b| b == 0).next().unwrap_or_default();
        let is_it = user == LazVlr::USER_ID.as_bytes() && u16_at(head, 18) == LazVlr::RECORD_ID;
        reader.consume(RECORD_HEAD);
        if is_it {
            let bytes = reader.fill(length)?;
            return Ok(bytes[..length.min(bytes.len())].to_vec());
        }
        reader.skip(length as u64)?;
        if reader.position() > header.points_at {
            break;
        }
    }
    Err(Error::corrupt(
        reader.path(),
        "LAS header",
        "a LASzip record, as the points are compressed",
        "none",
    ))
}

/// Items are of a known size, add up to a record, and belong to one kind of compression.
fn check_items(path: &Path, vlr: &LazVlr, header: &LasHeader) -> Result<()> {
    let items = vlr.items();
    let versions: &[u16] = match compressor(vlr) {
        Some(CompressorType::PointWiseChunked) => &[1, 2],
        Some(CompressorType::LayeredChunked) => &[3, 4],
        _ => {
            let what = "LAZ without chunks".to_owned();
            let hint = Some("rewrite it with laszip or PDAL".to_owned());
            return Err(Error::Unsupported { path: path.to_path_buf(), what, hint });
        }
    };
    let first = items.first().map(LazItem::item_type);
    let leads = matches!(first, Some(LazItemType::Point10 | LazItemType::Point14));
    let is_new = header.decoding.format >= 6;
    let fits =
        leads && (first == Some(LazItemType::Point14)) == is_new && is_new == (versions[0] == 3);
    let sound = |item: &LazItem| {
        versions.contains(&item.version())
            && size(item.item_type()) == usize::from(item.size())
            && item.size() > 0
    };
    let bytes: usize = items.iter().map(|item| usize::from(item.size())).sum();
    if fits && items.iter().all(sound) && bytes == header.record_bytes {
        return Ok(());
    }
    let found = format!("{} items of {bytes} bytes", items.len());
    let expected = format!(
        "items that make up a record of {} bytes of format {}",
        header.record_bytes, header.decoding.format
    );
    Err(Error::corrupt(path, "LASzip record", expected, found))
}

/// How the points are cut, as the first bytes of the record say.
fn compressor(vlr: &LazVlr) -> Option<CompressorType> {
    let mut bytes = Vec::new();
    vlr.write_to(&mut bytes).ok()?;
    match u16_at(&bytes, 0) {
        2 => Some(CompressorType::PointWiseChunked),
        3 => Some(CompressorType::LayeredChunked),
        _ => None,
    }
}

/// Bytes of an item of that type.
fn size(item: LazItemType) -> usize {
    match item {
        LazItemType::Point10 => 20,
        LazItemType::GpsTime | LazItemType::RGBNIR14 => 8,
        LazItemType::RGB12 | LazItemType::RGB14 => 6,
        LazItemType::WavePacket13 | LazItemType::WavePacket14 => 29,
        LazItemType::Point14 => 30,
        LazItemType::Byte(bytes) | LazItemType::Byte14(bytes) => bytes.into(),
    }
}

/// The chunks of the file, each within it.
fn chunks(path: &Path, vlr: &LazVlr, header: &LasHeader) -> Result<Vec<Chunk>> {
    let io = |e| Error::io(path, e);
    let bad = |expected: &str, found: String| {
        Err(Error::corrupt(path, "LAZ chunk table", expected, found))
    };
    if header.points == 0 {
        return Ok(Vec::new());
    }
    let mut file = File::open(path).map_err(io)?;
    let file_bytes = file.metadata().map_err(io)?.len();
    let first = header.points_at + PLACE_BYTES;
    // 1. Where the table is: in front of the points, or at the end if the writer could not go back.
    let mut table_at = 0;
    for place in [header.points_at, file_bytes.saturating_sub(PLACE_BYTES)] {
        let mut bytes = [0; 8];
        if place + PLACE_BYTES > file_bytes {
            return bad("a place within the file", format!("{file_bytes} bytes of file"));
        }
        read_at(&mut file, place, &mut bytes).map_err(io)?;
        table_at = u64_at(&bytes, 0);
        if table_at > header.points_at && table_at <= i64::MAX.unsigned_abs() {
            break;
        }
    }
    if table_at < first || table_at > file_bytes.saturating_sub(PLACE_BYTES) {
        return bad("a place behind the points", format!("byte {table_at} of {file_bytes}"));
    }
    // 2. How many there are, before room is made for them.
    let mut bytes = [0; 4];
    read_at(&mut file, table_at + COUNT_AT, &mut bytes).map_err(io)?;
    let count = u64::from(u32_at(&bytes, 0));
    let most = MOST_CHUNKS.min(header.points);
    if count > most {
        let what = format!("{}: chunks of a LAZ file", path.display());
        return Err(Error::Limit { what, limit: most, found: count });
    }
    file.seek(SeekFrom::Start(header.points_at)).map_err(io)?;
    let table = match guarded(|| ChunkTable::read_from(&mut file, vlr)) {
        Some(Ok(table)) => table,
        Some(Err(e)) => return bad("a table of chunks", e.to_string()),
        None => return bad("a table of chunks", "bytes that do not decompress".into()),
    };
    // 3. Each within the file, together all points.
    let (mut at, mut left, mut all) = (first, header.points, Vec::new());
    for entry in table.as_ref() {
        if left == 0 {
            break;
        }
        let points = entry.point_count.min(left);
        let end = at.checked_add(entry.byte_count).filter(|&end| end <= table_at);
        let Some(end) = end.filter(|_| points > 0) else {
            let place = format!("point {}", header.points - left);
            return Err(Error::corrupt(
                path,
                place,
                "a chunk of LAZ in front of the chunk table",
                format!(
                    "{} bytes from byte {at} on, and the table at byte {table_at}",
                    entry.byte_count
                ),
            ));
        };
        if entry.byte_count > MOST_CHUNK_BYTES {
            let what = format!("{}: bytes of a chunk of LAZ", path.display());
            return Err(Error::Limit { what, limit: MOST_CHUNK_BYTES, found: entry.byte_count });
        }
        all.push(Chunk { at, bytes: entry.byte_count, points });
        (at, left) = (end, left - points);
    }
    if left > 0 {
        let place = format!("point {}", header.points - left);
        return Err(Error::corrupt(
            path,
            place,
            format!("{} points in chunks", header.points),
            "no further chunk",
        ));
    }
    Ok(all)
}

fn read_at(file: &mut File, at: u64, out: &mut [u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(out)
}

impl PointSource for LazFile {
    fn path(&self) -> &Path {
        &self.path
    }

    fn about(&self) -> u64 {
        self.header.points
    }

    fn points(&self) -> Result<Box<dyn PointStream + '_>> {
        let file = File::open(&self.path).map_err(|e| Error::io(&self.path, e))?;
        let record = vec![0; self.header.record_bytes];
        Ok(Box::new(LazPoints {
            laz: self,
            file,
            record,
            chunk: 0,
            open: None,
            done: 0,
            passed_over: 0,
        }))
    }
}

type Decompressor<'a> = Box<dyn RecordDecompressor<Cursor<Vec<u8>>> + Send + 'a>;

/// The points of a compressed file.
struct LazPoints<'a> {
    laz: &'a LazFile,
    file: File,
    record: Vec<u8>,
    /// The next chunk.
    chunk: usize,
    /// The one that is open, and how many of its points are left.
    open: Option<(Decompressor<'a>, u64)>,
    /// Records gone past.
    done: u64,
    passed_over: u64,
}

impl LazPoints<'_> {
    /// Opens the next chunk; false if there is none.
    fn open_next(&mut self) -> Result<bool> {
        let path = &self.laz.path;
        let Some(chunk) = self.laz.chunks.get(self.chunk) else { return Ok(false) };
        self.chunk += 1;
        let length = usize::try_from(chunk.bytes).expect("a chunk's bytes have a limit");
        let mut bytes = vec![0; length];
        match read_at(&mut self.file, chunk.at, &mut bytes) {
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
                return Err(self.bad_chunk("the end of the file"));
            }
            read => read.map_err(|e| Error::io(path, e))?,
        }
        let is_layered = self.laz.items[0].version() >= 3;
        if is_layered && !layers_fit(&bytes, &self.laz.items, self.laz.header.record_bytes) {
            return Err(self.bad_chunk("layers longer than the chunk"));
        }
        let source = Cursor::new(bytes);
        let mut decompressor: Decompressor<'_> = if is_layered {
            Box::new(LayeredPointRecordDecompressor::new(source))
        } else {
            Box::new(SequentialPointRecordDecompressor::new(source))
        };
        let set = decompressor.set_fields_from(&self.laz.items);
        set.map_err(|e| self.bad_chunk(&e.to_string()))?;
        decompressor.set_selection(
            DecompressionSelection::xy_returns_channel()
                .decompress_z()
                .decompress_classification()
                .decompress_flags(),
        );
        self.open = Some((decompressor, chunk.points));
        Ok(true)
    }

    #[cold]
    fn bad_chunk(&self, found: &str) -> Error {
        Error::corrupt(
            &self.laz.path,
            format!("point {}", self.done),
            "a whole chunk of LAZ",
            found,
        )
    }
}

impl PointStream for LazPoints<'_> {
    fn next_points(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        while out.len() < max {
            let Some((mut decompressor, mut left)) = self.open.take().filter(|(_, left)| *left > 0)
            else {
                if self.open_next()? {
                    continue;
                }
                break;
            };
            let decoding = self.laz.header.decoding;
            let decoded = guarded(|| -> io::Result<()> {
                while left > 0 && out.len() < max {
                    decompressor.decompress_next(&mut self.record)?;
                    left -= 1;
                    self.done += 1;
                    match decoding.point(&self.record) {
                        Some(point) => out.push(point),
                        None => self.passed_over += 1,
                    }
                }
                Ok(())
            });
            match decoded {
                Some(Ok(())) => self.open = Some((decompressor, left)),
                Some(Err(e)) => return Err(self.bad_chunk(&e.to_string())),
                None => return Err(self.bad_chunk("bytes that do not decompress")),
            }
        }
        Ok(())
    }

    fn passed_over(&self) -> u64 {
        self.passed_over
    }
}

/// Whether the lengths of the layers, which stand behind the first point and the count, fit into the chunk.
fn layers_fit(chunk: &[u8], items: &[LazItem], record_bytes: usize) -> bool {
    let layers = |item: &LazItem| match item.item_type() {
        LazItemType::Point14 => POINT14_LAYERS,
        LazItemType::RGBNIR14 => 2,
        LazItemType::Byte14(bytes) => bytes.into(),
        _ => 1,
    };
    let count: usize = items.iter().map(layers).sum();
    let head = record_bytes + 4;
    let Some(lengths) = chunk.get(head..head + 4 * count) else { return false };
    let all: u64 = (0..count).map(|k| u64::from(u32_at(lengths, 4 * k))).sum();
    all <= (chunk.len() - head - 4 * count) as u64
}
