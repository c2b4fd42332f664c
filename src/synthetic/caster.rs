//! [`Caster`]: exact ray casting in f64 over the triangles of a scene, for making photographs.

use glam::DVec3;

use super::{Part, Placement, Scene, Texture};
use crate::geom::Bounds3;

/// Triangles in a leaf, at most.
const LEAF: usize = 4;

/// Finds the first triangle along a ray by a tree of bounds, and its colour.
///
/// Exact in the sense of plain f64 arithmetic: which triangle is hit does not depend on the tree.
#[derive(Debug, Clone)]
pub struct Caster {
    nodes: Vec<Node>,
    /// In the order of the tree's leaves, relative to `origin`.
    triangles: Vec<Triangle>,
    origin: DVec3,
    placement: Placement,
    texture: Texture,
}

/// A node of the tree: its children are the next node and `second`, or it holds `count` triangles from `second`.
#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds3,
    second: u32,
    count: u32,
}

#[derive(Debug, Clone, Copy)]
struct Triangle {
    a: DVec3,
    e1: DVec3,
    e2: DVec3,
    normal: DVec3,
    part: Part,
}

/// The first point along a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CastHit {
    /// The point, ground frame, metres.
    pub ground: DVec3,
    /// What it is part of.
    pub part: Part,
    /// Unit normal of its triangle, by the triangle's winding.
    pub normal: DVec3,
    /// Number of its triangle within the caster.
    triangle: u32,
}

impl CastHit {
    /// Whether `other` lies in the same plane on the same part, to within `tolerance_m` across the plane.
    pub fn continues(&self, other: &Self, tolerance_m: f64) -> bool {
        self.part == other.part
            && self.normal.dot(other.ground - self.ground).abs() <= tolerance_m
            && other.normal.dot(other.ground - self.ground).abs() <= tolerance_m
    }
}

impl Caster {
    /// A caster over the patches of a scene.
    pub fn of_scene(scene: &Scene) -> Self {
        let triangles: Vec<_> =
            scene.triangles().map(|(t, k)| (t, scene.patches()[k as usize].part)).collect();
        Self::new(&triangles, *scene.placement(), scene.texture().clone())
    }

    /// A caster over any triangles (ground frame, metres), painted with a placed texture.
    pub fn new(triangles: &[([DVec3; 3], Part)], placement: Placement, texture: Texture) -> Self {
        let origin = Bounds3::of(triangles.iter().flat_map(|t| t.0)).centre();
        let origin = if origin.is_finite() { origin } else { DVec3::ZERO };
        let mut items: Vec<Triangle> = triangles
            .iter()
            .map(|&([a, b, c], part)| {
                let (e1, e2) = (b - a, c - a);
                let normal = e1.cross(e2).normalize_or_zero();
                Triangle { a: a - origin, e1, e2, normal, part }
            })
            .filter(|t| t.normal != DVec3::ZERO)
            .collect();
        let mut nodes = Vec::new();
        grow(&mut nodes, &mut items, 0);
        Self { nodes, triangles: items, origin, placement, texture }
    }

    /// The first triangle along `from + t · along`, t > 0. `along` need not be of unit length. A hit of a
    /// neighbouring ray, if there is one, makes the search shorter and changes nothing else.
    pub fn cast(&self, from: DVec3, along: DVec3, near: Option<&CastHit>) -> Option<CastHit> {
        let from = from - self.origin;
        // A direction's 0 becomes almost 0: no infinity, and so no NaN, in the test of boxes.
        let almost = |c: f64| if c.abs() < 1e-300 { 1e-300 } else { c };
        let inverse =
            DVec3::new(1.0 / almost(along.x), 1.0 / almost(along.y), 1.0 / almost(along.z));
        let mut best = (f64::INFINITY, u32::MAX);
        if let Some(hit) = near {
            self.try_triangle(hit.triangle, from, along, &mut best);
        }
        // Nodes still to be looked at, with the distances at which the ray enters them; the nearest last.
        let mut stack = [(0_u32, 0.0); 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let (at, distance) = stack[depth];
            if distance > best.0 {
                continue;
            }
            let node = &self.nodes[at as usize];
            for k in node.second..node.second + node.count {
                self.try_triangle(k, from, along, &mut best);
            }
            if node.count > 0 {
                continue;
            }
            let [one, two] = [at + 1, node.second]
                .map(|k| (k, entry(&self.nodes[k as usize].bounds, from, inverse)));
            let in_order = if one.1 <= two.1 { [two, one] } else { [one, two] };
            for child in in_order {
                if child.1 < f64::INFINITY && child.1 <= best.0 {
                    stack[depth] = child;
                    depth += 1;
                }
            }
        }
        let triangle = self.triangles.get(best.1 as usize)?;
        Some(CastHit {
            ground: from + along * best.0 + self.origin,
            part: triangle.part,
            normal: triangle.normal,
            triangle: best.1,
        })
    }

    /// Colour (red, green, blue; 0 to 1) of a hit.
    pub fn colour(&self, hit: &CastHit) -> [f64; 3] {
        self.texture.colour(self.placement.scene_from_ground(hit.ground), hit.part)
    }

    /// Möller and Trumbore's test; the lower number wins a tie, so that order in the tree does not matter much
    /// (equal triangles have equal colours).
    #[inline]
    fn try_triangle(&self, k: u32, from: DVec3, along: DVec3, best: &mut (f64, u32)) {
        /// Room at edges, in weights: no ray slips between two triangles that share an edge.
        const ROOM: f64 = 1e-12;
        let t = &self.triangles[k as usize];
        let p = along.cross(t.e2);
        let det = t.e1.dot(p);
        if det == 0.0 {
            return;
        }
        let inverse = 1.0 / det;
        let s = from - t.a;
        let v = s.dot(p) * inverse;
        if !(-ROOM..=1.0 + ROOM).contains(&v) {
            return;
        }
        let q = s.cross(t.e1);
        let w = along.dot(q) * inverse;
        if w < -ROOM || v + w > 1.0 + ROOM {
            return;
        }
        let distance = t.e2.dot(q) * inverse;
        if distance > 0.0 && (distance, k) < *best {
            *best = (distance, k);
        }
    }
}

/// Adds the tree over `items`, whose first has the number `first`, to `nodes`; sorts the items.
fn grow(nodes: &mut Vec<Node>, items: &mut [Triangle], first: usize) {
    let number = |n: usize| u32::try_from(n).expect("a scene has few triangles");
    if items.is_empty() {
        return;
    }
    // A little room, so that rounding in the box test skips nothing.
    let tight = items.iter().map(bounds_of).fold(Bounds3::EMPTY, Bounds3::union);
    let room = 1e-9 * (1.0 + tight.diagonal());
    let bounds = Bounds3 { min: tight.min - room, max: tight.max + room };
    let at = nodes.len();
    nodes.push(Node { bounds, second: number(first), count: number(items.len()) });
    if items.len() <= LEAF {
        return;
    }
    let middle = split(items);
    let (left, right) = items.split_at_mut(middle);
    grow(nodes, left, first);
    nodes[at] = Node { bounds, second: number(nodes.len()), count: 0 };
    grow(nodes, right, first + middle);
}

/// Sorts the items along the axis, and returns the place, where a cut makes the expected cost least.
///
/// J. D. `MacDonald`, K. S. Booth (1990), "Heuristics for ray tracing using space subdivision", The Visual Computer
/// 6, 153–166, doi:10.1007/BF01911006: surface area times number, on both sides.
fn split(items: &mut [Triangle]) -> usize {
    let area = |b: &Bounds3| {
        let d = b.max - b.min;
        d.x * d.y + d.y * d.z + d.z * d.x
    };
    let count = items.len();
    let mut best = (f64::INFINITY, 0, count / 2);
    let mut right = vec![0.0; count];
    for axis in 0..3 {
        sort(items, axis);
        let mut bounds = Bounds3::EMPTY;
        for k in (1..count).rev() {
            bounds = bounds.union(bounds_of(&items[k]));
            right[k] = area(&bounds) * (count - k) as f64;
        }
        bounds = Bounds3::EMPTY;
        for k in 1..count {
            bounds = bounds.union(bounds_of(&items[k - 1]));
            let cost = area(&bounds) * k as f64 + right[k];
            if cost < best.0 {
                best = (cost, axis, k);
            }
        }
    }
    sort(items, best.1);
    best.2
}

fn sort(items: &mut [Triangle], axis: usize) {
    items.sort_by(|s, t| {
        let middle = |b: Bounds3| b.centre()[axis];
        middle(bounds_of(s)).total_cmp(&middle(bounds_of(t)))
    });
}

fn bounds_of(t: &Triangle) -> Bounds3 {
    Bounds3::of([t.a, t.a + t.e1, t.a + t.e2])
}

/// Where a ray enters a box, 0 if it starts inside; infinity if it misses it.
#[inline]
fn entry(bounds: &Bounds3, from: DVec3, inverse: DVec3) -> f64 {
    let (one, two) = ((bounds.min - from) * inverse, (bounds.max - from) * inverse);
    let enter = one.min(two).max(DVec3::ZERO).max_element();
    let leave = one.max(two).min_element();
    if enter <= leave { enter } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::Random;

    fn soup(count: usize, seed: u64) -> Vec<([DVec3; 3], Part)> {
        let mut r = Random::new(seed);
        let mut point = |scale: f64| DVec3::from(std::array::from_fn(|_| r.between(-scale, scale)));
        (0..count)
            .map(|k| {
                let middle = point(5.0);
                (std::array::from_fn(|_| middle + point(0.6)), Part::ALL[k % 8])
            })
            .collect()
    }

    #[test]
    fn the_tree_finds_what_trying_every_triangle_finds() {
        let triangles = soup(700, 1);
        let caster = Caster::new(&triangles, Placement::IDENTITY, Texture::new(0.02));
        let mut r = Random::new(2);
        let (mut hits, mut near) = (0, None);
        for _ in 0..3_000 {
            let from = DVec3::from(std::array::from_fn(|_| r.between(-8.0, 8.0)));
            let to = DVec3::from(std::array::from_fn(|_| r.between(-4.0, 4.0)));
            let mut best = (f64::INFINITY, u32::MAX);
            for k in 0..700 {
                caster.try_triangle(k, from - caster.origin, to - from, &mut best);
            }
            let found = caster.cast(from, to - from, near.as_ref());
            assert_eq!(found.map(|h| h.triangle), (best.1 != u32::MAX).then_some(best.1));
            hits += u32::from(found.is_some());
            near = found.or(near);
        }
        assert!(hits > 1_000, "{hits}");
    }

    #[test]
    fn rays_along_the_axes_and_in_faces_of_boxes_are_not_lost() {
        let quad = |z: f64| {
            let p = |x: f64, y: f64| DVec3::new(x, y, z);
            [[p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0)], [p(0.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)]]
        };
        let triangles: Vec<_> = [0.0, -1.0, -2.0, -3.0]
            .iter()
            .flat_map(|&z| quad(z).map(|t| (t, Part::Wall)))
            .collect();
        let caster = Caster::new(&triangles, Placement::IDENTITY, Texture::new(0.02));
        for (x, y) in [(0.0, 0.0), (1.0, 0.5), (0.5, 0.5), (1.0, 1.0), (0.25, 0.0)] {
            let hit = caster.cast(DVec3::new(x, y, 5.0), DVec3::NEG_Z, None).unwrap();
            assert!(hit.ground.z.abs() < 1e-12);
        }
        assert!(caster.cast(DVec3::new(0.5, 1.1, 5.0), DVec3::NEG_Z, None).is_none());
    }
}
