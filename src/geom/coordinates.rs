//! [`Coordinates`]: points as three arrays, for loops over many.

use glam::DVec3;

use super::held_bytes;

/// Points as arrays of equal length, one a coordinate.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Coordinates {
    /// x of each point.
    pub x: Vec<f64>,
    /// y of each point.
    pub y: Vec<f64>,
    /// z of each point.
    pub z: Vec<f64>,
}

impl Coordinates {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// Forgets all points, keeps the memory.
    pub fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.z.clear();
    }

    /// Appends a point.
    pub fn push(&mut self, p: DVec3) {
        self.x.push(p.x);
        self.y.push(p.y);
        self.z.push(p.z);
    }

    /// Point `k`.
    ///
    /// # Panics
    /// If there are not so many.
    #[inline]
    pub fn at(&self, k: usize) -> DVec3 {
        DVec3::new(self.x[k], self.y[k], self.z[k])
    }

    /// The coordinates of some points, x, y and z.
    ///
    /// # Panics
    /// If there are not so many.
    #[inline]
    pub fn range(&self, range: std::ops::Range<usize>) -> [&[f64]; 3] {
        [&self.x[range.clone()], &self.y[range.clone()], &self.z[range]]
    }

    /// All points in order.
    pub fn iter(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.x.iter().zip(&self.y).zip(&self.z).map(|((&x, &y), &z)| DVec3::new(x, y, z))
    }

    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        held_bytes(&self.x) + held_bytes(&self.y) + held_bytes(&self.z)
    }
}
