//! [`Draft`]: cameras as a parser found them, before names are checked and put in order.

use std::path::Path;

use glam::{DVec2, DVec3};

use crate::camera::{CameraSet, LeftOut, Lens, Photo, PhotoId, Pose};
use crate::{Error, Result};

/// The most photos of one file.
pub(in crate::input) const MAX_PHOTOS: usize = 1_000_000;

/// The longest name of a photo, bytes: the longest path of Linux.
const MAX_NAME: usize = 4096;

/// The most tie points of a sample.
pub(in crate::input) const MOST_TIES: usize = 20_000;

/// A photo as a parser found it.
#[derive(Debug, Clone)]
pub(in crate::input) struct DraftPhoto {
    /// The path below the photo folder; `\` is taken for `/`.
    pub(in crate::input) name: String,
    /// Where it stands in the file, for errors.
    pub(in crate::input) place: String,
    /// Lens and pose, or why the photo cannot be used (to follow its name and a colon).
    pub(in crate::input) orientation: std::result::Result<(Lens, Pose), String>,
}

/// Where one photo saw a point of the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::input) struct Tie {
    /// The photo, by its number in [`Draft::photos`].
    pub(in crate::input) photo: usize,
    /// Measured position, pixels, the top-left pixel's centre at (0.5, 0.5).
    pub(in crate::input) position_px: DVec2,
    /// The point, ground, metres.
    pub(in crate::input) point_ground: DVec3,
}

/// Cameras as a parser found them, in the order of the file.
#[derive(Debug, Clone, Default)]
pub(in crate::input) struct Draft {
    /// The photos.
    pub(in crate::input) photos: Vec<DraftPhoto>,
    /// A sample of the tie points, perhaps none.
    pub(in crate::input) ties: Vec<Tie>,
}

impl Draft {
    /// Moves cameras and tie points by an offset, metres.
    pub(in crate::input) fn shift(&mut self, offset: DVec3) {
        let oriented = self.photos.iter_mut().filter_map(|photo| photo.orientation.as_mut().ok());
        oriented.for_each(|(_, pose)| pose.centre_ground += offset);
        self.ties.iter_mut().for_each(|tie| tie.point_ground += offset);
    }

    /// The photos in the order of their names.
    ///
    /// # Errors
    /// [`Error::Corrupt`] for a name given twice or leading out of the photo folder; [`Error::Limit`] for more photos
    /// than a set may have.
    pub(in crate::input) fn finish(mut self, path: &Path) -> Result<CameraSet> {
        if self.photos.len() > MAX_PHOTOS {
            let (limit, found) = (MAX_PHOTOS as u64, self.photos.len() as u64);
            return Err(Error::Limit { what: format!("{}: photos", path.display()), limit, found });
        }
        for photo in &mut self.photos {
            photo.name = photo.name.replace('\\', "/");
            if let Some((expected, found)) = name_fault(&photo.name) {
                return Err(Error::corrupt(path, photo.place.clone(), expected, found));
            }
        }
        self.photos.sort_by(|a, b| a.name.cmp(&b.name));
        let mut set = CameraSet::default();
        for DraftPhoto { name, place, orientation } in self.photos {
            if set.names.last() == Some(&name) {
                let found = format!("{name:?} once more");
                return Err(Error::corrupt(path, place, "a photo name of its own", found));
            }
            let id = PhotoId(u32::try_from(set.names.len()).expect("a million at most"));
            match orientation {
                Ok((lens, pose)) => {
                    set.photos.push(Photo { id, name: name.clone(), lens, pose });
                }
                Err(reason) => set.left_out.push(LeftOut { id, name: name.clone(), reason }),
            }
            set.names.push(name);
        }
        Ok(set)
    }
}

/// What is expected and what is found, if `name` is no path below the photo folder.
pub(in crate::input) fn name_fault(name: &str) -> Option<(&'static str, String)> {
    let bytes = name.as_bytes();
    let is_drive = bytes.len() > 1 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':';
    if name.is_empty() {
        Some(("the name of a photo", "an empty one".into()))
    } else if name.len() > MAX_NAME {
        Some(("a photo name of at most 4096 bytes", format!("{} bytes", name.len())))
    } else if name.chars().any(char::is_control) {
        Some(("a photo name without control characters", format!("{name:?}")))
    } else if name.starts_with(['/', '\\'])
        || is_drive
        || name.split(['/', '\\']).any(|part| part == "..")
    {
        Some(("a photo name below the photo folder", format!("{name:?}")))
    } else {
        None
    }
}
