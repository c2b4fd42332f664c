//! Faces where the lines of pixels are not parallel: each candidate pixel's own line is tried.

use std::cmp::Ordering;

use glam::DVec3;

use super::build::SurfaceBuilder;
use super::{SurfaceFace, SurfaceTile};
use crate::frame::{LocalCentral, LocalCylinder};
use crate::geom::{FaceBlock, PixelRect};
use crate::raster::RayTriangle;

/// A place where a line meets a triangle.
struct Hit {
    /// Pixel of the tile.
    at: usize,
    elevation: f64,
    /// Whether the triangle's normal, by its winding, is on the viewer's side.
    is_front: bool,
}

/// What is shown of a line.
#[derive(Clone, Copy)]
struct Rule {
    slab: [f64; 2],
    /// Else the least.
    greatest_wins: bool,
}

impl SurfaceBuilder {
    pub(super) fn add_to_cylinder(&mut self, cylinder: &LocalCylinder, faces: &FaceBlock<'_>) {
        let mut around = std::mem::take(&mut self.around);
        around.clear();
        around.extend(faces.positions.iter().map(|&p| cylinder.around_axis(p)));
        let rect = self.tile.rect;
        let mut pixels = Vec::new();
        for (k, corners) in faces.triangles.iter().enumerate() {
            pixels.clear();
            let of = corners.map(|i| around[usize::from(i)]);
            cylinder.pixels_of(of, &rect, |part| pixels.push(part));
            let greatest = of.iter().fold(0.0, |d: f64, p| d.max(p.distance));
            for part in &pixels {
                self.try_lines(cylinder, faces, k, *part, greatest);
            }
        }
        self.around = around;
    }

    /// Tries the lines of a rectangle of pixels on triangle `k`, which reaches no farther from the axis than `greatest`.
    fn try_lines(
        &mut self,
        cylinder: &LocalCylinder,
        faces: &FaceBlock<'_>,
        k: usize,
        part: PixelRect,
        greatest: f64,
    ) {
        let rect = self.tile.rect;
        let inside = |v: i64, from: i64| usize::try_from(v - from).expect("inside the tile");
        let corners = faces.corners(k);
        let mut known = Sides::default();
        let rule = Rule { slab: cylinder.slab(), greatest_wins: true };
        for y in part.y0..part.y1 {
            let row = inside(y, rect.y0);
            let origin = self.block.cylinder().ray(0, row).origin;
            let triangle = RayTriangle::new(corners.map(|p| p - origin));
            for x in part.x0..part.x1 {
                let column = inside(x, rect.x0);
                let direction = self.block.cylinder().ray(column, row).direction;
                // On the other side of the axis lies another pixel's ground.
                let Some(t) = triangle.meet(direction).filter(|&t| t > 0.0) else { continue };
                let outward = triangle.normal().dot(direction) > 0.0;
                let hit = Hit {
                    at: row * rect.width() + column,
                    elevation: cylinder.elevation(t.min(greatest)) + 0.0,
                    is_front: outward != cylinder.shows_nearest(),
                };
                self.enter(rule, (faces, k), &hit, &mut known);
            }
        }
    }

    pub(super) fn add_to_central(&mut self, central: &LocalCentral, faces: &FaceBlock<'_>) {
        self.projected.clear();
        self.projected.extend(faces.positions.iter().map(|&p| central.camera_from_local(p)));
        let centre = central.centre();
        let rule = Rule { slab: central.slab(), greatest_wins: false };
        let mut pixels = Vec::new();
        for (k, corners) in faces.triangles.iter().enumerate() {
            pixels.clear();
            let of = corners.map(|i| self.projected[usize::from(i)]);
            self.block.central().pixels_of(of, |pixel| pixels.push(pixel));
            if pixels.is_empty() {
                continue;
            }
            let depths = of.map(|q| q.z);
            let near = depths[0].min(depths[1]).min(depths[2]);
            let far = depths[0].max(depths[1]).max(depths[2]);
            let triangle = RayTriangle::new(faces.corners(k).map(|p| p - centre));
            let mut known = Sides::default();
            for &at in &pixels {
                let direction = self.block.central().direction(at);
                let Some(t) = triangle.meet(direction) else { continue };
                let elevation = t.clamp(near, far);
                if elevation > 0.0 {
                    let is_front = triangle.normal().dot(direction) < 0.0;
                    let hit = Hit { at, elevation, is_front };
                    self.enter(rule, (faces, k), &hit, &mut known);
                }
            }
        }
    }

    /// Enters a triangle at a pixel if it wins there: the greatest elevation, or the least depth; ties go to the lowest
    /// id, ties of one id to the earlier triangle in the store.
    fn enter(
        &mut self,
        Rule { slab: [low, high], greatest_wins }: Rule,
        (faces, k): (&FaceBlock<'_>, usize),
        hit: &Hit,
        known: &mut Sides,
    ) {
        if hit.elevation < low || hit.elevation > high {
            return;
        }
        let tile = &self.tile;
        let wins = match tile.faces_at[hit.at] {
            SurfaceTile::NO_FACE => true,
            other => {
                let order = hit.elevation.total_cmp(&tile.elevations[hit.at]);
                match if greatest_wins { order } else { order.reverse() } {
                    Ordering::Greater => true,
                    Ordering::Equal => faces.ids[k] < tile.faces[other as usize].id,
                    Ordering::Less => false,
                }
            }
        };
        if !wins {
            return;
        }
        let known = &mut known.0[usize::from(hit.is_front)];
        let face = known.unwrap_or_else(|| self.keep_side(faces, k, hit.is_front));
        *known = Some(face);
        self.tile.elevations[hit.at] = hit.elevation;
        self.tile.faces_at[hit.at] = face;
    }

    /// Records one side of a triangle that won somewhere.
    fn keep_side(&mut self, faces: &FaceBlock<'_>, k: usize, is_front: bool) -> u32 {
        let [a, b, c] = faces.corners(k);
        let normal: DVec3 = (b - a).cross(c - a);
        let corners = self.keep_corners(faces, k);
        let face = u32::try_from(self.tile.faces.len()).expect("fewer than 2³² sides in one tile");
        let normal = if is_front { normal } else { -normal };
        self.tile.faces.push(SurfaceFace { corners, id: faces.ids[k], normal });
        face
    }
}

/// The index that each side of a triangle bears in the tile, back and front.
#[derive(Default)]
struct Sides([Option<u32>; 2]);
