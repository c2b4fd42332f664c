//! The crate's [`Error`]: one enum that says whose fault it is.
//!
//! Every message names the file or the flag, the place in it, what was expected and what was found.
//! [`Error::exit_code`] is the one place where a kind of error becomes an exit code of the command.

use std::io;
use std::path::{Path, PathBuf};

/// Result of every fallible function of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// What went wrong, by whose fault it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused a file operation: a full disk, a missing file, no permission.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
    /// A file does not hold what its format demands.
    #[error("{}: {place}: expected {expected}, found {found}", path.display())]
    Corrupt {
        /// The file.
        path: PathBuf,
        /// Where in it: "line 12", "byte 3044", "vertex 17", "key `frame.u_axis`".
        place: String,
        /// What the format demands there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// Valid input that groundel does not support.
    #[error("{}: {what} is not supported{}", path.display(), hint.as_deref().map(|h| format!(" ({h})")).unwrap_or_default())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The feature, with the place where it was met.
        what: String,
        /// What to do instead, if there is something.
        hint: Option<String>,
    },
    /// A size stated by a file, or asked for by a flag, is beyond a limit of this crate.
    #[error("{what}: {found} is beyond the limit of {limit}")]
    Limit {
        /// What is limited, with the file or flag that states it.
        what: String,
        /// The greatest value allowed.
        limit: u64,
        /// The value found.
        found: u64,
    },
    /// The command line, the project file or their combination makes no sense.
    #[error("{0}")]
    Usage(String),
    /// The user or the system asked the process to end; what was finished is kept.
    #[error("interrupted; the same command goes on from here")]
    Interrupted,
    /// The disk cannot hold what the job would write; nothing was begun.
    #[error("{}: about {} MiB of disk are needed, but only {} MiB are free", folder.display(), needed_bytes.div_ceil(1 << 20), free_bytes >> 20)]
    NoRoom {
        /// A folder on that disk.
        folder: PathBuf,
        /// Bytes needed, by the forecast.
        needed_bytes: u64,
        /// Bytes free.
        free_bytes: u64,
    },
    /// The job cannot be done within the memory or disk it was given; nothing was begun.
    #[error("{what} needs {} MiB, but only {} MiB are allowed{}", needed_bytes.div_ceil(1 << 20), allowed_bytes >> 20, hint.as_deref().map(|h| format!(" ({h})")).unwrap_or_default())]
    OverBudget {
        /// What needs it.
        what: String,
        /// Bytes needed.
        needed_bytes: u64,
        /// Bytes allowed.
        allowed_bytes: u64,
        /// What to do about it.
        hint: Option<String>,
    },
}

impl Error {
    /// An [`Error::Io`] at `path`; made for `map_err(|e| Error::io(path, e))`.
    pub fn io(path: impl AsRef<Path>, source: io::Error) -> Self {
        Self::Io { path: path.as_ref().to_path_buf(), source }
    }

    /// An [`Error::Corrupt`] in `path`.
    pub fn corrupt(
        path: impl AsRef<Path>,
        place: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Corrupt {
            path: path.as_ref().to_path_buf(),
            place: place.into(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// An [`Error::Unsupported`] in `path`, without a hint.
    pub fn unsupported(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Self::Unsupported { path: path.as_ref().to_path_buf(), what: what.into(), hint: None }
    }

    /// An [`Error::Usage`].
    pub fn usage(message: impl Into<String>) -> Self {
        Self::Usage(message.into())
    }

    /// The exit code of the command for this error: 2 bad input or usage, 3 over budget,
    /// 4 I/O error or interrupted (a retry may help). A named file that does not exist is bad input.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Io { source, .. } => match source.kind() {
                io::ErrorKind::NotFound
                | io::ErrorKind::NotADirectory
                | io::ErrorKind::IsADirectory => 2,
                _ => 4,
            },
            Self::Corrupt { .. }
            | Self::Unsupported { .. }
            | Self::Limit { .. }
            | Self::Usage(_) => 2,
            Self::OverBudget { .. } | Self::NoRoom { .. } => 3,
            Self::Interrupted => 4,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_may_be_retried_but_a_missing_file_may_not() {
        let full = Error::io("a.tif", io::Error::from(io::ErrorKind::StorageFull));
        let missing = Error::io("a.ply", io::Error::from(io::ErrorKind::NotFound));
        assert_eq!((full.exit_code(), missing.exit_code()), (4, 2));
    }

    #[test]
    fn a_corrupt_file_is_named_with_place_expectation_and_finding() {
        let e = Error::corrupt("m.ply", "vertex 17", "a finite x", "NaN");
        assert_eq!(e.to_string(), "m.ply: vertex 17: expected a finite x, found NaN");
        assert_eq!(e.exit_code(), 2);
    }

    #[test]
    fn over_budget_states_both_figures_rounded_against_the_user() {
        let e = Error::OverBudget {
            what: "photo a.jpg".into(),
            needed_bytes: (600 << 20) + 1,
            allowed_bytes: 512 << 20,
            hint: None,
        };
        assert_eq!(e.to_string(), "photo a.jpg needs 601 MiB, but only 512 MiB are allowed");
        assert_eq!(e.exit_code(), 3);
    }
}
