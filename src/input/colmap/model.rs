//! [`Model`]: cameras and photos as read from either form, checked and put in order.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;

use crate::camera::{CameraSet, LeftOut, Lens, LensError, LensModel, Photo, PhotoId, Pose};
use crate::geom::Size;
use crate::input::cameras::name_fault;
use crate::{Error, Result};

/// The most photos or cameras of one model: each photo costs about half a kilobyte.
pub(super) const MAX_COUNT: u64 = 1_000_000;

/// The longest name of a photo, bytes: the longest path of Linux.
pub(super) const MAX_NAME: usize = 4096;

/// Cameras and photos, in the order of the files.
#[derive(Debug)]
pub(super) struct Model<'a> {
    cameras_path: &'a Path,
    images_path: &'a Path,
    /// By COLMAP's id: the lens, or why there is none.
    cameras: BTreeMap<u32, std::result::Result<Lens, LensModel>>,
    images: Vec<(String, Image)>,
}

/// A camera as it stands in the file.
#[derive(Debug)]
pub(super) struct CameraRecord<'a> {
    pub(super) id: u32,
    pub(super) model: LensModel,
    pub(super) size: [u64; 2],
    pub(super) params: &'a [f64],
}

/// A photo as it stands in the file.
#[derive(Debug)]
pub(super) struct ImageRecord<'a> {
    pub(super) quaternion: [f64; 4],
    pub(super) translation: [f64; 3],
    pub(super) camera: u32,
    pub(super) name: &'a str,
}

#[derive(Debug)]
struct Image {
    pose: Pose,
    camera: u32,
    place: String,
}

impl<'a> Model<'a> {
    pub(super) fn new(cameras_path: &'a Path, images_path: &'a Path) -> Self {
        Self { cameras_path, images_path, cameras: BTreeMap::new(), images: Vec::new() }
    }

    /// Adds a camera that stands at `place` of its file.
    pub(super) fn add_camera(&mut self, place: &str, record: &CameraRecord) -> Result<()> {
        let corrupt = |expected: &str, found: String| {
            Err(Error::corrupt(self.cameras_path, place, expected, found))
        };
        limit(self.cameras_path, "cameras", self.cameras.len() as u64 + 1)?;
        let [Ok(width), Ok(height)] = record.size.map(u32::try_from) else {
            let found = format!("{} x {}", record.size[0], record.size[1]);
            return corrupt("a photo size within 32 bits", found);
        };
        let lens = match Lens::new(record.model, Size::new(width, height), record.params) {
            Ok(lens) => Ok(lens),
            Err(LensError::Unsupported(model)) => Err(model),
            Err(LensError::Invalid { expected, found }) => {
                return corrupt(&format!("{expected} (camera {})", record.id), found);
            }
        };
        if self.cameras.insert(record.id, lens).is_some() {
            return corrupt("a camera id of its own", format!("{} once more", record.id));
        }
        Ok(())
    }

    /// Adds a photo that stands at `place` of its file.
    pub(super) fn add_image(&mut self, place: String, record: &ImageRecord) -> Result<()> {
        limit(self.images_path, "photos", self.images.len() as u64 + 1)?;
        if let Some((expected, found)) = name_fault(record.name) {
            return Err(Error::corrupt(self.images_path, place, expected, found));
        }
        let translation = DVec3::from(record.translation);
        let pose = Pose::from_colmap(record.quaternion, translation).map_err(|e| {
            let expected = format!("{} for photo {:?}", e.expected, record.name);
            Error::corrupt(self.images_path, place.clone(), expected, e.found)
        })?;
        let image = Image { pose, camera: record.camera, place };
        self.images.push((record.name.to_owned(), image));
        Ok(())
    }

    /// The photos in the order of their names, with their lenses.
    pub(super) fn finish(self) -> Result<CameraSet> {
        let Self { cameras_path, images_path, cameras, mut images } = self;
        images.sort_by(|a, b| a.0.cmp(&b.0));
        let mut set = CameraSet::default();
        for (name, image) in images {
            let corrupt = |expected: String, found: String| {
                Err(Error::corrupt(images_path, image.place.clone(), expected, found))
            };
            if set.names.last() == Some(&name) {
                return corrupt("a photo name of its own".into(), format!("{name:?} once more"));
            }
            let number = u32::try_from(set.names.len()).expect("a million at most");
            let id = PhotoId(number);
            match cameras.get(&image.camera) {
                Some(&Ok(lens)) => {
                    set.photos.push(Photo { id, name: name.clone(), lens, pose: image.pose });
                }
                Some(Err(model)) => {
                    let reason = format!("camera model {} is not supported", model.name());
                    set.left_out.push(LeftOut { id, name: name.clone(), reason });
                }
                None => {
                    let expected = format!("the id of a camera in {}", cameras_path.display());
                    return corrupt(expected, format!("{} for photo {name:?}", image.camera));
                }
            }
            set.names.push(name);
        }
        Ok(set)
    }
}

/// An error if there are more of `what` than a model may have.
pub(super) fn limit(path: &Path, what: &str, found: u64) -> Result<()> {
    if found <= MAX_COUNT {
        return Ok(());
    }
    Err(Error::Limit { what: format!("{}: {what}", path.display()), limit: MAX_COUNT, found })
}
