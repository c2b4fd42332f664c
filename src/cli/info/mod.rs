//! `groundel info`: what is in a file or folder, told from its first bytes, not from its name.

mod cameras;
mod describe;
mod job;
mod mesh;
mod photo;
mod settings;
mod tiff;

pub(super) use describe::describe;
