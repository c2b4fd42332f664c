//! A text, word by word and line by line.

use super::super::byte_reader::ByteReader;
use super::number::number;
use crate::{Error, Result};

/// Longest word taken, bytes.
pub(super) const WORD_LIMIT: usize = 512;
/// Bytes of a word that an error shows.
const SHOWN_BYTES: usize = 40;
/// U+FEFF at the start of a text in UTF-8.
const BYTE_ORDER_MARK: [u8; 3] = [0xef, 0xbb, 0xbf];

/// What parts words, and whether lines may go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::input) enum Syntax {
    /// Blanks part words.
    Plain,
    /// Blanks part words, and a backslash at a line's end joins the next one to it.
    Continued,
    /// Blanks, commas and semicolons part words.
    Separated,
}

/// The words of a text; `#` at the start of a word begins a comment, which ends with the line.
#[derive(Debug)]
pub(in crate::input) struct Words<'a> {
    reader: ByteReader<'a>,
    syntax: Syntax,
    /// The current line, from 1.
    line: u64,
    is_in_comment: bool,
}

impl<'a> Words<'a> {
    /// The words of what `reader` gives.
    pub(in crate::input) fn new(mut reader: ByteReader<'a>, syntax: Syntax) -> Result<Self> {
        if reader.fill(3)?.starts_with(&BYTE_ORDER_MARK) {
            reader.consume(3);
        }
        Ok(Self { reader, syntax, line: 1, is_in_comment: false })
    }

    /// The current line, from 1.
    pub(in crate::input) fn line(&self) -> u64 {
        self.line
    }

    /// Whether nothing is left.
    pub(in crate::input) fn is_at_end(&mut self) -> Result<bool> {
        Ok(self.reader.fill(1)?.is_empty())
    }

    /// Whether no word is left on the line.
    pub(in crate::input) fn is_at_line_end(&mut self) -> Result<bool> {
        Ok(self.find_word()?.is_none())
    }

    /// The next word of the line, without going past its end; `None` if there is none.
    #[inline]
    pub(in crate::input) fn word(&mut self) -> Result<Option<&[u8]>> {
        let Some(length) = self.find_word()? else { return Ok(None) };
        Ok(Some(self.reader.take(length)))
    }

    /// The next word, on whatever line; `None` at the end of the text.
    pub(in crate::input) fn word_on_any_line(&mut self) -> Result<Option<&[u8]>> {
        loop {
            if let Some(length) = self.find_word()? {
                return Ok(Some(self.reader.take(length)));
            }
            if self.is_at_end()? {
                return Ok(None);
            }
            self.skip_line()?;
        }
    }

    /// The next word of the line as a number.
    pub(in crate::input) fn number(&mut self) -> Result<f64> {
        let Some(length) = self.find_word()? else {
            return Err(self.malformed("a number", "the end of the line"));
        };
        match number(&self.reader.fill(length)?[..length]) {
            Some(value) => {
                self.reader.consume(length);
                Ok(value)
            }
            None => Err(self.malformed_word("a number", length)),
        }
    }

    /// Goes to the next word of the line and gives its length.
    #[inline]
    fn find_word(&mut self) -> Result<Option<usize>> {
        loop {
            // 1. Past the blanks.
            let (syntax, kinds) = (self.syntax, kinds(self.syntax));
            let is_blank = |b: &u8| kinds[usize::from(*b)] == Kind::Blank;
            let bytes = self.reader.fill(WORD_LIMIT + 3)?;
            let Some(blanks) = bytes.iter().position(|b| !is_blank(b)) else {
                let all = bytes.len();
                self.reader.consume(all);
                if all == 0 {
                    return Ok(None);
                }
                continue;
            };
            self.reader.consume(blanks);
            // 2. To the end of the word, a byte beyond the longest at most.
            let bytes = self.reader.fill(WORD_LIMIT + 3)?;
            match bytes[0] {
                b'\n' => return Ok(None),
                b'#' => {
                    self.is_in_comment = true;
                    return Ok(None);
                }
                _ => {}
            }
            let window = &bytes[..bytes.len().min(WORD_LIMIT + 1)];
            let ends = |b: &u8| kinds[usize::from(*b)] != Kind::Word;
            let length = window.iter().position(ends).unwrap_or(window.len());
            if length > WORD_LIMIT {
                let expected = format!("a word of at most {WORD_LIMIT} bytes");
                return Err(self.malformed_word(expected, length));
            }
            // 3. A backslash at its end may join the next line to this one.
            let joint = match (syntax, bytes[length - 1], &bytes[length..]) {
                (Syntax::Continued, b'\\', [b'\n', ..]) => 1,
                (Syntax::Continued, b'\\', [b'\r', b'\n', ..]) => 2,
                _ => return Ok(Some(length)),
            };
            if length > 1 {
                // The backslash is met again when this word has been gone past.
                return Ok(Some(length - 1));
            }
            self.reader.consume(1 + joint);
            self.line += 1;
        }
    }

    /// Goes behind the end of the line, and of the lines joined to it.
    pub(in crate::input) fn skip_line(&mut self) -> Result<()> {
        let is_continued = self.syntax == Syntax::Continued && !self.is_in_comment;
        self.is_in_comment = false;
        let mut before = [0; 2];
        loop {
            let bytes = self.reader.fill(1)?;
            let Some(end) = bytes.iter().position(|&b| b == b'\n') else {
                let all = bytes.len();
                before = last_two(before, bytes);
                self.reader.consume(all);
                if all == 0 {
                    return Ok(());
                }
                continue;
            };
            before = last_two(before, &bytes[..end]);
            self.reader.consume(end + 1);
            self.line += 1;
            if !(is_continued && matches!(before, [_, b'\\'] | [b'\\', b'\r'])) {
                return Ok(());
            }
            before = [0; 2];
        }
    }

    /// The error for what stands at the current place of the line.
    #[cold]
    pub(in crate::input) fn malformed(
        &self,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Error {
        Error::corrupt(self.reader.path(), format!("line {}", self.line), expected, found)
    }

    /// The error for the next word, of that length.
    #[cold]
    fn malformed_word(&mut self, expected: impl Into<String>, length: usize) -> Error {
        match self.reader.fill(length) {
            Ok(bytes) => {
                let found = shown(&bytes[..length.min(bytes.len())]);
                self.malformed(expected, found)
            }
            Err(error) => error,
        }
    }
}

/// A word as an error shows it.
pub(in crate::input) fn shown(word: &[u8]) -> String {
    let text: String =
        String::from_utf8_lossy(&word[..word.len().min(SHOWN_BYTES)]).escape_debug().collect();
    if word.len() > SHOWN_BYTES { format!("`{text}…`") } else { format!("`{text}`") }
}

/// What a byte is to a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Word,
    Blank,
    End,
}

/// The kind of each byte.
#[inline]
fn kinds(syntax: Syntax) -> &'static [Kind; 256] {
    static PLAIN: [Kind; 256] = table(b" \t\r\x0b\x0c");
    static SEPARATED: [Kind; 256] = table(b" \t\r\x0b\x0c,;");
    match syntax {
        Syntax::Plain | Syntax::Continued => &PLAIN,
        Syntax::Separated => &SEPARATED,
    }
}

const fn table(blanks: &[u8]) -> [Kind; 256] {
    let mut kinds = [Kind::Word; 256];
    let mut k = 0;
    while k < blanks.len() {
        kinds[blanks[k] as usize] = Kind::Blank;
        k += 1;
    }
    kinds[b'\n' as usize] = Kind::End;
    kinds
}

/// The last two bytes of `before` and then `bytes`.
fn last_two(before: [u8; 2], bytes: &[u8]) -> [u8; 2] {
    match bytes {
        [] => before,
        [one] => [before[1], *one],
        [.., a, b] => [*a, *b],
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn words(text: &[u8], syntax: Syntax) -> Words<'_> {
        Words::new(ByteReader::of_memory(Path::new("a.txt"), text), syntax).unwrap()
    }

    /// The lines that have words, with their numbers.
    fn lines(text: &[u8], syntax: Syntax) -> Vec<(u64, Vec<String>)> {
        let (mut words, mut lines) = (words(text, syntax), Vec::new());
        while !words.is_at_end().unwrap() {
            let mut line = Vec::new();
            while let Some(word) = words.word().unwrap() {
                line.push(String::from_utf8(word.to_vec()).unwrap());
            }
            if !line.is_empty() {
                lines.push((words.line(), line));
            }
            words.skip_line().unwrap();
        }
        lines
    }

    fn line(number: u64, words: &str) -> (u64, Vec<String>) {
        (number, words.split(' ').map(str::to_owned).collect())
    }

    #[test]
    fn words_are_parted_by_blanks_and_comments_are_passed_over() {
        let text = b"\xef\xbb\xbfa  b\r\n\t# c d\n\n e # f\ng#h";
        let expected = [line(1, "a b"), line(4, "e"), line(5, "g#h")];
        assert_eq!(lines(text, Syntax::Plain), expected);
        assert_eq!(lines(b"1,2; 3\t,4\n;", Syntax::Separated), [line(1, "1 2 3 4")]);
    }

    #[test]
    fn a_backslash_joins_lines_but_not_behind_a_comment() {
        let text = b"a \\\n b\\\r\nc\nd # C:\\\ne\\f \\\n\\\n\ng \\";
        let expected = [line(3, "a b c"), line(4, "d"), line(7, "e\\f"), line(8, "g \\")];
        assert_eq!(lines(text, Syntax::Continued), expected);
        assert_eq!(lines(b"a \\\nb", Syntax::Plain), [line(1, "a \\"), line(2, "b")]);
    }

    #[test]
    fn a_line_that_is_passed_over_takes_the_joined_ones_with_it_across_the_buffer() {
        for end in ["\\\n", "\\\r\n"] {
            for length in (1 << 19) - 4..(1 << 19) + 2 {
                let text = format!("{}{end}b\nc", "a ".repeat(length / 2));
                let mut words = words(text.as_bytes(), Syntax::Continued);
                assert_eq!(words.word().unwrap(), Some(&b"a"[..]));
                words.skip_line().unwrap();
                assert_eq!(words.word().unwrap(), Some(&b"c"[..]));
                assert_eq!(words.line(), 3);
            }
        }
    }

    #[test]
    fn a_word_beyond_the_limit_is_an_error_that_names_the_line() {
        let text = format!("a\n{}", "1".repeat(WORD_LIMIT));
        let mut fitting = words(text.as_bytes(), Syntax::Plain);
        fitting.skip_line().unwrap();
        assert_eq!(fitting.word().unwrap().unwrap().len(), WORD_LIMIT);
        let text = format!("{text}1");
        let mut beyond = words(text.as_bytes(), Syntax::Plain);
        beyond.skip_line().unwrap();
        let error = beyond.word().unwrap_err().to_string();
        assert!(error.starts_with("a.txt: line 2: expected a word of at most 512"), "{error}");
    }

    #[test]
    fn a_number_that_is_none_is_named_with_its_line() {
        let mut words = words(b"1\n2.5 x", Syntax::Plain);
        words.skip_line().unwrap();
        assert_eq!(words.number().unwrap().to_bits(), 2.5_f64.to_bits());
        let error = words.number().unwrap_err().to_string();
        assert_eq!(error, "a.txt: line 2: expected a number, found `x`");
        words.word().unwrap();
        let error = words.number().unwrap_err().to_string();
        assert_eq!(error, "a.txt: line 2: expected a number, found the end of the line");
    }
}
