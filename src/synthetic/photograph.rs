//! Takes photographs of a scene: rays through an exact lens.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::caster::{CastHit, Caster};
use crate::camera::Photo;
use crate::image::Image;

/// Colour where a photo's ray meets nothing, 0 to 1.
pub const SKY: [f64; 3] = [0.62, 0.74, 0.90];

/// Points this near a plane lie in it, metres: above the rounding of ground coordinates, below any relief.
const PLANE_M: f64 = 1e-7;

/// How the rays of a photo's pixels are set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampling {
    /// A grid of n × n rays in each pixel, their mean: a box over the pixel.
    Box(u32),
    /// One ray through the centre where the pixel and its eight neighbours show one plane of one part, a box of
    /// n × n rays elsewhere: with a texture that a pixel resolves, several times faster, and smooth edges all the
    /// same. A thing that lies between all centres is missed.
    Edges(u32),
}

/// A sample of a photo: 8 or 16 bits.
pub trait Depth: Copy + Send + Default {
    /// The sample of a value in 0 to 1, rounded half up.
    fn of_unit(value: f64) -> Self;
}

impl Depth for u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    fn of_unit(value: f64) -> Self {
        (value.clamp(0.0, 1.0) * 255.0 + 0.5).floor() as Self
    }
}

impl Depth for u16 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 65535")]
    fn of_unit(value: f64) -> Self {
        (value.clamp(0.0, 1.0) * 65_535.0 + 0.5).floor() as Self
    }
}

/// A photograph of `caster`'s scene, `height × width × channels`: 3 channels for red, green and blue, 1 for grey.
///
/// Each ray goes through the lens exactly, distortion included; [`SKY`] where it meets nothing, black where the
/// lens shows no ray. The same picture for any number of threads.
pub fn photograph<T: Depth>(
    caster: &Caster,
    photo: &Photo,
    sampling: Sampling,
    channels: usize,
) -> Image<T> {
    let size = photo.lens.size();
    let mut image = Image::filled(size, channels, T::default());
    let stride = size.width as usize * channels;
    let eye = Eye { caster, photo };
    let bands = image.data_mut().par_chunks_mut(stride * BAND as usize).zip(0_u32..size.height);
    bands.for_each(|(out, k)| {
        let band = Band::new(&eye, k * BAND, sampling);
        for (line, row) in out.chunks_exact_mut(stride).zip(0_u32..) {
            for (pixel, x) in line.chunks_exact_mut(channels).zip(0_u32..) {
                write(pixel, band.colour(x, row));
            }
        }
    });
    image
}

/// Writes a colour into the channels of a pixel; grey by the weights of ITU-R BT.601.
pub(super) fn write<T: Depth>(pixel: &mut [T], rgb: [f64; 3]) {
    if let [grey] = pixel {
        *grey = T::of_unit(0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2]);
        return;
    }
    for (sample, c) in pixel.iter_mut().zip(rgb) {
        *sample = T::of_unit(c);
    }
}

/// What looks: a photo at a scene.
#[derive(Debug, Clone, Copy)]
struct Eye<'a> {
    caster: &'a Caster,
    photo: &'a Photo,
}

/// What a ray of a photo shows.
#[derive(Debug, Clone, Copy)]
enum Shown {
    /// The lens shows no ray here.
    Nothing,
    /// No face.
    Sky,
    /// A point of a face.
    Face(CastHit),
}

impl Eye<'_> {
    fn look(&self, position: DVec2, near: Option<&CastHit>) -> Shown {
        let Some(ray) = self.photo.lens.ray_from_photo(position) else {
            return Shown::Nothing;
        };
        let pose = &self.photo.pose;
        let along = pose.rotation.transpose() * DVec3::new(ray.x, ray.y, 1.0);
        match self.caster.cast(pose.centre_ground, along, near) {
            Some(hit) => Shown::Face(hit),
            None => Shown::Sky,
        }
    }

    fn colour(&self, shown: &Shown) -> [f64; 3] {
        match shown {
            Shown::Nothing => [0.0; 3],
            Shown::Sky => SKY,
            Shown::Face(hit) => self.caster.colour(hit),
        }
    }
}

/// Rows that are made together, so that most centres are looked at once.
const BAND: u32 = 16;

/// A band of rows, with what the centres in and around it show.
struct Band<'a> {
    eye: &'a Eye<'a>,
    y0: u32,
    side: u32,
    /// The row above the band, its rows and the one below, each with a pixel more on both sides; none for a plain box.
    centres: Vec<Vec<Shown>>,
}

impl<'a> Band<'a> {
    fn new(eye: &'a Eye<'a>, y0: u32, sampling: Sampling) -> Self {
        let (side, centres) = match sampling {
            Sampling::Box(side) => (side, Vec::new()),
            Sampling::Edges(side) => {
                let last = (y0 + BAND).min(eye.photo.lens.size().height);
                let rows = (0..last - y0 + 2).map(|j| centres(eye, f64::from(y0 + j) - 0.5));
                (side, rows.collect())
            }
        };
        Self { eye, y0, side: side.max(1), centres }
    }

    /// The colour of the pixel in column `x` of the band's row `row`.
    fn colour(&self, x: u32, row: u32) -> [f64; 3] {
        let y = self.y0 + row;
        if self.centres.is_empty() {
            return self.mean([x, y], None);
        }
        let (column, rows) = (x as usize + 1, &self.centres[row as usize..row as usize + 3]);
        let centre = &rows[1][column];
        let around = || rows.iter().flat_map(|row| &row[column - 1..=column + 1]);
        match centre {
            Shown::Face(hit) => {
                let same = |s: &Shown| matches!(s, Shown::Face(h) if hit.continues(h, PLANE_M));
                let smooth = around().all(same);
                if smooth { self.eye.colour(centre) } else { self.mean([x, y], Some(hit)) }
            }
            Shown::Sky if around().all(|s| matches!(s, Shown::Sky)) => SKY,
            _ => self.mean([x, y], None),
        }
    }

    /// The mean over a grid of rays in the pixel.
    fn mean(&self, [x, y]: [u32; 2], near: Option<&CastHit>) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let step = 1.0 / f64::from(self.side);
        let mut near = near.copied();
        for j in 0..self.side {
            for i in 0..self.side {
                let offset = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) * step;
                let at = DVec2::new(f64::from(x), f64::from(y)) + offset;
                let shown = self.eye.look(at, near.as_ref());
                for (s, c) in sum.iter_mut().zip(self.eye.colour(&shown)) {
                    *s += c;
                }
                if let Shown::Face(hit) = shown {
                    near = Some(hit);
                }
            }
        }
        sum.map(|s| s * step * step)
    }
}

/// What the centres of a row show, from one pixel left of the frame to one right of it.
fn centres(eye: &Eye<'_>, y: f64) -> Vec<Shown> {
    let width = eye.photo.lens.size().width;
    let mut near = None;
    (0..width + 2)
        .map(|k| {
            let shown = eye.look(DVec2::new(f64::from(k) - 0.5, y), near.as_ref());
            if let Shown::Face(hit) = shown {
                near = Some(hit);
            }
            shown
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{LensModel, PhotoId};
    use crate::geom::Size;
    use crate::synthetic::{CameraSpec, Part, Placement, SceneBuilder, Shot, Texture};

    /// A wall with a pillar before it, and a strongly distorted photo of it.
    fn eye(size: Size) -> (Caster, Photo) {
        let mut b = SceneBuilder::new();
        b.cuboid(DVec3::new(-2.0, -2.0, -1.2), DVec3::new(2.0, 2.0, -1.0), Part::Wall);
        b.lathe([0.3, 0.0], &[(0.2, -2.0), (0.2, 2.0)], 24, Part::Shaft);
        let placement = Placement::upright(DVec3::new(10.0, 20.0, 30.0), 0.4);
        let scene = b.build(placement, Texture::new(0.08));
        let (w, h) = (f64::from(size.width), f64::from(size.height));
        let params = vec![w * 1.1, w * 1.12, w * 0.52, h * 0.47, -0.2, 0.05, 0.003, -0.002];
        let camera = CameraSpec { model: LensModel::OpenCv, size, params };
        let ends = [DVec3::new(0.4, -0.3, 4.0), DVec3::new(0.0, 0.1, -1.0)];
        let shot = Shot::towards("a", &camera, &placement, ends, 0.05);
        (Caster::of_scene(&scene), shot.photo(PhotoId(0)).unwrap())
    }

    #[test]
    fn a_pixel_shows_the_colour_of_the_point_that_projects_into_its_centre() {
        let (caster, photo) = eye(Size::new(240, 180));
        let image: Image<u16> = photograph(&caster, &photo, Sampling::Box(1), 3);
        let mut tried = 0;
        for y in (3..180_u32).step_by(7) {
            for x in (3..240_u32).step_by(7) {
                let centre = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let eye = Eye { caster: &caster, photo: &photo };
                let Shown::Face(hit) = eye.look(centre, None) else { continue };
                // Forward, by the other direction of the lens.
                let c = photo.pose.camera_from_ground(hit.ground);
                let back = photo.lens.photo_from_ray(c.truncate() / c.z).unwrap();
                assert!((back - centre).length() < 1e-8);
                let expected = caster.colour(&hit).map(u16::of_unit);
                assert_eq!(image.pixel(x as usize, y as usize), expected);
                tried += 1;
            }
        }
        assert!(tried > 600, "{tried}");
    }

    #[test]
    fn rays_at_edges_alone_come_near_a_full_box_and_equal_it_there() {
        let (caster, photo) = eye(Size::new(240, 180));
        let full: Image<u8> = photograph(&caster, &photo, Sampling::Box(4), 3);
        let quick: Image<u8> = photograph(&caster, &photo, Sampling::Edges(4), 3);
        let differences: Vec<u8> =
            full.data().iter().zip(quick.data()).map(|(a, b)| a.abs_diff(*b)).collect();
        let equal = full.data().iter().zip(quick.data()).filter(|(a, b)| a == b).count();
        assert!(differences.iter().all(|&d| d <= 6), "{:?}", differences.iter().max());
        assert!(equal * 10 > differences.len() * 3, "{equal} of {}", differences.len());
    }

    #[test]
    fn a_grey_photo_is_the_luma_of_the_coloured_one() {
        let (caster, photo) = eye(Size::new(60, 45));
        let colour: Image<u8> = photograph(&caster, &photo, Sampling::Box(2), 3);
        let grey: Image<u8> = photograph(&caster, &photo, Sampling::Box(2), 1);
        for (rgb, luma) in colour.data().chunks_exact(3).zip(grey.data()) {
            let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(f64::from);
            assert!((0.299 * r + 0.587 * g + 0.114 * b - f64::from(*luma)).abs() <= 1.0);
        }
    }
}
