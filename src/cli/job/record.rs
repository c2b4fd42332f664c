//! [`JobRecord`]: all that a job's tiles and files are made from, but for the stores.

use std::fs::File;
use std::io::Read;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::camera::CameraRecord;
use super::folder::JobFolder;
use super::stamp::Stamp;
use crate::batch::{Manifest, TileAddress, curve_order};
use crate::camera::{Photo, PhotoId};
use crate::frame::{CentralView, FrameSpec, FrameTable, Mosaic};
use crate::output::write_atomically;
use crate::render::{BlendSettings, Interpolation, Tolerance};
use crate::report::Inputs;
use crate::tone::{PhotoFit, PhotoTone};
use crate::{Error, Result};

/// No manifest is longer; most of it is photos.
const MAX_BYTES: u64 = 1 << 30;

/// The contents of a job's `manifest.json`, replaced atomically. Whoever has it and the stores can render any of the job's
/// tiles. Paths are relative to the job's folder where they can be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::cli) struct JobRecord {
    /// [`JobRecord::VERSION`].
    pub(in crate::cli) version: u32,
    /// Version of groundel that planned the job.
    pub(in crate::cli) groundel: String,
    /// What the parts have in common.
    pub(in crate::cli) manifest: Manifest,
    /// First tile of each batch, along the curve.
    pub(in crate::cli) batches: Vec<u64>,
    /// The frame, as in `<stem>.frame.toml`.
    pub(in crate::cli) frame: String,
    /// The elevations at which sections end, ascending; none for an ordinary mosaic.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(in crate::cli) sections: Vec<f64>,
    /// The camera of a perspective view, as it is drawn.
    pub(in crate::cli) view: Option<CameraRecord>,
    pub(in crate::cli) rendering: Rendering,
    /// Fingerprint of what decides a pixel beside the photos.
    pub(in crate::cli) common: String,
    /// The folder of the stores.
    pub(in crate::cli) stores: String,
    pub(in crate::cli) mesh: MeshRecord,
    /// The folder of the photos.
    pub(in crate::cli) photo_folder: String,
    /// The folder of the masks.
    pub(in crate::cli) mask_folder: Option<String>,
    /// The photos that are used, by id.
    pub(in crate::cli) photos: Vec<PhotoRecord>,
    /// The names of the whole camera set.
    pub(in crate::cli) names: Vec<String>,
    /// For the report.
    pub(in crate::cli) inputs: Inputs,
    /// For the report.
    pub(in crate::cli) settings: Map<String, Value>,
    /// For the report.
    pub(in crate::cli) warnings: Vec<String>,
}

/// What decides a pixel besides the inputs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::cli) struct Rendering {
    pub(in crate::cli) interpolation: Interpolation,
    pub(in crate::cli) blend: BlendSettings,
    pub(in crate::cli) tolerance: Tolerance,
}

/// The mesh store and what it was made from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::cli) struct MeshRecord {
    /// File name of the store.
    pub(in crate::cli) store: String,
    /// Its key.
    pub(in crate::cli) key: String,
    /// The mesh files.
    pub(in crate::cli) files: Vec<FileRecord>,
}

/// A file and what it is known by.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::cli) struct FileRecord {
    pub(in crate::cli) file: String,
    pub(in crate::cli) stamp: Stamp,
}

/// A photo that is used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::cli) struct PhotoRecord {
    pub(in crate::cli) id: u32,
    pub(in crate::cli) name: String,
    pub(in crate::cli) camera: CameraRecord,
    /// Fingerprint of all that this photo adds to pixels: its file, its camera, its mask.
    pub(in crate::cli) key: String,
    /// What its file is known by; none if nothing of it is needed.
    pub(in crate::cli) stamp: Option<Stamp>,
    /// Its mask, in the folder of masks.
    pub(in crate::cli) mask: Option<FileRecord>,
    /// Its tone; none if it is taken as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(in crate::cli) levelled: Option<Levelled>,
}

/// The tone of a photo, and what it was found from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::cli) struct Levelled {
    pub(in crate::cli) tone: PhotoTone,
    pub(in crate::cli) fit: PhotoFit,
}

impl JobRecord {
    /// Version of the format.
    pub(in crate::cli) const VERSION: u32 = 1;

    /// Reads the record of a job.
    ///
    /// # Errors
    /// [`Error::Usage`] if the folder holds no job; [`Error::Corrupt`] if its manifest is damaged or of another version.
    pub(in crate::cli) fn load(folder: &JobFolder) -> Result<Self> {
        let path = folder.manifest();
        if !path.exists() {
            let folder = folder.path().display();
            return Err(Error::usage(format!(
                "{folder}: expected the folder of a job, found no manifest.json in it (`groundel plan` makes one)"
            )));
        }
        let mut text = String::new();
        File::open(&path)
            .and_then(|file| file.take(MAX_BYTES).read_to_string(&mut text))
            .map_err(|e| Error::io(&path, e))?;
        let record: Self = serde_json::from_str(&text).map_err(|e| {
            let place = format!("line {}, column {}", e.line(), e.column());
            Error::corrupt(&path, place, "a job manifest", e.to_string())
        })?;
        let corrupt = |place: &str, expected: &str, found: String| {
            Error::corrupt(&path, place, expected, found)
        };
        let (own, found) = (env!("CARGO_PKG_VERSION"), &record.groundel);
        if record.version != Self::VERSION || found != own {
            let expected = format!("a job of groundel {own} (format {})", Self::VERSION);
            let found = format!("groundel {found} (format {})", record.version);
            return Err(corrupt("key `groundel`", &expected, found));
        }
        record.manifest.check(&path)?;
        // Ids number the whole set: what is found of a photo is counted under its own.
        let ids = || record.photos.iter().map(|photo| u64::from(photo.id));
        let names = record.names.len() as u64;
        if !ids().is_sorted_by(|a, b| a < b) || ids().any(|id| id >= names) {
            let expected = format!("photos by id, below {names}");
            return Err(corrupt(
                "key `photos`",
                &expected,
                format!("{:?}", ids().collect::<Vec<_>>()),
            ));
        }
        let unsound = |p: &&PhotoRecord| p.levelled.as_ref().is_some_and(|l| !l.tone.is_sound());
        if let Some(photo) = record.photos.iter().find(unsound) {
            let found = format!("{:?}", photo.levelled);
            return Err(corrupt("key `levelled`", "a tone of small numbers", found));
        }
        let (sections, layers) = (record.sections.len(), record.manifest.sections());
        if layers != sections.max(1) || !record.sections.is_sorted_by(|a, b| a < b) {
            let expected = format!("elevations of {layers} sections, ascending");
            return Err(corrupt("key `sections`", &expected, format!("{:?}", record.sections)));
        }
        let tiles = record.manifest.pyramid().tile_count(0) as u64;
        let starts = &record.batches;
        let is_cut = starts.first() == Some(&0)
            && starts.is_sorted_by(|a, b| a < b)
            && starts.last().is_some_and(|last| *last < tiles);
        if !is_cut {
            return Err(corrupt("key `batches`", "a cut of all tiles", format!("{starts:?}")));
        }
        Ok(record)
    }

    /// Writes the record, replacing what was there at once.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(in crate::cli) fn save(&self, folder: &JobFolder) -> Result<()> {
        let mut json = serde_json::to_vec_pretty(self).expect("its keys are strings");
        json.push(b'\n');
        write_atomically(folder.manifest(), &json)
    }

    /// The mosaic.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if the record, read from `folder`, states no frame.
    pub(in crate::cli) fn mosaic(&self, folder: &JobFolder) -> Result<Mosaic> {
        const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
        let corrupt = |found: String| {
            Error::corrupt(folder.manifest(), "key `frame`", "the frame of a mosaic", found)
        };
        let table: FrameTable = toml::from_str(&self.frame).map_err(|e| corrupt(e.to_string()))?;
        let spec = table.check().map_err(|e| corrupt(e.to_string()))?;
        let incomplete = || corrupt("no pixel size or extent".into());
        let mosaic = match spec {
            FrameSpec::Plane(p) => {
                let (size, extent) = p.pixel_size.zip(p.extent).ok_or_else(incomplete)?;
                let slab = p.elevation.unwrap_or(ALL);
                Mosaic::new(p, size, extent, slab)?
            }
            FrameSpec::Cylinder(c) => {
                let (size, extent) = c.pixel_size.zip(c.extent).ok_or_else(incomplete)?;
                let slab = c.elevation.unwrap_or(ALL);
                Mosaic::new(c, size, extent, slab)?
            }
            FrameSpec::Perspective(view) => {
                let camera = self.view.as_ref().ok_or_else(|| corrupt("no camera".into()))?;
                let (lens, pose) = camera.read().map_err(corrupt)?;
                let stated = view.orientation;
                Mosaic::perspective(
                    CentralView { stated, lens, pose },
                    view.elevation.unwrap_or(ALL),
                )?
            }
        };
        if mosaic.size == self.manifest.size() {
            Ok(mosaic)
        } else {
            Err(corrupt(format!("one of {:?} pixels", mosaic.size)))
        }
    }

    /// The mosaic of each section, from the lowest; `mosaic` itself if there are no sections.
    pub(in crate::cli) fn section_mosaics(&self, mosaic: &Mosaic) -> Vec<Mosaic> {
        section_mosaics(mosaic, &self.sections)
    }

    /// The photos that are used, by id.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if the record, read from `folder`, states a camera that is none.
    pub(in crate::cli) fn photos(&self, folder: &JobFolder) -> Result<Vec<Photo>> {
        let photo = |record: &PhotoRecord| {
            let (lens, pose) = record.camera.read().map_err(|found| {
                let place = format!("photo {:?}", record.name);
                Error::corrupt(folder.manifest(), place, "a camera", found)
            })?;
            Ok(Photo { id: PhotoId(record.id), name: record.name.clone(), lens, pose })
        };
        self.photos.iter().map(photo).collect()
    }

    /// The number of batches.
    pub(in crate::cli) fn batch_count(&self) -> u32 {
        u32::try_from(self.batches.len()).unwrap_or(u32::MAX)
    }

    /// The tiles of each batch, in the order in which they are rendered.
    pub(in crate::cli) fn tiles_by_batch(&self) -> Vec<Vec<TileAddress>> {
        let order = curve_order(&self.manifest.pyramid());
        let starts = || self.batches.iter().map(|&at| usize::try_from(at).unwrap_or(order.len()));
        let ends = starts().skip(1).chain([order.len()]);
        starts().zip(ends).map(|(from, to)| order[from..to].to_vec()).collect()
    }
}

/// `mosaic` cut at each of some elevations; as it is if there are none.
pub(in crate::cli) fn section_mosaics(mosaic: &Mosaic, sections: &[f64]) -> Vec<Mosaic> {
    if sections.is_empty() {
        return vec![mosaic.clone()];
    }
    let cut = |&elevation: &f64| Mosaic { slab: [mosaic.slab[0], elevation], ..mosaic.clone() };
    sections.iter().map(cut).collect()
}
