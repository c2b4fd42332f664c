//! The shift between two pictures, to a hundredth of a pixel, by least squares.

use rayon::prelude::*;

use super::metrics::{Plane, within};

/// How far a picture lies from a reference, pixels: positive if its content lies further right, further down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shift {
    /// To the right.
    pub x: f64,
    /// Down.
    pub y: f64,
}

impl Shift {
    /// Its length, pixels.
    pub fn length(&self) -> f64 {
        (self.x * self.x + self.y * self.y).sqrt()
    }
}

/// Pixels around a pixel that must be in the mask: the gradient's reach, and the greatest shift that is sought.
const REACH: usize = 5;
/// The greatest shift that is sought, pixels.
const LIMIT: f64 = 3.0;

/// The shift of `picture` from `reference`, over the pixels whose 11 × 11 neighbourhood is in the mask; `None` if
/// there is too little structure, or the shift is beyond three pixels.
///
/// B. D. Lucas, T. Kanade (1981), "An iterative image registration technique with an application to stereo vision",
/// IJCAI 1981, 674–679: the displacement that makes the squared differences least, by Gauss–Newton steps. Steps:
/// (1) both pictures are smoothed alike, which leaves the shift as it is and makes interpolation near exact;
/// (2) the picture, moved back by the present shift, less the reference, is fitted by the reference's gradient;
/// (3) again until the shift rests; (4) again, each difference weighted by Tukey's biweight, so that pixels that
/// differ for another reason — silhouettes, blunders — have no say. Departure: one displacement for the whole
/// picture, no pyramid.
pub fn shift(picture: &Plane, reference: &Plane, mask: &[bool]) -> Option<Shift> {
    let (width, height) = (reference.width, reference.height);
    let whole = within(mask, width, height, REACH);
    let (picture, reference) = (smooth(picture), smooth(reference));
    let places = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
    let places: Vec<Place> = places
        .filter(|&[x, y]| whole[y * width + x])
        .map(|[x, y]| Place {
            at: [x as f64, y as f64],
            value: reference.at(x, y),
            gradient: [
                0.5 * (reference.at(x + 1, y) - reference.at(x - 1, y)),
                0.5 * (reference.at(x, y + 1) - reference.at(x, y - 1)),
            ],
        })
        .collect();
    let mut found = Shift { x: 0.0, y: 0.0 };
    let mut scale = f64::INFINITY;
    for _ in 0..STEPS {
        let differences: Vec<f64> =
            places.par_iter().map(|p| p.value - p.look(&picture, &found)).collect();
        let step = step(&places, &differences, scale)?;
        found = Shift { x: found.x + step.x, y: found.y + step.y };
        if !(found.x.abs() < LIMIT && found.y.abs() < LIMIT) {
            return None;
        }
        if step.length() < 0.01 {
            scale = spread(differences);
        }
        if step.length() < 1e-5 {
            break;
        }
    }
    Some(found)
}

/// Steps at most; a shift of a pixel needs about ten.
const STEPS: usize = 30;

/// A pixel of the reference.
struct Place {
    at: [f64; 2],
    value: f64,
    gradient: [f64; 2],
}

impl Place {
    /// The picture where this pixel lies if it is shifted.
    fn look(&self, picture: &Plane, shift: &Shift) -> f64 {
        quintic(picture, self.at[0] + shift.x, self.at[1] + shift.y)
    }
}

/// The weighted least-squares step; `None` if there is too little structure in some direction.
fn step(places: &[Place], differences: &[f64], scale: f64) -> Option<Shift> {
    let [mut xx, mut xy, mut yy, mut bx, mut by] = [0.0; 5];
    for (Place { gradient: [gx, gy], .. }, d) in places.iter().zip(differences) {
        // Tukey's constant: 95 % of the efficiency of least squares on normal errors.
        let t = d / (4.685 * scale);
        let weight = if t.abs() < 1.0 { (1.0 - t * t) * (1.0 - t * t) } else { 0.0 };
        xx += weight * gx * gx;
        xy += weight * gx * gy;
        yy += weight * gy * gy;
        bx += weight * gx * d;
        by += weight * gy * d;
    }
    let det = xx * yy - xy * xy;
    // A thirtieth of a grey level a pixel, in the weakest direction, tells nothing of a hundredth of a pixel.
    let enough = det > 0.0 && det / (xx + yy) > 1e-3 * places.len() as f64;
    enough.then(|| Shift { x: (yy * bx - xy * by) / det, y: (xx * by - xy * bx) / det })
}

/// The standard deviation of most of the differences, by their median magnitude; at least half a grey level.
fn spread(mut differences: Vec<f64>) -> f64 {
    let middle = differences.len() / 2;
    for d in &mut differences {
        *d = d.abs();
    }
    let (_, median, _) = differences.select_nth_unstable_by(middle, f64::total_cmp);
    (1.4826 * *median).max(0.5)
}

/// The binomial mean 1 4 6 4 1 along rows and columns; the outer two pixels stay as they are.
fn smooth(plane: &Plane) -> Plane {
    let mut out = plane.clone();
    for step in [1, plane.width] {
        let from = out.clone();
        for y in 2..plane.height.saturating_sub(2) {
            for x in 2..plane.width.saturating_sub(2) {
                let k = y * plane.width + x;
                let v = &from.values;
                out.values[k] = (v[k - 2 * step]
                    + v[k + 2 * step]
                    + 4.0 * (v[k - step] + v[k + step])
                    + 6.0 * v[k])
                    / 16.0;
            }
        }
    }
    out
}

/// The picture at a position (0 at the first pixel's centre), by Lagrange's polynomials of degree 5, which on a
/// smoothed picture leave less than a thousandth. The position must have three pixels on every side.
fn quintic(plane: &Plane, x: f64, y: f64) -> f64 {
    let (x0, y0) = (x.floor(), y.floor());
    let (wx, wy) = (lagrange(x - x0), lagrange(y - y0));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside by REACH")]
    let (left, top) = (x0 as usize - 2, y0 as usize - 2);
    let row = |j: usize| -> f64 {
        let first = (top + j) * plane.width + left;
        wx.iter().zip(&plane.values[first..first + 6]).map(|(w, v)| w * v).sum()
    };
    wy.iter().zip(0..).map(|(w, j)| w * row(j)).sum()
}

/// Weights of the values at −2, −1, 0, 1, 2, 3 for a position `t` in 0 to 1.
fn lagrange(t: f64) -> [f64; 6] {
    let nodes = [-2.0, -1.0, 0.0, 1.0, 2.0, 3.0];
    std::array::from_fn(|k| {
        let others = nodes.iter().enumerate().filter(|(j, _)| *j != k);
        others.map(|(_, n)| (t - n) / (nodes[k] - n)).product()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Size;
    use crate::image::Image;
    use crate::synthetic::{Part, Texture};
    use glam::DVec3;

    /// The texture of the wall at 4 mm a pixel, 8 bits, its content moved by (dx, dy) pixels.
    fn picture(dx: f64, dy: f64) -> Plane {
        let texture = Texture::new(0.02);
        let size = Size::new(200, 150);
        let mut image = Image::filled(size, 3, 0_u8);
        for y in 0..150_u32 {
            for x in 0..200_u32 {
                let at =
                    DVec3::new((f64::from(x) - dx) * 0.004, -(f64::from(y) - dy) * 0.004, -1.0);
                let pixel = image.pixel_mut(x as usize, y as usize);
                super::super::photograph::write(pixel, texture.colour(at, Part::Wall));
            }
        }
        Plane::luma(image.view())
    }

    #[test]
    fn a_known_shift_is_measured_to_a_hundredth_of_a_pixel() {
        let mask = vec![true; 200 * 150];
        let reference = picture(0.0, 0.0);
        for (dx, dy) in [(0.3, 0.0), (0.0, -0.3), (0.5, 0.5), (-0.02, 0.01), (1.3, -0.7)] {
            let found = shift(&picture(dx, dy), &reference, &mask).unwrap();
            assert!((found.x - dx).abs() < 0.01 && (found.y - dy).abs() < 0.01, "{found:?}");
        }
    }

    #[test]
    fn a_silhouette_that_lies_elsewhere_does_not_move_the_shift() {
        let mask = vec![true; 200 * 150];
        let [mut reference, mut moved] = [picture(0.0, 0.0), picture(0.3, -0.2)];
        // A dark column whose right edge is a pixel off in one of the pictures.
        for y in 0..150 {
            for x in 60..90 {
                reference.values[y * 200 + x] = 20.0;
                moved.values[y * 200 + x] = 20.0;
            }
            moved.values[y * 200 + 90] = 20.0;
        }
        let found = shift(&moved, &reference, &mask).unwrap();
        assert!((found.x - 0.3).abs() < 0.01 && (found.y + 0.2).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn a_picture_is_not_shifted_from_itself_and_a_flat_one_tells_nothing() {
        let mask = vec![true; 200 * 150];
        let reference = picture(0.0, 0.0);
        assert!(shift(&reference, &reference, &mask).unwrap().length() < 1e-9);
        let flat = Plane { values: vec![90.0; 200 * 150], ..reference.clone() };
        assert_eq!(shift(&flat, &flat, &mask), None);
        assert_eq!(shift(&reference, &reference, &vec![false; 200 * 150]), None);
    }
}
