//! The container of a glTF file: where its JSON is, and where the bytes of its buffers are.

use std::fs::File;
use std::path::{Component, Path, PathBuf};

use super::base64;
use super::document::{Buffer, Document};
use crate::input::byte_reader::ByteReader;
use crate::{Error, Result};

/// Longest JSON taken, bytes: that of a mesh is a few kilobytes, unless it holds the buffers themselves.
const JSON_LIMIT: u64 = 32 << 20;
/// The head of a GLB file: magic, version, length; then of each chunk length and kind.
const GLB_HEAD: usize = 12;
const CHUNK_HEAD: usize = 8;
const JSON_CHUNK: [u8; 4] = *b"JSON";
const BINARY_CHUNK: [u8; 4] = *b"BIN\0";

/// The bytes of a buffer.
#[derive(Debug)]
pub(super) struct BufferBytes {
    pub(super) place: Place,
    /// What the document says; no more than there are.
    pub(super) length: u64,
}

/// Where they are.
#[derive(Debug)]
pub(super) enum Place {
    /// In a file, from this byte on.
    File(PathBuf, u64),
    /// In the JSON.
    Held(Vec<u8>),
}

/// A glTF file, taken apart.
#[derive(Debug)]
pub(super) struct Container {
    pub(super) document: Document,
    pub(super) buffers: Vec<BufferBytes>,
}

impl Container {
    /// Reads the JSON of a GLB or glTF file, and finds its buffers.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let mut reader = ByteReader::open_as_it_is(path, 0)?;
        let (json, binary) = if reader.fill(4)?.starts_with(b"glTF") {
            read_glb(&mut reader)?
        } else {
            (read_json(&mut reader, 0, None)?, None)
        };
        let mut document: Document = serde_json::from_slice(&json).map_err(|e| {
            let place = format!("JSON, line {}, column {}", e.line(), e.column());
            Error::corrupt(path, place, "a glTF document", e.to_string())
        })?;
        drop(json);
        if !document.asset.version.starts_with("2.") {
            let what = format!("glTF version {}", document.asset.version);
            return Err(Error::unsupported(path, what));
        }
        let buffers = std::mem::take(&mut document.buffers.0);
        let buffers = buffers.into_iter().zip(0..);
        let buffers =
            buffers.map(|(buffer, k)| find(path, k, buffer, binary)).collect::<Result<_>>()?;
        Ok(Self { document, buffers })
    }
}

/// A part of a file: its start and length.
type Part = (u64, u64);

/// The JSON of a GLB file, and where its binary chunk is.
fn read_glb(reader: &mut ByteReader<'_>) -> Result<(Vec<u8>, Option<Part>)> {
    let (path, file_bytes) = (reader.path(), reader.most_bytes());
    let head = reader.fill(GLB_HEAD)?;
    let Some([_, version, length]) = words(head) else { return Err(reader.cut("header", 0)) };
    if version != 2 {
        return Err(Error::unsupported(path, format!("GLB version {version}")));
    }
    let length = u64::from(length);
    if length > file_bytes {
        let expected = format!("the {length} bytes that the header states");
        return Err(Error::corrupt(path, "length", expected, file_bytes.to_string()));
    }
    reader.consume(GLB_HEAD);
    let (mut json, mut binary, mut chunk) = (None, None, 0_u64);
    while reader.position() < length && binary.is_none() {
        let bytes = reader.fill(CHUNK_HEAD)?;
        let Some([chunk_bytes, _]) = words(bytes) else { return Err(reader.cut("chunk", chunk)) };
        let kind = [bytes[4], bytes[5], bytes[6], bytes[7]];
        reader.consume(CHUNK_HEAD);
        let (start, chunk_bytes) = (reader.position(), u64::from(chunk_bytes));
        if chunk_bytes > length.saturating_sub(start) {
            let expected = format!("at most {} bytes, to the end", length.saturating_sub(start));
            return Err(reader.malformed("chunk", chunk, expected, chunk_bytes.to_string()));
        }
        match kind {
            JSON_CHUNK if chunk == 0 => json = Some(read_json(reader, chunk, Some(chunk_bytes))?),
            BINARY_CHUNK if chunk == 1 => binary = Some((start, chunk_bytes)),
            _ if chunk == 0 => {
                return Err(reader.malformed("chunk", chunk, "JSON", "another kind"));
            }
            _ => reader.skip(chunk_bytes)?,
        }
        chunk += 1;
    }
    match json {
        Some(json) => Ok((json, binary)),
        None => Err(reader.cut("chunk", 0)),
    }
}

/// The next so many bytes of the file, or all that are left, which are JSON.
fn read_json(reader: &mut ByteReader<'_>, chunk: u64, bytes: Option<u64>) -> Result<Vec<u8>> {
    let found = bytes.unwrap_or_else(|| reader.most_bytes());
    if found > JSON_LIMIT {
        let what = format!(
            "{}: bytes of JSON (a GLB file holds its buffers outside)",
            reader.path().display()
        );
        return Err(Error::Limit { what, limit: JSON_LIMIT, found });
    }
    let mut json = Vec::new();
    while (json.len() as u64) < found {
        let left = usize::try_from(found).unwrap_or(usize::MAX) - json.len();
        let ready = reader.fill(1)?.len().min(left);
        if ready == 0 {
            return Err(reader.cut("chunk", chunk));
        }
        json.extend_from_slice(reader.take(ready));
    }
    // A byte order mark is not allowed, but met.
    let mark = if json.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    json.drain(..mark);
    Ok(json)
}

/// The first little-endian words of `bytes`, if there are so many.
fn words<const N: usize>(bytes: &[u8]) -> Option<[u32; N]> {
    let words = bytes.as_chunks().0;
    let word = |k: usize| words.get(k).copied().map(u32::from_le_bytes);
    let all: Option<Vec<u32>> = (0..N).map(word).collect();
    all?.try_into().ok()
}

/// Where buffer number `k` is, which holds what it states.
fn find(path: &Path, k: usize, buffer: Buffer, binary: Option<Part>) -> Result<BufferBytes> {
    let length = buffer.byte_length;
    let (place, found) = match (buffer.uri, binary) {
        (Some(uri), _) if uri.starts_with("data:") => {
            let coded = uri.split_once(";base64,").map(|(_, coded)| coded.as_bytes());
            let Some(bytes) = coded.and_then(base64::decode) else {
                let expected = "a data URI in Base64";
                return Err(Error::corrupt(path, format!("buffer {k}"), expected, "another"));
            };
            let found = bytes.len() as u64;
            (Place::Held(bytes), found)
        }
        (Some(uri), _) => {
            let file = beside(path, k, &uri)?;
            let about = File::open(&file).and_then(|file| file.metadata());
            let found = about.map_err(|e| Error::io(&file, e))?.len();
            (Place::File(file, 0), found)
        }
        (None, Some((start, found))) if k == 0 => (Place::File(path.to_path_buf(), start), found),
        (None, _) => {
            let expected = "a URI, or the binary chunk of a GLB file";
            return Err(Error::corrupt(path, format!("buffer {k}"), expected, "neither"));
        }
    };
    if found < length {
        let file = match &place {
            Place::File(file, _) => file.as_path(),
            Place::Held(_) => path,
        };
        let expected = format!("{length} bytes, as the document states");
        return Err(Error::corrupt(file, format!("buffer {k}"), expected, found.to_string()));
    }
    Ok(BufferBytes { place, length })
}

/// The file beside `path` that a URI names.
fn beside(path: &Path, k: usize, uri: &str) -> Result<PathBuf> {
    let name = percent_decoded(uri);
    let inner = name.as_deref().map(Path::new);
    let is_plain = |p: &Path| p.components().all(|c| matches!(c, Component::Normal(_)));
    match inner {
        Some(inner) if !uri.contains(':') && is_plain(inner) && inner.file_name().is_some() => {
            Ok(path.with_file_name("").join(inner))
        }
        _ => Err(Error::Unsupported {
            path: path.to_path_buf(),
            what: format!("buffer {k} at {uri:?}"),
            hint: Some("buffers must lie in the file's folder or below it".to_owned()),
        }),
    }
}

/// A URI's path with each `%XX` as the byte it stands for.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut parts = uri.split('%');
    let mut bytes = parts.next()?.as_bytes().to_vec();
    for part in parts {
        let code = part.get(..2).filter(|code| code.bytes().all(|b| b.is_ascii_hexdigit()))?;
        bytes.push(u8::from_str_radix(code, 16).ok()?);
        bytes.extend_from_slice(&part.as_bytes()[2..]);
    }
    String::from_utf8(bytes).ok().filter(|name| !name.contains('\0'))
}

impl BufferBytes {
    /// Reads the buffer from byte `offset` on; `path` is the document's.
    pub(super) fn open<'a>(&'a self, path: &'a Path, offset: u64) -> Result<ByteReader<'a>> {
        match &self.place {
            Place::File(file, start) => ByteReader::open_as_it_is(file, start + offset),
            Place::Held(bytes) => {
                let mut reader = ByteReader::of_memory(path, bytes);
                reader.skip(offset)?;
                Ok(reader)
            }
        }
    }
}
