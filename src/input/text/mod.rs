//! Text as meshes are written in it: lines, words and numbers.
//!
//! In: a file, compressed or not. Out: its words one by one, and numbers to the last bit. Promises: memory does not
//! grow with a line; a word of any length beyond [`words::WORD_LIMIT`] is an error that names the line.

mod number;
mod words;

pub(super) use number::number;
pub(super) use words::{Syntax, Words, shown};
