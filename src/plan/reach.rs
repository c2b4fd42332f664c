//! [`Reach`]: which parts of a mosaic a photo may touch.

use std::f64::consts::TAU;

use super::Partitions;
use super::needs::{Hull, View};
use crate::camera::Photo;
use crate::frame::{Mosaic, MosaicFrame};
use crate::geom::PixelRect;

/// Pixels added around what a box shows: room for rounding.
const MARGIN_PX: f64 = 2.0;

/// The squares of a mosaic that some photos may touch: the pixels of all others are the same without them, or with
/// others in their place.
#[derive(Debug, Clone)]
pub struct Reach {
    side: i64,
    columns: usize,
    touched: Vec<bool>,
}

impl Reach {
    /// Finds the squares, `side` pixels wide, of `mosaic` that `photos` may touch.
    ///
    /// The pixels that the box of a partition may show belong to a photo unless it is proven that no point of the box lies
    /// in its picture. What hides what is not looked at.
    pub fn of(mesh: &impl Partitions, mosaic: &Mosaic, side: u32, photos: &[Photo]) -> Self {
        let columns = mosaic.size.width.div_ceil(side) as usize;
        let rows = mosaic.size.height.div_ceil(side) as usize;
        let mut reach = Self { side: side.into(), columns, touched: vec![false; columns * rows] };
        let views: Vec<_> = photos.iter().map(|p| View::new(p, mesh.origin())).collect();
        let local = mosaic.local(mesh.origin());
        // A development repeats itself after a turn.
        let turn = match &mosaic.frame {
            MosaicFrame::Cylinder(cylinder) => TAU * cylinder.radius / mosaic.pixel_size,
            MosaicFrame::Plane(_) | MosaicFrame::Perspective(_) => 0.0,
        };
        for partition in 0..mesh.count() {
            let bounds = mesh.bounds(partition);
            let hull = Hull { corners: bounds.corners() };
            if bounds.is_empty() || views.iter().all(|view| view.rays(&hull).is_none()) {
                continue;
            }
            let Some(range) = local.box_range(&bounds) else { continue };
            for shift in [-turn, 0.0, turn] {
                let columns = [range.min.x + shift, range.max.x + shift];
                reach.touch(columns, [range.min.y, range.max.y]);
                if turn == 0.0 {
                    break;
                }
            }
        }
        reach
    }

    /// Whether the photos may touch a pixel of `rect`.
    pub fn meets(&self, rect: &PixelRect) -> bool {
        let cell = |at: i64| usize::try_from(at / self.side).unwrap_or(0);
        let rows = self.touched.len() / self.columns.max(1);
        !rect.is_empty()
            && (cell(rect.y0)..=cell(rect.y1 - 1).min(rows - 1)).any(|row| {
                let first = row * self.columns;
                let last = first + cell(rect.x1 - 1).min(self.columns - 1);
                self.touched[first + cell(rect.x0)..=last].contains(&true)
            })
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the squares"
    )]
    fn touch(&mut self, x: [f64; 2], y: [f64; 2]) {
        let rows = self.touched.len() / self.columns;
        let cells = |[from, to]: [f64; 2], count: usize| {
            let side = self.side as f64;
            let (from, to) =
                (((from - MARGIN_PX) / side).floor(), ((to + MARGIN_PX) / side).floor());
            // Not a number: all of them.
            let outside = to < 0.0 || from >= count as f64;
            let last = count as f64 - 1.0;
            let (from, to) = (from.max(0.0).min(last), to.min(last).max(0.0));
            (!outside).then(|| from as usize..=if to.is_nan() { count - 1 } else { to as usize })
        };
        let (Some(across), Some(down)) = (cells(x, self.columns), cells(y, rows)) else { return };
        for row in down {
            let first = row * self.columns;
            self.touched[first + across.start()..=first + across.end()].fill(true);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::partitions::soup::Soup;
    use super::super::photo_needs;
    use super::*;
    use crate::camera::{Lens, LensModel, PhotoId, Pose};
    use crate::frame::{Cylinder, Facing, Plane};
    use crate::geom::Size;

    /// Straight down on (x, y, 0) from 10 m: 20 m × 10 m of ground.
    fn nadir(x: f64, y: f64) -> Photo {
        let lens =
            Lens::new(LensModel::SimplePinhole, Size::new(2000, 1000), &[1000.0, 1000.0, 500.0]);
        let mut pose = Pose::from_colmap([0.0, 1.0, 0.0, 0.0], DVec3::ZERO).unwrap();
        pose.centre_ground = DVec3::new(x, y, 10.0);
        Photo { id: PhotoId(0), name: "a.jpg".into(), lens: lens.unwrap(), pose }
    }

    /// Rolling ground, 100 m × 100 m.
    fn ground() -> Soup {
        let p = |i: i32, j: i32| {
            let (x, y) = (f64::from(i), f64::from(j));
            DVec3::new(x, y, (x * 0.3).sin() + (y * 0.2).cos())
        };
        let cells = (-50..50).flat_map(|i| (-50..50).map(move |j| (i, j)));
        let faces: Vec<_> = cells
            .flat_map(|(i, j)| {
                [[p(i, j), p(i + 1, j), p(i + 1, j + 1)], [p(i, j), p(i + 1, j + 1), p(i, j + 1)]]
            })
            .collect();
        Soup::new(DVec3::ZERO, &faces, 2)
    }

    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    fn check(mosaic: &Mosaic, photo: Photo) -> usize {
        let (mesh, side) = (ground(), 64);
        let photos = [photo];
        let reach = Reach::of(&mesh, mosaic, side, &photos);
        let mut touched = 0;
        for tile in mosaic.size.rect().blocks(side.into()) {
            // The estimate of needs looks at the same boxes, cut: what it needs is reached.
            let needed = photo_needs(&mesh, mosaic, &tile, &photos)[0].is_some();
            assert!(reach.meets(&tile) || !needed, "{tile:?}");
            touched += usize::from(reach.meets(&tile));
        }
        touched
    }

    #[test]
    fn squares_that_a_photo_may_show_are_reached_and_most_others_are_not() {
        let mosaic = Mosaic::new(Plane::top(), 0.05, [-50.0, -50.0, 50.0, 50.0], ALL).unwrap();
        let all = mosaic.size.rect().blocks(64).count();
        let touched = check(&mosaic, nadir(13.0, -7.0));
        // A fiftieth of the ground, and what stands at its borders.
        assert!(touched * 50 > all && touched * 20 < all, "{touched} of {all}");
        assert_eq!(check(&mosaic, nadir(300.0, 0.0)), 0);
    }

    #[test]
    fn a_development_is_reached_on_both_sides_of_its_seam() {
        let cylinder = Cylinder {
            origin: DVec3::new(0.0, 0.0, -5.0),
            axis: DVec3::Z,
            zero: DVec3::X,
            radius: 20.0,
            facing: Facing::Inside,
            pixel_size: None,
            extent: None,
            elevation: None,
        };
        let half = TAU * 20.0 / 2.0;
        for from in [-half, -0.5 * half, -1.9 * half] {
            let extent = [from, 0.0, from + 2.0 * half, 10.0];
            let mosaic = Mosaic::new(cylinder.clone(), 0.05, extent, ALL).unwrap();
            // Over the seam of the first.
            let touched = check(&mosaic, nadir(-20.0, 0.0));
            assert!(touched > 0);
        }
    }
}
