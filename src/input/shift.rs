//! [`Shift`]: from the reduced coordinates of a mesh to the ground.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::{Error, Result};

/// Bytes of an ODM offset file that are read: two short lines, which more may follow.
const HEAD_BYTES: u64 = 4096;

/// What is added to reduced coordinates.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Shift {
    /// Metres along x, y and z.
    Stated([f64; 3]),
    /// The offset in `odm_georeferencing/coords.txt` of an ODM project, by which both its meshes and its cameras are
    /// reduced: a line with the coordinate system, such as `WGS84 UTM 34N`, and one with east and north, metres.
    OfOdm(PathBuf),
}

impl Shift {
    /// Metres along x, y and z.
    ///
    /// # Errors
    /// [`Error::Io`] if ODM's file cannot be read; [`Error::Corrupt`] with the line for what is no such file.
    pub fn metres(&self) -> Result<[f64; 3]> {
        match self {
            Self::Stated(metres) => Ok(*metres),
            Self::OfOdm(path) => odm_offset(path),
        }
    }
}

fn odm_offset(path: &Path) -> Result<[f64; 3]> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut head = Vec::new();
    file.take(HEAD_BYTES).read_to_end(&mut head).map_err(|e| Error::io(path, e))?;
    let head = String::from_utf8_lossy(&head);
    let mut lines = head.lines();
    let mut line = || lines.next().unwrap_or_default().trim();
    let (system, offset) = (line(), line());
    if !["WGS84", "EPSG", "+proj"].iter().any(|word| system.starts_with(word)) {
        return Err(malformed(path, 1, "a coordinate system such as WGS84 UTM 34N", system));
    }
    let number = |word: &str| word.parse::<f64>().ok().filter(|v| v.is_finite());
    let numbers: Option<Vec<f64>> = offset.split_whitespace().map(number).collect();
    match numbers.as_deref() {
        // `+ 0.0` turns −0 into 0.
        Some(&[east, north]) => Ok([east + 0.0, north + 0.0, 0.0]),
        _ => Err(malformed(path, 2, "an offset, two finite numbers", offset)),
    }
}

fn malformed(path: &Path, line: u32, expected: &str, found: &str) -> Error {
    let found: String = found.chars().take(80).collect();
    Error::corrupt(path, format!("line {line}"), expected, format!("{found:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_offset_of_odm_stands_in_its_second_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("coords.txt");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Shift::OfOdm(path.clone()).metres().map_err(|e| e.to_string())
        };
        let expected = Ok([512_345.0, 4_207_890.0, 0.0]);
        assert_eq!(read("WGS84 UTM 34N\n512345.0 4207890.0\n"), expected);
        assert_eq!(read("WGS84 UTM 34N\r\n512345 4207890\r\n-3.5 8.25 120.1\r\n"), expected);
        for (text, said) in [
            ("", "line 1: expected a coordinate system"),
            ("512345 4207890\n", "line 1"),
            ("WGS84 UTM 34N\n", "line 2: expected an offset"),
            ("WGS84 UTM 34N\n512345\n", "line 2"),
            ("WGS84 UTM 34N\n512345 nan\n", "line 2"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains("coords.txt") && error.contains(said), "{error}");
        }
        let missing = Shift::OfOdm(folder.path().join("none.txt")).metres().unwrap_err();
        assert_eq!(missing.exit_code(), 2);
        let stated = Shift::Stated([1.0, 2.0, 3.0]);
        assert_eq!(stated.metres().map_err(|e| e.to_string()), Ok([1.0, 2.0, 3.0]));
    }
}
