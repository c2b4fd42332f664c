//! [`Layer`]: what one output file holds, in which samples, and what its values mean.

use super::{IccProfile, Raster, SampleType};
use crate::image::{Colour, Depth};

/// `face` where no face is seen.
pub const NO_FACE: u32 = u32::MAX;
/// `count`, `used` and `coverage` where no face is seen.
pub const NO_SURFACE: u8 = u8::MAX;
/// `best` where no photo is used.
pub const NO_PHOTO: u16 = u16::MAX;

/// What the values of a layer mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Meaning {
    /// Colour and alpha: grey + alpha or RGB + alpha, 8 or 16 bit. Alpha is unassociated, 0 or the greatest value.
    Mosaic,
    /// Elevation over the frame, metres; NaN where no face is seen.
    Elevation,
    /// Face id; [`NO_FACE`] where no face is seen.
    Face,
    /// Photos that see the pixel, 0 to 254; [`NO_SURFACE`] where no face is seen.
    Count,
    /// Photos left after outlier rejection, 0 to 254; [`NO_SURFACE`] where no face is seen.
    Used,
    /// 0, 1, 2 photos, 3 = more than two, as a palette; [`NO_SURFACE`] where no face is seen.
    Coverage,
    /// Index of the heaviest kept photo; [`NO_PHOTO`] where there is none.
    Best,
}

/// One output file: samples, meaning, description and metadata.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Layer {
    meaning: Meaning,
    sample: SampleType,
    channels: usize,
    items: Vec<(String, String)>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    profile: Option<IccProfile>,
    #[serde(default, skip_serializing_if = "is_first")]
    section: u16,
}

/// Whether a section is the first: a job of one section does not state it.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
fn is_first(section: &u16) -> bool {
    *section == 0
}

impl Meaning {
    /// All meanings, the mosaic first.
    pub const ALL: [Self; 7] = [
        Self::Mosaic,
        Self::Elevation,
        Self::Face,
        Self::Count,
        Self::Used,
        Self::Coverage,
        Self::Best,
    ];

    /// The name of the layer: the word of the `--layers` flag, and the middle of its file's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mosaic => "mosaic",
            Self::Elevation => "elevation",
            Self::Face => "face",
            Self::Count => "count",
            Self::Used => "used",
            Self::Coverage => "coverage",
            Self::Best => "best",
        }
    }

    /// One sentence for a reader of the file.
    pub fn description(self) -> &'static str {
        match self {
            Self::Mosaic => "True-orthoimage mosaic; alpha 0 where no photo shows the surface",
            Self::Elevation => "Elevation of the surface over the frame, metres",
            Self::Face => {
                "Face of the mesh that the pixel shows, 0-based ordinal in the mesh files"
            }
            Self::Count => "Number of photos that see the pixel, at most 254",
            Self::Used => "Number of photos left after outlier rejection, at most 254",
            Self::Coverage => "Photos that see the pixel: 0 none, 1 one, 2 two, 3 more than two",
            Self::Best => "Index of the heaviest kept photo in the camera set ordered by name",
        }
    }
}

impl Layer {
    /// The mosaic: colour and one unassociated alpha channel.
    pub fn mosaic(colour: Colour, depth: Depth) -> Self {
        let sample = match depth {
            Depth::Eight => SampleType::U8,
            Depth::Sixteen => SampleType::U16,
        };
        let channels = match colour {
            Colour::Grey => 2,
            Colour::Rgb => 4,
        };
        Self {
            meaning: Meaning::Mosaic,
            sample,
            channels,
            items: Vec::new(),
            profile: None,
            section: 0,
        }
    }

    /// The layer of a meaning with one channel, or `None` for the mosaic, which needs colour and depth.
    pub fn of(meaning: Meaning) -> Option<Self> {
        let sample = match meaning {
            Meaning::Mosaic => return None,
            Meaning::Elevation => SampleType::F32,
            Meaning::Face => SampleType::U32,
            Meaning::Count | Meaning::Used | Meaning::Coverage => SampleType::U8,
            Meaning::Best => SampleType::U16,
        };
        Some(Self { meaning, sample, channels: 1, items: Vec::new(), profile: None, section: 0 })
    }

    /// The layer with one more metadata item; the order of items is kept.
    #[must_use]
    pub fn with_item(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.items.push((name.into(), value.into()));
        self
    }

    /// The layer with an ICC colour profile, which says what the samples' colours look like.
    #[must_use]
    pub fn with_profile(mut self, profile: IccProfile) -> Self {
        self.profile = Some(profile);
        self
    }

    /// The layer as that of another section than the first.
    #[must_use]
    pub fn of_section(mut self, section: u16) -> Self {
        self.section = section;
        self
    }

    /// The section that it belongs to; 0 for a mosaic that is not one of several sections.
    pub fn section(&self) -> u16 {
        self.section
    }

    /// The bytes of the ICC colour profile.
    pub fn profile(&self) -> Option<&[u8]> {
        self.profile.as_ref().map(IccProfile::bytes)
    }

    /// What the values mean.
    pub fn meaning(&self) -> Meaning {
        self.meaning
    }

    /// Type of the samples.
    pub fn sample(&self) -> SampleType {
        self.sample
    }

    /// Samples a pixel, alpha counted.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Metadata items `(name, value)`, in order.
    pub fn items(&self) -> &[(String, String)] {
        &self.items
    }

    /// Bytes a pixel.
    pub fn pixel_bytes(&self) -> usize {
        self.channels * self.sample.bytes()
    }

    /// The value of undefined pixels as GDAL writes it; none for the mosaic, which has alpha.
    pub fn nodata_text(&self) -> Option<&'static str> {
        match self.meaning {
            Meaning::Mosaic => None,
            Meaning::Elevation => Some("nan"),
            Meaning::Face => Some("4294967295"),
            Meaning::Count | Meaning::Used | Meaning::Coverage => Some("255"),
            Meaning::Best => Some("65535"),
        }
    }

    /// The little-endian pixel that fills a tile beyond the mosaic's edge: nodata, or zero for the mosaic.
    pub(super) fn padding(&self) -> Vec<u8> {
        match self.meaning {
            Meaning::Mosaic => vec![0; self.pixel_bytes()],
            Meaning::Elevation => f32::NAN.to_le_bytes().to_vec(),
            Meaning::Face => NO_FACE.to_le_bytes().to_vec(),
            Meaning::Count | Meaning::Used | Meaning::Coverage => vec![NO_SURFACE],
            Meaning::Best => NO_PHOTO.to_le_bytes().to_vec(),
        }
    }

    /// Whether samples and channels are those of the meaning: a layer read from a file may claim anything.
    pub fn is_consistent(&self) -> bool {
        match Self::of(self.meaning) {
            Some(own) => self.sample == own.sample && self.channels == own.channels,
            None => {
                matches!(self.sample, SampleType::U8 | SampleType::U16)
                    && matches!(self.channels, 2 | 4)
            }
        }
    }

    /// Whether a tile of equal pixels is the same bytes in the other layer.
    pub fn is_like(&self, other: &Self) -> bool {
        let of = |layer: &Self| (layer.meaning, layer.sample, layer.channels);
        of(self) == of(other)
    }

    /// Whether a raster has this layer's sample type and channels.
    pub fn fits(&self, raster: &Raster) -> bool {
        raster.sample_type() == self.sample && raster.channels() == self.channels
    }
}
