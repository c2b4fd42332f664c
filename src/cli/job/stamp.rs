//! [`Stamp`]: whether a file is still the one that a job was planned with.

use std::fs::{File, Metadata};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3Default, xxh3_64};

use crate::store::{SAMPLE_BYTES, visit_samples};
use crate::{Error, Result};

/// Bytes read at a time.
const BUFFER_BYTES: usize = 1 << 18;

/// What a file is known by: its length, its first, middle and last MiB, and, where it may be copied without its time of
/// modification, all of its bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::cli) struct Stamp {
    bytes: u64,
    /// Nanoseconds since 1970; 0 where the file system does not tell.
    modified: u64,
    sample: String,
    /// Of a file that is longer than what is sampled.
    whole: Option<String>,
}

/// How much of a file is read for its stamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::cli) enum Thoroughness {
    /// Three MiB.
    Sampled,
    /// All of it.
    Whole,
}

impl Stamp {
    /// The stamp of a file.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(in crate::cli) fn of(path: &Path, how: Thoroughness) -> Result<Self> {
        let io = |e| Error::io(path, e);
        let mut file = File::open(path).map_err(io)?;
        let meta = file.metadata().map_err(io)?;
        let sample = sample(&mut file, meta.len()).map_err(io)?;
        let is_longer = meta.len() > 3 * SAMPLE_BYTES;
        let whole = match how {
            Thoroughness::Whole if is_longer => Some(whole(&mut file).map_err(io)?),
            _ => None,
        };
        Ok(Self { bytes: meta.len(), modified: modified(&meta), sample, whole })
    }

    /// Whether the file at `path` has the same bytes. A file that was touched or copied, so that its time differs, is read
    /// whole if the stamp knows all of it.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(in crate::cli) fn fits(&self, path: &Path) -> Result<bool> {
        let found = Self::of(path, Thoroughness::Sampled)?;
        if (found.bytes, &found.sample) != (self.bytes, &self.sample) {
            return Ok(false);
        }
        if found.modified == self.modified || self.whole.is_none() {
            return Ok(true);
        }
        Ok(Self::of(path, Thoroughness::Whole)?.whole == self.whole)
    }
}

fn modified(meta: &Metadata) -> u64 {
    let since = meta.modified().ok().and_then(|t| t.duration_since(UNIX_EPOCH).ok());
    since.and_then(|t| u64::try_from(t.as_nanos()).ok()).unwrap_or(0)
}

fn sample(file: &mut File, bytes: u64) -> std::io::Result<String> {
    let mut hash = Xxh3Default::new();
    visit_samples(file, bytes, &mut |sample| hash.update(&xxh3_64(sample).to_le_bytes()))?;
    Ok(format!("{:032x}", hash.digest128()))
}

fn whole(file: &mut File) -> std::io::Result<String> {
    file.seek(SeekFrom::Start(0))?;
    let mut hash = Xxh3Default::new();
    let mut buffer = vec![0; BUFFER_BYTES];
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(format!("{:032x}", hash.digest128())),
            n => hash.update(&buffer[..n]),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::time::{Duration, SystemTime};

    use super::*;

    fn age(path: &Path) {
        let file = File::options().write(true).open(path).unwrap();
        file.set_modified(SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000)).unwrap();
    }

    #[test]
    fn a_copy_is_the_same_file_and_an_edited_one_is_not_wherever_the_edit_is() {
        let folder = tempfile::tempdir().unwrap();
        let [one, two] = ["a", "b"].map(|name| folder.path().join(name));
        for length in [0_usize, 1000, 5 << 20] {
            let bytes: Vec<u8> = (0..length).map(|k| u8::try_from(k % 251).unwrap()).collect();
            fs::write(&one, &bytes).unwrap();
            let stamp = Stamp::of(&one, Thoroughness::Whole).unwrap();
            assert!(stamp.fits(&one).unwrap());
            fs::write(&two, &bytes).unwrap();
            age(&two);
            assert!(stamp.fits(&two).unwrap(), "{length}");
            // The second of five MiB is not sampled.
            for at in [0, 3 << 19, length.saturating_sub(1)].into_iter().filter(|&at| at < length) {
                let mut edited = bytes.clone();
                edited[at] ^= 1;
                fs::write(&two, &edited).unwrap();
                assert!(!stamp.fits(&two).unwrap(), "{length} {at}");
            }
        }
        assert!(Stamp::of(&folder.path().join("c"), Thoroughness::Sampled).is_err());
    }
}
