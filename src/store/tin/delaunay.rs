//! The Delaunay triangulation of some points, made unique.
//!
//! In: points of the plane, no two at one place, each with its number in the whole. Out: triangles by these numbers, the
//! lowest first, turning from +u towards +v. The predicates are exact. Four and more points on one circle that holds no
//! other have several triangulations; here the polygon that they span is fanned from its lowest number. Of any part of
//! the points that holds a triangle of that fan, the same rule makes that triangle again.
//!
//! B. Delaunay (1934), "Sur la sphère vide"; the triangulation itself is the crate `spade`'s.

use glam::DVec2;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

use crate::geom::incircle;

/// A point of the plane, metres, and its number among all points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Site {
    pub(super) at: DVec2,
    pub(super) number: u32,
}

impl HasPosition for Site {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        Point2::new(self.at.x, self.at.y)
    }
}

/// A triangle, its lowest number first.
pub(super) type Corners = [Site; 3];

/// Gives `take` the triangles of `sites`, in no order.
pub(super) fn triangulate(sites: Vec<Site>, take: &mut dyn FnMut(Corners)) {
    if sites.len() < 3 {
        return;
    }
    let triangulation: DelaunayTriangulation<Site> =
        Triangulation::bulk_load(sites).expect("coordinates are finite, within the limits, or 0");
    let mut polygons = Polygons::of(&triangulation);
    for face in triangulation.inner_faces() {
        let corners = face.vertices().map(|v| *v.data());
        let index = face.fix().index();
        match polygons.name(index) {
            None => take(lowest_first(corners)),
            Some(name) => {
                for edge in face.adjacent_edges() {
                    let beyond = edge.rev().face().as_inner().map(|face| face.fix().index());
                    let is_inside = beyond.is_some_and(|face| polygons.name(face) == Some(name));
                    if !is_inside {
                        polygons.sides.push((name, *edge.from().data(), *edge.to().data()));
                    }
                }
            }
        }
    }
    drop(triangulation);
    fan(polygons.sides, take);
}

fn lowest_first([a, b, c]: Corners) -> Corners {
    if a.number < b.number && a.number < c.number {
        [a, b, c]
    } else if b.number < c.number {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// Faces that lie on one circle with a neighbour, joined.
struct Polygons {
    /// Of each face one of its polygon, itself where it is alone; empty if no face has such a neighbour.
    joined: Vec<u32>,
    /// Which are not alone.
    is_joined: Vec<bool>,
    /// Sides of the polygons, by name, turning as faces do.
    sides: Vec<(u32, Site, Site)>,
}

impl Polygons {
    fn of(triangulation: &DelaunayTriangulation<Site>) -> Self {
        let mut all = Self { joined: Vec::new(), is_joined: Vec::new(), sides: Vec::new() };
        for edge in triangulation.undirected_edges() {
            let [edge, rev] = [edge.as_directed(), edge.as_directed().rev()];
            let (Some(face), Some(other)) = (edge.face().as_inner(), rev.face().as_inner()) else {
                continue;
            };
            let corners = face.vertices().map(|v| v.data().at);
            let Some(opposite) = rev.opposite_vertex() else { continue };
            let [a, b, c] = corners;
            if incircle(a, b, c, opposite.data().at) == 0.0 {
                all.join(face.fix().index(), other.fix().index(), triangulation.num_all_faces());
            }
        }
        all
    }

    fn join(&mut self, a: usize, b: usize, faces: usize) {
        if self.joined.is_empty() {
            let faces =
                u32::try_from(faces).expect("faces of a triangulation have numbers of 32 bits");
            self.joined = (0..faces).collect();
            self.is_joined = vec![false; self.joined.len()];
        }
        (self.is_joined[a], self.is_joined[b]) = (true, true);
        let (a, b) = (self.root(a), self.root(b));
        self.joined[a.max(b) as usize] = a.min(b);
    }

    fn root(&mut self, face: usize) -> u32 {
        let mut face = face;
        while self.joined[face] as usize != face {
            let above = self.joined[self.joined[face] as usize];
            self.joined[face] = above;
            face = above as usize;
        }
        self.joined[face]
    }

    /// The polygon of a face; `None` if it is alone.
    fn name(&mut self, face: usize) -> Option<u32> {
        let is_joined = self.is_joined.get(face).copied().unwrap_or(false);
        is_joined.then(|| self.root(face))
    }
}

/// Fans each polygon from its lowest number.
fn fan(mut sides: Vec<(u32, Site, Site)>, take: &mut dyn FnMut(Corners)) {
    sides.sort_unstable_by_key(|(name, from, _)| (*name, from.number));
    for polygon in sides.chunk_by(|a, b| a.0 == b.0) {
        let first = polygon[0].1;
        let after = |site: Site| {
            let at = polygon.binary_search_by_key(&site.number, |(_, from, _)| from.number);
            polygon[at.expect("a polygon's sides are closed")].2
        };
        let (mut last, mut next) = (polygon[0].2, after(polygon[0].2));
        while next.number != first.number {
            take([first, last, next]);
            (last, next) = (next, after(next));
        }
    }
}

/// A check that the tests lean on, by the definition alone: the triangles of all three points whose circle holds no other,
/// and of those on it only the fan.
#[cfg(test)]
pub(super) fn by_definition(sites: &[Site]) -> Vec<[u32; 3]> {
    use super::circle::Circle;
    use crate::geom::orient2d;
    let mut all = Vec::new();
    for (i, &a) in sites.iter().enumerate() {
        for (j, &b) in sites.iter().enumerate().skip(i + 1) {
            for &c in &sites[j + 1..] {
                let turn = orient2d(a.at, b.at, c.at);
                let corners = match turn {
                    t if t > 0.0 => lowest_first([a, b, c]),
                    t if t < 0.0 => lowest_first([a, c, b]),
                    _ => continue,
                };
                let circle = Circle::new(corners);
                if !sites.iter().any(|&site| circle.forbids(site)) {
                    all.push(corners.map(|s| s.number));
                }
            }
        }
    }
    all.sort_unstable();
    all
}
