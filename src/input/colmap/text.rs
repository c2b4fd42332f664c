//! The text form: `cameras.txt`, `images.txt` and `points3D.txt`.
//!
//! Numbers are separated by blanks, lines that begin with `#` and empty lines are passed over, with one exception: the
//! line after a photo's holds its keypoints, and is *empty* where it has none. A photo's name is the rest of its line:
//! it may hold spaces. A keypoint line is recognised by its digits, so that a file without such lines is an error rather
//! than half of its photos lost.

use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::str::FromStr;

use glam::DVec3;

use super::keypoints::Keypoints;
use super::model::{CameraRecord, ImageRecord, Model, WantedPoints};
use crate::camera::LensModel;
use crate::input::cameras::Draft;
use crate::{Error, Result};

/// The longest line that is held, bytes; only keypoint lines, which are not, are longer.
const MAX_LINE: usize = 1 << 16;

/// Reads the files.
pub(super) fn read(cameras: &Path, images: &Path, points: Option<&Path>) -> Result<Draft> {
    let mut model = Model::new(cameras, images);
    read_cameras(cameras, &mut model)?;
    read_images(images, &mut model)?;
    let (mut draft, mut wanted) = model.finish()?;
    if let Some(points) = points.filter(|_| !wanted.is_empty()) {
        read_points(points, &mut wanted)?;
    }
    draft.ties = wanted.into_ties();
    Ok(draft)
}

fn read_cameras(path: &Path, model: &mut Model) -> Result<()> {
    let mut lines = Lines::open(path)?;
    while lines.next_record()? {
        let mut words = Words { lines: &lines, rest: lines.text()? };
        let id = words.number("a camera id")?;
        let name = words.next("a camera model")?;
        let Some(lens_model) = LensModel::from_name(name) else {
            return Err(lines.corrupt("the name of a camera model of COLMAP", format!("{name:?}")));
        };
        let size = [words.number("a width")?, words.number("a height")?];
        let mut params = Vec::new();
        while !words.rest.is_empty() {
            params.push(words.number("a camera parameter")?);
        }
        let record = CameraRecord { id, model: lens_model, size, params: &params };
        model.add_camera(&lines.place(), &record)?;
    }
    Ok(())
}

fn read_images(path: &Path, model: &mut Model) -> Result<()> {
    let mut lines = Lines::open(path)?;
    while lines.next_record()? {
        let mut words = Words { lines: &lines, rest: lines.text()? };
        words.number::<u32>("a photo id")?;
        let mut pose = [0.0; 7];
        for value in &mut pose {
            *value = words.number("a pose")?;
        }
        let [qw, qx, qy, qz, tx, ty, tz] = pose;
        let camera = words.number("a camera id")?;
        let record = ImageRecord {
            quaternion: [qw, qx, qy, qz],
            translation: [tx, ty, tz],
            camera,
            name: words.rest,
        };
        model.add_image(lines.place(), &record)?;
        lines.read_keypoints(model)?;
    }
    Ok(())
}

fn read_points(path: &Path, wanted: &mut WantedPoints) -> Result<()> {
    let mut lines = Lines::open(path)?;
    // Of long tracks only the beginning of the line is needed.
    while lines.next_record_head()? {
        let mut words = Words { lines: &lines, rest: lines.head()? };
        let id = words.number("a point id")?;
        let mut position = [0.0; 3];
        for value in &mut position {
            *value = words.number("a position")?;
        }
        wanted.add(id, DVec3::from(position));
    }
    Ok(())
}

/// The words of one line.
struct Words<'a> {
    lines: &'a Lines<'a>,
    /// What is left, without blanks at either end.
    rest: &'a str,
}

impl<'a> Words<'a> {
    fn next(&mut self, what: &str) -> Result<&'a str> {
        if self.rest.is_empty() {
            return Err(self.lines.corrupt(what, "the end of the line"));
        }
        let (word, rest) = self.rest.split_once([' ', '\t']).unwrap_or((self.rest, ""));
        self.rest = rest.trim_start();
        Ok(word)
    }

    fn number<T: FromStr>(&mut self, what: &str) -> Result<T> {
        let word = self.next(what)?;
        word.parse().ok().ok_or_else(|| self.lines.corrupt(what, format!("{word:?}")))
    }
}

/// How long a line may be.
#[derive(Clone, Copy, PartialEq, Eq)]
enum LineLength {
    /// At most [`MAX_LINE`], but for comments.
    Limited,
    /// As long as it likes; what is beyond [`MAX_LINE`] is not held.
    Any,
}

/// A text file read line by line, with bounded memory.
struct Lines<'a> {
    path: &'a Path,
    inner: BufReader<File>,
    /// The current line, without its end.
    line: Vec<u8>,
    /// Its number, the first being 1.
    number: u64,
}

impl<'a> Lines<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let inner = BufReader::with_capacity(1 << 16, file);
        Ok(Self { path, inner, line: Vec::new(), number: 0 })
    }

    fn place(&self) -> String {
        format!("line {}", self.number)
    }

    fn corrupt(&self, expected: &str, found: impl Into<String>) -> Error {
        Error::corrupt(self.path, self.place(), expected, found)
    }

    /// The current line as text, without blanks at either end.
    fn text(&self) -> Result<&str> {
        match std::str::from_utf8(&self.line) {
            Ok(text) => Ok(text.trim()),
            Err(e) => {
                let found = format!("other bytes at column {}", e.valid_up_to() + 1);
                Err(self.corrupt("text in UTF-8", found))
            }
        }
    }

    /// Goes to the next line that is neither empty nor a comment; `false` at the end.
    fn next_record(&mut self) -> Result<bool> {
        self.next_record_of(LineLength::Limited)
    }

    /// As [`Self::next_record`], for lines of any length, of which only the beginning is held.
    fn next_record_head(&mut self) -> Result<bool> {
        self.next_record_of(LineLength::Any)
    }

    /// The first 512 bytes of the line as text, without a blank in front: more than the numbers that are looked for.
    fn head(&self) -> Result<&str> {
        let head = &self.line[..self.line.len().min(512)];
        match std::str::from_utf8(head) {
            Ok(text) => Ok(text.trim()),
            Err(_) => Err(self.corrupt("numbers", "other bytes")),
        }
    }

    fn next_record_of(&mut self, length: LineLength) -> Result<bool> {
        while self.next_line(length)? {
            // A comment of any length and encoding is none of our business.
            let first = self.line.iter().find(|b| !b.is_ascii_whitespace());
            if first.is_some_and(|&b| b != b'#') {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Reads a line; one that is longer than allowed is an error unless it is a comment. `false` at the end.
    fn next_line(&mut self, length: LineLength) -> Result<bool> {
        self.number += 1;
        self.line.clear();
        let mut is_end = true;
        loop {
            let chunk = self.inner.fill_buf().map_err(|e| Error::io(self.path, e))?;
            if chunk.is_empty() {
                return Ok(!is_end);
            }
            is_end = false;
            let end = chunk.iter().position(|&b| b == b'\n');
            let part = &chunk[..end.unwrap_or(chunk.len())];
            let room = MAX_LINE - self.line.len();
            self.line.extend_from_slice(&part[..part.len().min(room)]);
            let is_cut = part.len() > room;
            let used = end.map_or(chunk.len(), |e| e + 1);
            self.inner.consume(used);
            let may_be_cut = length == LineLength::Any || self.line.first() == Some(&b'#');
            if is_cut && !may_be_cut {
                return Err(self.corrupt("a line of at most 65536 bytes", "a longer one"));
            }
            if end.is_some() {
                return Ok(true);
            }
        }
    }

    /// Reads the line of a photo's keypoints, `X Y POINT3D_ID` each, or an empty line, or the end of the file.
    fn read_keypoints(&mut self, model: &mut Model) -> Result<()> {
        const EXPECTED: &str =
            "keypoints (X Y POINT3D_ID each) or an empty line after a photo's line";
        self.number += 1;
        let mut keypoints = Keypoints::new(model);
        loop {
            let chunk = self.inner.fill_buf().map_err(|e| Error::io(self.path, e))?;
            let end = chunk.iter().position(|&b| b == b'\n');
            let taken = keypoints.take(&chunk[..end.unwrap_or(chunk.len())]);
            let is_last = end.is_some() || chunk.is_empty();
            let used = end.map_or(chunk.len(), |e| e + 1);
            self.inner.consume(used);
            if let Err(alien) = taken {
                return Err(self.corrupt(EXPECTED, format!("{:?}", char::from(alien))));
            }
            if is_last {
                break;
            }
        }
        match keypoints.finish() {
            words if words.is_multiple_of(3) => Ok(()),
            words => Err(self.corrupt(EXPECTED, format!("{words} numbers"))),
        }
    }
}
