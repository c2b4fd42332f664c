//! All points, sorted along a Z-order curve on the plane, each place once.
//!
//! In: points in any order. Out: the same, sorted by key, then by place; of several at one place, the highest. Memory: as
//! many points as are allowed at a time; what is more goes to a file of sorted runs, which are merged. The order is one of
//! the points' coordinates alone.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use rayon::slice::ParallelSliceMut;

use super::plane::TinPlane;
use crate::{Error, Result};

/// Bytes of a point in a file: three doubles, little-endian.
pub(super) const POINT_BYTES: usize = 24;
/// Bytes of a point in memory.
pub(super) const SORTED_BYTES: usize = size_of::<Sorted>();
/// Steps of the curve's lattice a metre, as a power of two: a micron.
const STEPS_LOG2: i32 = 20;
/// Added to make steps positive: points lie within 2⁴⁰ m.
const MIDDLE: i64 = 1 << 61;
/// Points of a run that are held while runs are merged, at least.
const LEAST_HELD: usize = 256;

/// A point with what it is sorted by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sorted {
    /// Place on the curve.
    pub(super) key: [u64; 2],
    /// In the plane, metres.
    pub(super) at: DVec2,
    /// Metres.
    pub(super) elevation: f64,
    /// As it was read, metres.
    pub(super) ground: DVec3,
}

impl Sorted {
    /// The point `ground` over `plane`.
    pub(super) fn new(ground: DVec3, plane: &TinPlane) -> Self {
        let (at, elevation) = plane.place(ground);
        Self { key: curve(at), at, elevation, ground }
    }
}

impl Eq for Sorted {}

impl Ord for Sorted {
    /// By key, then place, the highest first; the rest only makes the order one.
    fn cmp(&self, other: &Self) -> Ordering {
        let by = |a: f64, b: f64| a.total_cmp(&b);
        self.key
            .cmp(&other.key)
            .then_with(|| by(self.at.x, other.at.x))
            .then_with(|| by(self.at.y, other.at.y))
            .then_with(|| by(other.elevation, self.elevation))
            .then_with(|| by(self.ground.x, other.ground.x))
            .then_with(|| by(self.ground.y, other.ground.y))
            .then_with(|| by(self.ground.z, other.ground.z))
    }
}

impl PartialOrd for Sorted {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The place of a point of the plane on the curve: the bits of its steps along u and v, interleaved.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "saturates beyond the limit; positive"
)]
fn curve(at: DVec2) -> [u64; 2] {
    let steps = |x: f64| {
        let steps = (x * f64::from(1 << STEPS_LOG2)).floor() as i64;
        (steps.clamp(-MIDDLE, MIDDLE - 1) + MIDDLE) as u64
    };
    let (u, v) = (steps(at.x), steps(at.y));
    let both = |u: u64, v: u64| spread(u) | spread(v) << 1;
    [both(u >> 32, v >> 32), both(u & 0xffff_ffff, v & 0xffff_ffff)]
}

/// The lower 32 bits of `x`, a zero between each two.
fn spread(x: u64) -> u64 {
    let x = (x | x << 16) & 0x0000_ffff_0000_ffff;
    let x = (x | x << 8) & 0x00ff_00ff_00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333_3333_3333;
    (x | x << 1) & 0x5555_5555_5555_5555
}

/// Takes points, and writes them out in sorted runs as memory fills.
pub(super) struct Sorter {
    plane: TinPlane,
    held: Vec<Sorted>,
    capacity: usize,
    path: PathBuf,
    file: Option<BufWriter<File>>,
    /// Points of each run.
    runs: Vec<u64>,
}

impl Sorter {
    /// Holds up to `capacity` points; runs go to a file in `folder`.
    pub(super) fn new(plane: TinPlane, capacity: usize, folder: &Path) -> Self {
        let path = folder.join("runs");
        Self {
            plane,
            held: Vec::new(),
            capacity: capacity.max(1),
            path,
            file: None,
            runs: Vec::new(),
        }
    }

    /// Takes a point, whose coordinates in the plane must be finite.
    pub(super) fn push(&mut self, ground: DVec3) -> Result<()> {
        if self.held.len() == self.capacity {
            self.write_run()?;
        }
        self.held.push(Sorted::new(ground, &self.plane));
        Ok(())
    }

    fn write_run(&mut self) -> Result<()> {
        self.held.par_sort_unstable();
        let io = |e| Error::io(&self.path, e);
        let file = match &mut self.file {
            Some(file) => file,
            none => none
                .insert(BufWriter::with_capacity(1 << 20, File::create(&self.path).map_err(io)?)),
        };
        for point in &self.held {
            file.write_all(&point_bytes(point.ground)).map_err(io)?;
        }
        self.runs.push(self.held.len() as u64);
        self.held.clear();
        Ok(())
    }

    /// Gives all points to `take` in order, each place once; how many were at a place that was taken. The file is gone then.
    pub(super) fn finish(mut self, take: &mut dyn FnMut(&Sorted) -> Result<()>) -> Result<u64> {
        let mut unique = Unique { last: None, doubles: 0, take };
        if self.runs.is_empty() {
            self.held.par_sort_unstable();
            self.held.iter().try_for_each(|point| unique.offer(point))?;
            return Ok(unique.doubles);
        }
        if !self.held.is_empty() {
            self.write_run()?;
        }
        self.held = Vec::new();
        let io = |e| Error::io(&self.path, e);
        if let Some(file) = self.file.take() {
            file.into_inner().map_err(|e| io(e.into_error()))?;
        }
        let mut merge = Merge::open(&self.path, &self.runs, self.capacity, self.plane)?;
        while let Some(point) = merge.next()? {
            unique.offer(&point)?;
        }
        drop(merge);
        std::fs::remove_file(&self.path).map_err(io)?;
        Ok(unique.doubles)
    }
}

/// The bytes of a point in a file.
pub(super) fn point_bytes(ground: DVec3) -> [u8; POINT_BYTES] {
    let mut bytes = [0; POINT_BYTES];
    for (eight, value) in bytes.chunks_exact_mut(8).zip(ground.to_array()) {
        eight.copy_from_slice(&value.to_le_bytes());
    }
    bytes
}

/// The point of such bytes.
pub(super) fn point_of(bytes: &[u8]) -> DVec3 {
    let value = |k: usize| {
        let eight = bytes[8 * k..].first_chunk().expect("three doubles");
        f64::from_le_bytes(*eight)
    };
    DVec3::new(value(0), value(1), value(2))
}

/// Passes on the first point of each place.
struct Unique<'a> {
    last: Option<DVec2>,
    doubles: u64,
    take: &'a mut dyn FnMut(&Sorted) -> Result<()>,
}

impl Unique<'_> {
    fn offer(&mut self, point: &Sorted) -> Result<()> {
        if self.last == Some(point.at) {
            self.doubles += 1;
            return Ok(());
        }
        self.last = Some(point.at);
        (self.take)(point)
    }
}

/// The runs of a file, merged.
struct Merge {
    file: File,
    path: PathBuf,
    plane: TinPlane,
    runs: Vec<Run>,
    heap: BinaryHeap<Reverse<(Sorted, usize)>>,
    /// Points that a run holds in memory at most.
    held: usize,
}

/// What is left of a run.
struct Run {
    /// Where its next bytes stand, and how many points are left there.
    at: u64,
    left: u64,
    buffer: Vec<u8>,
    start: usize,
}

impl Merge {
    fn open(path: &Path, runs: &[u64], capacity: usize, plane: TinPlane) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let (mut at, mut all) = (0, Vec::new());
        for &left in runs {
            all.push(Run { at, left, buffer: Vec::new(), start: 0 });
            at += left * POINT_BYTES as u64;
        }
        let held = (capacity / runs.len().max(1)).max(LEAST_HELD);
        let heap = BinaryHeap::with_capacity(all.len());
        let mut merge = Self { file, path: path.to_path_buf(), plane, runs: all, heap, held };
        for run in 0..merge.runs.len() {
            merge.refill(run)?;
        }
        Ok(merge)
    }

    /// Puts the next point of a run, if there is one, into the heap.
    fn refill(&mut self, k: usize) -> Result<()> {
        let run = &mut self.runs[k];
        if run.start == run.buffer.len() {
            let count = run.left.min(self.held as u64);
            if count == 0 {
                return Ok(());
            }
            let bytes = usize::try_from(count).expect("at most what is held") * POINT_BYTES;
            run.buffer.resize(bytes, 0);
            let read = self
                .file
                .seek(SeekFrom::Start(run.at))
                .and_then(|_| self.file.read_exact(&mut run.buffer));
            read.map_err(|e| Error::io(&self.path, e))?;
            (run.at, run.left, run.start) = (run.at + bytes as u64, run.left - count, 0);
        }
        let point = point_of(&run.buffer[run.start..]);
        run.start += POINT_BYTES;
        self.heap.push(Reverse((Sorted::new(point, &self.plane), k)));
        Ok(())
    }

    fn next(&mut self) -> Result<Option<Sorted>> {
        let Some(Reverse((point, run))) = self.heap.pop() else { return Ok(None) };
        self.refill(run)?;
        Ok(Some(point))
    }
}
