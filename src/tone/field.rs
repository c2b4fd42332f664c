//! Fields: what gains and vignetting leave, as gentle surfaces over each photo's frame.

use super::model::{FIELD, field_basis};
use super::solve::{Observation, Weighed};

/// Rounds of alternation between the fields and the surface's colours.
const ROUNDS: usize = 6;
/// How strongly nodes are held at zero, as a part of what the photo's observations weigh: enough that tone does not drift
/// over a block of many photos.
const RIDGE: f64 = 0.05;

/// The fields of all photos, one triple a node; what they explain is taken out of `rest`, for each observation the
/// logarithms that are to be explained.
pub(super) fn fields(
    weighed: &Weighed<'_>,
    photos: usize,
    rest: &mut [[f64; 3]],
) -> Vec<[[f64; 3]; FIELD]> {
    let mut fields = vec![[[0.0; 3]; FIELD]; photos];
    let by_photo = by_photo(weighed.observations, photos);
    let start: Vec<[f64; 3]> = rest.to_vec();
    for _ in 0..ROUNDS {
        let colours = weighed.point_means(rest);
        for (field, of) in fields.iter_mut().zip(&by_photo) {
            // What is left of the observation, and what the field takes already.
            let wanted = |&k: &usize| {
                let colour = colours[weighed.point_of[k]];
                std::array::from_fn(|c| start[k][c] - colour[c])
            };
            if let Some(found) = fit(weighed, of, wanted) {
                *field = found;
            }
        }
        for (k, observation) in weighed.observations.iter().enumerate() {
            let taken = value(&fields[observation.photo as usize], observation);
            rest[k] = std::array::from_fn(|c| start[k][c] - taken[c]);
        }
    }
    fields
}

/// The observations of each photo.
fn by_photo(observations: &[Observation], photos: usize) -> Vec<Vec<usize>> {
    let mut of = vec![Vec::new(); photos];
    for (k, observation) in observations.iter().enumerate() {
        of[observation.photo as usize].push(k);
    }
    of
}

/// A field at an observation's position.
pub(super) fn value(field: &[[f64; 3]; FIELD], observation: &Observation) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (node, weight) in field_basis(observation.at) {
        for (sum, of) in sum.iter_mut().zip(field[node]) {
            *sum += weight * of;
        }
    }
    sum
}

/// The nodes that fit best, in the sense of least squares with a ridge; `None` without observations.
fn fit(
    weighed: &Weighed<'_>,
    of: &[usize],
    wanted: impl Fn(&usize) -> [f64; 3],
) -> Option<[[f64; 3]; FIELD]> {
    let (mut normal, mut right) = ([[0.0; FIELD]; FIELD], [[0.0; 3]; FIELD]);
    let mut total = 0.0;
    for k in of {
        let (weight, basis) = (weighed.weights[*k], field_basis(weighed.observations[*k].at));
        let wanted = wanted(k);
        total += weight;
        for (i, a) in basis {
            for (j, b) in basis {
                normal[i][j] += weight * a * b;
            }
            for (right, wanted) in right[i].iter_mut().zip(wanted) {
                *right += weight * a * wanted;
            }
        }
    }
    if total <= 0.0 {
        return None;
    }
    for (i, row) in normal.iter_mut().enumerate() {
        row[i] += RIDGE * total;
    }
    cholesky(&mut normal);
    let mut found = [[0.0; 3]; FIELD];
    for c in 0..3 {
        let of = substitute(&normal, std::array::from_fn(|i| right[i][c]));
        for (node, v) in found.iter_mut().zip(of) {
            node[c] = v;
        }
    }
    Some(found)
}

/// The lower triangle becomes the Cholesky factor of a positive definite matrix.
fn cholesky(matrix: &mut [[f64; FIELD]; FIELD]) {
    for i in 0..FIELD {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| matrix[i][k] * matrix[j][k]).sum();
            let left = matrix[i][j] - sum;
            matrix[i][j] = if i == j { left.sqrt() } else { left / matrix[j][j] };
        }
    }
}

/// Solves by a Cholesky factor, forward and back.
fn substitute(factor: &[[f64; FIELD]; FIELD], mut x: [f64; FIELD]) -> [f64; FIELD] {
    for i in 0..FIELD {
        let sum: f64 = (0..i).map(|k| factor[i][k] * x[k]).sum();
        x[i] = (x[i] - sum) / factor[i][i];
    }
    for i in (0..FIELD).rev() {
        let sum: f64 = (i + 1..FIELD).map(|k| factor[k][i] * x[k]).sum();
        x[i] = (x[i] - sum) / factor[i][i];
    }
    x
}
