//! Checks that several kinds of frame share, and the error they give.

use glam::DVec3;

/// Axes may be this far from orthonormal before they are refused: a file written with six digits passes.
const TOLERANCE: f64 = 1e-6;

/// Axes this near to orthonormal are taken as they are, so that written axes read back to the same bits.
const KEEP: f64 = 1e-12;

/// What is wrong with a frame: the key, what it demands and what was given.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key}: expected {expected}, found {found}")]
pub struct FrameError {
    /// The key, as in a frame file.
    pub key: &'static str,
    /// What it demands.
    pub expected: String,
    /// What was given.
    pub found: String,
}

impl FrameError {
    pub(super) fn new(
        key: &'static str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self { key, expected: expected.into(), found: found.into() }
    }
}

/// A point or vector of finite coordinates.
pub(super) fn finite(key: &'static str, v: [f64; 3]) -> Result<DVec3, FrameError> {
    let p = DVec3::from(v);
    if p.is_finite() {
        Ok(p)
    } else {
        Err(FrameError::new(key, "three finite numbers", format!("{v:?}")))
    }
}

/// A positive, finite length.
pub(super) fn positive(key: &'static str, value: f64) -> Result<f64, FrameError> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(FrameError::new(key, "a positive, finite number of metres", format!("{value:?}")))
    }
}

/// `[u_min, v_min, u_max, v_max]`, finite and ordered.
pub(super) fn extent(e: [f64; 4]) -> Result<[f64; 4], FrameError> {
    if e.iter().all(|c| c.is_finite()) && e[0] < e[2] && e[1] < e[3] {
        Ok(e)
    } else {
        let expected = "finite [u_min, v_min, u_max, v_max] with u_min < u_max and v_min < v_max";
        Err(FrameError::new("extent", expected, format!("{e:?}")))
    }
}

/// `[min, max]` of elevation; either may be infinite.
pub(super) fn elevation(e: [f64; 2]) -> Result<[f64; 2], FrameError> {
    if e[0] < e[1] {
        Ok(e)
    } else {
        Err(FrameError::new("elevation", "[min, max] with min < max", format!("{e:?}")))
    }
}

/// Two axes made orthonormal: as they are if they are so to 1e-12; else, within 1e-6, the first normalised and the
/// second turned square to it; else an error that shows lengths and angle.
pub(super) fn orthonormal(
    keys: [&'static str; 2],
    first: DVec3,
    second: DVec3,
) -> Result<[DVec3; 2], FrameError> {
    for (key, axis) in keys.into_iter().zip([first, second]) {
        let length = axis.length();
        if (length - 1.0).abs() > TOLERANCE {
            return Err(FrameError::new(key, "a unit vector", format!("length {length:?}")));
        }
    }
    let cosine = first.dot(second);
    if cosine.abs() > TOLERANCE {
        let angle = libm::acos(cosine / (first.length() * second.length())).to_degrees();
        let expected = format!("a right angle with {}", keys[0]);
        return Err(FrameError::new(keys[1], expected, format!("{angle:.6} degrees")));
    }
    let off = [first.length() - 1.0, second.length() - 1.0, cosine];
    if off.iter().all(|o| o.abs() <= KEEP) {
        return Ok([first, second]);
    }
    // Division, so that a vector along a coordinate axis becomes that axis exactly.
    let first = first / first.length();
    let second = second - first * second.dot(first);
    Ok([first, second / second.length()])
}
