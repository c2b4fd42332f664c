//! [`Photo`] and [`CameraSet`]: oriented photographs.

use super::{Lens, Pose};

/// Index of a photo in the whole camera set ordered by bytewise name, photos that cannot be used counted too.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, bytemuck::Pod, bytemuck::Zeroable,
)]
#[repr(transparent)]
pub struct PhotoId(pub u32);

/// An oriented photograph.
#[derive(Debug, Clone, PartialEq)]
pub struct Photo {
    /// Its place in the whole set.
    pub id: PhotoId,
    /// Its name: the path below the photo folder, with `/`.
    pub name: String,
    /// Interior orientation.
    pub lens: Lens,
    /// Exterior orientation.
    pub pose: Pose,
}

/// A photo of the set that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// Its place in the whole set.
    pub id: PhotoId,
    /// Its name.
    pub name: String,
    /// Why it cannot be used, to follow the name and a colon.
    pub reason: String,
}

/// All photos that a camera file or folder names.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CameraSet {
    /// The usable photos, by id.
    pub photos: Vec<Photo>,
    /// The names of the whole set, bytewise sorted, without repetition: the index is the id.
    pub names: Vec<String>,
    /// The photos that cannot be used, by id.
    pub left_out: Vec<LeftOut>,
}

impl CameraSet {
    /// The usable photo of that name.
    pub fn find(&self, name: &str) -> Option<&Photo> {
        let at = self.photos.binary_search_by(|p| p.name.as_str().cmp(name)).ok()?;
        self.photos.get(at)
    }
}
