//! Axis-aligned bounds in two and three dimensions.

use glam::{DVec2, DVec3};

/// A closed axis-aligned rectangle; empty when `min > max` in some coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds2 {
    /// Least corner.
    pub min: DVec2,
    /// Greatest corner.
    pub max: DVec2,
}

/// A closed axis-aligned box; empty when `min > max` in some coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds3 {
    /// Least corner.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
}

impl Default for Bounds2 {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Bounds2 {
    /// Bounds of nothing: the identity of [`Self::union`].
    pub const EMPTY: Self = Self { min: DVec2::INFINITY, max: DVec2::NEG_INFINITY };

    /// Bounds of some points.
    pub fn of(points: impl IntoIterator<Item = DVec2>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::including)
    }

    /// These bounds, grown to hold `p`.
    #[must_use]
    pub fn including(self, p: DVec2) -> Self {
        Self { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The least bounds that hold both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether the bounds hold no point.
    pub fn is_empty(&self) -> bool {
        !(self.min.x <= self.max.x && self.min.y <= self.max.y)
    }

    /// Whether the two closed rectangles share a point.
    pub fn intersects(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }
}

impl Bounds3 {
    /// Bounds of nothing: the identity of [`Self::union`].
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Bounds of some points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::including)
    }

    /// These bounds, grown to hold `p`.
    #[must_use]
    pub fn including(self, p: DVec3) -> Self {
        Self { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The least bounds that hold both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether the bounds hold no point.
    pub fn is_empty(&self) -> bool {
        !(self.min.x <= self.max.x && self.min.y <= self.max.y && self.min.z <= self.max.z)
    }

    /// Whether the two closed boxes share a point.
    pub fn intersects(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Length of the diagonal; 0 for a point, negative infinity never.
    pub fn diagonal(&self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.max - self.min).length() }
    }

    /// The middle.
    pub fn centre(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// The eight corners; bit 0, 1, 2 of the index chooses the greater x, y, z.
    pub fn corners(&self) -> [DVec3; 8] {
        let pick = |bit: bool, lo: f64, hi: f64| if bit { hi } else { lo };
        std::array::from_fn(|k| {
            DVec3::new(
                pick(k & 1 != 0, self.min.x, self.max.x),
                pick(k & 2 != 0, self.min.y, self.max.y),
                pick(k & 4 != 0, self.min.z, self.max.z),
            )
        })
    }

    /// The range `(least, greatest)` of the linear function `normal · p + offset` over the box.
    ///
    /// Rounding: each bound may be off by a few units in the last place of the sum's terms; a caller that
    /// culls by it must leave that much room.
    pub fn linear_range(&self, normal: DVec3, offset: f64) -> (f64, f64) {
        let (a, b) = (normal * self.min, normal * self.max);
        (a.min(b).element_sum() + offset, a.max(b).element_sum() + offset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_bounds_meet_nothing_and_are_the_identity_of_union() {
        let b = Bounds3::of([DVec3::ZERO, DVec3::ONE]);
        assert!(Bounds3::EMPTY.is_empty() && !Bounds3::EMPTY.intersects(&b));
        assert_eq!(Bounds3::EMPTY.union(b), b);
    }

    #[test]
    fn the_range_of_a_linear_function_is_that_over_the_corners() {
        let b = Bounds3 { min: DVec3::new(-1.0, 2.0, -3.0), max: DVec3::new(4.0, 5.0, -2.0) };
        let n = DVec3::new(0.5, -2.0, 3.0);
        let values = b.corners().map(|c| n.dot(c) + 7.0);
        let (lo, hi) = b.linear_range(n, 7.0);
        let least = values.into_iter().fold(f64::INFINITY, f64::min);
        let greatest = values.into_iter().fold(f64::NEG_INFINITY, f64::max);
        assert_eq!((lo.to_bits(), hi.to_bits()), (least.to_bits(), greatest.to_bits()));
    }
}
