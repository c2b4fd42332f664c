//! The format of a mesh file, by its content.
//!
//! In: the first bytes of a file, or of what was compressed in it. Out: the format, whatever the name: a binary STL file
//! has a length that no other has by chance, and the texts begin with words or numbers of their own. The name only tells
//! a binary STL file that was cut from a file of no known format, and glTF from other JSON.

use std::fmt;
use std::path::Path;

use super::super::byte_reader::ByteReader;
use super::super::content::Compression;
use super::super::text::{Syntax, Words, number};
use super::super::{obj, stl};
use crate::{Error, Result};

/// How far into JSON the key of glTF is looked for, bytes.
const KEY_BYTES: usize = 1 << 16;

/// The format of a mesh file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshFormat {
    /// What the content is.
    pub kind: MeshKind,
    /// How it is compressed.
    pub compression: Compression,
}

/// The kinds of mesh files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshKind {
    /// PLY, text or binary.
    Ply,
    /// Wavefront OBJ.
    Obj,
    /// STL as text.
    StlText,
    /// Binary STL.
    StlBinary,
    /// Plain triplets of numbers.
    Xyz,
    /// glTF in one binary file.
    Glb,
    /// glTF as JSON.
    Gltf,
}

impl MeshKind {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ply => "PLY",
            Self::Obj => "OBJ",
            Self::StlText => "STL (text)",
            Self::StlBinary => "STL (binary)",
            Self::Xyz => "XYZ triplets",
            Self::Glb => "GLB",
            Self::Gltf => "glTF",
        }
    }
}

impl fmt::Display for MeshFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind.name())?;
        match self.compression {
            Compression::None => Ok(()),
            Compression::Gzip => f.write_str(", gzip"),
            Compression::Zstd => f.write_str(", Zstandard"),
        }
    }
}

/// The format of a mesh file; `None` if it is of no known one.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Corrupt`] if it is compressed and damaged, or if it is a binary STL
/// file of a wrong length.
pub fn mesh_format(path: &Path) -> Result<Option<MeshFormat>> {
    let mut reader = ByteReader::open(path, 0)?;
    let compression = reader.compression();
    let head = reader.fill(stl::HEAD_BYTES)?;
    let head = head[..head.len().min(stl::HEAD_BYTES)].to_vec();
    let kind = match head.as_slice() {
        [b'p', b'l', b'y', b'\r' | b'\n', ..] => Some(MeshKind::Ply),
        [b'g', b'l', b'T', b'F', ..] => Some(MeshKind::Glb),
        _ if is_json(&head) => is_gltf(path, &mut reader)?.then_some(MeshKind::Gltf),
        _ if is_binary_stl(path, &head, &mut reader)? => Some(MeshKind::StlBinary),
        _ => kind_of_text(path)?,
    };
    Ok(kind.map(|kind| MeshFormat { kind, compression }))
}

fn is_json(head: &[u8]) -> bool {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    text.trim_ascii_start().starts_with(b"{")
}

/// Whether JSON is that of a glTF file: its name says so, or it has the key that every one must have, near its start.
fn is_gltf(path: &Path, reader: &mut ByteReader<'_>) -> Result<bool> {
    let is_named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf"));
    let key = b"\"asset\"";
    Ok(is_named || reader.fill(KEY_BYTES)?.windows(key.len()).any(|window| window == key))
}

/// Whether the length of the content is that of a binary STL file with this head.
fn is_binary_stl(path: &Path, head: &[u8], reader: &mut ByteReader<'_>) -> Result<bool> {
    let Some(head) = head.first_chunk() else { return Ok(false) };
    // To know the length of compressed content takes a reading of it; a text is known at once: as a number of
    // faces, four of its bytes would be 150 million or more.
    let count_is_text = head[80..].iter().all(|b| (b'\t'..=b'~').contains(b));
    let expected = stl::bytes_of(head);
    if reader.compression() != Compression::None && count_is_text {
        return Ok(false);
    }
    let found = reader.content_bytes()?;
    // A file that says that it is a solid, but is no text, or whose name says STL, is one that was cut.
    let is_text = head.iter().all(|b| matches!(b, b'\t'..=b'\r' | b' '..=b'~' | 0x80..));
    let claims = head.starts_with(b"solid") || names_stl(path);
    if found != expected && claims && !is_text {
        let expected = format!("{expected} bytes, as its count of faces says");
        return Err(Error::corrupt(path, "binary STL, length", expected, found.to_string()));
    }
    Ok(found == expected)
}

/// Whether the file's name ends in `.stl`, perhaps followed by the ending of a compression.
fn names_stl(path: &Path) -> bool {
    let is = |path: &Path, ending| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    let inner = path.with_extension("");
    is(path, "stl") || (is(path, "gz") || is(path, "zst")) && is(&inner, "stl")
}

/// The kind of a text, by its first word.
fn kind_of_text(path: &Path) -> Result<Option<MeshKind>> {
    let mut words = Words::new(ByteReader::open(path, 0)?, Syntax::Separated)?;
    Ok(match words.word_on_any_line() {
        Ok(Some(word)) if word.eq_ignore_ascii_case(b"solid") => Some(MeshKind::StlText),
        Ok(Some(word)) if obj::is_keyword(word) => Some(MeshKind::Obj),
        Ok(Some(word)) if number(word).is_some() => Some(MeshKind::Xyz),
        // A word beyond the limit is none of ours.
        Ok(_) | Err(Error::Corrupt { .. }) => None,
        Err(error) => return Err(error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::reading::{gzip, with_file};

    fn format(name: &str, bytes: &[u8]) -> Result<Option<String>> {
        Ok(with_file(name, bytes, mesh_format)?.map(|format| format.to_string()))
    }

    #[test]
    fn a_format_is_known_by_its_content_plain_and_compressed() {
        let mut binary = b"solid".to_vec();
        binary.resize(80, b' ');
        binary.extend([1, 0, 0, 0]);
        binary.resize(134, 1);
        for (bytes, name) in [
            (&b"ply\nformat"[..], "PLY"),
            (b"ply\r\n", "PLY"),
            (b"# by hand\n\nmtllib a\nv 1 2 3", "OBJ"),
            (b"\xef\xbb\xbfv 1 2 3", "OBJ"),
            (b" solid a\nfacet", "STL (text)"),
            (&binary, "STL (binary)"),
            (b"# nine\n\n-1.5 0 0", "XYZ triplets"),
            (b"1;2;3", "XYZ triplets"),
            (b"glTF\x02\0", "GLB"),
            (b"\n { \"asset\": {}}", "glTF"),
        ] {
            for file in ["a", "a.ply", "a.obj"] {
                assert_eq!(format(file, bytes).unwrap().unwrap(), name);
                assert_eq!(format(file, &gzip(bytes)).unwrap().unwrap(), format!("{name}, gzip"));
                let zstd = zstd::encode_all(bytes, 1).unwrap();
                assert_eq!(format(file, &zstd).unwrap().unwrap(), format!("{name}, Zstandard"));
            }
        }
        for bytes in
            [&b""[..], b"\n\n", b"plyx", b"hello", b"{}", b"\0\x01", &[b'x'; 2000], &gzip(b"")]
        {
            assert_eq!(format("a.obj", bytes).unwrap(), None, "{bytes:?}");
        }
        assert_eq!(format("a.gltf", b"{}").unwrap().unwrap(), "glTF");
    }

    #[test]
    fn a_binary_stl_file_of_a_wrong_length_is_told_so() {
        let mut bytes = b"solid".to_vec();
        bytes.resize(184, 0);
        bytes[80] = 3;
        let named = "a.STL";
        let error = format(named, &bytes).unwrap_err().to_string();
        assert!(
            error.contains("length: expected 234 bytes, as its count of faces says, found 184")
        );
        assert!(format(named, &gzip(&bytes)).is_err());
        bytes[..5].fill(0);
        assert!(format(named, &bytes).is_err() && format("a.STL.gz", &gzip(&bytes)).is_err());
        assert_eq!(format("a.bin", &bytes).unwrap(), None);
    }

    #[test]
    fn a_damaged_stream_is_an_error() {
        let packed = gzip(&b"v 1 2 3\n".repeat(9999));
        assert!(matches!(format("a.obj.gz", &packed[..9]), Err(Error::Corrupt { .. })));
    }
}
