//! `--sections`: the upper ends of the slabs of a batch of parallel sections, and what their files are called.

use std::path::{Path, PathBuf};

use super::frame_choice::{Fit, FrameChoice};
use crate::frame::{Cylinder, FrameSpec, Plane};
use crate::{Error, Result};

/// More sections in a run than this are likely a mistyped step.
const MOST: usize = 1000;
/// Room for rounding at the upper end, steps.
const SLACK: f64 = 1e-9;
/// Names hold elevations to so many digits a metre.
const NAMED_DIGITS: f64 = 1e9;

type Parsed<T> = std::result::Result<T, String>;

/// `from`, `to`, `step` as a list that makes sense.
pub(super) fn check([from, to, step]: [f64; 3]) -> Parsed<[f64; 3]> {
    if ![from, to, step].iter().all(|value| value.is_finite()) {
        return Err("expected finite numbers".into());
    }
    if from > to || step <= 0.0 {
        let expected = "expected FROM not above TO and STEP greater than 0";
        return Err(format!("{expected}, found {from}, {to} and {step}"));
    }
    let count = (to - from) / step + 1.0;
    if count > MOST as f64 {
        return Err(format!("expected at most {MOST} sections, found {count:.0}"));
    }
    let all = elevations([from, to, step]);
    if all.windows(2).any(|pair| name(pair[0]) == name(pair[1])) {
        return Err(format!("expected a STEP that tells sections apart, found {step}"));
    }
    Ok([from, to, step])
}

/// The elevations of the sections, ascending: `from + k · step` up to `to`, without adding up rounding.
pub(super) fn elevations([from, to, step]: [f64; 3]) -> Vec<f64> {
    let all = (0..=MOST).map(|k| from + k as f64 * step);
    all.take_while(|&elevation| elevation <= to + SLACK * step).collect()
}

/// `frame` with the slab of the highest of the sections.
///
/// # Errors
/// [`Error::Usage`] if the frame has no sections, or states an upper end of its own or a lower end above a section.
pub(super) fn over_all(frame: FrameChoice, sections: &[f64]) -> Result<FrameChoice> {
    let (Some(&first), Some(&last)) = (sections.first(), sections.last()) else {
        return Ok(frame);
    };
    let slab = |stated: Option<[f64; 2]>| {
        let [low, high] = stated.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        if high < f64::INFINITY {
            return Err(Error::usage(format!(
                "--sections: the sections end where they are, expected `elevation` MIN,inf, found {low},{high}"
            )));
        }
        if low >= first {
            return Err(Error::usage(format!(
                "--sections: expected sections above the least elevation {low}, found one at {first}"
            )));
        }
        Ok(Some([low, last]))
    };
    Ok(match frame {
        FrameChoice::Fit(fit) => FrameChoice::Fit(Fit { elevation: slab(fit.elevation)?, ..fit }),
        FrameChoice::Stated(FrameSpec::Plane(plane)) => {
            let elevation = slab(plane.elevation)?;
            FrameChoice::Stated(FrameSpec::Plane(Plane { elevation, ..plane }))
        }
        FrameChoice::Stated(FrameSpec::Cylinder(cylinder)) => {
            let elevation = slab(cylinder.elevation)?;
            FrameChoice::Stated(FrameSpec::Cylinder(Cylinder { elevation, ..cylinder }))
        }
        FrameChoice::Stated(FrameSpec::Perspective(_)) => {
            return Err(Error::usage("--sections does not go with a perspective view"));
        }
    })
}

/// The mosaic of a section: `<out stem>_<elevation>m.tif` beside `out`.
pub(super) fn file(out: &Path, elevation: f64) -> PathBuf {
    let mut name = out.file_stem().unwrap_or_default().to_os_string();
    name.push(format!("_{}m.", self::name(elevation)));
    name.push(out.extension().unwrap_or_default());
    out.with_file_name(name)
}

/// The shortest decimal number of an elevation to the nanometre.
fn name(elevation: f64) -> String {
    let rounded = (elevation * NAMED_DIGITS).round() / NAMED_DIGITS;
    // `+ 0.0` turns −0 into 0; what is too great to be rounded has no such digits.
    let rounded = if rounded.is_finite() { rounded + 0.0 } else { elevation };
    format!("{rounded}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_lie_at_whole_steps_and_are_called_by_the_shortest_number() {
        let names = |list| elevations(list).into_iter().map(name).collect::<Vec<_>>();
        assert_eq!(names([-0.5, 0.5, 0.25]), ["-0.5", "-0.25", "0", "0.25", "0.5"]);
        // 0.1 + 2 · 0.1 is more than 0.3, by rounding alone.
        assert_eq!(names([0.1, 0.3, 0.1]), ["0.1", "0.2", "0.3"]);
        assert_eq!(names([1.0, 1.9, 0.5]), ["1", "1.5"]);
        assert_eq!(names([7.0, 7.0, 1.0]), ["7"]);
        let thousand = elevations([0.0, 99.9, 0.1]);
        assert_eq!((thousand.len(), thousand[999].to_bits()), (1000, (999.0 * 0.1_f64).to_bits()));
        let file = |out: &str| file(Path::new(out), -0.5);
        assert_eq!(file("a/nave.tif"), Path::new("a/nave_-0.5m.tif"));
        assert_eq!(file("nave 1.2.tiff"), Path::new("nave 1.2_-0.5m.tiff"));
    }

    #[test]
    fn lists_that_make_no_sense_are_refused() {
        assert!(check([0.0, 99.9, 0.1]).is_ok() && check([1.0, 1.0, 0.5]).is_ok());
        for (list, found) in [
            ([0.0, 1.0, 0.0], "greater than 0"),
            ([0.0, 1.0, -1.0], "greater than 0"),
            ([1.0, 0.0, 0.1], "not above TO"),
            ([0.0, f64::INFINITY, 1.0], "finite"),
            ([0.0, 100.1, 0.1], "at most 1000"),
            ([0.0, 1e-9, 1e-10], "tells sections apart"),
            ([1e15, 1e15 + 1.0, 1e-2], "tells sections apart"),
        ] {
            let error = check(list).unwrap_err();
            assert!(error.contains(found), "{list:?}: {error}");
        }
    }

    #[test]
    fn the_slab_reaches_to_the_highest_section_and_none_of_its_own_may_be_stated() {
        let over = |elevation| {
            let plane = FrameSpec::Plane(Plane { elevation, ..Plane::top() });
            over_all(FrameChoice::Stated(plane), &[1.0, 2.0])
        };
        let slab = |elevation| match over(elevation).unwrap() {
            FrameChoice::Stated(FrameSpec::Plane(plane)) => plane.elevation,
            other => panic!("{other:?}"),
        };
        assert_eq!(slab(None), Some([f64::NEG_INFINITY, 2.0]));
        assert_eq!(slab(Some([0.5, f64::INFINITY])), Some([0.5, 2.0]));
        let error = over(Some([0.5, 9.0])).unwrap_err().to_string();
        assert!(error.contains("MIN,inf, found 0.5,9"), "{error}");
        let error = over(Some([1.0, f64::INFINITY])).unwrap_err().to_string();
        assert!(error.contains("above the least elevation 1"), "{error}");
    }
}
