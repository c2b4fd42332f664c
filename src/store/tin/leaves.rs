//! Leaves: runs of a few thousand neighbouring points, with their bounds, and a tree of bounds over them.
//!
//! In: the points sorted along the curve. Out: which leaves meet a rectangle, how many points there are, and blocks that
//! fit the memory. A leaf is the largest cell of the curve around its points that holds no more than [`LEAF_POINTS`]: a
//! function of the points alone. Memory: a leaf takes 90 bytes.

use std::ops::Range;

use glam::DVec2;

use super::sort::Sorted;
use crate::geom::Bounds2;
use crate::{Error, Result};

/// Most points of a leaf.
pub(super) const LEAF_POINTS: usize = 4096;

/// Neighbouring points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaf {
    /// Number of the first point.
    pub(super) first: u32,
    /// Of the points, metres.
    pub(super) bounds: Bounds2,
    /// Place of the first point on the curve.
    key: [u64; 2],
}

/// Cuts points into leaves as they come.
#[derive(Debug)]
pub(super) struct LeafMaker {
    /// Most points of a leaf.
    most: usize,
    pending: Vec<([u64; 2], DVec2)>,
    /// Place of the last point of the leaf before.
    before: Option<[u64; 2]>,
    first: u32,
    leaves: Vec<Leaf>,
}

/// Number of leading bits that two places on the curve share.
fn shared(a: [u64; 2], b: [u64; 2]) -> u32 {
    match (a[0] ^ b[0]).leading_zeros() {
        64 => 64 + (a[1] ^ b[1]).leading_zeros(),
        bits => bits,
    }
}

impl LeafMaker {
    /// Leaves of at most `most` points.
    pub(super) fn new(most: usize) -> Self {
        Self { most, pending: Vec::new(), before: None, first: 0, leaves: Vec::new() }
    }

    /// Takes the next point in order.
    pub(super) fn push(&mut self, point: &Sorted) {
        self.pending.push((point.key, point.at));
        if self.pending.len() > self.most {
            self.cut();
        }
    }

    /// Makes a leaf of the first points that are pending: those of the largest cell that leaves out the point before, and
    /// the one that would be too many.
    fn cut(&mut self) {
        let Some(&(key, _)) = self.pending.first() else { return };
        let beyond = self.pending.get(self.most).map(|&(k, _)| k);
        let bits = [self.before, beyond].into_iter().flatten().map(|other| shared(key, other) + 1);
        let bits = bits.max().unwrap_or(0);
        let same = |other: [u64; 2]| shared(key, other) >= bits.min(128);
        let most = self.pending.len().min(self.most);
        let count = self.pending[..most].iter().take_while(|(k, _)| same(*k)).count().max(1);
        let points = self.pending.drain(..count);
        let (mut bounds, mut last) = (Bounds2::EMPTY, key);
        for (key, at) in points {
            bounds = bounds.including(at);
            last = key;
        }
        self.leaves.push(Leaf { first: self.first, bounds, key });
        self.before = Some(last);
        self.first += u32::try_from(count).expect("points of a leaf");
    }

    /// All leaves.
    pub(super) fn finish(mut self) -> Leaves {
        while !self.pending.is_empty() {
            self.cut();
        }
        Leaves::new(self.leaves, self.first)
    }
}

/// A block: leaves that are triangulated at once, and the points that takes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Block {
    pub(super) leaves: Range<usize>,
    /// Of its own points.
    pub(super) bounds: Bounds2,
    /// Points of the leaves within reach, its own counted.
    pub(super) points: u64,
}

/// All leaves, under a tree of bounds.
#[derive(Debug)]
pub(super) struct Leaves {
    all: Vec<Leaf>,
    points: u32,
    /// A complete binary tree: the root at 1, the children of k at 2k and 2k + 1, leaves at the end.
    nodes: Vec<Bounds2>,
}

impl Leaves {
    fn new(leaves: Vec<Leaf>, points: u32) -> Self {
        let width = leaves.len().next_power_of_two();
        let mut nodes = vec![Bounds2::EMPTY; 2 * width];
        for (node, leaf) in nodes[width..].iter_mut().zip(&leaves) {
            *node = leaf.bounds;
        }
        for k in (1..width).rev() {
            nodes[k] = nodes[2 * k].union(nodes[2 * k + 1]);
        }
        Self { all: leaves, points, nodes }
    }

    /// Bytes that leaves of so many points take, at most about.
    pub(super) fn bytes(&self) -> usize {
        self.all.capacity() * size_of::<Leaf>() + self.nodes.len() * size_of::<Bounds2>()
    }

    /// Of all points.
    pub(super) fn bounds(&self) -> Bounds2 {
        self.nodes.get(1).copied().unwrap_or(Bounds2::EMPTY)
    }

    /// Number of points.
    pub(super) fn points(&self) -> u32 {
        self.points
    }

    /// Numbers of the points of some leaves.
    pub(super) fn range(&self, leaves: Range<usize>) -> Range<u32> {
        let first = |k: usize| self.all.get(k).map_or(self.points, |leaf| leaf.first);
        first(leaves.start)..first(leaves.end)
    }

    /// Mean distance of neighbours, metres: the square root of the area of all leaves' bounds a point.
    pub(super) fn spacing(&self) -> f64 {
        let area = |leaf: &Leaf| {
            let size = leaf.bounds.max - leaf.bounds.min;
            size.x * size.y
        };
        let area: f64 = self.all.iter().map(area).sum();
        (area / f64::from(self.points.max(1))).sqrt()
    }

    /// Gives `take` the leaves in order whose bounds, and those of all nodes above them, `may` be wanted.
    pub(super) fn visit(
        &self,
        may: &dyn Fn(&Bounds2) -> bool,
        take: &mut dyn FnMut(usize) -> Result<bool>,
    ) -> Result<()> {
        let width = self.nodes.len() / 2;
        let mut open = vec![1];
        while let Some(node) = open.pop() {
            if self.nodes[node].is_empty() || !may(&self.nodes[node]) {
                continue;
            }
            if node < width {
                open.extend([2 * node + 1, 2 * node]);
            } else if !take(node - width)? {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Points of the leaves that meet `reach`.
    fn points_near(&self, reach: &Bounds2) -> Result<u64> {
        let mut count = 0;
        self.visit(&|bounds| meets(bounds, reach), &mut |k| {
            count += self.range(k..k + 1).len() as u64;
            Ok(true)
        })?;
        Ok(count)
    }

    /// Blocks of all leaves, in order, none of which takes more than `most` points, and few more than `wanted`.
    ///
    /// # Errors
    /// [`Error::OverBudget`] if a single leaf takes more, of `point_bytes` each.
    pub(super) fn blocks(
        &self,
        reach: f64,
        wanted: u64,
        most: u64,
        point_bytes: u64,
    ) -> Result<Vec<Block>> {
        let (mut open, mut blocks) = (Vec::new(), Vec::new());
        open.push(0..self.all.len());
        while let Some(leaves) = open.pop() {
            if leaves.is_empty() {
                continue;
            }
            let own = self.all[leaves.clone()].iter().map(|leaf| leaf.bounds);
            let bounds = own.fold(Bounds2::EMPTY, Bounds2::union);
            let points = self.points_near(&grown(&bounds, reach))?;
            let is_mostly_others = 2 * self.range(leaves.clone()).len() as u64 <= points;
            if points <= wanted || points <= most && (is_mostly_others || leaves.len() == 1) {
                blocks.push(Block { leaves, bounds, points });
            } else if leaves.len() == 1 {
                return Err(Error::OverBudget {
                    what: format!(
                        "the {points} points within --max-edge {reach:?} m of one place, triangulated at once,"
                    ),
                    needed_bytes: points * point_bytes,
                    allowed_bytes: most * point_bytes,
                    hint: Some("take a shorter --max-edge, or allow more --memory".into()),
                });
            } else {
                let middle = self.middle(&leaves);
                open.extend([middle..leaves.end, leaves.start..middle]);
            }
        }
        Ok(blocks)
    }

    /// Where the cell that holds these leaves is halved.
    fn middle(&self, leaves: &Range<usize>) -> usize {
        let (first, last) = (self.all[leaves.start].key, self.all[leaves.end - 1].key);
        let bits = shared(first, last);
        let is_below = |leaf: &Leaf| shared(first, leaf.key) > bits;
        let below = self.all[leaves.clone()].partition_point(is_below);
        let middle = if below == 0 || below == leaves.len() { leaves.len() / 2 } else { below };
        leaves.start + middle
    }
}

/// Whether two rectangles have a point in common.
pub(super) fn meets(a: &Bounds2, b: &Bounds2) -> bool {
    a.min.cmple(b.max).all() && b.min.cmple(a.max).all()
}

/// Whether `inner` lies within `outer`.
pub(super) fn holds(outer: &Bounds2, inner: &Bounds2) -> bool {
    outer.min.cmple(inner.min).all() && inner.max.cmple(outer.max).all()
}

/// `bounds`, `by` farther on every side, and by more than rounding takes.
pub(super) fn grown(bounds: &Bounds2, by: f64) -> Bounds2 {
    let greatest = bounds.min.abs().max(bounds.max.abs()).max_element();
    let by = DVec2::splat(by * (1.0 + 1e-9) + greatest * 1e-14);
    Bounds2 { min: bounds.min - by, max: bounds.max + by }
}
