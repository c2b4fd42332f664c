//! The file of a TIN: a binary PLY whose header bears what was found, and a checksum of its body.
//!
//! Layout: a header of [`HEADER_BYTES`], padded by a comment; each vertex as three doubles; each face as a count, 3, and three
//! unsigned numbers of 32 bits; all little-endian.

use std::fs::File;
use std::io::{BufReader, BufWriter, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::sort::{POINT_BYTES, point_bytes};
use crate::{Error, Result};
use glam::DVec3;

/// Bytes of the header.
pub(super) const HEADER_BYTES: usize = 512;
/// Bytes of a face.
const FACE_BYTES: usize = 13;
/// What the comment with the facts begins with.
const FACTS: &str = "comment groundel tin:";

/// What a TIN was made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TinCounts {
    /// Points in the TIN.
    pub points: u64,
    /// Points that the clouds mark as withheld or as noise.
    pub passed_over: u64,
    /// Points at the place of a higher one.
    pub doubles: u64,
    /// Triangles.
    pub triangles: u64,
    /// Mean distance of neighbouring points in the plane, metres.
    pub spacing_m: f64,
    /// The longest edge allowed in the plane, metres.
    pub max_edge_m: f64,
}

/// A TIN in the work folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Tin {
    /// The PLY file.
    pub path: PathBuf,
    /// What it was made of.
    pub counts: TinCounts,
}

impl TinCounts {
    fn header(&self, checksum: u32) -> String {
        let Self { points, passed_over, doubles, triangles, spacing_m, max_edge_m } = self;
        let head = format!(
            "ply\nformat binary_little_endian 1.0\n\
             {FACTS} {passed_over} {doubles} {spacing_m:?} {max_edge_m:?} {checksum}\n\
             element vertex {points}\nproperty double x\nproperty double y\nproperty double z\n\
             element face {triangles}\nproperty list uchar uint vertex_indices\ncomment "
        );
        let tail = "\nend_header\n";
        let padding = HEADER_BYTES - head.len() - tail.len();
        format!("{head}{}{tail}", ".".repeat(padding))
    }

    /// What a header says, and the checksum; `None` if it is not one of ours.
    fn of_header(header: &str) -> Option<(Self, u32)> {
        let line = |start: &str| header.lines().find_map(|line| line.strip_prefix(start));
        let mut facts = line(FACTS)?.split_whitespace();
        let counts = Self {
            passed_over: facts.next()?.parse().ok()?,
            doubles: facts.next()?.parse().ok()?,
            spacing_m: facts.next()?.parse().ok()?,
            max_edge_m: facts.next()?.parse().ok()?,
            points: line("element vertex ")?.parse().ok()?,
            triangles: line("element face ")?.parse().ok()?,
        };
        let checksum = facts.next()?.parse().ok()?;
        (counts.header(checksum) == header).then_some((counts, checksum))
    }
}

impl Tin {
    /// The TIN at `path`; `None` if there is none, or none that is whole.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn open(path: &Path) -> Result<Option<Self>> {
        let io = |e| Error::io(path, e);
        let file = match File::open(path) {
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            file => file.map_err(io)?,
        };
        let bytes = file.metadata().map_err(io)?.len();
        let mut reader = BufReader::with_capacity(1 << 18, file);
        let mut header = Vec::new();
        reader.by_ref().take(HEADER_BYTES as u64).read_to_end(&mut header).map_err(io)?;
        let header = String::from_utf8(header).ok();
        let Some((counts, checksum)) = header.as_deref().and_then(TinCounts::of_header) else {
            return Ok(None);
        };
        let body = counts.points.checked_mul(POINT_BYTES as u64);
        let body =
            body.and_then(|b| b.checked_add(counts.triangles.checked_mul(FACE_BYTES as u64)?));
        if body.and_then(|b| b.checked_add(HEADER_BYTES as u64)) != Some(bytes) {
            return Ok(None);
        }
        let (mut hasher, mut buffer) = (crc32fast::Hasher::new(), vec![0; 1 << 18]);
        loop {
            let read = reader.read(&mut buffer).map_err(io)?;
            if read == 0 {
                break;
            }
            hasher.update(&buffer[..read]);
        }
        let is_whole = hasher.finalize() == checksum;
        Ok(is_whole.then(|| Self { path: path.to_path_buf(), counts }))
    }
}

/// Writes a TIN.
#[derive(Debug)]
pub(super) struct TinWriter {
    path: PathBuf,
    file: BufWriter<File>,
    hasher: crc32fast::Hasher,
}

impl TinWriter {
    /// A new file.
    pub(super) fn create(path: PathBuf) -> Result<Self> {
        let io = |e| Error::io(&path, e);
        let mut file = BufWriter::with_capacity(1 << 20, File::create(&path).map_err(io)?);
        file.write_all(&[0; HEADER_BYTES]).map_err(io)?;
        Ok(Self { path, file, hasher: crc32fast::Hasher::new() })
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.hasher.update(bytes);
        self.file.write_all(bytes).map_err(|e| Error::io(&self.path, e))
    }

    /// Appends a vertex; before the first face.
    pub(super) fn vertex(&mut self, ground: DVec3) -> Result<()> {
        self.write(&point_bytes(ground))
    }

    /// Makes what was written readable by others.
    pub(super) fn flush(&mut self) -> Result<()> {
        self.file.flush().map_err(|e| Error::io(&self.path, e))
    }

    /// Appends faces.
    pub(super) fn faces(&mut self, triangles: &[[u32; 3]]) -> Result<()> {
        for triangle in triangles {
            let mut bytes = [3; FACE_BYTES];
            for (four, number) in bytes[1..].chunks_exact_mut(4).zip(triangle) {
                four.copy_from_slice(&number.to_le_bytes());
            }
            self.write(&bytes)?;
        }
        Ok(())
    }

    /// Writes the header, and gives the file the name `to`.
    pub(super) fn finish(self, to: &Path, counts: TinCounts) -> Result<Tin> {
        let Self { path, file, hasher } = self;
        let io = |e| Error::io(&path, e);
        let mut file = file.into_inner().map_err(|e| io(e.into_error()))?;
        file.seek(SeekFrom::Start(0)).map_err(io)?;
        file.write_all(counts.header(hasher.finalize()).as_bytes()).map_err(io)?;
        file.sync_all().map_err(io)?;
        drop(file);
        std::fs::rename(&path, to).map_err(|e| Error::io(to, e))?;
        Ok(Tin { path: to.to_path_buf(), counts })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_has_room_for_the_longest_numbers_and_reads_back() {
        let counts = TinCounts {
            points: u64::MAX,
            passed_over: u64::MAX,
            doubles: u64::MAX,
            triangles: u64::MAX,
            spacing_m: -2.225_073_858_507_201_4e-308,
            max_edge_m: f64::INFINITY,
        };
        let header = counts.header(u32::MAX);
        assert_eq!(header.len(), HEADER_BYTES);
        assert_eq!(TinCounts::of_header(&header), Some((counts, u32::MAX)));
    }

    #[test]
    fn a_file_that_is_cut_or_damaged_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        assert_eq!(Tin::open(&path).unwrap(), None);
        let mut writer = TinWriter::create(folder.path().join("part")).unwrap();
        for x in [0.0, 1.0, 2.0] {
            writer.vertex(DVec3::new(x, x * x, 0.0)).unwrap();
        }
        writer.faces(&[[0, 1, 2]]).unwrap();
        let counts = TinCounts {
            points: 3,
            passed_over: 1,
            doubles: 2,
            triangles: 1,
            spacing_m: 0.5,
            max_edge_m: 3.0,
        };
        let tin = writer.finish(&path, counts).unwrap();
        assert_eq!(Tin::open(&path).unwrap(), Some(tin));
        let good = std::fs::read(&path).unwrap();
        for at in [0, 70, 200, HEADER_BYTES - 1, HEADER_BYTES, good.len() - 1] {
            let mut bad = good.clone();
            bad[at] ^= 4;
            std::fs::write(&path, bad).unwrap();
            assert_eq!(Tin::open(&path).unwrap(), None, "byte {at}");
        }
        std::fs::write(&path, &good[..good.len() - 1]).unwrap();
        assert_eq!(Tin::open(&path).unwrap(), None);
    }
}
