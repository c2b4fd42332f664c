//! Corners of triangles whose vertices lie all over the file: an external join.
//!
//! In: a mesh's triangles, and its vertices in a temporary file. Out: the corners, in the order of the triangles.
//! Every file is read and written from start to end, so that the time is linear whatever the order of the faces:
//!
//! 1. for each corner, the vertex's number goes to the file of requests of the range of vertices that it lies in;
//! 2. range by range, the vertices are held in memory, and the requests answered in their order;
//! 3. for each corner, the next answer is taken from its range's file.
//!
//! Memory: one range of vertices, or a buffer for each range.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use super::vertices::PACKED_BYTES;
use crate::geom::{MeshSource, TriangleChunk};
use crate::{Error, Result};

/// Most ranges: files open at one time.
const RANGES: u64 = 256;

/// What is to be joined.
#[derive(Debug, Clone, Copy)]
pub(super) struct Join<'a> {
    pub(super) source: &'a dyn MeshSource,
    /// Triangles read at a time, and how many such chunks need no corners.
    pub(super) chunk: usize,
    pub(super) skip: u64,
    /// Where files go.
    pub(super) folder: &'a Path,
    pub(super) budget_bytes: usize,
}

/// The answers: corners of the triangles that follow, packed.
#[derive(Debug)]
pub(super) struct Answers {
    range_vertices: u32,
    files: Vec<(PathBuf, BufReader<File>)>,
}

impl Join<'_> {
    /// Joins the triangles with the packed vertices in the file `vertices`.
    pub(super) fn run(&self, vertices: &Path) -> Result<Answers> {
        let count = self.source.vertex_count();
        let fitting = (self.budget_bytes / PACKED_BYTES).max(64) as u64;
        let range = u32::try_from(fitting.max(count.div_ceil(RANGES))).unwrap_or(u32::MAX);
        let ranges = count.div_ceil(u64::from(range));
        self.ask(range, ranges)?;
        let io = |e| Error::io(vertices, e);
        let mut reader = File::open(vertices).map_err(io)?;
        let mut files = Vec::new();
        for r in 0..ranges {
            let mut held = Vec::new();
            let bytes = u64::from(range) * PACKED_BYTES as u64;
            Read::by_ref(&mut reader).take(bytes).read_to_end(&mut held).map_err(io)?;
            files.push(self.answer(r, &held)?);
        }
        let open = |path: PathBuf| {
            let file = File::open(&path).map_err(|e| Error::io(&path, e))?;
            Ok((path, BufReader::with_capacity(self.buffer_bytes(ranges), file)))
        };
        let files = files.into_iter().map(open).collect::<Result<_>>()?;
        Ok(Answers { range_vertices: range, files })
    }

    fn path(&self, kind: &str, range: u64) -> PathBuf {
        self.folder.join(format!("{kind}-{range}"))
    }

    fn buffer_bytes(&self, ranges: u64) -> usize {
        let share = self.budget_bytes as u64 / ranges.max(1);
        usize::try_from(share.clamp(4 << 10, 256 << 10)).expect("at most 256 KiB")
    }

    /// Step 1: the vertices' numbers within their ranges.
    fn ask(&self, range: u32, ranges: u64) -> Result<()> {
        let mut files = Vec::new();
        for r in 0..ranges {
            let path = self.path("ask", r);
            let file = File::create(&path).map_err(|e| Error::io(&path, e))?;
            files.push((path, BufWriter::with_capacity(self.buffer_bytes(ranges), file)));
        }
        let (mut stream, mut chunk) = (self.source.faces()?, TriangleChunk::default());
        for done in 0_u64.. {
            stream.next_faces(self.chunk, &mut chunk)?;
            if chunk.is_empty() {
                break;
            }
            if done < self.skip {
                continue;
            }
            for index in chunk.triangles.iter().flatten() {
                let (path, file) = &mut files[(index / range) as usize];
                let asked = (index % range).to_le_bytes();
                file.write_all(&asked).map_err(|e| Error::io(&path, e))?;
            }
        }
        files.iter_mut().try_for_each(|(path, file)| file.flush().map_err(|e| Error::io(path, e)))
    }

    /// Step 2, for the range whose vertices are held; gives the file of answers.
    fn answer(&self, range: u64, held: &[u8]) -> Result<PathBuf> {
        let (asked, told) = (self.path("ask", range), self.path("told", range));
        let read_error = |e| Error::io(&asked, e);
        let write_error = |e| Error::io(&told, e);
        let mut reader = File::open(&asked).map_err(read_error)?;
        let mut writer =
            BufWriter::with_capacity(1 << 16, File::create(&told).map_err(write_error)?);
        let mut requests = Vec::new();
        loop {
            requests.clear();
            Read::by_ref(&mut reader)
                .take(1 << 16)
                .read_to_end(&mut requests)
                .map_err(read_error)?;
            if requests.is_empty() {
                break;
            }
            for request in requests.chunks_exact(4) {
                let index = u32::from_le_bytes(request.try_into().expect("four bytes")) as usize;
                let vertex = held.get(index * PACKED_BYTES..(index + 1) * PACKED_BYTES);
                let vertex = vertex.expect("faces are checked to name vertices that there are");
                writer.write_all(vertex).map_err(write_error)?;
            }
        }
        writer.flush().map_err(write_error)?;
        std::fs::remove_file(&asked).map_err(read_error)?;
        Ok(told)
    }
}

impl Answers {
    /// Step 3: replaces `packed` by the corners of the next triangles, which must be those that were asked for.
    pub(super) fn take(&mut self, triangles: &[[u32; 3]], packed: &mut Vec<u8>) -> Result<()> {
        packed.resize(triangles.len() * 3 * PACKED_BYTES, 0);
        let corners = packed.chunks_exact_mut(PACKED_BYTES);
        for (index, corner) in triangles.iter().flatten().zip(corners) {
            let (path, file) = &mut self.files[(index / self.range_vertices) as usize];
            file.read_exact(corner).map_err(|e| Error::io(&path, e))?;
        }
        Ok(())
    }
}

impl Drop for Answers {
    fn drop(&mut self) {
        for (path, _) in &self.files {
            // What cannot be deleted now goes with the folder.
            drop(std::fs::remove_file(path));
        }
    }
}
