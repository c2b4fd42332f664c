//! Making a TIN, or opening one that has been made.

use std::path::PathBuf;

use glam::DVec3;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::super::mesh::{TemporaryFolder, lock};
use super::block::{BYTES_PER_POINT, Points};
use super::file::{HEADER_BYTES, Tin, TinCounts, TinWriter};
use super::key::key;
use super::leaves::{Block, LEAF_POINTS, LeafMaker, Leaves};
use super::plane::TinPlane;
use super::sort::{SORTED_BYTES, Sorter};
use crate::geom::{POINT_LIMIT_M, PointSource};
use crate::{Error, Result};

/// The longest edge where none is asked for: this many times the mean distance of neighbours. It closes what a car or a
/// tree hides, and leaves open what a lake does.
const EDGE_SPACINGS: f64 = 50.0;
/// Points read at a time.
const CHUNK: usize = 1 << 14;
/// Most points: their triangles, two a point, are numbered by 32 bits.
const MOST_POINTS: u64 = 1 << 31;
/// The part of the work that reading and sorting is, about.
const READING: f64 = 0.4;
/// Bytes of disk a point: in a run, as a vertex, and as two triangles.
const DISK_BYTES: u64 = 24 + 24 + 26;

/// Takes word of how far the making has come, 0 to 1. Its error ends it.
pub type TinProgress<'a> = &'a mut (dyn FnMut(f64) -> Result<()> + Send);

/// How a TIN is made.
#[derive(Debug, Clone)]
pub struct TinBuild {
    /// The work folder; made if there is none.
    pub work: PathBuf,
    /// Working memory, bytes.
    pub budget_bytes: usize,
    /// What the points are triangulated over.
    pub plane: TinPlane,
    /// Added to every point, metres.
    pub shift: DVec3,
    /// No triangle has an edge longer than this in the plane, metres, perhaps infinite; `None`: 50 times the mean distance
    /// of neighbouring points, rounded to two digits.
    pub max_edge_m: Option<f64>,
}

impl TinBuild {
    /// Bytes of disk that the making takes, about.
    pub fn disk_bytes(sources: &[&dyn PointSource]) -> u64 {
        let points = sources.iter().map(|s| s.about()).fold(0, u64::saturating_add);
        points.saturating_mul(DISK_BYTES)
    }

    /// Opens the TIN of these clouds; makes it if there is none, or if it is damaged. Runs on rayon's current threads.
    ///
    /// # Errors
    /// Those of the clouds; [`Error::Usage`] if no triangle is left; [`Error::Limit`] for more points than 31 bits can
    /// number; [`Error::OverBudget`] if the points within the greatest edge of one place do not fit the memory; [`Error::Corrupt`]
    /// for a file that changes while it is read; [`Error::Io`]; what `on_progress` returns. Nothing is left then.
    pub fn open_or_build(
        &self,
        sources: &[&dyn PointSource],
        on_progress: TinProgress<'_>,
    ) -> Result<Tin> {
        let key_of = || key(sources, self.shift, &self.plane, self.max_edge_m);
        let key = key_of()?;
        std::fs::create_dir_all(&self.work).map_err(|e| Error::io(&self.work, e))?;
        let path = self.work.join(format!("tin-{key}.ply"));
        if let Some(tin) = Tin::open(&path)? {
            return Ok(tin);
        }
        // One writer at a time; whoever waited finds the TIN made.
        let _lock = lock(&path.with_extension("lock"))?;
        if let Some(tin) = Tin::open(&path)? {
            return Ok(tin);
        }
        let folder = TemporaryFolder::new(path.with_extension("tmp"))?;
        let part = folder.path().join("tin.ply");
        let mut writer = TinWriter::create(part.clone())?;
        let (leaves, counts) = self.sort(sources, folder.path(), &mut writer, on_progress)?;
        let points = Points {
            path: &part,
            at: HEADER_BYTES as u64,
            plane: self.plane,
            leaves: &leaves,
            max_edge: counts.max_edge_m,
        };
        let triangles = self.triangulate(&points, &mut writer, on_progress)?;
        if triangles == 0 {
            return Err(Error::usage(format!(
                "the point clouds make no triangle with edges of up to {:?} m (--max-edge): {} points, their mean spacing is {:.3} m",
                counts.max_edge_m, counts.points, counts.spacing_m
            )));
        }
        if key_of()? != key {
            let names: Vec<String> =
                sources.iter().map(|s| s.path().display().to_string()).collect();
            let place = "content, while it was read";
            return Err(Error::corrupt(names.join(", "), place, "no change", "a change"));
        }
        writer.finish(&path, TinCounts { triangles, ..counts })
    }

    /// Reads all points and writes them sorted, as vertices.
    fn sort(
        &self,
        sources: &[&dyn PointSource],
        folder: &std::path::Path,
        writer: &mut TinWriter,
        on_progress: TinProgress<'_>,
    ) -> Result<(Leaves, TinCounts)> {
        let capacity = self.budget_bytes / 4 * 3 / SORTED_BYTES;
        let mut sorter = Sorter::new(self.plane, capacity, folder);
        let about: u64 = sources.iter().map(|s| s.about()).fold(0, u64::saturating_add);
        let (mut read, mut passed_over, mut chunk) = (0, 0, Vec::new());
        for source in sources {
            let (mut points, mut of_file) = (source.points()?, 0_u64);
            loop {
                points.next_points(CHUNK, &mut chunk)?;
                if chunk.is_empty() {
                    break;
                }
                for &point in &chunk {
                    sorter.push(self.moved(*source, of_file, point)?)?;
                    of_file += 1;
                }
                read += chunk.len() as u64;
                on_progress(READING * (read as f64 / about.max(1) as f64).min(1.0))?;
                if read > MOST_POINTS {
                    let what = format!("number of points up to {}", source.path().display());
                    return Err(Error::Limit { what, limit: MOST_POINTS, found: read });
                }
            }
            passed_over += points.passed_over();
        }
        let mut leaves = LeafMaker::new(LEAF_POINTS);
        let doubles = sorter.finish(&mut |point| {
            leaves.push(point);
            writer.vertex(point.ground)
        })?;
        writer.flush()?;
        let leaves = leaves.finish();
        let spacing_m = leaves.spacing();
        let max_edge_m = self.max_edge_m.unwrap_or_else(|| two_digits(EDGE_SPACINGS * spacing_m));
        let points = leaves.points().into();
        let counts =
            TinCounts { points, passed_over, doubles, triangles: 0, spacing_m, max_edge_m };
        Ok((leaves, counts))
    }

    /// The point where the shift moves it to.
    fn moved(&self, source: &dyn PointSource, number: u64, point: DVec3) -> Result<DVec3> {
        let ground = point + self.shift;
        if ground.abs().cmple(DVec3::splat(POINT_LIMIT_M)).all() {
            return Ok(ground);
        }
        let place = format!("point {number} of those used, shifted");
        let expected = format!("coordinates within {POINT_LIMIT_M:e} m");
        Err(Error::corrupt(source.path(), place, expected, format!("{:?}", ground.to_array())))
    }

    /// Triangulates block after block, as many at once as there are threads and as fit; the triangles written.
    fn triangulate(
        &self,
        points: &Points<'_>,
        writer: &mut TinWriter,
        on_progress: TinProgress<'_>,
    ) -> Result<u64> {
        let threads = rayon::current_num_threads().max(1) as u64;
        let budget = self.budget_bytes.saturating_sub(points.leaves.bytes()) as u64;
        let most = budget / BYTES_PER_POINT;
        let blocks =
            points.leaves.blocks(points.max_edge, most / threads, most, BYTES_PER_POINT)?;
        let all = blocks.iter().map(|block| block.points).sum::<u64>().max(1) as f64;
        let (mut written, mut done, mut rest) = (0, 0, &blocks[..]);
        while !rest.is_empty() {
            let (batch, after) = rest.split_at(fitting(rest, most, threads));
            let found: Vec<_> = batch.par_iter().map(|block| points.triangles(block)).collect();
            for triangles in found {
                let triangles = triangles?;
                writer.faces(&triangles)?;
                written += triangles.len() as u64;
            }
            done += batch.iter().map(|block| block.points).sum::<u64>();
            on_progress(READING + (1.0 - READING) * done as f64 / all)?;
            rest = after;
        }
        Ok(written)
    }
}

/// How many of the first blocks to triangulate at once: one a thread, and no more than `most` points.
fn fitting(blocks: &[Block], most: u64, threads: u64) -> usize {
    let mut points = 0;
    let fits = |block: &&Block| {
        points += block.points;
        points <= most
    };
    let threads = usize::try_from(threads).unwrap_or(usize::MAX);
    blocks.iter().take(threads).take_while(fits).count().max(1)
}

/// `x`, at least 0, rounded to two significant digits.
fn two_digits(x: f64) -> f64 {
    // As text, so that the result is what a user would type.
    format!("{x:.1e}").parse().unwrap_or(x)
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn the_longest_edge_is_rounded_to_two_digits() {
        let rounded = [0.012_34, 17.55, 999.9, 0.0].map(two_digits);
        assert_eq!(rounded.map(f64::to_bits), [0.012, 18.0, 1000.0, 0.0].map(f64::to_bits));
    }
}
