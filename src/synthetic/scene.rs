//! [`Scene`]: an exact polyhedron with an analytic texture, and the builder of such.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::{Part, Placement, Texture};
use crate::geom::Bounds3;

/// A planar convex quadrilateral of a scene, counter-clockwise as seen from outside.
///
/// One of its edges may have length 0 (both corners are then the same vertex): a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patch {
    /// Indices into [`Scene::vertices`].
    pub corners: [u32; 4],
    /// What it is part of.
    pub part: Part,
}

/// A polyhedron of planar patches, exact in f64, with an analytic texture.
///
/// Patches that share an edge share its two vertices, so that no vertex lies within another patch's edge
/// wherever the builder was given none.
#[derive(Debug, Clone)]
pub struct Scene {
    vertices: Vec<DVec3>,
    patches: Vec<Patch>,
    placement: Placement,
    texture: Texture,
}

impl Scene {
    /// Vertices in the ground frame, metres.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices
    }

    /// The patches.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// Where the scene stands in the ground frame.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// The texture, in scene coordinates.
    pub fn texture(&self) -> &Texture {
        &self.texture
    }

    /// The four corners of a patch in the ground frame.
    pub fn corners(&self, patch: &Patch) -> [DVec3; 4] {
        patch.corners.map(|k| self.vertices[k as usize])
    }

    /// Bounds of all vertices, ground frame.
    pub fn bounds(&self) -> Bounds3 {
        Bounds3::of(self.vertices.iter().copied())
    }

    /// Colour (red, green, blue; 0 to 1) of a ground point on a face of `part`.
    pub fn colour(&self, ground: DVec3, part: Part) -> [f64; 3] {
        self.texture.colour(self.placement.scene_from_ground(ground), part)
    }

    /// The patches as triangles with the ordinal of their patch: one or two a patch.
    pub fn triangles(&self) -> impl Iterator<Item = ([DVec3; 3], u32)> + '_ {
        self.patches.iter().zip(0_u32..).flat_map(move |(patch, k)| {
            let [a, b, c, d] = patch.corners;
            [[a, b, c], [a, c, d]]
                .into_iter()
                .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
                .map(move |t| (t.map(|i| self.vertices[i as usize]), k))
        })
    }
}

/// Collects the patches of a [`Scene`] in scene coordinates; equal points become one vertex.
#[derive(Debug, Default)]
pub struct SceneBuilder {
    index: BTreeMap<[u64; 3], u32>,
    points: Vec<DVec3>,
    patches: Vec<Patch>,
    offset: DVec3,
}

impl SceneBuilder {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// From now on, what is added is moved by `offset` from where it was given; metres.
    pub fn moved_by(&mut self, offset: DVec3) {
        self.offset = offset;
    }

    /// Adds a planar convex quadrilateral, counter-clockwise as seen from outside.
    ///
    /// Two neighbouring corners may be equal: a triangle. Less than a triangle is left out.
    pub fn quad(&mut self, corners: [DVec3; 4], part: Part) {
        let corners = corners.map(|p| self.vertex(p));
        let distinct = (0..4).filter(|&k| corners[k] != corners[(k + 1) % 4]).count();
        if distinct >= 3 && corners[0] != corners[2] && corners[1] != corners[3] {
            self.patches.push(Patch { corners, part });
        }
    }

    /// Adds a plane figure at height `z` over the scene's x–y plane, facing the viewer.
    pub fn sheet(&mut self, figure: &Figure, z: f64, part: Part) {
        for cell in &figure.cells {
            self.quad(cell.map(|p| p.extend(z)), part);
        }
    }

    /// Adds a plane figure at height `z`, facing away from the viewer.
    pub fn sheet_behind(&mut self, figure: &Figure, z: f64, part: Part) {
        for &[a, b, c, d] in &figure.cells {
            self.quad([d, c, b, a].map(|p| p.extend(z)), part);
        }
    }

    /// Adds the walls over the outline of a figure, from height `back` to `front`, facing outwards of it; facing
    /// inwards where `back > front`.
    pub fn walls(&mut self, figure: &Figure, back: f64, front: f64, part: Part) {
        for [a, b] in figure.outline() {
            self.quad([a.extend(back), b.extend(back), b.extend(front), a.extend(front)], part);
        }
    }

    /// Adds the closed prism over a figure, from height `back` to `front`.
    pub fn prism(&mut self, figure: &Figure, back: f64, front: f64, part: Part) {
        self.sheet(figure, front, part);
        self.sheet_behind(figure, back, part);
        self.walls(figure, back, front, part);
    }

    /// Adds a closed box between two corners.
    pub fn cuboid(&mut self, min: DVec3, max: DVec3, part: Part) {
        self.prism(&Figure::rectangle(min.truncate(), max.truncate()), min.z, max.z, part);
    }

    /// Adds a solid of revolution about an upright axis at `(x, z)`, as a polyhedron of `sides` facets.
    ///
    /// `profile` is a list of (radius, y) from bottom to top; a radius of 0 at either end closes it.
    pub fn lathe(&mut self, [x, z]: [f64; 2], profile: &[(f64, f64)], sides: u32, part: Part) {
        let ring = |radius: f64, y: f64, k: u32| {
            // Half a facet of turn: no facet is seen edge-on from the front, and none is parallel to it.
            let angle = std::f64::consts::TAU * (f64::from(k % sides) + 0.3) / f64::from(sides);
            DVec3::new(x + radius * libm::sin(angle), y, z + radius * libm::cos(angle))
        };
        for pair in profile.windows(2) {
            let ((r0, y0), (r1, y1)) = (pair[0], pair[1]);
            for k in 0..sides {
                let at = |r, y, k| ring(r, y, k);
                self.quad(
                    [at(r0, y0, k), at(r0, y0, k + 1), at(r1, y1, k + 1), at(r1, y1, k)],
                    part,
                );
            }
        }
    }

    /// The scene, placed in the ground frame.
    pub fn build(self, placement: Placement, texture: Texture) -> Scene {
        let vertices = self.points.iter().map(|&p| placement.ground_from_scene(p)).collect();
        Scene { vertices, patches: self.patches, placement, texture }
    }

    fn vertex(&mut self, p: DVec3) -> u32 {
        let p = p + self.offset;
        // + 0.0 makes one zero of the two.
        let key = (p + 0.0).to_array().map(f64::to_bits);
        let points = &mut self.points;
        *self.index.entry(key).or_insert_with(|| {
            points.push(p);
            u32::try_from(points.len() - 1).expect("a scene has few vertices")
        })
    }
}

/// A plane figure made of convex quadrilateral cells that meet edge to edge, counter-clockwise (x right, y up).
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// The cells; a cell may have one edge of length 0.
    pub cells: Vec<[DVec2; 4]>,
}

/// A round-arched opening in a wall: a rectangle from `sill` to the springing, and half a polygon over it.
#[derive(Debug, Clone, Copy)]
pub struct Opening {
    /// Left and right jamb.
    pub x: [f64; 2],
    /// Lower end; at or above the wall's foot.
    pub sill: f64,
    /// Straight pieces of the arch, at least 2.
    pub segments: u32,
}

impl Figure {
    /// A rectangle of one cell.
    pub fn rectangle(min: DVec2, max: DVec2) -> Self {
        Self { cells: vec![[min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)]] }
    }

    /// A wall `x[0]..x[1]` × `y[0]..y[1]` with arched openings whose arches all spring at `spring`; openings are
    /// given from left to right and do not touch. Returns the wall, and one figure for each opening.
    ///
    /// All cells meet edge to edge: every strip of the wall is cut at every sill and at the springing.
    pub fn arched_wall(
        x: [f64; 2],
        y: [f64; 2],
        spring: f64,
        openings: &[Opening],
    ) -> (Self, Vec<Self>) {
        let mut rows: Vec<f64> =
            [y[0], spring].into_iter().chain(openings.iter().map(|o| o.sill)).collect();
        rows.sort_by(f64::total_cmp);
        rows.dedup();
        let mut wall = Self::default();
        let mut left = x[0];
        let mut holes = Vec::with_capacity(openings.len());
        for opening in openings {
            wall.strip([left, opening.x[0]], &rows);
            wall.cells.push(cell([left, opening.x[0]], [spring; 2], [y[1]; 2]));
            let mut hole = Self::default();
            for (x, arch) in opening.strips(spring) {
                for pair in rows.windows(2) {
                    let target = if pair[0] < opening.sill { &mut wall } else { &mut hole };
                    target.cells.push(cell(x, [pair[0]; 2], [pair[1]; 2]));
                }
                hole.cells.push(cell(x, [spring; 2], arch));
                wall.cells.push(cell(x, arch, [y[1]; 2]));
            }
            holes.push(hole);
            left = opening.x[1];
        }
        wall.strip([left, x[1]], &rows);
        wall.cells.push(cell([left, x[1]], [spring; 2], [y[1]; 2]));
        (wall, holes)
    }

    /// The directed edges that only one cell has, in the cells' order: the figure lies to their left.
    pub fn outline(&self) -> Vec<[DVec2; 2]> {
        let key = |p: DVec2| (p + 0.0).to_array().map(f64::to_bits);
        let mut seen = std::collections::BTreeSet::new();
        let edges = || self.cells.iter().flat_map(|c| (0..4).map(move |k| [c[k], c[(k + 1) % 4]]));
        for [a, b] in edges() {
            seen.insert([key(a), key(b)]);
        }
        edges().filter(|[a, b]| a != b && !seen.contains(&[key(*b), key(*a)])).collect()
    }

    /// Adds the cells of one vertical strip between the given rows.
    fn strip(&mut self, x: [f64; 2], rows: &[f64]) {
        for pair in rows.windows(2) {
            self.cells.push(cell(x, [pair[0]; 2], [pair[1]; 2]));
        }
    }
}

impl Opening {
    /// The vertical strips of the opening, and the height of the arch at both sides of each.
    fn strips(self, spring: f64) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
        let radius = 0.5 * (self.x[1] - self.x[0]);
        let at = move |k: u32| {
            if k == 0 {
                return (self.x[0], spring);
            }
            if k == self.segments {
                return (self.x[1], spring);
            }
            let angle = std::f64::consts::PI * f64::from(k) / f64::from(self.segments);
            (self.x[0] + radius * (1.0 - libm::cos(angle)), spring + radius * libm::sin(angle))
        };
        (0..self.segments).map(move |k| {
            let ((x0, y0), (x1, y1)) = (at(k), at(k + 1));
            ([x0, x1], [y0, y1])
        })
    }
}

/// A trapezoid with upright sides: `low` and `high` are the heights at its left and right.
fn cell(x: [f64; 2], low: [f64; 2], high: [f64; 2]) -> [DVec2; 4] {
    [
        DVec2::new(x[0], low[0]),
        DVec2::new(x[1], low[1]),
        DVec2::new(x[1], high[1]),
        DVec2::new(x[0], high[0]),
    ]
}
