//! The text form: `cameras.txt` and `images.txt`.
//!
//! Numbers are separated by blanks, lines that begin with `#` and empty lines are passed over, with one exception: the
//! line after a photo's holds its keypoints, and is *empty* where it has none. A photo's name is the rest of its line:
//! it may hold spaces. A keypoint line is recognised by its digits, so that a file without such lines is an error rather
//! than half of its photos lost.

use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::str::FromStr;

use super::model::{CameraRecord, ImageRecord, Model};
use crate::camera::{CameraSet, LensModel};
use crate::{Error, Result};

/// The longest line that is held, bytes; only keypoint lines, which are not, are longer.
const MAX_LINE: usize = 1 << 16;

/// What a byte may be in a line of keypoints.
const ALIEN: u8 = 0;
const BLANK: u8 = 1;
const WORD: u8 = 2;

/// Blanks; digits, signs, points, exponents, "nan" and "inf"; anything else is alien.
const KEYPOINT_BYTES: [u8; 256] = {
    let mut table = [ALIEN; 256];
    let (blanks, words) = (*b" \t\r", *b"0123456789+-.eEnaif");
    let mut i = 0;
    while i < blanks.len() {
        table[blanks[i] as usize] = BLANK;
        i += 1;
    }
    i = 0;
    while i < words.len() {
        table[words[i] as usize] = WORD;
        i += 1;
    }
    table
};

/// Reads both files.
pub(super) fn read(cameras: &Path, images: &Path) -> Result<CameraSet> {
    let mut model = Model::new(cameras, images);
    read_cameras(cameras, &mut model)?;
    read_images(images, &mut model)?;
    model.finish()
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
        lines.skip_keypoints()?;
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
        while self.next_line()? {
            // A comment of any length and encoding is none of our business.
            let first = self.line.iter().find(|b| !b.is_ascii_whitespace());
            if first.is_some_and(|&b| b != b'#') {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Reads a line; one that is longer than allowed is an error unless it is a comment. `false` at the end.
    fn next_line(&mut self) -> Result<bool> {
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
            if is_cut && self.line.first() != Some(&b'#') {
                return Err(self.corrupt("a line of at most 65536 bytes", "a longer one"));
            }
            if end.is_some() {
                return Ok(true);
            }
        }
    }

    /// Passes over the line of a photo's keypoints, `X Y POINT3D_ID` each, or an empty line, or the end of the file.
    fn skip_keypoints(&mut self) -> Result<()> {
        self.number += 1;
        let (mut words, mut in_word) = (0_u64, false);
        loop {
            let chunk = self.inner.fill_buf().map_err(|e| Error::io(self.path, e))?;
            let end = chunk.iter().position(|&b| b == b'\n');
            let part = &chunk[..end.unwrap_or(chunk.len())];
            let mut alien = None;
            for &byte in part {
                let kind = KEYPOINT_BYTES[usize::from(byte)];
                words += u64::from(kind == WORD && !in_word);
                in_word = kind == WORD;
                if kind == ALIEN {
                    alien = Some(byte);
                    break;
                }
            }
            let is_last = end.is_some() || chunk.is_empty();
            let used = end.map_or(chunk.len(), |e| e + 1);
            self.inner.consume(used);
            let expected = "keypoints (X Y POINT3D_ID each) or an empty line after a photo's line";
            if let Some(byte) = alien {
                let found = format!("{:?}", char::from(byte));
                return Err(self.corrupt(expected, found));
            }
            if is_last && words % 3 != 0 {
                return Err(self.corrupt(expected, format!("{words} numbers")));
            }
            if is_last {
                return Ok(());
            }
        }
    }
}
