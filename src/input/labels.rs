//! [`PhotoLabels`]: photos that a camera file names without folder or extension.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::{Error, Result};

/// Extensions of photos, in lower case.
const EXTENSIONS: [&str; 5] = ["jpg", "jpeg", "png", "tif", "tiff"];
/// The most files and folders that are looked at, and how deep.
const MAX_ENTRIES: u64 = 2_000_000;
const MAX_DEPTH: usize = 16;

/// The photos of a folder by all that a label may give of their names.
#[derive(Debug, Default)]
pub(in crate::input) struct PhotoLabels {
    /// Path below the folder, or its end from some `/` on; with or without extension: the paths it may mean.
    names: BTreeMap<String, Meaning>,
}

#[derive(Debug)]
enum Meaning {
    One(String),
    /// The first two.
    Several(String, String),
}

impl PhotoLabels {
    /// The photos in `folder` and the folders below it; no folder: no photo is known.
    ///
    /// # Errors
    /// [`Error::Io`] if a folder cannot be read; [`Error::Limit`] for more than two million files.
    pub(in crate::input) fn of(folder: Option<&Path>) -> Result<Self> {
        let mut labels = Self::default();
        if let Some(folder) = folder {
            let mut paths = Vec::new();
            let mut count = 0;
            walk(folder, "", 0, &mut count, &mut paths)?;
            // In the order of their names, whatever the folder lists them in.
            paths.sort_unstable();
            for path in &paths {
                labels.add(path);
            }
        }
        Ok(labels)
    }

    /// The photo that `label` means: of that path, or with that end of its path, with or without extension. The label
    /// itself where none is known; inside, why it cannot be told.
    pub(in crate::input) fn name_of(&self, label: &str) -> std::result::Result<String, String> {
        let label = label.replace('\\', "/");
        match self.names.get(&label) {
            Some(Meaning::One(path)) => Ok(path.clone()),
            Some(Meaning::Several(a, b)) => Err(format!("its label may mean {a} or {b}")),
            None => Ok(label),
        }
    }

    fn add(&mut self, path: &str) {
        let ends = path.match_indices('/').map(|(at, _)| &path[at + 1..]);
        for end in std::iter::once(path).chain(ends) {
            let stem = end.rsplit_once('.').map_or(end, |(stem, _)| stem);
            for key in [end, stem] {
                self.insert(key, path);
            }
        }
    }

    fn insert(&mut self, key: &str, path: &str) {
        match self.names.get_mut(key) {
            None => {
                self.names.insert(key.to_owned(), Meaning::One(path.to_owned()));
            }
            // The whole path means itself, whatever else ends like it.
            Some(meaning) if key == path => *meaning = Meaning::One(path.to_owned()),
            Some(Meaning::One(other)) if other != key => {
                let first = std::mem::take(other);
                self.names.insert(key.to_owned(), Meaning::Several(first, path.to_owned()));
            }
            Some(_) => {}
        }
    }
}

/// Adds the photos in `folder`, `prefix` being its path below the first folder, with a `/` at its end.
fn walk(
    folder: &Path,
    prefix: &str,
    depth: usize,
    count: &mut u64,
    paths: &mut Vec<String>,
) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(|e| Error::io(folder, e))? {
        let entry = entry.map_err(|e| Error::io(folder, e))?;
        *count += 1;
        if *count > MAX_ENTRIES {
            let what = format!("{}: files", folder.display());
            return Err(Error::Limit { what, limit: MAX_ENTRIES, found: *count });
        }
        // A name that is no text can be meant by no label.
        let Ok(name) = entry.file_name().into_string() else { continue };
        let kind = entry.file_type().map_err(|e| Error::io(entry.path(), e))?;
        if kind.is_dir() && depth < MAX_DEPTH {
            walk(&entry.path(), &format!("{prefix}{name}/"), depth + 1, count, paths)?;
        } else if !kind.is_dir() && is_photo(&name) {
            paths.push(format!("{prefix}{name}"));
        }
    }
    Ok(())
}

fn is_photo(name: &str) -> bool {
    let extension = name.rsplit_once('.').map(|(_, extension)| extension.to_ascii_lowercase());
    extension.is_some_and(|extension| EXTENSIONS.contains(&extension.as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_finds_its_photo_with_or_without_folder_and_extension() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        fs::create_dir_all(root.join("west/1")).unwrap();
        fs::create_dir(root.join("east")).unwrap();
        for name in ["a.JPG", "a.xmp", "west/b.tif", "west/1/c.png", "east/c.png", "a/../d.e.jpeg"]
        {
            let name = name.replace("a/../", "");
            fs::write(root.join(name), "").unwrap();
        }
        let labels = PhotoLabels::of(Some(root)).unwrap();
        for (label, name) in [
            ("a", "a.JPG"),
            ("a.JPG", "a.JPG"),
            ("b", "west/b.tif"),
            ("west\\b", "west/b.tif"),
            ("1/c.png", "west/1/c.png"),
            ("east/c", "east/c.png"),
            ("d.e", "d.e.jpeg"),
            ("nowhere.jpg", "nowhere.jpg"),
        ] {
            assert_eq!(labels.name_of(label).as_deref(), Ok(name), "{label}");
        }
        let e = labels.name_of("c").unwrap_err();
        assert!(e.contains("east/c.png or west/1/c.png"), "{e}");
        fs::write(root.join("c.png"), "").unwrap();
        let labels = PhotoLabels::of(Some(root)).unwrap();
        assert_eq!(labels.name_of("c.png").as_deref(), Ok("c.png"));
        assert_eq!(PhotoLabels::of(None).unwrap().name_of("x"), Ok("x".into()));
    }
}
