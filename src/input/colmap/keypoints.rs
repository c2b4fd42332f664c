//! [`Keypoints`]: the words of a line of keypoints, `X Y POINT3D_ID` each, taken byte by byte.

use glam::DVec2;

use super::model::{Keypoint, Model};

/// The longest word that is looked at, bytes; a number has fewer.
const MAX_WORD: usize = 64;

/// What a byte may be in a line of keypoints.
const ALIEN: u8 = 0;
const BLANK: u8 = 1;
const WORD: u8 = 2;

/// Blanks; digits, signs, points, exponents, "nan" and "inf"; anything else is alien.
const BYTES: [u8; 256] = {
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

/// A line of keypoints on its way into a model.
pub(super) struct Keypoints<'m, 'p> {
    model: &'m mut Model<'p>,
    /// The words of the current keypoint.
    words: [Vec<u8>; 3],
    count: u64,
    in_word: bool,
}

impl<'m, 'p> Keypoints<'m, 'p> {
    /// The keypoints of the photo that `model` got last.
    pub(super) fn new(model: &'m mut Model<'p>) -> Self {
        Self { model, words: Default::default(), count: 0, in_word: false }
    }

    /// Takes a part of the line.
    ///
    /// # Errors
    /// The first byte that no line of keypoints has.
    pub(super) fn take(&mut self, part: &[u8]) -> std::result::Result<(), u8> {
        for &byte in part {
            match BYTES[usize::from(byte)] {
                WORD => self.letter(byte),
                BLANK => self.end_word(),
                _ => return Err(byte),
            }
        }
        Ok(())
    }

    /// Ends the line; how many words it had.
    pub(super) fn finish(mut self) -> u64 {
        self.end_word();
        self.count
    }

    fn letter(&mut self, byte: u8) {
        let word = &mut self.words[(self.count % 3) as usize];
        if !self.in_word {
            word.clear();
            self.in_word = true;
        }
        if word.len() < MAX_WORD {
            word.push(byte);
        }
    }

    fn end_word(&mut self) {
        if !std::mem::take(&mut self.in_word) {
            return;
        }
        self.count += 1;
        let [x, y, point] = &self.words;
        if self.count.is_multiple_of(3) && point != b"-1" {
            let number = |word: &[u8]| std::str::from_utf8(word).ok()?.parse::<f64>().ok();
            // What is no number is no tie point either.
            let position = |word: &[u8]| number(word).unwrap_or(f64::NAN);
            self.model.add_keypoint(|| Keypoint {
                position_px: DVec2::new(position(x), position(y)),
                point: std::str::from_utf8(point)
                    .ok()
                    .and_then(|p| p.parse().ok())
                    .unwrap_or(u64::MAX),
            });
        }
    }
}
