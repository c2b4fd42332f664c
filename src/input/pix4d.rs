//! `Pix4D`'s cameras: `…_calibrated_camera_parameters.txt`, and `…_offset.xyz` beside it.
//!
//! Format: the file's own header. Ten lines a photo: name, width and height; the rows of K; three radial terms; two
//! tangential ones, in OpenCV's order; the projection centre t; the rows of R; `m = K [R | −R t] X`, camera axes x right,
//! y down, z forward. Pixels are taken from the corner of the first one, which the program does not state. The three numbers of the
//! offset are added to every centre; without that file the centres stand as they are. Only perspective cameras are
//! read. The file holds no tie points.

use std::fs::File;
use std::io::{ErrorKind, Read as _};
use std::path::Path;

use glam::DVec3;

use super::cameras::{
    CameraOptions, Draft, DraftPhoto, MAX_PHOTOS, PhotoFolder, lens, pose, rotation_of_rows,
};
use crate::camera::LensModel;
use crate::geom::Size;
use crate::{Error, Result};

/// The first lines of such a file.
const HEADER: [&str; 7] = [
    "fileName imageWidth imageHeight",
    "camera matrix K [3x3]",
    "radial distortion [3x1]",
    "tangential distortion [2x1]",
    "camera position t [3x1]",
    "camera rotation R [3x3]",
    "camera model m = K [R|-Rt] X",
];
/// The end of such a file's name, and of that of the offset's.
const NAME_END: &str = "calibrated_camera_parameters.txt";
const OFFSET_END: &str = "offset.xyz";
/// The longest file, bytes: some half a kilobyte a photo.
const MAX_BYTES: u64 = 1 << 29;
/// The longest offset, bytes.
const MAX_OFFSET_BYTES: u64 = 4096;

/// Whether a file that begins with `head` is of this kind.
pub(super) fn is_pix4d(head: &str) -> bool {
    head.lines().next().is_some_and(|line| words_of(line).eq(words_of(HEADER[0])))
}

/// Reads the cameras at `path`.
///
/// # Errors
/// [`Error::Corrupt`] with the line for anything that is no such file; [`Error::Unsupported`] for cameras that are not
/// perspective; [`Error::Limit`] above 512 MiB or a million photos.
pub(super) fn read(path: &Path, options: &CameraOptions) -> Result<Draft> {
    let offset = offset_beside(path)?;
    let text = text_of(path, MAX_BYTES)?;
    let mut lines = Lines { path, inner: text.lines().enumerate(), number: 0 };
    lines.header()?;
    let folder = PhotoFolder(options.photos.as_deref());
    let mut draft = Draft::default();
    while let Some(title) = lines.next() {
        if draft.photos.len() == MAX_PHOTOS {
            let (limit, what) = (MAX_PHOTOS as u64, format!("{}: photos", path.display()));
            return Err(Error::Limit { what, limit, found: limit + 1 });
        }
        draft.photos.push(lines.photo(title, offset, folder)?);
    }
    Ok(draft)
}

fn words_of(line: &str) -> std::str::SplitWhitespace<'_> {
    line.trim_start_matches('\u{feff}').split_whitespace()
}

/// A text file of at most `limit` bytes.
fn text_of(path: &Path, limit: u64) -> Result<String> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut bytes = Vec::new();
    file.take(limit + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
    if bytes.len() as u64 > limit {
        let what = format!("{}: bytes", path.display());
        return Err(Error::Limit { what, limit, found: bytes.len() as u64 });
    }
    String::from_utf8(bytes).map_err(|e| {
        let place = format!("byte {}", e.utf8_error().valid_up_to());
        Error::corrupt(path, place, "text in UTF-8", "other bytes")
    })
}

/// The offset in the file beside `path`; none: zero.
fn offset_beside(path: &Path) -> Result<DVec3> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let Some(project) = name.strip_suffix(NAME_END) else { return Ok(DVec3::ZERO) };
    let beside = path.with_file_name(format!("{project}{OFFSET_END}"));
    let text = match text_of(&beside, MAX_OFFSET_BYTES) {
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {
            return Ok(DVec3::ZERO);
        }
        text => text?,
    };
    let text = text.replace(['(', ')', ',', ';'], " ");
    numbers::<3>(&text).map(DVec3::from).ok_or_else(|| {
        let found: String = text.chars().take(80).collect();
        Error::corrupt(&beside, "the whole", "three finite numbers", format!("{:?}", found.trim()))
    })
}

fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let mut words = words_of(text);
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        *number = words.next()?.parse().ok().filter(|v: &f64| v.is_finite())?;
    }
    words.next().is_none().then_some(numbers)
}

/// The lines of the file.
struct Lines<'a> {
    path: &'a Path,
    inner: std::iter::Enumerate<std::str::Lines<'a>>,
    /// Of the last line given, the first being 1.
    number: usize,
}

impl<'a> Lines<'a> {
    /// The next line that is not empty.
    fn next(&mut self) -> Option<&'a str> {
        let (number, line) = self.inner.find(|(_, line)| !line.trim().is_empty())?;
        self.number = number + 1;
        Some(line)
    }

    fn place(&self) -> String {
        format!("line {}", self.number)
    }

    fn corrupt(&self, expected: impl Into<String>, found: impl Into<String>) -> Error {
        Error::corrupt(self.path, self.place(), expected, found)
    }

    fn header(&mut self) -> Result<()> {
        for (i, wanted) in HEADER.into_iter().enumerate() {
            let line = self.next().unwrap_or_default();
            if words_of(line).eq(words_of(wanted)) {
                continue;
            }
            let found: String = line.chars().take(80).collect();
            if i == 0 {
                return Err(self.corrupt(format!("{wanted:?}"), format!("{found:?}")));
            }
            return Err(Error::Unsupported {
                path: self.path.to_path_buf(),
                what: format!("line {}: {found:?} in place of {wanted:?}", self.number),
                hint: Some("only perspective cameras of Pix4D are read".into()),
            });
        }
        Ok(())
    }

    fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N]> {
        let expected = format!("{N} finite numbers: {what}");
        let Some(line) = self.next() else {
            return Err(self.corrupt(format!("{expected} after it"), "the end of the file"));
        };
        numbers(line).ok_or_else(|| {
            let found: String = line.chars().take(80).collect();
            self.corrupt(expected, format!("{found:?}"))
        })
    }

    fn rows(&mut self, what: &str) -> Result<[[f64; 3]; 3]> {
        Ok([self.numbers(what)?, self.numbers(what)?, self.numbers(what)?])
    }

    /// The photo whose first line is `title`.
    fn photo(&mut self, title: &str, offset: DVec3, folder: PhotoFolder) -> Result<DraftPhoto> {
        let place = self.place();
        // 1. Name, which may hold blanks, and size.
        let mut words = title.trim().rsplitn(3, char::is_whitespace);
        let mut size = || words.next().and_then(|word| word.parse::<u32>().ok());
        let (height, width) = (size(), size());
        let (Some(width), Some(height), Some(name)) = (width, height, words.next()) else {
            let found: String = title.chars().take(80).collect();
            return Err(
                self.corrupt("the name of a photo, its width and its height", format!("{found:?}"))
            );
        };
        // 2. Interior orientation.
        let [[fx, skew, cx], [zero, fy, cy], last] = self.rows("a row of K")?;
        if (zero, last[0], last[1], last[2]) != (0.0, 0.0, 0.0, 1.0) {
            return Err(self.corrupt(
                "a K with 0 below the diagonal and 0 0 1 at the end",
                format!("{last:?}"),
            ));
        }
        let [k1, k2, k3] = self.numbers("radial distortion")?;
        let [p1, p2] = self.numbers("tangential distortion")?;
        let params = [fx, fy, cx, cy, skew, k1, k2, k3, 0.0, p1, p2];
        let lens = lens((self.path, &place), LensModel::Brown, Size::new(width, height), &params)?;
        // 3. Exterior orientation.
        let centre = DVec3::from(self.numbers::<3>("camera position")?);
        let rotation = rotation_of_rows(self.rows("a row of R")?);
        let pose =
            pose(rotation, centre + offset).map_err(|e| self.corrupt(e.expected, e.found))?;
        let name = folder.name_of(name.trim());
        Ok(DraftPhoto { name, place, orientation: lens.map(|lens| (lens, pose)) })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use glam::{DMat3, DVec2};

    use super::*;

    const GOOD: &str = "fileName imageWidth imageHeight \r\ncamera matrix K [3x3]\r\nradial distortion [3x1]\r\n\
        tangential distortion [2x1]\r\ncamera position t [3x1]\r\ncamera rotation R [3x3]\r\n\
        camera model m = K [R|-Rt] X\r\n\r\nfirst photo.JPG 4608 3456\r\n\
        3952.5 0 2233.25\r\n0 3950.25 1667.75\r\n0 0 1\r\n0.038 -0.017 0.02\r\n0.0024 0.0029\r\n\
        21.5 -29.5 30.75\r\n0.6 -0.8 0\r\n-0.8 -0.6 0\r\n0 0 -1\r\nb.JPG 4608 3456\r\n\
        3952.5 0 2233.25\r\n0 3952.5 1667.75\r\n0 0 1\r\n0 0 0\r\n0 0\r\n1 2 3\r\n1 0 0\r\n0 -1 0\r\n0 0 -1\r\n";

    fn read_text(text: &str, offset: Option<&str>) -> Result<Draft> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("site_calibrated_camera_parameters.txt");
        fs::write(&path, text).unwrap();
        if let Some(offset) = offset {
            fs::write(folder.path().join("site_offset.xyz"), offset).unwrap();
        }
        read(&path, &CameraOptions::default())
    }

    #[test]
    fn a_camera_sees_what_the_files_own_formula_says() {
        assert!(is_pix4d(GOOD));
        let draft = read_text(GOOD, Some("412000.5 5300000.25 100\n")).unwrap();
        assert_eq!(draft.photos.len(), 2);
        assert_eq!(draft.photos[0].name, "first photo.JPG");
        let (lens, pose) = draft.photos[0].orientation.as_ref().unwrap();
        // The formula: X' = R (X − t) in the file's own coordinates, then distortion, then K.
        let rotation = DMat3::from_cols(
            DVec3::new(0.6, -0.8, 0.0),
            DVec3::new(-0.8, -0.6, 0.0),
            DVec3::new(0.0, 0.0, -1.0),
        );
        let (t, offset) =
            (DVec3::new(21.5, -29.5, 30.75), DVec3::new(412_000.5, 5_300_000.25, 100.0));
        for point in [DVec3::new(25.0, -31.0, 2.0), DVec3::new(15.0, -24.0, 5.0)] {
            let q = rotation * (point - t);
            let (x, y) = (q.x / q.z, q.y / q.z);
            let s = x * x + y * y;
            let g = 1.0 + 0.038 * s - 0.017 * s * s + 0.02 * s * s * s;
            let xd = x * g + 2.0 * 0.0024 * x * y + 0.0029 * (s + 2.0 * x * x);
            let yd = y * g + 2.0 * 0.0029 * x * y + 0.0024 * (s + 2.0 * y * y);
            let wanted = DVec2::new(3952.5 * xd + 2233.25, 3950.25 * yd + 1667.75);
            let seen = pose.camera_from_ground(point + offset);
            let at = lens.photo_from_ray(seen.truncate() / seen.z).unwrap();
            assert!((at - wanted).length() < 1e-4, "{at} instead of {wanted}");
        }
        let draft = read_text(GOOD, None).unwrap();
        assert_eq!(
            draft.photos[1].orientation.as_ref().unwrap().1.centre_ground,
            DVec3::new(1.0, 2.0, 3.0)
        );
    }

    #[test]
    fn what_is_no_such_file_is_an_error_with_its_line() {
        for (from, to, what) in [
            ("tangential distortion", "fisheye distortion", "line 4"),
            (
                "4608 3456\r\n3952.5 0 2233.25\r\n0 3950",
                "4608\r\n3952.5 0 2233.25\r\n0 3950",
                "line 9: expected the name",
            ),
            ("0 3950.25", "1 3950.25", "below the diagonal"),
            ("0.038 -0.017", "0.038", "line 13: expected 3 finite numbers"),
            ("0.0024 0.0029", "inf 0.0029", "line 14"),
            ("-0.8 -0.6 0", "-0.8 0.6 0", "rotation matrix"),
            ("3952.5 0 2233.25\r\n0 3950", "-3952.5 0 2233.25\r\n0 3950", "positive focal"),
            ("0 -1 0\r\n0 0 -1\r\n", "", "the end of the file"),
            ("fileName", "fileNames", "line 1"),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let e = read_text(&GOOD.replace(from, to), None).unwrap_err();
            assert!(e.exit_code() == 2 && e.to_string().contains(what), "{e}");
        }
        let e = read_text(GOOD, Some("1 2")).unwrap_err().to_string();
        assert!(e.contains("site_offset.xyz") && e.contains("three finite numbers"), "{e}");
    }

    #[test]
    fn a_damaged_file_is_an_error_or_cameras() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("site_calibrated_camera_parameters.txt");
        for bad in super::super::mutation::damaged(GOOD.as_bytes(), 3000) {
            fs::write(&path, bad).unwrap();
            if let Err(e) = read(&path, &CameraOptions::default()) {
                assert_eq!(e.exit_code(), 2, "{e}");
            }
        }
    }
}
