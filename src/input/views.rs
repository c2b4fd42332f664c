//! [`Views`]: what OpenMVG and `AliceVision` state alike: views that name their camera and their pose by numbers.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, DVec3};

use super::cameras::{Draft, DraftPhoto, MOST_TIES, PhotoFolder, Thinned, Tie};
use super::json::Id;
use crate::camera::{Lens, Pose};
use crate::{Error, Result};

/// A photo as such a file states it.
#[derive(Debug)]
pub(super) struct View {
    pub(super) id: Id,
    pub(super) camera: Option<Id>,
    pub(super) pose: Option<Id>,
    /// Where the tool found the photo.
    pub(super) path: String,
}

/// A point and where views saw it.
#[derive(Debug)]
pub(super) struct Landmark {
    pub(super) point_ground: DVec3,
    /// View and position, pixels.
    pub(super) seen: Vec<(Id, DVec2)>,
}

/// A whole file.
#[derive(Debug, Default)]
pub(super) struct Views {
    pub(super) photos: Vec<View>,
    /// The lens, or why its photos are left out.
    pub(super) cameras: BTreeMap<Id, std::result::Result<Lens, String>>,
    pub(super) poses: BTreeMap<Id, Pose>,
    pub(super) landmarks: Vec<Landmark>,
}

impl Views {
    /// The photos, under their names in the photo folder.
    ///
    /// # Errors
    /// [`Error::Corrupt`] naming the view for an id given twice.
    pub(super) fn draft(self, path: &Path, photos: PhotoFolder) -> Result<Draft> {
        let Self { photos: views, cameras, poses, landmarks } = self;
        let mut draft = Draft::default();
        let mut numbers = BTreeMap::new();
        for View { id, camera, pose, path: old_path } in views {
            let place = format!("view {}", id.0);
            let orientation = match (
                camera.and_then(|id| cameras.get(&id)),
                pose.and_then(|id| poses.get(&id)),
            ) {
                (Some(Ok(lens)), Some(pose)) => Ok((*lens, *pose)),
                (_, None) => Err("it is not oriented".to_owned()),
                (Some(Err(reason)), _) => Err(reason.clone()),
                (None, _) => Err("it has no camera".to_owned()),
            };
            if numbers.insert(id, draft.photos.len()).is_some() {
                return Err(Error::corrupt(path, place, "a view id of its own", "it once more"));
            }
            let name = photos.name_of(&old_path);
            draft.photos.push(DraftPhoto { name, place, orientation });
        }
        let mut ties = Thinned::new(MOST_TIES);
        for Landmark { point_ground, seen } in landmarks {
            for (view, position_px) in seen {
                if let Some(&photo) = numbers.get(&view) {
                    ties.offer(|| Tie { photo, position_px, point_ground });
                }
            }
        }
        draft.ties = ties.into_items();
        Ok(draft)
    }
}
