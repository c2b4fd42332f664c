//! `groundel ortho`: stores → plan → tiles → files → report.

use super::config::Config;
use crate::{Error, Result};

/// How a command that made all it was asked for has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExitStatus {
    /// Everything was used.
    Done,
    /// Some photos had to be left out; each was named.
    PhotosLeftOut,
}

impl ExitStatus {
    /// The exit code of the command.
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::PhotosLeftOut => 1,
        }
    }
}

/// Makes the mosaic that `config` asks for.
///
/// # Errors
/// Bad input, a job over budget, or a failed file operation; no file bears a final name then.
pub(super) fn run(config: &Config) -> Result<ExitStatus> {
    Err(Error::unsupported(&config.out, "rendering"))
}
