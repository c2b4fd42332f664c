//! Bundler's `bundle.out`, with the list of its images beside it.
//!
//! ```text
//! # Bundle file v0.3
//! cameras points
//! per camera:  f k1 k2, three rows of R, t
//! per point:   X Y Z, r g b, views, then per view: camera key x y
//! ```
//!
//! `P = R X + t`, camera axes x right, y *up*, looking along −z; `p = −P / P.z`, `p' = f (1 + k1 |p|² + k2 |p|⁴) p`, from
//! the picture's centre, y *up*: the README of Bundler 0.4. A camera with `f = 0` was not oriented. Names stand in the list,
//! a line each, perhaps followed by `0` and a focal length; the photos' sizes are those of their files.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use glam::{DMat3, DVec2, DVec3};

use super::byte_reader::ByteReader;
use super::cameras::{
    CameraOptions, Draft, DraftPhoto, MAX_PHOTOS, MOST_TIES, PhotoFolder, Thinned, Tie, lens, pose,
    rotation_of_rows,
};
use super::text::{Syntax, Words, number, shown};
use crate::camera::{Lens, LensModel, Pose};
use crate::geom::Size;
use crate::{Error, Result};

/// The longest list of images, bytes.
const MAX_LIST_BYTES: u64 = 1 << 28;

/// Reads a Bundler file and its list of images.
///
/// # Errors
/// [`Error::Corrupt`] with the line for what is no such file, or a list of another length; [`Error::Usage`] without the
/// folder of the photos; [`Error::Limit`] for more photos than a set may have.
pub(super) fn read(path: &Path, options: &CameraOptions) -> Result<Draft> {
    let list = options.image_list.clone().unwrap_or_else(|| path.with_file_name("list.txt"));
    let paths = read_list(&list)?;
    let mut file = Bundle { words: Words::new(ByteReader::open(path, 0)?, Syntax::Plain)? };
    let cameras = file.count("the number of cameras")?;
    let points = file.count("the number of points")?;
    if cameras > MAX_PHOTOS as u64 {
        let what = format!("{}: photos", path.display());
        return Err(Error::Limit { what, limit: MAX_PHOTOS as u64, found: cameras });
    }
    if cameras != paths.len() as u64 {
        let (place, expected) =
            ("the whole", format!("{cameras} images, as {} has", path.display()));
        return Err(Error::corrupt(&list, place, expected, format!("{} lines", paths.len())));
    }
    let photos = PhotoFolder(options.photos.as_deref());
    let mut draft = Draft::default();
    let mut sizes = Vec::new();
    for old_path in &paths {
        let name = photos.name_of(old_path);
        let place = format!("line {}", file.words.line());
        let (orientation, size) = file.camera(path, &name, photos)?;
        draft.photos.push(DraftPhoto { name, place, orientation });
        sizes.push(size);
    }
    let mut ties = Thinned::new(MOST_TIES);
    for _ in 0..points {
        file.point(&sizes, &mut ties)?;
    }
    draft.ties = ties.into_items();
    Ok(draft)
}

/// The paths in a list of images.
fn read_list(path: &Path) -> Result<Vec<String>> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut bytes = Vec::new();
    file.take(MAX_LIST_BYTES + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
    if bytes.len() as u64 > MAX_LIST_BYTES {
        let what = format!("{}: bytes of a list of images", path.display());
        return Err(Error::Limit { what, limit: MAX_LIST_BYTES, found: bytes.len() as u64 });
    }
    let text = String::from_utf8(bytes).map_err(|e| {
        let place = format!("byte {}", e.utf8_error().valid_up_to());
        Error::corrupt(path, place, "text in UTF-8", "other bytes")
    })?;
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    Ok(lines.map(|line| without_focal(line).to_owned()).collect())
}

/// A line of the list without `0` and focal length at its end.
fn without_focal(line: &str) -> &str {
    let cut =
        |line: &str| line.rsplit_once([' ', '\t']).map(|(a, b)| (a.trim_end().len(), b.to_owned()));
    if let Some((end, focal)) = cut(line)
        && focal.parse::<f64>().is_ok()
        && let Some((end, fisheye)) = cut(&line[..end])
        && matches!(fisheye.as_str(), "0" | "1")
    {
        return &line[..end];
    }
    line
}

type Orientation = std::result::Result<(Lens, Pose), String>;

/// The numbers of a Bundler file.
struct Bundle<'a> {
    words: Words<'a>,
}

impl Bundle<'_> {
    fn number(&mut self, what: &str) -> Result<f64> {
        let word = match self.words.word_on_any_line()? {
            Some(word) => number(word).filter(|v| v.is_finite()).ok_or_else(|| shown(word)),
            None => Err("the end of the file".into()),
        };
        word.map_err(|found| self.words.malformed(what, found))
    }

    fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.number(what)?;
        }
        Ok(values)
    }

    fn count(&mut self, what: &str) -> Result<u64> {
        let word = match self.words.word_on_any_line()? {
            Some(word) => {
                let count = str::from_utf8(word).ok().and_then(|w| w.parse().ok());
                count.ok_or_else(|| shown(word))
            }
            None => Err("the end of the file".into()),
        };
        word.map_err(|found| self.words.malformed(what, found))
    }

    /// A camera: lens and pose, and the photo's size.
    fn camera(
        &mut self,
        path: &Path,
        name: &str,
        photos: PhotoFolder,
    ) -> Result<(Orientation, Option<Size>)> {
        let place = format!("line {}", self.words.line());
        let [focal, k1, k2] = self.numbers("a focal length and two coefficients")?;
        let rows = [(); 3].map(|()| self.numbers::<3>("a row of a rotation"));
        let [a, b, c] = rows;
        let rotation = rotation_of_rows([a?, b?, c?]);
        let t = DVec3::from(self.numbers("a translation")?);
        if focal == 0.0 {
            return Ok((Err("it is not oriented".into()), None));
        }
        // y up and z backward become y down and z forward.
        let turned = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)) * rotation;
        let pose = pose(turned, -(rotation.transpose() * t))
            .map_err(|e| Error::corrupt(path, place.clone(), e.expected, e.found))?;
        let size = match photos.size_of(path, name)? {
            Ok(size) => size,
            Err(reason) => return Ok((Err(reason), None)),
        };
        let centre = centre(size);
        let params = [focal, centre.x, centre.y, k1, k2];
        let lens = lens((path, &place), LensModel::Radial, size, &params)?;
        Ok((lens.map(|lens| (lens, pose)), Some(size)))
    }

    /// A point and its views.
    fn point(&mut self, sizes: &[Option<Size>], ties: &mut Thinned<Tie>) -> Result<()> {
        let point_ground = DVec3::from(self.numbers("a point")?);
        self.numbers::<3>("a colour")?;
        let views = self.count("the number of views")?;
        for _ in 0..views {
            let photo = self.count("the number of a camera")?;
            self.count("the number of a key")?;
            let [x, y] = self.numbers("a position")?;
            let photo = usize::try_from(photo).ok().filter(|&photo| photo < sizes.len());
            let Some(photo) = photo else {
                let expected = format!("the number of a camera below {}", sizes.len());
                return Err(self.words.malformed(expected, "a greater one"));
            };
            if let Some(size) = sizes[photo] {
                let position_px = centre(size) + DVec2::new(x, -y);
                ties.offer(|| Tie { photo, position_px, point_ground });
            }
        }
        Ok(())
    }
}

/// The picture's centre, pixels.
fn centre(size: Size) -> DVec2 {
    DVec2::new(f64::from(size.width), f64::from(size.height)) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_the_list_may_end_in_a_focal_length() {
        assert_eq!(without_focal("a b.jpg 0 1234.5"), "a b.jpg");
        assert_eq!(without_focal("images/a.jpg"), "images/a.jpg");
        assert_eq!(without_focal("tower 2.jpg"), "tower 2.jpg");
        assert_eq!(without_focal("a 7 12"), "a 7 12");
    }
}
