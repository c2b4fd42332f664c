//! Claims about tones, through the module's interface.

use glam::DVec2;

use super::*;
use crate::geom::Size;
use crate::synthetic::Random;

/// Photos of one camera, all with a tone of their own, that look at points of a wall: each sees a part of it.
fn problem(photos: usize, tone: impl Fn(usize) -> PhotoTone, seed: u64) -> Problem {
    let mut random = Random::new(seed);
    let mut problem = Problem { photos: vec![(0, 1.5); photos], ..Problem::default() };
    for _ in 0..4000 {
        let (x, y) = (random.between(0.0, photos as f64), random.unit());
        let colour: [f64; 3] = std::array::from_fn(|_| random.between(3.0, 5.0));
        let start = problem.observations.len();
        for photo in 0..photos {
            // Photo k sees x from k − 1 to k + 2.
            let at = DVec2::new((x - photo as f64 + 1.0) / 3.0, y);
            if (0.0..1.0).contains(&at.x) {
                let of = tone(photo).at(at, 1.5);
                let log = std::array::from_fn(|c| colour[c] + of[c] + random.between(-0.02, 0.02));
                problem.observations.push(Observation {
                    photo: u32::try_from(photo).unwrap(),
                    at,
                    log,
                });
            }
        }
        if problem.observations.len() < start + 2 {
            problem.observations.truncate(start);
        } else {
            problem.points.push(start);
        }
    }
    problem
}

fn uneven(photo: usize) -> PhotoTone {
    let gain = [0.2, -0.15, 0.05, -0.1, 0.12][photo % 5];
    PhotoTone {
        gain: [gain, gain * 0.8, gain + 0.03],
        vignetting: [-0.35, 0.08],
        field: Vec::new(),
    }
}

/// The greatest difference, over the frames, of two sets of tones, a constant for each channel not counted.
fn difference(a: &[PhotoTone], b: &[PhotoTone]) -> f64 {
    let mut all: [Vec<f64>; 3] = Default::default();
    for (a, b) in a.iter().zip(b) {
        for k in 0..25 {
            let at = DVec2::new(f64::from(k % 5), f64::from(k / 5)) / 4.0;
            let (a, b) = (a.at(at, 1.5), b.at(at, 1.5));
            all.iter_mut().enumerate().for_each(|(c, of)| of.push(a[c] - b[c]));
        }
    }
    let spread = |of: &Vec<f64>| {
        let mean = of.iter().sum::<f64>() / of.len() as f64;
        of.iter().fold(0.0, |most: f64, v| most.max((v - mean).abs()))
    };
    all.iter().map(spread).fold(0.0, f64::max)
}

#[test]
fn gains_and_vignetting_of_known_answer_are_found_and_their_sign_is_right() {
    let problem = problem(5, uneven, 1);
    let known: Vec<_> = (0..5).map(uneven).collect();
    for levelling in [Levelling::Gain, Levelling::Full] {
        let found = solve(&problem, levelling);
        let wrong = difference(&found.photos, &known);
        assert!(wrong < if levelling == Levelling::Full { 0.06 } else { 0.3 }, "{wrong}");
        assert!(found.photos[0].gain[0] > 0.1 && found.photos[1].gain[0] < -0.1);
    }
    let found = solve(&problem, Levelling::Full);
    for fit in &found.fits {
        assert!(fit.points > 500 && fit.group == 0);
        assert!(fit.before > 0.05 && fit.after < 0.02, "{fit:?}");
    }
    let grid = ToneGrid::new(&known[0], Size::new(600, 400));
    let mut colours = [[100.0_f32; 3]];
    grid.apply(&[DVec2::new(300.0, 200.0)], [&mut colours], 255.0);
    let bright = known[0].at(DVec2::splat(0.5), 1.5)[0];
    assert!((f64::from(colours[0][0]) - 100.0 / bright.exp()).abs() < 0.1, "{colours:?}");
}

#[test]
fn a_fifth_of_gross_errors_changes_little() {
    let mut problem = problem(5, uneven, 2);
    let mut random = Random::new(3);
    for o in &mut problem.observations {
        if random.below(5) == 0 {
            o.log = o.log.map(|v| v + random.between(0.5, 1.5));
        }
    }
    let known: Vec<_> = (0..5).map(uneven).collect();
    let wrong = difference(&solve(&problem, Levelling::Full).photos, &known);
    assert!(wrong < 0.1, "{wrong}");
}

#[test]
fn the_gauge_is_the_mean_of_all_or_the_photos_that_are_named_in_each_group_alone() {
    let mut problem = problem(6, uneven, 4);
    // Two halves that share nothing.
    let (mut observations, mut points) = (Vec::new(), Vec::new());
    for (k, &start) in problem.points.iter().enumerate() {
        let end = problem.points.get(k + 1).copied().unwrap_or(problem.observations.len());
        let of = &problem.observations[start..end];
        for half in [0..3, 3..6] {
            let part: Vec<_> = of.iter().filter(|o| half.contains(&o.photo)).copied().collect();
            if part.len() > 1 {
                points.push(observations.len());
                observations.extend(part);
            }
        }
    }
    (problem.observations, problem.points) = (observations, points);
    let mean =
        |tones: &[PhotoTone]| tones.iter().map(|t| t.gain[1]).sum::<f64>() / tones.len() as f64;
    let found = solve(&problem, Levelling::Gain).photos;
    assert!(mean(&found[..3]).abs() < 1e-12 && mean(&found[3..]).abs() < 1e-12);
    problem.tone_from = vec![1];
    let found = solve(&problem, Levelling::Gain).photos;
    assert!(found[1].gain[1].abs() < 1e-12 && mean(&found[..3]).abs() > 0.05);
    assert!(mean(&found[3..]).abs() < 1e-12);
}

#[test]
fn a_photo_of_little_overlap_stays_as_it_is_and_one_without_any_too() {
    let mut problem = problem(3, uneven, 5);
    problem.photos.extend([(0, 1.5), (0, 1.5)]);
    problem.points.push(problem.observations.len());
    let o = |photo, log| Observation { photo, at: DVec2::splat(0.5), log: [log; 3] };
    problem.observations.extend([o(0, 4.0), o(3, 4.9)]);
    let found = solve(&problem, Levelling::Full);
    let quiet = found.photos[3].gain[0].abs();
    assert!(quiet < 0.3, "one observation is not believed: {quiet}");
    assert_eq!(found.photos[4].gain.map(f64::to_bits), [0.0_f64; 3].map(f64::to_bits));
    assert_eq!((found.fits[4].points, found.fits[4].group), (0, 4));
}

#[test]
fn a_clipped_highlight_stays_neutral() {
    let tone = PhotoTone { gain: [0.2, 0.0, -0.2], ..PhotoTone::default() };
    let grid = ToneGrid::new(&tone, Size::new(60, 40));
    let mut colours = [[255.0_f32; 3], [128.0; 3]];
    grid.apply(&[DVec2::new(30.0, 20.0); 2], [&mut colours], 255.0);
    let [white, grey] = colours;
    assert!((white[0] - white[1]).abs() < 1e-3 && (white[1] - white[2]).abs() < 1e-3, "{white:?}");
    assert!(grey[0] < 110.0 && grey[2] > 150.0, "{grey:?}");
}

#[test]
fn a_tone_reads_back_to_the_last_bit_and_an_unsound_one_is_known() {
    let tone = PhotoTone { field: vec![[0.1, 1.0 / 3.0, -0.2]; 16], ..uneven(3) };
    let text = serde_json::to_string(&tone).unwrap();
    assert_eq!(serde_json::from_str::<PhotoTone>(&text).unwrap(), tone);
    assert!(tone.is_sound());
    assert!(!PhotoTone { gain: [f64::NAN, 0.0, 0.0], ..uneven(1) }.is_sound());
    assert!(!PhotoTone { field: vec![[0.0; 3]; 3], ..uneven(1) }.is_sound());
}
