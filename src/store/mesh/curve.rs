//! The order of triangles in a store: size class, then place on a space-filling curve.
//!
//! In: the lattice bounds of the mesh's vertices and its number of faces. Out: a key for each triangle, a
//! function of its corners alone. A huge face would inflate the bounds of its neighbours' partition, so faces
//! larger than a partition is likely to be stand in classes of their own, each for a factor of 4 in size.

use super::lattice::LatticePoint;
use super::layout::Node;
use super::partition::Triangle;
use crate::geom::{hilbert3, hilbert3_lanes};

/// Bits of each coordinate on the curve: cells of a millionth of the mesh's extent.
const AXIS_BITS: u32 = 20;
/// Bits of the key that hold the place on the curve; the class stands above them.
pub(super) const CURVE_BITS: u32 = 3 * AXIS_BITS;
/// Number of classes; one fewer than would fit above the place, so that a range of keys has an end.
pub(super) const CLASSES: u64 = (1 << (64 - CURVE_BITS)) - 1;
/// Triangles whose keys are made at once.
const LANES: usize = 8;
/// Bits of each coordinate of the coarse cells by which vertices are counted.
const COARSE_BITS: u32 = 6;
/// Number of coarse cells.
pub(super) const COARSE_CELLS: usize = 1 << (3 * COARSE_BITS);

/// Where triangles stand on the curve.
#[derive(Debug, Clone, Copy)]
pub(super) struct Curve {
    min: LatticePoint,
    /// Lattice coordinates, less the least, are shifted right by this into cells.
    shift: u32,
    /// Bits of the largest extent of class 0.
    class_bits: u32,
}

impl Curve {
    /// The curve for vertices within `bounds`, and `faces` faces.
    pub(super) fn new(bounds: &Node, faces: u64) -> Self {
        let extent = (0..3).map(|a| bounds.max[a].saturating_sub(bounds.min[a]).max(0)).max();
        let bits = bit_length(extent.unwrap_or(0).cast_unsigned());
        // Evenly spread, the 512 faces of a small partition span √(512 / faces) of the mesh.
        let halvings = faces.max(1).ilog2().saturating_sub(9) / 2;
        Self {
            min: bounds.min,
            shift: bits.saturating_sub(AXIS_BITS),
            class_bits: bits.saturating_sub(halvings),
        }
    }

    /// Sets the keys of triangles whose corners lie within the bounds.
    pub(super) fn set_keys(&self, triangles: &mut [Triangle]) {
        for lanes in triangles.chunks_mut(LANES) {
            let mut cells = [[0; LANES]; 3];
            for (l, triangle) in lanes.iter_mut().enumerate() {
                let (class, cell) = self.class_and_cell(&triangle.corners);
                triangle.key = class << CURVE_BITS;
                for (axis, coordinate) in cells.iter_mut().zip(cell) {
                    axis[l] = coordinate;
                }
            }
            let places = hilbert3_lanes(cells, AXIS_BITS);
            for (triangle, place) in lanes.iter_mut().zip(places) {
                triangle.key |= place;
            }
        }
    }

    /// The class of a triangle by its largest extent, and the cell of its centroid.
    #[inline]
    fn class_and_cell(&self, [a, b, c]: &[LatticePoint; 3]) -> (u64, [u32; 3]) {
        let mut cell = [0; 3];
        let mut extent = 0;
        for axis in 0..3 {
            let (p, q, r) = (a[axis], b[axis], c[axis]);
            extent = extent.max(p.max(q).max(r) - p.min(q).min(r));
            cell[axis] = self.cell((p + q + r - 3 * self.min[axis]) / 3);
        }
        let bits = bit_length(extent.cast_unsigned());
        let class = u64::from(bits.saturating_sub(self.class_bits).div_ceil(2));
        (class.min(CLASSES - 1), cell)
    }

    /// The coarse cell, below [`COARSE_CELLS`], in which a vertex lies: the high bits of the place of a class 0
    /// triangle there.
    #[inline]
    pub(super) fn coarse_cell(&self, p: LatticePoint) -> u32 {
        let fine =
            std::array::from_fn(|a| self.cell(p[a] - self.min[a]) >> (AXIS_BITS - COARSE_BITS));
        u32::try_from(hilbert3(fine, COARSE_BITS)).expect("18 bits")
    }

    /// The first key of a coarse cell.
    pub(super) fn coarse_key(cell: usize) -> u64 {
        (cell as u64) << (CURVE_BITS - 3 * COARSE_BITS)
    }

    /// The cell of a coordinate less the least; beyond the bounds, that at their end.
    #[inline]
    fn cell(&self, offset: i64) -> u32 {
        let last = (1 << AXIS_BITS) - 1;
        u32::try_from((offset >> self.shift).clamp(0, last)).expect("20 bits")
    }
}

/// Bits needed for `n`.
#[inline]
fn bit_length(n: u64) -> u32 {
    u64::BITS - n.leading_zeros()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIDE: i64 = 1 << 38;

    fn curve(faces: u64) -> Curve {
        Curve::new(&Node { min: [-5, 10, -SIDE], max: [SIDE, SIDE, 7] }, faces)
    }

    fn key(curve: &Curve, corners: [LatticePoint; 3]) -> u64 {
        let mut triangles = [Triangle { key: 9, id: 0, corners }; 11];
        curve.set_keys(&mut triangles);
        assert!(triangles.iter().all(|t| t.key == triangles[0].key));
        triangles[0].key
    }

    proptest! {
        #[test]
        fn a_coarse_cell_is_the_prefix_of_the_key(
            x in -5..SIDE, y in 10..SIDE, z in -SIDE..7,
        ) {
            let (curve, p) = (curve(1 << 20), [x, y, z]);
            let cell = curve.coarse_cell(p) as usize;
            let key = key(&curve, [p, p, p]);
            prop_assert!(Curve::coarse_key(cell) <= key);
            prop_assert!(key < Curve::coarse_key(cell + 1));
        }
    }

    #[test]
    fn faces_larger_than_a_partition_stand_in_classes_of_their_own() {
        let class = |faces, size| {
            let corners = [[0, 10, 0], [size, 10, 0], [0, 10 + size / 2, 0]];
            key(&curve(faces), corners) >> CURVE_BITS
        };
        assert_eq!(class(100, SIDE), 0);
        assert_eq!(class(1 << 21, SIDE / 128), 0);
        assert_eq!(class(1 << 21, SIDE / 32), 1);
        assert_eq!(class(1 << 21, SIDE / 8), 2);
        assert!(class(u64::from(u32::MAX), SIDE) < CLASSES);
    }

    #[test]
    fn a_mesh_without_extent_has_a_curve() {
        for node in [Node::EMPTY, Node { min: [3; 3], max: [3; 3] }] {
            assert_eq!(Curve::new(&node, 0).shift, 0);
        }
        let curve = Curve::new(&Node { min: [3; 3], max: [3; 3] }, 9);
        assert_eq!(key(&curve, [[3; 3]; 3]), 0);
    }
}
