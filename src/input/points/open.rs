//! The format of a point cloud, by its content, and its opening.

use std::fmt;
use std::path::Path;

use super::super::byte_reader::ByteReader;
use super::super::content::Compression;
use super::super::mesh::{MeshKind, mesh_format};
use super::las::{LasFile, LasHeader, MAGIC};
use super::laz::LazFile;
use super::text::TextFile;
use crate::geom::PointSource;
use crate::{Error, Result};

/// Bytes that tell a text from what is none.
const HEAD_BYTES: usize = 4096;

/// The format of a point cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointFormat {
    /// LAS.
    Las,
    /// LAS whose points are compressed in chunks.
    Laz,
    /// Lines of x, y, z.
    Text,
}

impl fmt::Display for PointFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Las => "LAS",
            Self::Laz => "LAZ",
            Self::Text => "XYZ text",
        })
    }
}

/// The format of a point cloud file; `None` if it is of no known one. A text is taken for one of points unseen.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Corrupt`] if its header is damaged, or its compression.
pub fn point_format(path: &Path) -> Result<Option<PointFormat>> {
    let mut reader = ByteReader::open(path, 0)?;
    let head = reader.fill(HEAD_BYTES)?;
    if head.starts_with(MAGIC) {
        let is_compressed = LasHeader::read(&mut reader)?.is_compressed;
        return Ok(Some(if is_compressed { PointFormat::Laz } else { PointFormat::Las }));
    }
    let is_text = |b: &u8| matches!(b, b'\t'..=b'\r' | b' '..=b'~' | 0x80..);
    let head = &head[..head.len().min(HEAD_BYTES)];
    if head.is_empty() || !head.iter().all(is_text) {
        return Ok(None);
    }
    let mesh = mesh_format(path)?.map(|format| format.kind);
    Ok(matches!(mesh, None | Some(MeshKind::Xyz)).then_some(PointFormat::Text))
}

/// Opens a point cloud file, whatever its format and name.
///
/// # Errors
/// [`Error::Unsupported`] for a format that is not known; those of the format: see its module.
pub fn open_points(path: &Path) -> Result<Box<dyn PointSource>> {
    let unsupported = |what: &str, hint: &str| Error::Unsupported {
        path: path.to_path_buf(),
        what: what.to_owned(),
        hint: Some(hint.to_owned()),
    };
    Ok(match point_format(path)? {
        Some(PointFormat::Text) => Box::new(TextFile::open(path)?),
        Some(PointFormat::Las) => {
            let mut reader = ByteReader::open(path, 0)?;
            let header = LasHeader::read(&mut reader)?;
            Box::new(LasFile::new(&reader, header)?)
        }
        Some(PointFormat::Laz) => {
            let mut reader = ByteReader::open(path, 0)?;
            if reader.compression() != Compression::None {
                return Err(unsupported("LAZ that is compressed once more", "decompress it"));
            }
            let header = LasHeader::read(&mut reader)?;
            Box::new(LazFile::open(reader, header)?)
        }
        None => {
            let hint = "export the points as LAS; a mesh goes with --mesh";
            return Err(unsupported("a point cloud that is neither LAS, LAZ nor XYZ text", hint));
        }
    })
}
