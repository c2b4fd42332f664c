//! Building a [`SurfaceTile`] from a stream of face blocks.
//!
//! 1. Each vertex of a block is projected once, by a function of the vertex alone.
//! 2. Each triangle is scan-converted; at each centre its elevation is that of its plane, kept within its vertices'
//!    range; a centre outside the slab is not a candidate.
//! 3. The greatest elevation wins, ties go to the lowest id, ties of one id to the earlier triangle in the store.
//! 4. At the end the triangles that still show somewhere are kept, and the surface points are lifted.

use std::cmp::Ordering;

use glam::DVec3;

use super::{SurfaceFace, SurfaceTile};
use crate::frame::{AroundAxis, Block, LocalMosaic, LocalPlane, PixelRay};
use crate::geom::{FaceBlock, FaceId, HaloRect, PixelRect, held_bytes};
use crate::raster::{Triangle, scan};

/// Builds one tile after another, reusing its memory.
#[derive(Debug, Default)]
pub struct SurfaceBuilder {
    pub(super) tile: SurfaceTile,
    pub(super) block: Block,
    pub(super) projected: Vec<DVec3>,
    pub(super) around: Vec<AroundAxis>,
    kept: Vec<u32>,
}

impl SurfaceBuilder {
    /// Starts the tile of a rectangle, perhaps with pixels around it: no pixel has a surface.
    pub fn start(&mut self, mosaic: &LocalMosaic, area: impl Into<HaloRect>) {
        let HaloRect { inner, outer: rect } = area.into();
        self.block.set(mosaic, rect);
        let tile = &mut self.tile;
        (tile.rect, tile.inner) = (rect, inner);
        tile.elevations.clear();
        tile.elevations.resize(rect.area(), f64::NAN);
        tile.faces_at.clear();
        tile.faces_at.resize(rect.area(), SurfaceTile::NO_FACE);
        tile.points.clear();
        tile.lines.clear();
        tile.faces.clear();
        tile.vertices.clear();
    }

    /// The rectangle that was started, with what its pixels show.
    pub fn block(&self) -> &Block {
        &self.block
    }

    /// Adds the faces of one partition. Partitions must come in ascending order.
    pub fn add(&mut self, mosaic: &LocalMosaic, faces: &FaceBlock<'_>) {
        // Where a vertex of the block went in the tile.
        self.kept.clear();
        self.kept.resize(faces.positions.len(), u32::MAX);
        match mosaic {
            LocalMosaic::Plane(plane) => self.add_to_plane(plane, faces),
            LocalMosaic::Cylinder(cylinder) => self.add_to_cylinder(cylinder, faces),
            LocalMosaic::Central(central) => self.add_to_central(central, faces),
        }
    }

    fn add_to_plane(&mut self, mosaic: &LocalPlane, block: &FaceBlock<'_>) {
        self.projected.clear();
        self.projected.extend(block.positions.iter().map(|&p| mosaic.project(p)));
        let rect = self.tile.rect;
        for (k, corners) in block.triangles.iter().enumerate() {
            let corners = corners.map(|i| self.projected[usize::from(i)]);
            if !may_hold_centre(&rect, corners) {
                continue;
            }
            let (projected, turned) = in_order(corners);
            if let Some(triangle) = Triangle::new(projected.map(DVec3::truncate))
                && let Some(face) = self.show(mosaic, &triangle, projected, block.ids[k])
            {
                self.keep(block, k, face, triangle.flipped() != turned);
            }
        }
    }

    /// Enters one triangle where it wins; the index it bears in the tile, if it won anywhere.
    fn show(
        &mut self,
        mosaic: &LocalPlane,
        triangle: &Triangle,
        corners: [DVec3; 3],
        id: FaceId,
    ) -> Option<u32> {
        let heights = corners.map(|c| c.z);
        let (low, high) = (
            heights[0].min(heights[1]).min(heights[2]),
            heights[0].max(heights[1]).max(heights[2]),
        );
        let [slab_low, slab_high] = mosaic.slab();
        if high < slab_low || low > slab_high {
            return None;
        }
        let (second, third) = (heights[1] - heights[0], heights[2] - heights[0]);
        let SurfaceTile { rect, elevations, faces_at, faces, .. } = &mut self.tile;
        let face = u32::try_from(faces.len()).expect("fewer than 2³² triangles show in one tile");
        let mut shown = false;
        let (rect, stride) = (*rect, rect.x1 - rect.x0);
        scan(triangle, &rect, |x, y, [u, v]| {
            // `+ 0.0`: a negative zero is zero, so that equal elevations compare equal.
            let elevation = (heights[0] + (u * second + v * third)).clamp(low, high) + 0.0;
            if elevation < slab_low || elevation > slab_high {
                return;
            }
            let at =
                usize::try_from((y - rect.y0) * stride + x - rect.x0).expect("inside the tile");
            let wins = match faces_at[at] {
                SurfaceTile::NO_FACE => true,
                other => match elevation.total_cmp(&elevations[at]) {
                    Ordering::Greater => true,
                    Ordering::Equal => id < faces[other as usize].id,
                    Ordering::Less => false,
                },
            };
            if wins {
                elevations[at] = elevation;
                faces_at[at] = face;
                shown = true;
            }
        });
        shown.then_some(face)
    }

    /// Records a triangle that won somewhere.
    fn keep(&mut self, block: &FaceBlock<'_>, k: usize, face: u32, flipped: bool) {
        let corners = self.keep_corners(block, k);
        let [a, b, c] = block.corners(k);
        let normal = (b - a).cross(c - a);
        // In mosaic pixels rows run along −v: a positive turn on the screen is a normal away from the viewer.
        let normal = if flipped { normal } else { -normal };
        debug_assert_eq!(face as usize, self.tile.faces.len());
        self.tile.faces.push(SurfaceFace { corners, id: block.ids[k], normal });
    }

    /// The indices in the tile of a triangle's corners, new where they are not known yet.
    pub(super) fn keep_corners(&mut self, block: &FaceBlock<'_>, k: usize) -> [u32; 3] {
        let vertices = &mut self.tile.vertices;
        block.triangles[k].map(|i| {
            let slot = &mut self.kept[usize::from(i)];
            if *slot == u32::MAX {
                *slot = u32::try_from(vertices.len())
                    .expect("fewer than 2³² vertices show in one tile");
                vertices.push(block.positions[usize::from(i)]);
            }
            *slot
        })
    }

    /// Takes the surface away from the pixels of the tile for which `is_kept` says no; before [`Self::finish`].
    pub fn retain(&mut self, is_kept: impl Fn(usize) -> bool) {
        let SurfaceTile { elevations, faces_at, .. } = &mut self.tile;
        for (k, (elevation, face)) in elevations.iter_mut().zip(faces_at).enumerate() {
            if !is_kept(k) {
                (*elevation, *face) = (f64::NAN, SurfaceTile::NO_FACE);
            }
        }
    }

    /// Memory held, bytes.
    pub fn memory_bytes(&self) -> u64 {
        let tile = &self.tile;
        held_bytes(&tile.elevations)
            + held_bytes(&tile.faces_at)
            + tile.points.memory_bytes()
            + tile.lines.memory_bytes()
            + self.block.memory_bytes()
            + held_bytes(&tile.faces)
            + held_bytes(&tile.vertices)
            + held_bytes(&self.projected)
            + held_bytes(&self.around)
            + held_bytes(&self.kept)
    }

    /// The tile as it was last finished.
    pub fn tile(&self) -> &SurfaceTile {
        &self.tile
    }

    /// Ends the tile: drops triangles that show nowhere any more and lifts the surface points.
    pub fn finish(&mut self, mosaic: &LocalMosaic) -> &SurfaceTile {
        self.drop_hidden_faces();
        let tile = &mut self.tile;
        let width = tile.rect.width();
        if !matches!(mosaic, LocalMosaic::Plane(_)) {
            lift_lines(tile, &self.block, mosaic);
            return &self.tile;
        }
        for (row, elevations) in tile.elevations.chunks(width.max(1)).enumerate() {
            let y = tile.rect.y0 as f64 + (row as f64 + 0.5);
            for (column, &elevation) in elevations.iter().enumerate() {
                // An elevation that is not a number makes a point that is not.
                let x = tile.rect.x0 as f64 + (column as f64 + 0.5);
                tile.points.push(mosaic.lift(x, y, elevation));
            }
        }
        &self.tile
    }

    fn drop_hidden_faces(&mut self) {
        let tile = &mut self.tile;
        // New index of each face, then of each vertex; u32::MAX while it shows nowhere.
        self.kept.clear();
        self.kept.resize(tile.faces.len(), u32::MAX);
        for &face in tile.faces_at.iter().filter(|&&f| f != SurfaceTile::NO_FACE) {
            self.kept[face as usize] = 0;
        }
        renumber(&mut self.kept, &mut tile.faces);
        for face in tile.faces_at.iter_mut().filter(|f| **f != SurfaceTile::NO_FACE) {
            *face = self.kept[*face as usize];
        }
        self.kept.clear();
        self.kept.resize(tile.vertices.len(), u32::MAX);
        for vertex in tile.faces.iter().flat_map(|f| f.corners) {
            self.kept[vertex as usize] = 0;
        }
        renumber(&mut self.kept, &mut tile.vertices);
        for vertex in tile.faces.iter_mut().flat_map(|f| &mut f.corners) {
            *vertex = self.kept[*vertex as usize];
        }
    }
}

/// Lifts the points of a cylinder or a perspective view, and gives their lines.
fn lift_lines(tile: &mut SurfaceTile, block: &Block, mosaic: &LocalMosaic) {
    let width = tile.rect.width().max(1);
    for (k, &elevation) in tile.elevations.iter().enumerate() {
        let (ray, t, area) = match mosaic {
            LocalMosaic::Plane(_) => return,
            LocalMosaic::Cylinder(cylinder) => {
                let t = cylinder.distance(elevation);
                (block.cylinder().ray(k % width, k / width), t, cylinder.area_at(t))
            }
            LocalMosaic::Central(central) => {
                let (origin, direction) = (central.centre(), block.central().direction(k));
                let area = block.central().area_at(k, elevation);
                (PixelRay { origin, direction }, elevation, area)
            }
        };
        // An elevation that is not a number makes a point that is not.
        tile.points.push(ray.origin + ray.direction * t);
        tile.lines.push(ray.direction / area);
    }
}

/// Keeps the items whose mark is not `u32::MAX`, in order, and turns the marks into their new indices.
fn renumber<T: Copy>(marks: &mut [u32], items: &mut Vec<T>) {
    let mut next = 0_u32;
    for (k, mark) in marks.iter_mut().enumerate().filter(|(_, m)| **m != u32::MAX) {
        items[next as usize] = items[k];
        *mark = next;
        next += 1;
    }
    items.truncate(next as usize);
}

/// Whether a triangle's bounds hold the centre of a pixel of `rect`.
#[inline]
fn may_hold_centre(rect: &PixelRect, [a, b, c]: [DVec3; 3]) -> bool {
    // The first and last centre in the bounds, and those of the rectangle.
    let first = (a.min(b).min(c) - 0.5).ceil();
    let last = (a.max(b).max(c) - 0.5).floor();
    first.x <= last.x
        && first.y <= last.y
        && first.x < rect.x1 as f64
        && first.y < rect.y1 as f64
        && last.x >= rect.x0 as f64
        && last.y >= rect.y0 as f64
}

/// The corners in one order whatever the file's, and whether that turned the winding: faces with the same corners
/// then have the same elevations to the last bit, and the lowest id wins.
fn in_order(corners: [DVec3; 3]) -> ([DVec3; 3], bool) {
    let [mut a, mut b, mut c] = corners;
    let mut turned = false;
    for first in [true, false, true] {
        let (p, q) = if first { (&mut a, &mut b) } else { (&mut b, &mut c) };
        if p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(p.z.total_cmp(&q.z)).is_gt() {
            std::mem::swap(p, q);
            turned = !turned;
        }
    }
    ([a, b, c], turned)
}
