//! `--masks`: which parts of which photos are not to be used.

use std::path::{Path, PathBuf};

use super::super::config::Config;
use crate::camera::Photo;
use crate::input::photo::read_mask_header;
use crate::store::photo::{Demand, PhotoSource};
use crate::{Error, Result};

/// A photo's mask: the photo's id and the mask's file, checked for its size.
#[derive(Debug)]
pub(in crate::cli) struct Mask {
    pub(in crate::cli) photo: u32,
    pub(in crate::cli) source: PhotoSource,
}

/// The masks of `photos`, by id: `<photo name>.png` or, if that is not there, `<photo stem>.png` in the folder that
/// `config` names; sub-folders as in the photo's name. A photo without one is used whole.
///
/// # Errors
/// [`Error::Usage`] if the folder holds no mask for any photo; what a missing folder, or a mask that is no PNG or of
/// another size than its photo, gives.
pub(super) fn find(config: &Config, photos: &[Photo]) -> Result<Vec<Mask>> {
    let Some(folder) = &config.masks else { return Ok(Vec::new()) };
    let found = std::fs::metadata(folder).map_err(|e| Error::io(folder, e))?;
    if !found.is_dir() {
        return Err(Error::corrupt(folder, "--masks", "a folder of masks", "a file"));
    }
    let mut masks = Vec::new();
    for photo in photos {
        let Some(path) = mask_file(folder, &photo.name)? else { continue };
        check(&path, &config.photos.join(&photo.name), photo)?;
        let (name, expected) = (photo.name.clone(), Some(photo.lens.size()));
        let source = PhotoSource { name, path, expected, demand: Some(Demand::ALL) };
        masks.push(Mask { photo: photo.id.0, source });
    }
    if masks.is_empty() {
        let example = photos.first().map(|p| format!(", such as {}.png", p.name));
        return Err(Error::usage(format!(
            "--masks: {} holds no mask for any photo{}",
            folder.display(),
            example.unwrap_or_default()
        )));
    }
    Ok(masks)
}

/// The mask's file, if there is one.
fn mask_file(folder: &Path, photo: &str) -> Result<Option<PathBuf>> {
    let named = folder.join(format!("{photo}.png"));
    for path in [named, folder.join(photo).with_extension("png")] {
        if path.try_exists().map_err(|e| Error::io(&path, e))? {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

fn check(path: &Path, photo_path: &Path, photo: &Photo) -> Result<()> {
    // In a folder of both, `a.png` is no mask of `a.png`.
    let same = |p: &Path| p.canonicalize().ok();
    if same(path).is_some() && same(path) == same(photo_path) {
        let message = "--masks: expected a mask, found the photo itself";
        return Err(Error::usage(format!("{message}: {}", path.display())));
    }
    let (size, expected) = (read_mask_header(path)?.size, photo.lens.size());
    if size == expected {
        return Ok(());
    }
    let expected = format!("{} × {} pixels, as its photo", expected.width, expected.height);
    let found = format!("{} × {} pixels", size.width, size.height);
    Err(Error::corrupt(path, "size", expected, found))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_whole_name_comes_before_the_stem() {
        let folder = tempfile::tempdir().unwrap();
        let of = |photo| mask_file(folder.path(), photo).unwrap();
        std::fs::create_dir(folder.path().join("left wall")).unwrap();
        assert_eq!(of("left wall/a.b.jpg"), None);
        let stem = folder.path().join("left wall/a.b.png");
        std::fs::write(&stem, "").unwrap();
        assert_eq!(of("left wall/a.b.jpg"), Some(stem));
        let whole = folder.path().join("left wall/a.b.jpg.png");
        std::fs::write(&whole, "").unwrap();
        assert_eq!(of("left wall/a.b.jpg"), Some(whole));
    }
}
