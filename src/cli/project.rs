//! The project file: the settings of `groundel ortho` as TOML, under what the flags say.

use super::args::OrthoArgs;
use crate::frame::FrameTable;
use crate::{Error, Result};

/// `args` with every setting that they leave open taken from the project file they name, and its `[frame]`.
///
/// # Errors
/// What reading the file gives, and [`Error::Usage`] naming the key whose value makes no sense.
pub(super) fn merged(args: OrthoArgs) -> Result<(OrthoArgs, Option<FrameTable>)> {
    match &args.project {
        None => Ok((args, None)),
        Some(path) => Err(Error::unsupported(path, "a project file")),
    }
}
