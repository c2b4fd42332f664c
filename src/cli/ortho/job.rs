//! The plan of a job: its grid, its scene, and the record that says it all.

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;
use xxhash_rust::xxh3::xxh3_128;

use super::super::config::Config;
use super::super::job::{
    CameraRecord, FileRecord, JobFolder, JobRecord, Levelled, MeshRecord, PhotoRecord, Rendering,
    Stamp, Thoroughness, section_mosaics,
};
use super::inputs::Inputs;
use super::levelling::{LevelledPhotos, levelled};
use super::precision;
use super::profile::CommonProfile;
use super::reporting;
use super::stores::Stores;
use crate::batch::Manifest;
use crate::camera::Photo;
use crate::frame::{Mosaic, MosaicFrame, frame_toml};
use crate::geom::Bounds3;
use crate::image::{Colour, Depth};
use crate::output::{Georeference, IccProfile, Layer, Meaning, TileFormat, parse_crs};
use crate::render::{self, Canvas, Scene, ScenePhoto};
use crate::store::photo::PhotoStore;
use crate::tone::{PhotoTone, ToneGrid};
use crate::{Error, Result};

/// ε of the occlusion test where `--occlusion-tolerance` does not say: this part of a mosaic pixel.
const TOLERANCE_PX: f64 = 0.02;

/// All that rendering needs, decided once.
#[derive(Debug)]
pub(in crate::cli) struct Job {
    pub(in crate::cli) folder: JobFolder,
    pub(in crate::cli) record: JobRecord,
    pub(in crate::cli) mosaic: Mosaic,
    pub(in crate::cli) canvas: Canvas,
    pub(in crate::cli) scene: Scene,
}

/// Where a job lies, and who renders it.
#[derive(Debug, Clone, Copy)]
pub(in crate::cli) enum Place<'a> {
    /// In the work folder, for this process.
    Work,
    /// In a folder of its own, for any machine.
    Own(&'a JobFolder),
}

impl Job {
    /// Decides colour, depth and layers of a mosaic, and writes down the whole job, all its tiles in one batch.
    pub(in crate::cli) fn plan(
        config: &Config,
        inputs: &Inputs,
        mosaic: Mosaic,
        stores: Stores,
        place: Place<'_>,
    ) -> Result<Self> {
        let (colour, depth) = colour_and_depth(&stores.pixels, &stores.photos);
        let rendering = rendering(config, &mosaic, (colour, depth))?;
        let common = CommonProfile::of(&config.photos, &stores.photos, colour)?;
        let mut warnings = precision::warnings(inputs, &stores.mesh);
        warnings.extend(common.warnings);
        let (origin, bounds) = (stores.mesh.origin(), stores.mesh.bounds());
        let bounds_ground = Bounds3 { min: bounds.min + origin, max: bounds.max + origin };
        warnings.extend(inputs.doubts(config, &bounds_ground)?);
        let profile = common.profile.map(IccProfile::new);
        let names = inputs.cameras.names.len();
        let (stores, levelled) = levelled(config, &mosaic, &rendering, stores, names)?;
        warnings.extend(levelled.warning.clone());
        let keys = Keys::of(&mosaic, &stores, &rendering, &levelled);
        let sections = section_mosaics(&mosaic, &config.sections);
        let manifest = manifest(config, inputs, &sections, &rendering, (profile, keys.settings()))?;
        let folder = match place {
            Place::Own(folder) => folder.clone(),
            Place::Work => {
                let name = format!("job-{:032x}", manifest.fingerprint());
                JobFolder::new(&config.work.join(name))
            }
        };
        fs::create_dir_all(folder.path()).map_err(|e| Error::io(folder.path(), e))?;
        let thoroughness = match place {
            Place::Own(_) => Thoroughness::Whole,
            Place::Work => Thoroughness::Sampled,
        };
        let photos = photo_records(config, (&stores, &levelled), inputs, (&keys, thoroughness))?;
        let record = JobRecord {
            version: JobRecord::VERSION,
            groundel: env!("CARGO_PKG_VERSION").into(),
            manifest,
            batches: vec![0],
            frame: frame_toml(&mosaic),
            sections: config.sections.clone(),
            view: view(&mosaic),
            rendering,
            common: keys.common,
            stores: folder.state(&config.work)?,
            mesh: mesh_record(&folder, inputs, &stores)?,
            photo_folder: folder.state(&config.photos)?,
            mask_folder: config.masks.as_ref().map(|masks| folder.state(masks)).transpose()?,
            photos,
            names: inputs.cameras.names.clone(),
            inputs: reporting::inputs(config, inputs, &stores),
            settings: config.described(),
            warnings,
        };
        let canvas = canvas(&sections, &rendering, stores.mesh.origin());
        let scene = scene(&rendering, stores, &levelled.tones(), names)?;
        Ok(Self { folder, record, mosaic, canvas, scene })
    }
}

/// The canvas of a mosaic, or of the sections of one, from the lowest.
///
/// # Panics
/// If there is none.
pub(in crate::cli) fn canvas(sections: &[Mosaic], rendering: &Rendering, origin: DVec3) -> Canvas {
    let (highest, below) = sections.split_last().expect("at least one section");
    Canvas {
        mosaic: highest.local(origin),
        below: below.iter().map(|section| section.local(origin)).collect(),
        tolerance: rendering.tolerance,
    }
}

/// What is photographed, and the rule by which it is coloured.
///
/// `tones` are those of the photos in the stores, in their order.
pub(in crate::cli) fn scene(
    rendering: &Rendering,
    stores: Stores,
    tones: &[Option<&PhotoTone>],
    names: usize,
) -> Result<Scene> {
    let Stores { mesh, pixels, masks, photos, .. } = stores;
    let origin = mesh.origin();
    let depth = rendering.blend.depth;
    let photos = photos.iter().zip(tones).map(|(photo, tone)| {
        let of = scene_photo(photo, origin, &pixels, depth)?;
        let tone = tone.map(|tone| ToneGrid::new(tone, photo.lens.size()));
        Ok(ScenePhoto { tone, ..of })
    });
    Ok(Scene {
        photos: photos.collect::<Result<_>>()?,
        mesh,
        pixels,
        masks,
        interpolation: rendering.interpolation,
        blend: rendering.blend,
        names,
    })
}

fn rendering(
    config: &Config,
    mosaic: &Mosaic,
    (colour, depth): (Colour, Depth),
) -> Result<Rendering> {
    let blend = render::BlendSettings {
        outliers: config.outliers,
        beta: config.beta,
        weights: config.weights,
        edges: config.edges,
        blend: config.blend,
        colour,
        depth,
        undefined: config.undefined,
    };
    blend.check()?;
    Ok(Rendering {
        interpolation: config.interpolation,
        blend,
        tolerance: tolerance(config, mosaic),
    })
}

/// ε of the occlusion test.
fn tolerance(config: &Config, mosaic: &Mosaic) -> render::Tolerance {
    match (config.occlusion_tolerance_m, &mosaic.frame) {
        (Some(metres), _) => render::Tolerance::Fixed(metres),
        (None, MosaicFrame::Perspective(view)) => {
            let focal = view.lens.focal_px();
            render::Tolerance::OfDepth(TOLERANCE_PX / (focal.x * focal.y).sqrt())
        }
        (None, _) => render::Tolerance::Fixed(TOLERANCE_PX * mosaic.pixel_size),
    }
}

/// RGB if any photo has colour, 16 bit if any photo has.
fn colour_and_depth(pixels: &PhotoStore, photos: &[Photo]) -> (Colour, Depth) {
    let any = |test: &dyn Fn(usize) -> bool| photos.iter().any(|p| test(p.id.0 as usize));
    let colour = if any(&|k| pixels.channels(k) > 1) { Colour::Rgb } else { Colour::Grey };
    let depth = if any(&|k| pixels.bits(k) > 8) { Depth::Sixteen } else { Depth::Eight };
    (colour, depth)
}

fn scene_photo(photo: &Photo, origin: DVec3, pixels: &PhotoStore, to: Depth) -> Result<ScenePhoto> {
    let limit = u64::from(render::OrthoTile::NO_PHOTO) - 1;
    let index = u16::try_from(photo.id.0).ok().filter(|&i| u64::from(i) <= limit);
    let index = index.ok_or_else(|| Error::Limit {
        what: "index of a photo in the camera set (the layer `best` has 16 bits)".into(),
        limit,
        found: photo.id.0.into(),
    })?;
    let own = if pixels.bits(photo.id.0 as usize) > 8 { Depth::Sixteen } else { Depth::Eight };
    Ok(ScenePhoto::new(index, photo, origin, own.gain(to)))
}

/// What a perspective view is drawn of.
fn view(mosaic: &Mosaic) -> Option<CameraRecord> {
    match &mosaic.frame {
        MosaicFrame::Perspective(view) => Some(CameraRecord::new(&view.lens, &view.pose)),
        MosaicFrame::Plane(_) | MosaicFrame::Cylinder(_) => None,
    }
}

/// Fingerprints of everything that decides a pixel: version, inputs and settings.
struct Keys {
    /// Of all but the photos.
    common: String,
    /// Of each photo in the store: its file, camera, mask and tone.
    photos: Vec<String>,
}

impl Keys {
    /// Debug forms of f64 read back to the same bits.
    fn of(
        mosaic: &Mosaic,
        stores: &Stores,
        rendering: &Rendering,
        levelled: &LevelledPhotos,
    ) -> Self {
        let version = env!("CARGO_PKG_VERSION");
        let (frame, mesh, view) = (frame_toml(mosaic), stores.mesh.key(), view(mosaic));
        let common = format!("{version}\n{frame}\n{view:?}\n{mesh:?}\n{rendering:?}\n");
        let key = |(photo, tone): (&Photo, Option<&PhotoTone>)| {
            let number = photo.id.0 as usize;
            let masks = stores.masks.as_ref().filter(|masks| masks.has(number));
            let mask = masks.map(|masks| masks.fingerprint(number));
            let file = stores.pixels.fingerprint(number);
            hash(&format!("{photo:?} {file:?} {mask:?} {tone:?}"))
        };
        let photos = stores.photos.iter().zip(levelled.tones()).map(key).collect();
        Self { common: hash(&common), photos }
    }

    /// Of all together.
    fn settings(&self) -> String {
        hash(&format!("{}\n{}", self.common, self.photos.join("\n")))
    }
}

fn hash(text: &str) -> String {
    format!("{:032x}", xxh3_128(text.as_bytes()))
}

fn mesh_record(folder: &JobFolder, inputs: &Inputs, stores: &Stores) -> Result<MeshRecord> {
    let file = |path: &Path| -> Result<FileRecord> {
        let stamp = Stamp::of(path, Thoroughness::Sampled)?;
        Ok(FileRecord { file: folder.state(path)?, stamp })
    };
    let meshes = inputs.meshes.iter();
    let files = meshes.flat_map(|mesh| {
        let further = mesh.further_files().iter().map(PathBuf::as_path);
        std::iter::once(mesh.path()).chain(further)
    });
    let store = stores.mesh.path().file_name().and_then(|name| name.to_str());
    Ok(MeshRecord {
        store: store.unwrap_or_default().into(),
        key: stores.mesh.key().hex(),
        files: files.map(file).collect::<Result<_>>()?,
    })
}

fn photo_records(
    config: &Config,
    (stores, levelled): (&Stores, &LevelledPhotos),
    inputs: &Inputs,
    (keys, how): (&Keys, Thoroughness),
) -> Result<Vec<PhotoRecord>> {
    let keyed = stores.photos.iter().zip(&keys.photos);
    let all: Vec<_> = keyed.zip(&levelled.photos).collect();
    let record = |((photo, key), levelled): &((&Photo, &String), &Option<Levelled>)| {
        let is_needed = stores.pixels.fingerprint(photo.id.0 as usize).is_some();
        let stamp = || Stamp::of(&config.photos.join(&photo.name), how);
        let mask = inputs.masks.iter().find(|mask| mask.photo == photo.id.0 && is_needed);
        let mask = mask.map(|mask| -> Result<FileRecord> {
            let path = &mask.source.path;
            let below = config.masks.as_ref().and_then(|folder| path.strip_prefix(folder).ok());
            let file = below.unwrap_or(path).display().to_string();
            Ok(FileRecord { file, stamp: Stamp::of(path, how)? })
        });
        Ok(PhotoRecord {
            id: photo.id.0,
            name: photo.name.clone(),
            camera: CameraRecord::new(&photo.lens, &photo.pose),
            key: (*key).clone(),
            stamp: is_needed.then(stamp).transpose()?,
            mask: mask.transpose()?,
            levelled: (*levelled).clone(),
        })
    };
    all.par_iter().map(record).collect()
}

fn manifest(
    config: &Config,
    inputs: &Inputs,
    sections: &[Mosaic],
    rendering: &Rendering,
    (profile, settings): (Option<IccProfile>, String),
) -> Result<Manifest> {
    let mosaic = sections.first().expect("at least one section");
    let crs = mosaic.plane().and_then(|plane| plane.crs.as_deref());
    let epsg = crs.map(parse_crs).transpose()?;
    let [origin_u, _, _, origin_v] = mosaic.extent;
    let pixel_size = mosaic.pixel_size;
    // A perspective view has no coordinates of the ground.
    let georeference =
        (pixel_size > 0.0).then_some(Georeference { origin_u, origin_v, pixel_size, epsg });
    let colours = Layer::mosaic(rendering.blend.colour, rendering.blend.depth);
    let mut layers = vec![match profile {
        Some(profile) => colours.with_profile(profile),
        None => colours,
    }];
    layers.extend(config.layers.iter().filter_map(|&meaning| Layer::of(meaning)));
    let with_items = |layer: Layer, frame: &str| {
        let layer = layer.with_item("GROUNDEL_FRAME", frame);
        match layer.meaning() {
            Meaning::Best => {
                inputs.cameras.names.iter().enumerate().fold(layer, |layer, (k, name)| {
                    layer.with_item(format!("PHOTO_{k}"), name.clone())
                })
            }
            _ => layer,
        }
    };
    let of_section = |(number, section): (u16, &Mosaic)| {
        let frame = frame_toml(section);
        let layer = |l: &Layer| with_items(l.clone(), &frame).of_section(number);
        layers.iter().map(layer).collect::<Vec<_>>()
    };
    let layers = (0..).zip(sections).flat_map(of_section).collect();
    let format = TileFormat { tile_size: config.tile_size, compression: config.compression };
    let manifest = Manifest::new(mosaic.size, format, layers, georeference, settings)?;
    Ok(manifest.with_extras(config.dpi, config.sidecars.clone()))
}
