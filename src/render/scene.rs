//! What a job renders.

use glam::DVec3;

use crate::blend;
use crate::camera::Photo;
use crate::frame::LocalMosaic;
use crate::sample::Interpolation;
use crate::store::mesh::MeshStore;
use crate::store::photo::PhotoStore;
use crate::tone::ToneGrid;
use crate::visibility::{EdgeMap, Tolerance, ViewPhoto};

/// A photo of the job.
#[derive(Debug)]
pub struct ScenePhoto {
    /// Its index in the *whole* camera set ordered by bytewise name, as the `best` layer bears it.
    pub index: u16,
    /// Its orientation, in the mesh store's local frame.
    pub view: ViewPhoto,
    /// What its samples are multiplied by to reach the mosaic's range: 257 for an 8-bit photo of a 16-bit mosaic.
    pub gain: f32,
    /// What its samples are multiplied by so that they agree with those of other photos; `None`: they are taken as they
    /// are.
    pub tone: Option<ToneGrid>,
}

impl ScenePhoto {
    /// A photo of a job whose mesh store has its local frame's origin at `origin_ground`.
    pub fn new(index: u16, photo: &Photo, origin_ground: DVec3, gain: f32) -> Self {
        let view = ViewPhoto::new(photo.lens, photo.pose.relative_to(origin_ground));
        Self { index, view, gain, tone: None }
    }
}

/// What is photographed, and the rule by which it is coloured. Photos are in the order of their index, by which the photo
/// store knows them too. What is drawn of it is a [`Canvas`].
#[derive(Debug)]
pub struct Scene {
    /// The mesh.
    pub mesh: MeshStore,
    /// The photos' pixels.
    pub pixels: PhotoStore,
    /// The masks of the photos that have one, under the photos' numbers: a point whose position lies on a 0 is not
    /// seen by the photo. `None`: there are no masks.
    pub masks: Option<PhotoStore>,
    /// The photos' orientations.
    pub photos: Vec<ScenePhoto>,
    /// How photos are sampled.
    pub interpolation: Interpolation,
    /// How samples become a pixel.
    pub blend: blend::Settings,
    /// Number of photos in the whole camera set.
    pub names: usize,
}

/// What a scene is drawn on: a mosaic, or sections of one. A tile depends on scene, canvas and its rectangle alone.
#[derive(Debug, Clone)]
pub struct Canvas {
    /// The mosaic, in the mesh store's local frame; of several sections the highest.
    pub mosaic: LocalMosaic,
    /// The other sections, from the lowest: the same mosaic, the slab with the same lower end and ever higher upper ends.
    /// Empty for an ordinary mosaic.
    pub below: Vec<LocalMosaic>,
    /// The part of the segment before a surface point in which a face does not occlude it: it goes by the mosaic's pixel.
    pub tolerance: Tolerance,
}

impl Scene {
    /// The greatest value that a photo can hold, by its number.
    pub(super) fn range_of(&self, photo: usize) -> f32 {
        if self.pixels.bits(photo) > 8 { f32::from(u16::MAX) } else { f32::from(u8::MAX) }
    }

    /// Pixels around a block that must be known for its colours.
    pub(super) fn halo(&self) -> i64 {
        if self.blend.edges == blend::Edges::Guard { EdgeMap::REACH } else { 0 }
    }
}

impl Canvas {
    /// Number of sections; 1 for an ordinary mosaic.
    pub fn sections(&self) -> usize {
        self.below.len() + 1
    }

    /// A section, from the lowest.
    pub(super) fn section(&self, section: usize) -> &LocalMosaic {
        self.below.get(section).unwrap_or(&self.mosaic)
    }

    /// The lowest section whose slab reaches up to an elevation; the highest if none below it does.
    pub(super) fn lowest_section(&self, elevation: f64) -> u16 {
        let lower = self.below.partition_point(|section| section.slab()[1] < elevation);
        u16::try_from(lower).expect("sections are numbered in 16 bits")
    }
}
