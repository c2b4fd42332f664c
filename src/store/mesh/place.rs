//! First and second reading of the meshes: their bounds; then every vertex onto the lattice.
//!
//! In: streams of vertices. Out: bounds and counts; then packed vertices, held or in a temporary file, and how many
//! of them lie in each coarse cell of the curve, by which buckets are laid out. Memory: a few chunks, and what the
//! plan gives to vertices.

use std::path::PathBuf;

use glam::DVec3;
use rayon::prelude::*;

use super::curve::Curve;
use super::lattice::{Lattice, usable};
use super::plan::Plan;
use super::progress::{BuildStage, Meter};
use super::vertices::{PACKED_BYTES, VertexWriter, Vertices, pack};
use crate::geom::{Bounds3, MeshSource};
use crate::{Error, Result};

/// Vertices that a thread takes at a time.
const BATCH: usize = 1 << 13;

/// What the first reading finds.
#[derive(Debug)]
pub(super) struct Survey {
    /// Ground bounds of the usable vertices.
    pub(super) bounds: Bounds3,
    /// Usable vertices of each mesh.
    pub(super) usable: Vec<u64>,
    /// Vertices of all meshes that no face may use.
    pub(super) unusable: u64,
}

/// Reads all vertices for their bounds.
pub(super) fn survey(
    sources: &[&dyn MeshSource],
    plan: &Plan,
    meter: &mut Meter<'_>,
) -> Result<Survey> {
    let mut survey = Survey { bounds: Bounds3::EMPTY, usable: Vec::new(), unusable: 0 };
    let total = sources.iter().map(|s| s.vertex_count()).sum();
    let mut done = 0;
    for source in sources {
        let mut here = 0;
        for_each_chunk(*source, plan.chunk, |chunk| {
            let part = |vertices: &[DVec3]| {
                let good = vertices.iter().copied().filter(|&p| usable(p));
                let (count, bounds) =
                    good.fold((0, Bounds3::EMPTY), |(n, b), p| (n + 1, b.including(p)));
                (count, bounds)
            };
            // Sum, least and greatest: independent of how the threads share the work.
            let (count, bounds) = chunk
                .par_chunks(BATCH)
                .map(part)
                .reduce(|| (0, Bounds3::EMPTY), |a, b| (a.0 + b.0, a.1.union(b.1)));
            here += count;
            survey.unusable += chunk.len() as u64 - count;
            survey.bounds = survey.bounds.union(bounds);
            done += chunk.len() as u64;
            meter.tell(BuildStage::Bounds, done, total)
        })?;
        survey.usable.push(here);
    }
    Ok(survey)
}

/// Where vertices go.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement<'a> {
    pub(super) plan: &'a Plan,
    pub(super) lattice: &'a Lattice,
    pub(super) curve: &'a Curve,
}

impl Placement<'_> {
    /// Places the vertices of a mesh, of which the survey found `usable` to be usable; counts them in `cells`. On
    /// disk they go to a file at `path`.
    pub(super) fn place(
        &self,
        source: &dyn MeshSource,
        usable: u64,
        path: Option<PathBuf>,
        cells: &mut [u32],
    ) -> Result<Vertices> {
        let mut writer = VertexWriter::new(path)?;
        let mut packed: Vec<([u8; PACKED_BYTES], u32)> = Vec::new();
        let mut bytes = Vec::new();
        let mut found = 0;
        for_each_chunk(source, self.plan.chunk, |chunk| {
            let place = |&ground: &DVec3| {
                let point = self.lattice.point(ground);
                (pack(point), point.map_or(u32::MAX, |p| self.curve.coarse_cell(p)))
            };
            chunk.par_iter().with_min_len(BATCH).map(place).collect_into_vec(&mut packed);
            bytes.clear();
            for (vertex, cell) in &packed {
                bytes.extend_from_slice(vertex);
                if let Some(count) = cells.get_mut(*cell as usize) {
                    *count = count.saturating_add(1);
                    found += 1;
                }
            }
            writer.write(&bytes)
        })?;
        if found != usable {
            let (expected, found) = (format!("{usable} as before"), found.to_string());
            return Err(Error::corrupt(source.path(), "finite vertices", expected, found));
        }
        writer.finish(self.plan.block_vertices, self.plan.cache_bytes)
    }
}

/// Gives all vertices of a mesh to `work`, chunk by chunk, while the next is being read.
fn for_each_chunk(
    source: &dyn MeshSource,
    max: usize,
    mut work: impl FnMut(&[DVec3]) -> Result<()> + Send,
) -> Result<()> {
    let mut stream = source.vertices()?;
    let (mut chunk, mut ahead) = (Vec::new(), Vec::new());
    stream.next_vertices(max, &mut chunk)?;
    while !chunk.is_empty() {
        let (read, worked) = rayon::join(|| stream.next_vertices(max, &mut ahead), || work(&chunk));
        worked?;
        read?;
        std::mem::swap(&mut chunk, &mut ahead);
    }
    Ok(())
}
