//! The shift between two pictures, to a hundredth of a pixel, by least squares.

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
/// (3) again until the shift rests. Departure: one displacement for the whole picture, no pyramid.
pub fn shift(picture: &Plane, reference: &Plane, mask: &[bool]) -> Option<Shift> {
    let (width, height) = (reference.width, reference.height);
    let whole = within(mask, width, height, REACH);
    let (picture, reference) = (smooth(picture), smooth(reference));
    let gradient = |x: usize, y: usize| {
        [
            0.5 * (reference.at(x + 1, y) - reference.at(x - 1, y)),
            0.5 * (reference.at(x, y + 1) - reference.at(x, y - 1)),
        ]
    };
    let places: Vec<[usize; 2]> = (0..height)
        .flat_map(|y| (0..width).map(move |x| [x, y]))
        .filter(|&[x, y]| whole[y * width + x])
        .collect();
    // The normal matrix does not change: the gradients are the reference's.
    let [mut xx, mut xy, mut yy] = [0.0; 3];
    for &[x, y] in &places {
        let [gx, gy] = gradient(x, y);
        xx += gx * gx;
        xy += gx * gy;
        yy += gy * gy;
    }
    let det = xx * yy - xy * xy;
    // Less than a grey level of gradient a pixel, in the weakest direction, tells nothing of a hundredth of a pixel.
    let enough = det > 0.0 && det / (xx + yy) > 1e-3 * places.len() as f64;
    if !enough {
        return None;
    }
    let mut found = Shift { x: 0.0, y: 0.0 };
    for _ in 0..30 {
        let [mut bx, mut by] = [0.0; 2];
        for &[x, y] in &places {
            let [gx, gy] = gradient(x, y);
            let moved = quintic(&picture, x as f64 + found.x, y as f64 + found.y);
            let difference = reference.at(x, y) - moved;
            bx += gx * difference;
            by += gy * difference;
        }
        let step = Shift { x: (yy * bx - xy * by) / det, y: (xx * by - xy * bx) / det };
        found = Shift { x: found.x + step.x, y: found.y + step.y };
        if !(found.x.abs() < LIMIT && found.y.abs() < LIMIT) {
            return None;
        }
        if step.length() < 1e-5 {
            break;
        }
    }
    Some(found)
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
    fn a_picture_is_not_shifted_from_itself_and_a_flat_one_tells_nothing() {
        let mask = vec![true; 200 * 150];
        let reference = picture(0.0, 0.0);
        assert!(shift(&reference, &reference, &mask).unwrap().length() < 1e-9);
        let flat = Plane { values: vec![90.0; 200 * 150], ..reference.clone() };
        assert_eq!(shift(&flat, &flat, &mask), None);
        assert_eq!(shift(&reference, &reference, &vec![false; 200 * 150]), None);
    }
}
