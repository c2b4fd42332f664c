//! `groundel info`: what is in a file or folder, told from its first bytes, not from its name.

mod describe;
mod tiff;

pub(super) use describe::describe;
