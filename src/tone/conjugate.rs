//! The conjugate gradient method for a symmetric positive definite system that is known by what it does to a vector.
//!
//! M. R. Hestenes, E. Stiefel (1952), "Methods of conjugate gradients for solving linear systems",
//! doi:10.6028/jres.049.044; preconditioned by the diagonal.

/// The residual is small enough at this part of the right-hand side.
const TOLERANCE: f64 = 1e-7;
/// Steps at most.
const STEPS: usize = 300;

/// Improves `x` until `matrix · x = right`, as near as rounding and the number of steps allow. `diagonal` is the
/// matrix's; all positive.
pub(super) fn solve(
    x: &mut [f64],
    right: &[f64],
    diagonal: &[f64],
    mut matrix: impl FnMut(&[f64], &mut [f64]),
) {
    let mut product = vec![0.0; x.len()];
    matrix(x, &mut product);
    let mut residual: Vec<f64> = right.iter().zip(&product).map(|(b, p)| b - p).collect();
    let scaled = |r: &[f64]| -> Vec<f64> { r.iter().zip(diagonal).map(|(r, d)| r / d).collect() };
    let mut z = scaled(&residual);
    let mut direction = z.clone();
    let mut along = dot(&residual, &z);
    let enough = TOLERANCE * TOLERANCE * dot(right, &scaled(right)).max(f64::MIN_POSITIVE);
    for _ in 0..STEPS {
        if along <= enough {
            return;
        }
        matrix(&direction, &mut product);
        let step = along / dot(&direction, &product);
        for (k, x) in x.iter_mut().enumerate() {
            *x += step * direction[k];
            residual[k] -= step * product[k];
        }
        z = scaled(&residual);
        let next = dot(&residual, &z);
        for (d, z) in direction.iter_mut().zip(&z) {
            *d = z + next / along * *d;
        }
        along = next;
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_of_known_answer_is_solved() {
        let matrix = |x: &[f64], out: &mut [f64]| {
            for k in 0..x.len() {
                let before = if k > 0 { x[k - 1] } else { 0.0 };
                out[k] = (3.0 + k as f64) * x[k] - before - x.get(k + 1).copied().unwrap_or(0.0);
            }
        };
        let wanted: Vec<f64> = (0..40).map(|k| f64::from(k % 7) - 2.5).collect();
        let mut right = vec![0.0; 40];
        matrix(&wanted, &mut right);
        let diagonal: Vec<f64> = (0..40).map(|k| 3.0 + f64::from(k)).collect();
        let mut x = vec![0.0; 40];
        solve(&mut x, &right, &diagonal, matrix);
        assert!(x.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{x:?}");
    }
}
