//! The key of a mesh store: what it was made from.
//!
//! In: the input files, their shifts, and the layout's settings. Out: 128 bits that change with a shift, and with a
//! file's name, length, modification time, or its first, middle or last MiB; not with the folder that it lies in. Does not read the
//! whole of a large file: an edit within one that keeps length and modification time is not seen.

use std::fmt;
use std::fs::File;
use std::io;
use std::iter;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use glam::DVec3;
use xxhash_rust::xxh3::Xxh3;

use super::lattice::STEPS_LOG2;
use super::layout::{PARTITION_TRIANGLES, VERSION};
use crate::geom::MeshSource;
use crate::store::visit_samples;
use crate::{Error, Result};

/// Fingerprint of the input files and the settings of a mesh store.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct MeshKey(pub(super) [u8; 16]);

impl MeshKey {
    /// The key of the store that these meshes make, in this order.
    ///
    /// # Errors
    /// [`Error::Io`] if a file cannot be read.
    pub fn of(sources: &[&dyn MeshSource]) -> Result<Self> {
        let parts: Vec<_> = sources
            .iter()
            .map(|source| {
                let further = source.further_files().iter().map(PathBuf::as_path);
                (iter::once(source.path()).chain(further).collect(), source.shift())
            })
            .collect();
        Self::of_files(&parts)
    }

    /// The key of meshes, each read from some files and shifted.
    fn of_files(meshes: &[(Vec<&Path>, DVec3)]) -> Result<Self> {
        let mut hash = Xxh3::new();
        hash.update(&VERSION.to_le_bytes());
        hash.update(&STEPS_LOG2.to_le_bytes());
        hash.update(&(PARTITION_TRIANGLES as u64).to_le_bytes());
        for (files, shift) in meshes {
            hash.update(&(files.len() as u64).to_le_bytes());
            for file in files {
                add_file(&mut hash, file).map_err(|e| Error::io(file, e))?;
            }
            for metres in shift.to_array() {
                hash.update(&metres.to_le_bytes());
            }
        }
        Ok(Self(hash.digest128().to_le_bytes()))
    }

    /// The key as 32 hexadecimal digits, as it stands in file names.
    pub fn hex(&self) -> String {
        format!("{:032x}", u128::from_be_bytes(self.0))
    }
}

impl fmt::Debug for MeshKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "MeshKey({})", self.hex())
    }
}

/// Adds one file: each part with its length, so that no two lists of files give the same bytes.
pub(in crate::store) fn add_file(hash: &mut Xxh3, path: &Path) -> io::Result<()> {
    let name = path.file_name().unwrap_or_default().as_encoded_bytes();
    hash.update(&(name.len() as u64).to_le_bytes());
    hash.update(name);
    let mut file = File::open(path)?;
    let about = file.metadata()?;
    let bytes = about.len();
    hash.update(&bytes.to_le_bytes());
    // Before 1970, or unknown: zero; length and content still count.
    let modified = about.modified().ok().and_then(|t| t.duration_since(UNIX_EPOCH).ok());
    hash.update(&modified.unwrap_or_default().as_nanos().to_le_bytes());
    visit_samples(&mut file, bytes, &mut |sample| hash.update(sample))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_key_follows_content_name_time_and_shift_but_not_the_folder() {
        let dir = tempfile::tempdir().unwrap();
        let time = UNIX_EPOCH + Duration::from_secs(1_700_000_000);
        let write = |folder: &str, name: &str, bytes: &[u8], time| {
            let path = dir.path().join(folder).join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, bytes).unwrap();
            File::options().append(true).open(&path).unwrap().set_modified(time).unwrap();
            path
        };
        let mut bytes = vec![5; 5 << 20];
        let of = |paths: &[&Path]| {
            let alone: Vec<_> = paths.iter().map(|&p| (vec![p], DVec3::ZERO)).collect();
            MeshKey::of_files(&alone).unwrap()
        };
        let key = |path: &Path| of(&[path]);
        let first = key(&write("a", "m.ply", &bytes, time));
        assert_eq!(key(&write("b", "m.ply", &bytes, time)), first);
        assert_ne!(key(&write("b", "n.ply", &bytes, time)), first);
        assert_ne!(key(&write("b", "m.ply", &bytes, time + Duration::from_micros(1))), first);
        assert_ne!(key(&write("b", "m.ply", &bytes[1..], time)), first);
        for place in [0, 5 << 19, (5 << 20) - 1] {
            bytes[place] ^= 1;
            assert_ne!(key(&write("b", "m.ply", &bytes, time)), first, "byte {place}");
            bytes[place] ^= 1;
        }
        let (a, b) = (write("a", "m.ply", &bytes, time), write("b", "n.ply", &bytes, time));
        assert_ne!(of(&[&a, &b]), of(&[&b, &a]));
        let together = MeshKey::of_files(&[(vec![&a, &b], DVec3::ZERO)]).unwrap();
        assert_ne!(together, of(&[&a, &b]));
        for shift in [DVec3::X, DVec3::Y, -DVec3::X] {
            assert_ne!(MeshKey::of_files(&[(vec![&a], shift)]).unwrap(), of(&[&a]), "{shift}");
        }
        assert_eq!(first.hex().len(), 32);
    }
}
