//! [`solve`]: from observations to tones.
//!
//! 1. Gains of the mean of the channels and vignetting together, by conjugate gradients on the normal equations, the
//!    surface's colours eliminated point by point (the Schur complement).
//! 2. Gains of each channel, vignetting held.
//! 3. Weights anew, by how far each observation is from what is expected; from 1, some times.
//! 4. Fields of what is left ([`super::field`]).
//! 5. Gauge: in each group of photos that share points, the mean gain is 0, or that of the photos whose tone is to stay.

use glam::DVec2;

use super::conjugate;
use super::field::fields;
use super::groups::groups;
use super::model::{FIELD, vignetting_basis};
use super::{Levelling, PhotoTone};

/// A surface point as one photo shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Index of the photo in [`Problem::photos`].
    pub photo: u32,
    /// Position in the frame, both coordinates 0 to 1.
    pub at: DVec2,
    /// Natural logarithms of the three channels.
    pub log: [f64; 3],
}

/// What is to be solved.
#[derive(Debug, Clone, Default)]
pub struct Problem {
    /// For each photo the number of its camera, and the frame's width over its height. Cameras are numbered from 0.
    pub photos: Vec<(usize, f64)>,
    /// The observations of a point one after the other, at least two.
    pub observations: Vec<Observation>,
    /// First observation of each point, ascending from 0.
    pub points: Vec<usize>,
    /// The photos whose tone is to stay, mean by mean; none: that of all.
    pub tone_from: Vec<u32>,
}

/// What was found of one photo.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhotoFit {
    /// Surface points that it shares with others.
    pub points: usize,
    /// Median of the absolute difference to the mean of all that show a point, natural logarithm, as photographed.
    pub before: f64,
    /// The same, levelled.
    pub after: f64,
    /// The lowest photo of those with which it was levelled.
    pub group: usize,
}

/// The answer.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tones {
    /// One a photo.
    pub photos: Vec<PhotoTone>,
    /// One a photo.
    pub fits: Vec<PhotoFit>,
}

/// Rounds of reweighting.
const ROUNDS: usize = 8;
/// Observations as far from what is expected as this, in logarithms, count whole; so do those within 1.5 times the median.
const LEAST_SCALE: f64 = 0.06;
const SCALE_OF_MEDIAN: f64 = 1.5;
/// Beyond so many times that they hardly count: it is not the surface that they show.
const FAR: f64 = 4.0;
const FAR_WEIGHT: f64 = 0.05;
/// How strongly a gain is held at 0: as if so many observations said so. A photo of little overlap stays as it is.
const GAIN_PRIOR: f64 = 4.0;
/// Likewise vignetting, as a part of its camera's observations.
const VIGNETTING_PRIOR: f64 = 1e-3;

/// Observations with their weights.
pub(super) struct Weighed<'a> {
    pub(super) observations: &'a [Observation],
    pub(super) point_of: &'a [usize],
    pub(super) weights: Vec<f64>,
    points: usize,
}

impl Weighed<'_> {
    /// The weighted mean of what belongs to each point.
    pub(super) fn point_means<const C: usize>(&self, of: &[[f64; C]]) -> Vec<[f64; C]> {
        let (mut sums, mut totals) = (vec![[0.0; C]; self.points], vec![0.0; self.points]);
        for ((of, &point), &weight) in of.iter().zip(self.point_of).zip(&self.weights) {
            totals[point] += weight;
            for (sum, v) in sums[point].iter_mut().zip(of) {
                *sum += weight * v;
            }
        }
        for (sum, total) in sums.iter_mut().zip(totals) {
            *sum = sum.map(|v| v / total);
        }
        sums
    }
}

/// Finds tones such that photos agree.
///
/// Photos without observations keep their tone.
///
/// # Panics
/// If the problem is not as it says: a number out of range, or a point without observations.
pub fn solve(problem: &Problem, levelling: Levelling) -> Tones {
    let count = problem.photos.len();
    let mut tones = vec![PhotoTone::default(); count];
    let observations = &problem.observations;
    if levelling == Levelling::None || observations.is_empty() {
        let fits = (0..count).map(|group| PhotoFit { group, ..PhotoFit::default() }).collect();
        return Tones { photos: tones, fits };
    }
    let point_of = point_of(problem);
    let weights = vec![1.0; observations.len()];
    let points = problem.points.len();
    let mut weighed = Weighed { observations, point_of: &point_of, weights, points };
    let before = residuals(&weighed, &logs(observations));
    let bases: Vec<[f64; 2]> = observations
        .iter()
        .map(|o| vignetting_basis(o.at, problem.photos[o.photo as usize].1))
        .collect();
    let mut rest = logs(observations);
    let has_vignetting = levelling == Levelling::Full;
    for _ in 0..ROUNDS {
        common(problem, &weighed, &bases, has_vignetting, &mut tones);
        by_channel(&weighed, &bases, problem, &mut tones);
        rest = left(observations, &bases, &tones);
        weighed.weights = weights_of(&residuals(&weighed, &rest));
    }
    if levelling == Levelling::Full {
        let found = fields(&weighed, count, &mut rest);
        for (tone, field) in tones.iter_mut().zip(found) {
            take_field(tone, field);
        }
    }
    let after = residuals(&weighed, &rest);
    let groups = group_photos(problem);
    gauge(problem, &groups, &mut tones);
    let fits = fits(observations, &groups, [&before, &after]);
    Tones { photos: tones, fits }
}

fn point_of(problem: &Problem) -> Vec<usize> {
    let ends = problem.points.iter().skip(1).copied().chain([problem.observations.len()]);
    let spans = problem.points.iter().zip(ends).enumerate();
    spans.flat_map(|(point, (&start, end))| std::iter::repeat_n(point, end - start)).collect()
}

fn logs(observations: &[Observation]) -> Vec<[f64; 3]> {
    observations.iter().map(|o| o.log).collect()
}

/// What gains and vignetting do not explain, the surface's colours still in it.
fn left(observations: &[Observation], bases: &[[f64; 2]], tones: &[PhotoTone]) -> Vec<[f64; 3]> {
    let of = |(o, basis): (&Observation, &[f64; 2])| {
        let tone = &tones[o.photo as usize];
        let common = tone.vignetting[0] * basis[0] + tone.vignetting[1] * basis[1];
        std::array::from_fn(|c| o.log[c] - tone.gain[c] - common)
    };
    observations.iter().zip(bases).map(of).collect()
}

/// For each observation how far it is from its point's mean: the root of the mean square over the channels.
fn residuals(weighed: &Weighed<'_>, rest: &[[f64; 3]]) -> Vec<f64> {
    let means = weighed.point_means(rest);
    let of = |(rest, &point): (&[f64; 3], &usize)| {
        let squares = rest.iter().zip(means[point]).map(|(v, mean)| (v - mean) * (v - mean));
        (squares.sum::<f64>() / 3.0).sqrt()
    };
    rest.iter().zip(weighed.point_of).map(of).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Huber's weights, and almost none far out.
fn weights_of(residuals: &[f64]) -> Vec<f64> {
    let scale = LEAST_SCALE.max(SCALE_OF_MEDIAN * median(residuals.to_vec()));
    let weight = |&e: &f64| {
        if e <= scale {
            1.0
        } else if e <= FAR * scale {
            scale / e
        } else {
            FAR_WEIGHT * scale / e
        }
    };
    residuals.iter().map(weight).collect()
}

/// Gains of the mean of the channels, and vignetting: unknowns are one gain a photo, then two numbers a camera.
fn common(
    problem: &Problem,
    weighed: &Weighed<'_>,
    bases: &[[f64; 2]],
    has_vignetting: bool,
    tones: &mut [PhotoTone],
) {
    let photos = problem.photos.len();
    let cameras = problem.photos.iter().map(|(camera, _)| camera + 1).max().unwrap_or(0);
    let unknowns = photos + 2 * cameras;
    let slots = |o: &Observation| {
        let camera = problem.photos[o.photo as usize].0;
        (o.photo as usize, photos + 2 * camera)
    };
    // The sum over the observations of what `of` says, each less its point's mean, into the unknowns it depends on.
    let gather = |of: &dyn Fn(usize) -> f64, out: &mut [f64]| {
        let values: Vec<[f64; 1]> = (0..bases.len()).map(|k| [of(k)]).collect();
        let means = weighed.point_means(&values);
        out.fill(0.0);
        for (k, o) in weighed.observations.iter().enumerate() {
            let v = weighed.weights[k] * (values[k][0] - means[weighed.point_of[k]][0]);
            let (gain, vignetting) = slots(o);
            out[gain] += v;
            out[vignetting] += v * bases[k][0];
            out[vignetting + 1] += v * bases[k][1];
        }
        if !has_vignetting {
            out[photos..].fill(0.0);
        }
    };
    let mut totals = vec![0.0; unknowns];
    for (o, &weight) in weighed.observations.iter().zip(&weighed.weights) {
        let (gain, vignetting) = slots(o);
        totals[gain] += weight;
        totals[vignetting] += weight;
        totals[vignetting + 1] += weight;
    }
    let prior: Vec<f64> = (0..unknowns)
        .map(|k| if k < photos { GAIN_PRIOR } else { 1.0 + VIGNETTING_PRIOR * totals[k] })
        .collect();
    let diagonal: Vec<f64> = totals.iter().zip(&prior).map(|(t, p)| t + p).collect();
    let mut right = vec![0.0; unknowns];
    gather(&|k| weighed.observations[k].log.iter().sum::<f64>() / 3.0, &mut right);
    let mut x = vec![0.0; unknowns];
    conjugate::solve(&mut x, &right, &diagonal, |x, out| {
        let value = |k: usize| {
            let (gain, vignetting) = slots(&weighed.observations[k]);
            x[gain] + x[vignetting] * bases[k][0] + x[vignetting + 1] * bases[k][1]
        };
        gather(&value, out);
        for (k, out) in out.iter_mut().enumerate() {
            *out += prior[k] * x[k];
        }
    });
    for (photo, (tone, (camera, _))) in tones.iter_mut().zip(&problem.photos).enumerate() {
        let at = photos + 2 * camera;
        tone.gain = [x[photo]; 3];
        tone.vignetting = [x[at], x[at + 1]];
    }
}

/// Gains of each channel, vignetting held.
fn by_channel(
    weighed: &Weighed<'_>,
    bases: &[[f64; 2]],
    problem: &Problem,
    tones: &mut [PhotoTone],
) {
    let photos = problem.photos.len();
    let mut diagonal = vec![GAIN_PRIOR; photos];
    for (o, &weight) in weighed.observations.iter().zip(&weighed.weights) {
        diagonal[o.photo as usize] += weight;
    }
    let gather = |values: &[[f64; 3]], c: usize, out: &mut [f64]| {
        let means = weighed.point_means(values);
        out.fill(0.0);
        for (k, o) in weighed.observations.iter().enumerate() {
            let v = values[k][c] - means[weighed.point_of[k]][c];
            out[o.photo as usize] += weighed.weights[k] * v;
        }
    };
    let vignetted: Vec<[f64; 3]> = {
        let none: Vec<_> =
            tones.iter().map(|tone| PhotoTone { gain: [0.0; 3], ..tone.clone() }).collect();
        left(weighed.observations, bases, &none)
    };
    for c in 0..3 {
        let mut right = vec![0.0; photos];
        gather(&vignetted, c, &mut right);
        let mut x: Vec<f64> = tones.iter().map(|tone| tone.gain[c]).collect();
        conjugate::solve(&mut x, &right, &diagonal, |x, out| {
            let value = |o: &Observation| [x[o.photo as usize]; 3];
            let values: Vec<_> = weighed.observations.iter().map(value).collect();
            gather(&values, c, out);
            for (out, x) in out.iter_mut().zip(x) {
                *out += GAIN_PRIOR * x;
            }
        });
        for (tone, x) in tones.iter_mut().zip(x) {
            tone.gain[c] = x;
        }
    }
}

/// The field's mean belongs to the gain.
fn take_field(tone: &mut PhotoTone, mut field: [[f64; 3]; FIELD]) {
    for c in 0..3 {
        let mean = field.iter().map(|node| node[c]).sum::<f64>() / FIELD as f64;
        tone.gain[c] += mean;
        for node in &mut field {
            node[c] -= mean;
        }
    }
    tone.field = field.to_vec();
}

/// The lowest photo of each photo's group.
fn group_photos(problem: &Problem) -> Vec<usize> {
    let point_of = point_of(problem);
    let photo = |k: usize| problem.observations[k].photo as usize;
    let neighbours = (1..point_of.len()).filter(|&k| point_of[k] == point_of[k - 1]);
    groups(problem.photos.len(), neighbours.map(|k| (photo(k - 1), photo(k))))
}

/// Moves the gains of each group so that their mean, or that of the photos whose tone is to stay, is 0.
fn gauge(problem: &Problem, groups: &[usize], tones: &mut [PhotoTone]) {
    let is_seen = {
        let mut seen = vec![false; tones.len()];
        problem.observations.iter().for_each(|o| seen[o.photo as usize] = true);
        seen
    };
    let mut kept = vec![false; tones.len()];
    problem.tone_from.iter().for_each(|&photo| kept[photo as usize] = true);
    for group in (0..tones.len()).filter(|&k| groups[k] == k) {
        let members: Vec<usize> =
            (0..tones.len()).filter(|&k| groups[k] == group && is_seen[k]).collect();
        let stated: Vec<usize> = members.iter().copied().filter(|&k| kept[k]).collect();
        let of = if stated.is_empty() { &members } else { &stated };
        for c in 0..3 {
            let mean = of.iter().map(|&k| tones[k].gain[c]).sum::<f64>() / of.len().max(1) as f64;
            for &k in &members {
                tones[k].gain[c] -= mean;
            }
        }
    }
}

fn fits(
    observations: &[Observation],
    groups: &[usize],
    [before, after]: [&[f64]; 2],
) -> Vec<PhotoFit> {
    let mut of: Vec<[Vec<f64>; 2]> = vec![[Vec::new(), Vec::new()]; groups.len()];
    for (k, o) in observations.iter().enumerate() {
        let [to_before, to_after] = &mut of[o.photo as usize];
        to_before.push(before[k]);
        to_after.push(after[k]);
    }
    let fit = |([before, after], &group): ([Vec<f64>; 2], &usize)| PhotoFit {
        points: before.len(),
        before: median(before),
        after: median(after),
        group,
    };
    of.into_iter().zip(groups).map(fit).collect()
}
