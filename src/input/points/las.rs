//! LAS: header, and the points of an uncompressed file.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::super::byte_reader::ByteReader;
use super::super::content::Compression;
use super::record::{Decoding, FORMAT_BYTES};
use crate::geom::{POINT_LIMIT_M, PointSource, PointStream};
use crate::{Error, Result};

/// First bytes of a file.
pub(super) const MAGIC: &[u8; 4] = b"LASF";
/// Bytes of the header of LAS 1.0 to 1.2, and of 1.4, which is the first with counts of 64 bits.
const LEAST_HEADER: usize = 227;
const NEW_HEADER: usize = 375;
/// Of the point format, set where the points are compressed.
const COMPRESSED: u8 = 0x80;
/// Steps of a coordinate, at most.
const MOST_STEPS: f64 = 2_147_483_648.0;

/// A checked header.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LasHeader {
    pub(super) decoding: Decoding,
    pub(super) record_bytes: usize,
    pub(super) points: u64,
    /// Where the points begin, bytes.
    pub(super) points_at: u64,
    pub(super) is_compressed: bool,
    /// Where the variable length records begin, bytes, and how many there are.
    pub(super) records_at: u64,
    pub(super) records: u32,
}

impl LasHeader {
    /// Reads the header at the start of `reader`.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if it is cut or contradicts itself; [`Error::Unsupported`] for a point format beyond 10.
    pub(super) fn read(reader: &mut ByteReader<'_>) -> Result<Self> {
        let path = reader.path();
        let bad = |expected: String, found: String| {
            Err(Error::corrupt(path, "LAS header", expected, found))
        };
        let bytes = reader.fill(NEW_HEADER)?;
        if bytes.len() < LEAST_HEADER || !bytes.starts_with(MAGIC) {
            return bad(format!("{LEAST_HEADER} bytes or more"), format!("{} bytes", bytes.len()));
        }
        let bytes = &bytes[..bytes.len().min(NEW_HEADER)];
        let (minor, header_bytes) = (bytes[25], u16_at(bytes, 94));
        let (format, record_bytes) = (bytes[104], usize::from(u16_at(bytes, 105)));
        let is_new =
            minor >= 4 && usize::from(header_bytes) >= NEW_HEADER && bytes.len() == NEW_HEADER;
        let points = if is_new { u64_at(bytes, 247) } else { u32_at(bytes, 107).into() };
        let number = format & 0x3f;
        let Some(&least) = FORMAT_BYTES.get(usize::from(number)) else {
            return Err(Error::unsupported(path, format!("the LAS point format {number}")));
        };
        if record_bytes < least {
            return bad(
                format!("point records of {least} bytes or more"),
                record_bytes.to_string(),
            );
        }
        let points_at = u64::from(u32_at(bytes, 96));
        if points_at < u64::from(header_bytes) || usize::from(header_bytes) < LEAST_HEADER {
            let found =
                format!("points from byte {points_at} and a header of {header_bytes} bytes");
            return bad("points behind the header".into(), found);
        }
        let three = |at: usize| {
            DVec3::new(f64_at(bytes, at), f64_at(bytes, at + 8), f64_at(bytes, at + 16))
        };
        let (scale, offset) = (three(131), three(155));
        let reach = (scale.abs() * MOST_STEPS + offset.abs()).max_element();
        let is_finite = scale.is_finite() && offset.is_finite();
        if !is_finite || reach > POINT_LIMIT_M || scale.abs().min_element() <= 0.0 {
            let expected =
                format!("scales other than 0 and coordinates within {POINT_LIMIT_M:e} m");
            return bad(
                expected,
                format!("scales {:?} and offsets {:?}", scale.to_array(), offset.to_array()),
            );
        }
        Ok(Self {
            decoding: Decoding { format: number, scale, offset },
            record_bytes,
            points,
            points_at,
            is_compressed: format & COMPRESSED != 0,
            records_at: header_bytes.into(),
            records: u32_at(bytes, 100),
        })
    }
}

pub(super) fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(part(bytes, at))
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(part(bytes, at))
}

pub(super) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(part(bytes, at))
}

fn f64_at(bytes: &[u8], at: usize) -> f64 {
    f64::from_le_bytes(part(bytes, at))
}

fn part<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    *bytes[at..].first_chunk().expect("the callers have checked the length")
}

/// An uncompressed LAS file; as a whole it may be in gzip or Zstandard.
#[derive(Debug)]
pub(super) struct LasFile {
    path: PathBuf,
    header: LasHeader,
}

impl LasFile {
    /// The file of which `header` was read from `reader`.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if the file is too short for its points.
    pub(super) fn new(reader: &ByteReader<'_>, header: LasHeader) -> Result<Self> {
        let path = reader.path();
        let room = reader.most_bytes().saturating_sub(header.points_at);
        let held = room / header.record_bytes as u64;
        if reader.compression() == Compression::None && held < header.points {
            let expected = format!("{} points of {} bytes", header.points, header.record_bytes);
            let found = "the end of the file";
            return Err(Error::corrupt(path, format!("point {held}"), expected, found));
        }
        Ok(Self { path: path.to_path_buf(), header })
    }
}

impl PointSource for LasFile {
    fn path(&self) -> &Path {
        &self.path
    }

    fn about(&self) -> u64 {
        self.header.points
    }

    fn points(&self) -> Result<Box<dyn PointStream + '_>> {
        let reader = ByteReader::open(&self.path, self.header.points_at)?;
        Ok(Box::new(LasPoints { reader, header: &self.header, done: 0, passed_over: 0 }))
    }
}

/// The points of an uncompressed file.
struct LasPoints<'a> {
    reader: ByteReader<'a>,
    header: &'a LasHeader,
    /// Records gone past.
    done: u64,
    passed_over: u64,
}

impl PointStream for LasPoints<'_> {
    fn next_points(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        out.clear();
        let LasHeader { decoding, record_bytes, points, .. } = *self.header;
        while self.done < points && out.len() < max {
            let bytes = self.reader.fill(record_bytes)?;
            let left = usize::try_from(points - self.done).unwrap_or(usize::MAX);
            let count = (bytes.len() / record_bytes).min(max - out.len()).min(left);
            if count == 0 {
                return Err(self.reader.cut("point", self.done));
            }
            let records = bytes[..count * record_bytes].chunks_exact(record_bytes);
            let before = out.len();
            out.extend(records.filter_map(|record| decoding.point(record)));
            self.passed_over += (count - (out.len() - before)) as u64;
            self.reader.consume(count * record_bytes);
            self.done += count as u64;
        }
        Ok(())
    }

    fn passed_over(&self) -> u64 {
        self.passed_over
    }
}
