//! [`inverse`]: the lens that distorts what stated corrections put right.
//!
//! Classical photogrammetry corrects measured positions; a lens distorts true ones. The inverse of a polynomial is none,
//! but the polynomial of Brown's lens with four radial terms that comes nearest to it, by least squares over the photo, is
//! taken where it comes within [`CLOSE_PX`] everywhere (P. Drap and J. Lefèvre, 2016, "An exact formula for calculating
//! inverse radial lens distortions", Sensors 16 (6), 807, doi:10.3390/s16060807, derive its radial terms from the series).

use glam::DVec2;

use crate::geom::Size;

/// The greatest error that is taken, pixels: a sixth of what the better of two real blocks leaves at its tie points, 0.30.
const CLOSE_PX: f64 = 0.05;
/// Positions a side of the photo that are fitted, and that are tried, others.
const FITTED: u32 = 25;
const TRIED: u32 = 42;
/// Terms: four radial, two tangential.
const TERMS: usize = 6;

/// Corrections on positions from the principal point, divided by the focal length, y up.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corrections {
    pub(super) k: [f64; 3],
    /// The first belongs to x, the second to y.
    pub(super) p: [f64; 2],
}

impl Corrections {
    /// The true position of a measured one, both y down.
    fn apply(&self, DVec2 { x, y: down }: DVec2) -> DVec2 {
        let (y, [k1, k2, k3], [p1, p2]) = (-down, self.k, self.p);
        let s = x * x + y * y;
        let g = 1.0 + s * (k1 + s * (k2 + s * k3));
        let x_true = x * g + p1 * (s + 2.0 * x * x) + 2.0 * p2 * x * y;
        let y_true = y * g + p2 * (s + 2.0 * y * y) + 2.0 * p1 * x * y;
        DVec2::new(x_true, -y_true)
    }
}

/// `k1, k2, k3, k4, p1, p2` of Brown's lens in OpenCV's order that undoes `corrections` in a photo; else the greatest error
/// of the best such lens, pixels.
pub(super) fn inverse(
    corrections: &Corrections,
    size: Size,
    principal_px: DVec2,
    focal_px: f64,
) -> Result<[f64; TERMS], f64> {
    let extent = DVec2::new(f64::from(size.width), f64::from(size.height));
    let positions = |n: u32| {
        (0..n * n).map(move |k| {
            let part = DVec2::new(f64::from(k % n), f64::from(k / n)) / f64::from(n - 1);
            (part * extent - principal_px) / focal_px
        })
    };
    // Radii in parts of the greatest keep the powers alike.
    let corners = positions(2).map(|m| corrections.apply(m).length());
    let most = corners.fold(0.0, f64::max);
    let mut system = [[0.0; TERMS + 1]; TERMS];
    for measured in positions(FITTED) {
        let truth = corrections.apply(measured) / most;
        for (row, rest) in terms(truth).into_iter().zip((measured / most - truth).to_array()) {
            for (i, of) in system.iter_mut().enumerate() {
                row.iter().zip(&mut of[..TERMS]).for_each(|(v, sum)| *sum += row[i] * v);
                of[TERMS] += row[i] * rest;
            }
        }
    }
    let found = solved(system);
    let off = |measured: DVec2| {
        let truth = corrections.apply(measured) / most;
        let [x, y] =
            terms(truth).map(|row| row.iter().zip(&found).map(|(a, b)| a * b).sum::<f64>());
        ((truth + DVec2::new(x, y)) * most - measured).length() * focal_px
    };
    let worst =
        positions(TRIED).map(off).fold(0.0, |a: f64, b| if b > a || b.is_nan() { b } else { a });
    if worst <= CLOSE_PX {
        let [k1, k2, k3, k4, p1, p2] = found;
        let square = (most * most).recip();
        let k = [k1 * square, k2 * square.powi(2), k3 * square.powi(3), k4 * square.powi(4)];
        Ok([k[0], k[1], k[2], k[3], p1 / most, p2 / most])
    } else {
        Err(worst)
    }
}

/// What each coefficient adds to x and to y of a true position, y down.
fn terms(DVec2 { x, y }: DVec2) -> [[f64; TERMS]; 2] {
    let s = x * x + y * y;
    let radial = [s, s * s, s * s * s, s * s * s * s];
    let of = |v: f64, tangential: [f64; 2]| {
        let [a, b, c, d] = radial.map(|r| r * v);
        [a, b, c, d, tangential[0], tangential[1]]
    };
    [of(x, [2.0 * x * y, s + 2.0 * x * x]), of(y, [s + 2.0 * y * y, 2.0 * x * y])]
}

/// The solution of a linear system, the right-hand side its last column: Gauss's elimination with pivots. NaN for one
/// that has none.
fn solved(mut system: [[f64; TERMS + 1]; TERMS]) -> [f64; TERMS] {
    for column in 0..TERMS {
        let below = column..TERMS;
        let pivot =
            below.max_by(|&a, &b| system[a][column].abs().total_cmp(&system[b][column].abs()));
        system.swap(column, pivot.unwrap_or(column));
        let row = system[column].map(|v| v / system[column][column]);
        for (k, other) in system.iter_mut().enumerate() {
            let factor = other[column];
            if k == column {
                *other = row;
            } else {
                other.iter_mut().zip(&row).for_each(|(v, r)| *v -= factor * r);
            }
        }
    }
    system.map(|row| row[TERMS])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_is_solved() {
        let mut system = [[0.0; TERMS + 1]; TERMS];
        for (i, row) in system.iter_mut().enumerate() {
            for (j, v) in row[..TERMS].iter_mut().enumerate() {
                *v = if i == j { 0.0 } else { (1 + (3 * i + 5 * j) % 7) as f64 };
            }
            row[TERMS] = row[..TERMS].iter().zip(1..).map(|(v, x)| v * f64::from(x)).sum();
        }
        for (found, x) in solved(system).into_iter().zip(1..) {
            assert!((found - f64::from(x)).abs() < 1e-9, "{found}");
        }
    }

    #[test]
    fn corrections_that_no_lens_undoes_tell_how_far_off_it_is() {
        let (size, principal) = (Size::new(6000, 4000), DVec2::new(3010.0, 1990.0));
        let none = Corrections { k: [0.0; 3], p: [0.0; 2] };
        assert!(inverse(&none, size, principal, 5000.0).is_ok_and(|k| k.iter().all(|k| *k == 0.0)));
        let mild = Corrections { k: [0.08, -0.01, 0.0], p: [2e-5, -1e-5] };
        assert!(inverse(&mild, size, principal, 5000.0).is_ok());
        // Ten times the decentring: its product with the radial terms is not in the lens.
        let decentred = Corrections { p: [2e-4, -1e-4], ..mild };
        let off = inverse(&decentred, size, principal, 5000.0);
        assert!(off.is_err_and(|off| (CLOSE_PX..1.0).contains(&off)), "{off:?}");
        let strong = Corrections { k: [0.9, 0.0, 0.5], p: [1e-2, 0.0] };
        assert!(inverse(&strong, size, principal, 2500.0).is_err_and(|off| off > CLOSE_PX));
    }
}
