//! [`Refinement`]: a scene cut into a mesh of as many faces as wanted, streamed.
//!
//! In: a [`Scene`] and an edge length, or a number of faces. Out: vertices and faces one by one, in a fixed
//! order; nothing grows with the mesh but the counters. Each edge of the scene is cut into equal parts by its
//! own length alone, so that both patches at an edge have the same vertices there: no T-junctions, and a closed
//! surface stays closed. All vertices lie on the scene's patches, up to rounding.

use std::collections::BTreeMap;

use glam::DVec3;

use super::{Patch, Scene};
use crate::{Error, Result};

/// A mesh that refines a scene; see the module's page.
#[derive(Debug, Clone)]
pub struct Refinement<'a> {
    scene: &'a Scene,
    edges: Vec<Edge>,
    grids: Vec<Grid>,
    vertex_count: u64,
    face_count: u64,
}

/// An edge of the scene, its ends in ascending order.
#[derive(Debug, Clone, Copy)]
struct Edge {
    ends: [u32; 2],
    /// Parts into which it is cut; 0 if its ends are one vertex.
    parts: u32,
    /// Index of its first inner vertex in the mesh.
    first: u32,
}

/// The grid of `columns × rows` cells laid over a patch.
///
/// Its border is that of the patch's edges, which may have fewer parts than the grid: there, grid points are
/// moved to the nearest vertex of the edge, and triangles that vanish by it are left out.
#[derive(Debug, Clone, Copy)]
struct Grid {
    patch: Patch,
    columns: u32,
    rows: u32,
    /// Edges bottom, right, top, left, each with its index in `edges`.
    edges: [usize; 4],
    /// Index of the first inner vertex in the mesh.
    first: u32,
}

impl<'a> Refinement<'a> {
    /// The mesh whose edges are at most `edge_length_m` long where they lie on edges of the scene (elsewhere a
    /// little more, by a factor of at most √2 for rectangles).
    ///
    /// # Errors
    /// [`Error::Limit`] if the mesh would have 2³¹ vertices or faces, or more.
    pub fn by_edge_length(scene: &'a Scene, edge_length_m: f64) -> Result<Self> {
        let mut index = BTreeMap::new();
        let mut edges: Vec<Edge> = Vec::new();
        let mut grids = Vec::with_capacity(scene.patches().len());
        for &patch in scene.patches() {
            let [a, b, c, d] = patch.corners;
            // Directions are those of the grid: along columns, and along rows.
            let sides = [[a, b], [b, c], [d, c], [a, d]].map(|[p, q]| {
                *index.entry([p.min(q), p.max(q)]).or_insert_with_key(|&ends| {
                    edges.push(Edge { ends, parts: parts(scene, ends, edge_length_m), first: 0 });
                    edges.len() - 1
                })
            });
            let [bottom, right, top, left] = sides.map(|k| edges[k].parts);
            let (columns, rows) = (bottom.max(top), left.max(right));
            grids.push(Grid { patch, columns, rows, edges: sides, first: 0 });
        }
        let mut mesh = Self { scene, edges, grids, vertex_count: 0, face_count: 0 };
        mesh.number()?;
        Ok(mesh)
    }

    /// The coarsest mesh, by edge length, of `target` faces or a little more (or of the scene's own faces, if
    /// these are more).
    ///
    /// # Errors
    /// [`Error::Limit`] if the mesh would have 2³¹ vertices or faces, or more.
    pub fn by_face_count(scene: &'a Scene, target: u64) -> Result<Self> {
        let diagonal = scene.bounds().diagonal();
        let (mut fine, mut coarse) = (diagonal * 1e-5, diagonal);
        for _ in 0..40 {
            let middle = (fine * coarse).sqrt();
            match Self::by_edge_length(scene, middle) {
                Ok(mesh) if mesh.face_count < target => coarse = middle,
                Ok(_) | Err(Error::Limit { .. }) => fine = middle,
                Err(e) => return Err(e),
            }
        }
        Self::by_edge_length(scene, fine)
    }

    /// The scene.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> u64 {
        self.vertex_count
    }

    /// Number of faces.
    pub fn face_count(&self) -> u64 {
        self.face_count
    }

    /// All vertices in the ground frame: those of the scene, then those on its edges, then those within its
    /// patches in the order of the faces.
    pub fn vertices(&self) -> impl Iterator<Item = DVec3> + '_ {
        let corners = self.scene.vertices().iter().copied();
        let on_edges = self.edges.iter().flat_map(move |edge| {
            let [p, q] = edge.ends.map(|k| self.scene.vertices()[k as usize]);
            (1..edge.parts).map(move |k| p + (q - p) * (f64::from(k) / f64::from(edge.parts)))
        });
        let within = self.grids.iter().flat_map(move |grid| {
            let [a, b, c, d] = self.scene.corners(&grid.patch);
            let (along, up, twist) = (b - a, d - a, (a - b) + (c - d));
            (1..grid.rows).flat_map(move |j| {
                let t = f64::from(j) / f64::from(grid.rows);
                (1..grid.columns).map(move |i| {
                    let s = f64::from(i) / f64::from(grid.columns);
                    a + along * s + up * t + twist * (s * t)
                })
            })
        });
        corners.chain(on_edges).chain(within)
    }

    /// All faces, counter-clockwise as seen from outside, patch by patch and row by row, each with the ordinal of
    /// its patch. The face's id is its place in this order.
    pub fn faces(&self) -> impl Iterator<Item = ([u32; 3], u32)> + '_ {
        self.grids.iter().zip(0_u32..).flat_map(move |(grid, patch)| {
            (0..grid.rows).flat_map(move |j| {
                (0..grid.columns).flat_map(move |i| {
                    let [a, b] = [self.point(grid, i, j), self.point(grid, i + 1, j)];
                    let [d, c] = [self.point(grid, i, j + 1), self.point(grid, i + 1, j + 1)];
                    [[a, b, c], [a, c, d]]
                        .into_iter()
                        .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
                        .map(move |t| (t, patch))
                })
            })
        })
    }

    /// The faces' corners in the ground frame, each with the ordinal of its patch; holds all vertices in memory.
    pub fn triangles(&self) -> Vec<([DVec3; 3], u32)> {
        let vertices: Vec<DVec3> = self.vertices().collect();
        self.faces().map(|(t, patch)| (t.map(|k| vertices[k as usize]), patch)).collect()
    }

    /// Gives every vertex its index and counts.
    fn number(&mut self) -> Result<()> {
        let mut next = self.scene.vertices().len() as u64;
        let mut faces = 0;
        for edge in &mut self.edges {
            edge.first = index(next)?;
            next += u64::from(edge.parts.saturating_sub(1));
        }
        for grid in &mut self.grids {
            grid.first = index(next)?;
            let (columns, rows) = (u64::from(grid.columns), u64::from(grid.rows));
            let inner = columns.saturating_sub(1) * rows.saturating_sub(1);
            next += inner;
            // Euler's formula for a triangulated disc: F = 2 · inner + border − 2.
            let border: u64 = grid.edges.iter().map(|&k| u64::from(self.edges[k].parts)).sum();
            faces += 2 * inner + border - 2;
        }
        index(next)?;
        index(faces)?;
        (self.vertex_count, self.face_count) = (next, faces);
        Ok(())
    }

    /// The mesh vertex at grid point `(i, j)` of a patch.
    fn point(&self, grid: &Grid, i: u32, j: u32) -> u32 {
        let [a, _, _, d] = grid.patch.corners;
        let b = grid.patch.corners[1];
        if j == 0 {
            self.on_edge(grid.edges[0], a, [i, grid.columns])
        } else if j == grid.rows {
            self.on_edge(grid.edges[2], d, [i, grid.columns])
        } else if i == 0 {
            self.on_edge(grid.edges[3], a, [j, grid.rows])
        } else if i == grid.columns {
            self.on_edge(grid.edges[1], b, [j, grid.rows])
        } else {
            grid.first + (j - 1) * (grid.columns - 1) + i - 1
        }
    }

    /// The vertex of an edge that is nearest to the share `k / count` of it, counted from the end `from`; in the
    /// middle between two, the one nearer to that end.
    fn on_edge(&self, edge: usize, from: u32, [k, count]: [u32; 2]) -> u32 {
        let Edge { ends: [low, high], parts, first } = self.edges[edge];
        let step = if parts == count { k } else { nearest(k, count, parts) };
        let (near, far) = if from == low { (low, high) } else { (high, low) };
        if step == 0 {
            near
        } else if step == parts {
            far
        } else if from == low {
            first + step - 1
        } else {
            first + parts - step - 1
        }
    }
}

/// Parts into which an edge is cut.
fn parts(scene: &Scene, [p, q]: [u32; 2], edge_length_m: f64) -> u32 {
    if p == q {
        return 0;
    }
    let length = scene.vertices()[p as usize].distance(scene.vertices()[q as usize]);
    // The millionth keeps equal lengths equal despite rounding; the cap is beyond what `number` lets pass.
    let count = (length / edge_length_m - 1e-6).ceil().clamp(1.0, f64::from(1 << 30));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 2^30")]
    let count = count as u32;
    count
}

/// `k · parts / count` rounded to the nearest, halves down.
fn nearest(k: u32, count: u32, parts: u32) -> u32 {
    let [k, count, parts] = [k, count, parts].map(u64::from);
    u32::try_from((2 * k * parts + count - 1) / (2 * count)).expect("k ≤ count, so at most parts")
}

/// A mesh index within the limit of 31 bits.
fn index(value: u64) -> Result<u32> {
    let limit = (1 << 31) - 1;
    u32::try_from(value).ok().filter(|&v| u64::from(v) <= limit).ok_or(Error::Limit {
        what: "a refined scene's vertices or faces".into(),
        limit,
        found: value,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{Figure, Opening, Part, Placement, SceneBuilder, Texture};

    fn scene() -> Scene {
        let mut b = SceneBuilder::new();
        let openings = [
            Opening { x: [0.5, 1.7], sill: 0.4, segments: 7 },
            Opening { x: [2.2, 2.9], sill: 0.0, segments: 5 },
        ];
        let (wall, _) = Figure::arched_wall([0.0, 4.0], [0.0, 3.1], 1.5, &openings);
        b.prism(&wall, -0.3, 0.1, Part::Arcade);
        b.lathe([2.0, 1.0], &[(0.0, 0.0), (0.2, 0.0), (0.15, 1.3), (0.0, 1.3)], 24, Part::Shaft);
        b.cuboid(DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.011, 3.0, 2.3), Part::Plinth);
        b.build(Placement::IDENTITY, Texture::new(0.02))
    }

    #[test]
    fn a_closed_scene_stays_closed_at_any_edge_length() {
        let scene = scene();
        for length in [9.0, 0.5, 0.21, 0.1, 0.037] {
            let mesh = Refinement::by_edge_length(&scene, length).unwrap();
            let mut edges = BTreeMap::new();
            for ([a, b, c], _) in mesh.faces() {
                for e in [[a, b], [b, c], [c, a]] {
                    *edges.entry(e).or_insert(0) += 1;
                }
            }
            for (&[a, b], &n) in &edges {
                assert_eq!(n, 1, "edge {a} {b} at {length}");
                assert_eq!(edges.get(&[b, a]), Some(&1), "edge {a} {b} at {length}");
            }
        }
    }

    #[test]
    fn faces_fill_each_patch_exactly_once_in_its_plane() {
        let scene = scene();
        for length in [0.5, 0.1, 0.037] {
            let mesh = Refinement::by_edge_length(&scene, length).unwrap();
            let normal = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]);
            let mut whole = vec![DVec3::ZERO; scene.patches().len()];
            for (t, k) in scene.triangles() {
                whole[k as usize] += normal(&t);
            }
            let mut sum = vec![0.0; whole.len()];
            for (t, k) in mesh.triangles() {
                let k = k as usize;
                let unit = whole[k].normalize();
                // No face is turned over, and none leaves the plane: its area counts in full.
                let along = normal(&t).dot(unit);
                assert!(along > 0.0 && (normal(&t).length() - along).abs() < 1e-14, "{t:?}");
                sum[k] += along;
            }
            for (s, w) in sum.iter().zip(&whole) {
                assert!((s / w.length() - 1.0).abs() < 1e-9, "{s} {w}");
            }
        }
    }

    #[test]
    fn the_counts_are_those_of_the_streams_and_every_vertex_is_used() {
        let scene = scene();
        for length in [9.0, 0.3, 0.05] {
            let mesh = Refinement::by_edge_length(&scene, length).unwrap();
            assert_eq!(mesh.vertices().count() as u64, mesh.vertex_count());
            assert_eq!(mesh.faces().count() as u64, mesh.face_count());
            let mut used = vec![false; usize::try_from(mesh.vertex_count()).unwrap()];
            mesh.faces().flat_map(|(t, _)| t).for_each(|k| used[k as usize] = true);
            assert!(used.iter().all(|&u| u));
        }
    }

    #[test]
    fn a_wanted_number_of_faces_is_met_from_above_and_nearly() {
        let scene = scene();
        for target in [5_000, 100_000] {
            let found = Refinement::by_face_count(&scene, target).unwrap().face_count();
            assert!((target..target + target / 10).contains(&found), "{found} for {target}");
        }
    }

    #[test]
    fn a_mesh_beyond_31_bits_is_refused() {
        let scene = scene();
        let refused = Refinement::by_edge_length(&scene, 1e-5);
        assert!(matches!(refused, Err(Error::Limit { .. })));
    }
}
