//! [`Model`]: cameras, photos and tie points as read from either form, checked.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec2, DVec3};

use crate::camera::{Lens, LensError, LensModel, Pose};
use crate::geom::Size;
use crate::input::cameras::{Draft, DraftPhoto, MOST_TIES, Thinned, Tie, name_fault};
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
    /// A sample of the keypoints that have a point.
    keypoints: Thinned<(usize, Keypoint)>,
}

/// Where a photo saw a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Keypoint {
    pub(super) position_px: DVec2,
    /// COLMAP's id of the point.
    pub(super) point: u64,
}

/// Points that some keypoints wait for.
#[derive(Debug)]
pub(super) struct WantedPoints {
    /// The photo, by its number in the file, and the keypoint; by point id.
    keypoints: Vec<(usize, Keypoint)>,
    /// The points found so far, by id.
    ties: Vec<Tie>,
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
        let (cameras, images) = (BTreeMap::new(), Vec::new());
        Self { cameras_path, images_path, cameras, images, keypoints: Thinned::new(MOST_TIES) }
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

    /// Offers a keypoint of the photo that was added last.
    pub(super) fn add_keypoint(&mut self, make: impl FnOnce() -> Keypoint) {
        let photo = self.images.len().saturating_sub(1);
        self.keypoints.offer(|| (photo, make()));
    }

    /// The photos with their lenses, and the keypoints that wait for their points.
    pub(super) fn finish(self) -> Result<(Draft, WantedPoints)> {
        let Self { cameras_path, images_path, cameras, images, keypoints } = self;
        check_names(images_path, &images)?;
        let mut draft = Draft::default();
        for (name, Image { pose, camera, place }) in images {
            let orientation = match cameras.get(&camera) {
                Some(&Ok(lens)) => Ok((lens, pose)),
                Some(Err(model)) => Err(format!("camera model {} is not supported", model.name())),
                None => {
                    let expected = format!("the id of a camera in {}", cameras_path.display());
                    let found = format!("{camera} for photo {name:?}");
                    return Err(Error::corrupt(images_path, place, expected, found));
                }
            };
            draft.photos.push(DraftPhoto { name, place, orientation });
        }
        let mut keypoints = keypoints.into_items();
        keypoints.sort_by_key(|(_, keypoint)| keypoint.point);
        Ok((draft, WantedPoints { keypoints, ties: Vec::new() }))
    }
}

impl WantedPoints {
    /// Whether no point is wanted.
    pub(super) fn is_empty(&self) -> bool {
        self.keypoints.is_empty()
    }

    /// Takes a point, if it is wanted.
    pub(super) fn add(&mut self, id: u64, point_ground: DVec3) {
        let first = self.keypoints.partition_point(|(_, keypoint)| keypoint.point < id);
        let of_point = self.keypoints[first..].iter().take_while(|(_, k)| k.point == id);
        self.ties.extend(of_point.map(|&(photo, keypoint)| Tie {
            photo,
            position_px: keypoint.position_px,
            point_ground,
        }));
        // A damaged file that repeats its points gives no more ties than keypoints.
        self.ties.truncate(self.keypoints.len());
    }

    /// The tie points.
    pub(super) fn into_ties(self) -> Vec<Tie> {
        self.ties
    }
}

/// An error at the later of two photos of one name.
fn check_names(path: &Path, images: &[(String, Image)]) -> Result<()> {
    let mut sorted: Vec<&(String, Image)> = images.iter().collect();
    sorted.sort_by(|a, b| a.0.cmp(&b.0));
    match sorted.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => {
            let (name, image) = pair[1];
            let found = format!("{name:?} once more");
            Err(Error::corrupt(path, image.place.clone(), "a photo name of its own", found))
        }
        None => Ok(()),
    }
}

/// An error if there are more of `what` than a model may have.
pub(super) fn limit(path: &Path, what: &str, found: u64) -> Result<()> {
    if found <= MAX_COUNT {
        return Ok(());
    }
    Err(Error::Limit { what: format!("{}: {what}", path.display()), limit: MAX_COUNT, found })
}
