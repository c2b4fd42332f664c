//! The plan of a job: its grid, its scene, its manifest and where its files go.

use std::fs;
use std::path::PathBuf;

use glam::DVec3;
use xxhash_rust::xxh3::xxh3_128;

use super::super::config::Config;
use super::choices;
use super::inputs::Inputs;
use super::precision;
use super::profile::CommonProfile;
use super::stores::Stores;
use crate::batch::Manifest;
use crate::camera::Photo;
use crate::frame::{Mosaic, MosaicFrame, frame_toml};
use crate::geom::Bounds3;
use crate::image::{Colour, Depth};
use crate::output::{Georeference, IccProfile, Layer, Meaning, TileFormat, parse_crs};
use crate::render::{self, Scene, ScenePhoto};
use crate::report::LeftOut;
use crate::store::mesh::MeshStore;
use crate::store::photo::PhotoStore;
use crate::{Error, Result};

/// ε of the occlusion test where `--occlusion-tolerance` does not say: this part of a mosaic pixel.
const TOLERANCE_PX: f64 = 0.02;

/// All that rendering needs, decided once.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) mosaic: Mosaic,
    pub(super) scene: Scene,
    pub(super) photos: Vec<Photo>,
    pub(super) left_out: Vec<LeftOut>,
    /// What the user should know, but what kept nothing from being done.
    pub(super) warnings: Vec<String>,
    pub(super) manifest: Manifest,
    /// The job's folder in the work folder.
    pub(super) folder: PathBuf,
    /// Its part file.
    pub(super) part: PathBuf,
    /// The file of each layer of the manifest.
    pub(super) outputs: Vec<PathBuf>,
}

impl Job {
    /// Decides colour, depth and layers of a mosaic.
    pub(super) fn plan(
        config: &Config,
        inputs: &Inputs,
        mosaic: Mosaic,
        stores: Stores,
    ) -> Result<Self> {
        let Stores { mesh, pixels, masks, photos, left_out } = stores;
        let mut warnings = precision::warnings(inputs, &mesh);
        let (colour, depth) = colour_and_depth(&pixels, &photos);
        let blend = render::BlendSettings {
            outliers: choices::outliers(config.outliers),
            beta: config.beta,
            weights: choices::weights(config.weights),
            blend: choices::blend(config.blend),
            colour,
            depth,
            undefined: config.undefined,
        };
        blend.check()?;
        let tolerance = tolerance(config, &mosaic);
        let rendering = Rendering {
            interpolation: choices::interpolation(config.interpolation),
            blend,
            tolerance,
        };
        let stores = (&mesh, &pixels, masks.as_ref());
        let settings = fingerprint(&mosaic, stores, &photos, &rendering);
        let common = CommonProfile::of(&config.photos, &photos, colour)?;
        warnings.extend(common.warnings);
        let profile = common.profile.map(IccProfile::new);
        let manifest = manifest(config, inputs, &mosaic, &rendering, (profile, settings))?;
        let origin = mesh.origin();
        let bounds = mesh.bounds();
        let bounds_ground = Bounds3 { min: bounds.min + origin, max: bounds.max + origin };
        warnings.extend(inputs.doubts(config, &bounds_ground)?);
        let scene = Scene {
            mosaic: mosaic.local(origin),
            photos: photos
                .iter()
                .map(|p| scene_photo(p, origin, &pixels, depth))
                .collect::<Result<_>>()?,
            mesh,
            pixels,
            masks,
            interpolation: rendering.interpolation,
            blend,
            names: inputs.cameras.names.len(),
            tolerance: rendering.tolerance,
        };
        let folder = config.work.join(format!("job-{:032x}", manifest.fingerprint()));
        fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        manifest.save(&folder.join("manifest.json"))?;
        let outputs = manifest.layers().iter().map(|l| config.layer_file(l.meaning())).collect();
        let part = folder.join("part-0");
        Ok(Self { mosaic, scene, photos, left_out, warnings, manifest, folder, part, outputs })
    }
}

/// What decides a pixel besides the inputs.
#[derive(Debug)]
struct Rendering {
    interpolation: render::Interpolation,
    blend: render::BlendSettings,
    tolerance: render::Tolerance,
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

/// Identifies everything that decides a pixel: version, inputs and settings. Debug forms of f64 read back to the same bits.
fn fingerprint(
    mosaic: &Mosaic,
    (mesh, pixels, masks): (&MeshStore, &PhotoStore, Option<&PhotoStore>),
    photos: &[Photo],
    rendering: &Rendering,
) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let mut text = format!("{version}\n{}\n{:?}\n{rendering:?}\n", frame_toml(mosaic), mesh.key());
    let photo_line = |p: &Photo| format!("{p:?} {:?}\n", pixels.fingerprint(p.id.0 as usize));
    text.extend(photos.iter().map(photo_line));
    if let Some(masks) = masks {
        let masked = photos.iter().map(|p| p.id.0 as usize).filter(|&k| masks.has(k));
        text.extend(masked.map(|k| format!("mask {k} {:?}\n", masks.fingerprint(k))));
    }
    format!("{:032x}", xxh3_128(text.as_bytes()))
}

fn manifest(
    config: &Config,
    inputs: &Inputs,
    mosaic: &Mosaic,
    rendering: &Rendering,
    (profile, settings): (Option<IccProfile>, String),
) -> Result<Manifest> {
    let crs = mosaic.plane().and_then(|plane| plane.crs.as_deref());
    let epsg = crs.map(parse_crs).transpose()?;
    let [origin_u, _, _, origin_v] = mosaic.extent;
    let pixel_size = mosaic.pixel_size;
    // A perspective view has no coordinates of the ground.
    let georeference =
        (pixel_size > 0.0).then_some(Georeference { origin_u, origin_v, pixel_size, epsg });
    let frame = frame_toml(mosaic);
    let colours = Layer::mosaic(rendering.blend.colour, rendering.blend.depth);
    let mut layers = vec![match profile {
        Some(profile) => colours.with_profile(profile),
        None => colours,
    }];
    layers.extend(config.layers.iter().filter_map(|&meaning| Layer::of(meaning)));
    let with_items = |layer: Layer| {
        let layer = layer.with_item("GROUNDEL_FRAME", frame.clone());
        match layer.meaning() {
            Meaning::Best => {
                inputs.cameras.names.iter().enumerate().fold(layer, |layer, (k, name)| {
                    layer.with_item(format!("PHOTO_{k}"), name.clone())
                })
            }
            _ => layer,
        }
    };
    let layers = layers.into_iter().map(with_items).collect();
    let format = TileFormat { tile_size: config.tile_size, compression: config.compression };
    let manifest = Manifest::new(mosaic.size, format, layers, georeference, settings)?;
    Ok(manifest.with_extras(config.dpi, config.sidecars.clone()))
}
