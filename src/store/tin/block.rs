//! The triangles of one block.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::circle::Circle;
use super::delaunay::{Corners, Site, triangulate};
use super::leaves::{Block, Leaves, grown, holds};
use super::plane::TinPlane;
use super::sort::{POINT_BYTES, point_of};
use crate::geom::Bounds2;
use crate::{Error, Result};

/// Bytes that a point takes while its block is triangulated, reckoned from what holds it: site, triangulation, triangles.
pub(super) const BYTES_PER_POINT: u64 = 288;
/// Leaves that are held to be asked about circles.
const HELD_LEAVES: usize = 64;

/// The sorted points in their file, and how they are cut.
pub(super) struct Points<'a> {
    pub(super) path: &'a Path,
    /// Where the first point stands in the file, bytes.
    pub(super) at: u64,
    pub(super) plane: TinPlane,
    pub(super) leaves: &'a Leaves,
    /// Greatest length of an edge in the plane, metres.
    pub(super) max_edge: f64,
}

impl Points<'_> {
    /// The triangles of `block`, sorted, as numbers of points, the lowest first.
    pub(super) fn triangles(&self, block: &Block) -> Result<Vec<[u32; 3]>> {
        let file = File::open(self.path).map_err(|e| Error::io(self.path, e))?;
        let mut reader = Reader { points: self, file, bytes: Vec::new(), held: BTreeMap::new() };
        let known = grown(&block.bounds, self.max_edge);
        // 1. All points within reach.
        let mut sites = Vec::with_capacity(usize::try_from(block.points).unwrap_or(0));
        self.leaves.visit(&|bounds| super::leaves::meets(bounds, &known), &mut |k| {
            reader.read(k, &mut |site| {
                if holds(&known, &Bounds2 { min: site.at, max: site.at }) {
                    sites.push(site);
                }
            })?;
            Ok(true)
        })?;
        // 2. Their triangles, those of this block.
        let own = self.leaves.range(block.leaves.clone());
        let data = self.leaves.bounds();
        let (mut sure, mut doubtful) = (Vec::new(), Vec::new());
        triangulate(sites, &mut |corners| {
            if !own.contains(&corners[0].number) || !self.is_short(&corners) {
                return;
            }
            let circle = Circle::new(corners);
            if holds(&known, &data) || circle.lies_within(&known, &data) {
                sure.push(corners.map(|site| site.number));
            } else {
                doubtful.push((circle, corners.map(|site| site.number)));
            }
        });
        // 3. Those whose circle reaches farther hold no point there.
        for (circle, triangle) in doubtful {
            if !reader.forbids(&circle, &known)? {
                sure.push(triangle);
            }
        }
        sure.sort_unstable();
        Ok(sure)
    }

    /// Whether no edge is longer than the greatest.
    fn is_short(&self, [a, b, c]: &Corners) -> bool {
        let short = |a: &Site, b: &Site| (a.at - b.at).length() <= self.max_edge;
        short(a, b) && short(b, c) && short(c, a)
    }
}

/// Reads leaves.
struct Reader<'a> {
    points: &'a Points<'a>,
    file: File,
    bytes: Vec<u8>,
    held: BTreeMap<usize, Vec<Site>>,
}

impl Reader<'_> {
    /// Gives `take` the points of leaf `k`.
    fn read(&mut self, k: usize, take: &mut dyn FnMut(Site)) -> Result<()> {
        let points = self.points;
        let range = points.leaves.range(k..k + 1);
        self.bytes.resize(range.len() * POINT_BYTES, 0);
        let at = points.at + u64::from(range.start) * POINT_BYTES as u64;
        let read =
            self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut self.bytes));
        read.map_err(|e| Error::io(points.path, e))?;
        for (number, bytes) in range.zip(self.bytes.chunks_exact(POINT_BYTES)) {
            take(Site { at: points.plane.place(point_of(bytes)).0, number });
        }
        Ok(())
    }

    /// Whether a point outside `known` forbids the triangle.
    fn forbids(&mut self, circle: &Circle, known: &Bounds2) -> Result<bool> {
        let leaves = self.points.leaves;
        let mut is_forbidden = false;
        leaves.visit(&|bounds| circle.may_hold_unknown(bounds, known), &mut |k| {
            if !self.held.contains_key(&k) {
                if self.held.len() == HELD_LEAVES {
                    self.held.clear();
                }
                let mut sites = Vec::new();
                self.read(k, &mut |site| sites.push(site))?;
                self.held.insert(k, sites);
            }
            is_forbidden = self.held[&k].iter().any(|&site| circle.forbids(site));
            Ok(!is_forbidden)
        })?;
        Ok(is_forbidden)
    }
}
