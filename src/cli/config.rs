//! [`Config`]: the settings of a run as built, typed and complete.

use std::path::{Path, PathBuf};
use std::thread;

use clap::ValueEnum;
use serde_json::{Map, Value, json};

use super::args::OrthoArgs;
use super::choice::PhotoChoice;
use super::frame_choice::{self, FrameChoice};
use super::print_size;
use super::project;
use super::settings::{BlendRule, Interpolation, Outliers, Weights};
use super::sidecars;
use super::values::LEAST_MEMORY_BYTES;
use crate::input::{AngleUnit, CameraFormat, CameraOptions};
use crate::output::{Compression, Meaning, PrintResolution, Sidecar};
use crate::report::physical_bytes;
use crate::{Error, Result};

/// Memory cap where the system does not tell how much memory there is, bytes: 2 GiB.
const MEMORY_UNKNOWN_BYTES: u64 = 2 << 30;
/// Side of the tiles in the files: GDAL's for Cloud Optimized GeoTIFF.
const TILE_SIZE: u32 = 512;
/// Where stores go, beside the output.
const WORK_FOLDER: &str = ".groundel";

/// All that `groundel ortho` needs to know.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// The mesh files; face ids run on in this order.
    pub meshes: Vec<PathBuf>,
    /// Added to every vertex of every mesh, metres.
    pub shift: [f64; 3],
    /// The camera set.
    pub cameras: PathBuf,
    /// How the camera set is to be read.
    pub camera_options: CameraOptions,
    /// The folder of the photos.
    pub photos: PathBuf,
    /// Which of the photos to use.
    pub choice: PhotoChoice,
    /// The folder of the photos' masks.
    pub masks: Option<PathBuf>,
    /// What the mosaic is drawn on.
    pub frame: FrameChoice,
    /// Allow a mosaic of more than 10 times the photos' pixels.
    pub force: bool,
    /// How photos are sampled.
    pub interpolation: Interpolation,
    /// Rejection of outlying colours.
    pub outliers: Outliers,
    /// Standard deviations beyond which a colour is rejected.
    pub beta: f64,
    /// Weight of a photo in the mean.
    pub weights: Weights,
    /// How many colours become one.
    pub blend: BlendRule,
    /// How far behind another face a point counts as seen, metres; `None`: 0.02 pixel.
    pub occlusion_tolerance_m: Option<f64>,
    /// Colour under transparent pixels, in the output's range.
    pub undefined: [u16; 3],
    /// The layers to write beside the mosaic, each once, in the order of [`Meaning::ALL`].
    pub layers: Vec<Meaning>,
    /// How large the pixels are on paper, if that is to be stated.
    pub dpi: Option<PrintResolution>,
    /// The files to write beside the mosaic, its frame not counted.
    pub sidecars: Vec<Sidecar>,
    /// The mosaic's file.
    pub out: PathBuf,
    /// Compression of the tiles.
    pub compression: Compression,
    /// Side of the tiles in the files, pixels.
    pub tile_size: u32,
    /// Where to write the run report.
    pub report: Option<PathBuf>,
    /// Memory cap of the process, bytes.
    pub memory_bytes: u64,
    /// Threads.
    pub threads: usize,
    /// Folder for stores.
    pub work: PathBuf,
    /// Show no progress and no summary.
    pub quiet: bool,
}

impl Config {
    /// The settings that `args` and the project file they name make; flags override the file.
    ///
    /// # Errors
    /// [`Error::Usage`] naming flag and key if something needed is missing or makes no sense;
    /// [`Error::Unsupported`] for frames that cannot be drawn yet; what reading the files gives.
    pub fn build(args: OrthoArgs) -> Result<Self> {
        let (args, frame) = project::merged(args)?;
        let args = print_size::resolved(args)?;
        let out = mosaic_file(needed(args.out.clone(), "out")?)?;
        if args.mesh.is_empty() {
            return Err(missing("mesh"));
        }
        let frame = frame_choice::frame(&args, frame)?;
        let sidecars = sidecars::asked(&args, &frame)?;
        Ok(Self {
            cameras: needed(args.cameras.clone(), "cameras")?,
            camera_options: args.camera.options(args.photos.clone(), args.force),
            photos: needed(args.photos.clone(), "photos")?,
            frame,
            meshes: args.mesh,
            // `+ 0.0` turns −0 into 0.
            shift: args.shift.unwrap_or_default().map(|metres| metres + 0.0),
            choice: PhotoChoice { include: args.include, exclude: args.exclude },
            masks: args.masks,
            force: args.force,
            interpolation: args.interpolation.unwrap_or_default(),
            outliers: args.outliers.unwrap_or_default(),
            beta: args.beta.unwrap_or(1.0),
            weights: args.weights.unwrap_or_default(),
            blend: args.blend.unwrap_or_default(),
            occlusion_tolerance_m: args.occlusion_tolerance,
            undefined: args.undefined.unwrap_or_default(),
            layers: Meaning::ALL.into_iter().filter(|l| args.layers.contains(l)).collect(),
            dpi: args.dpi,
            sidecars,
            compression: args.compress.unwrap_or(Compression::Deflate),
            tile_size: args.tile_size.unwrap_or(TILE_SIZE),
            report: args.report,
            memory_bytes: args.memory.unwrap_or_else(default_memory_bytes),
            threads: args.threads.unwrap_or_else(all_processors),
            work: args.work.unwrap_or_else(|| out.with_file_name(WORK_FOLDER)),
            quiet: args.quiet,
            out,
        })
    }

    /// The file of a layer: `<out stem>.<layer>.tif` beside the mosaic; of [`Meaning::Mosaic`]: the mosaic.
    pub fn layer_file(&self, layer: Meaning) -> PathBuf {
        match layer {
            Meaning::Mosaic => self.out.clone(),
            _ => self.beside(&format!("{}.tif", layer.name())),
        }
    }

    /// The frame written beside the mosaic: `<out stem>.frame.toml`.
    pub fn frame_file(&self) -> PathBuf {
        self.beside("frame.toml")
    }

    /// A file beside the mosaic that can be asked for: `<out stem>.tfw`, `<out stem>.dxf`.
    pub fn sidecar_file(&self, sidecar: Sidecar) -> PathBuf {
        self.beside(sidecar.extension())
    }

    fn beside(&self, ending: &str) -> PathBuf {
        let mut name = self.out.file_stem().unwrap_or_default().to_os_string();
        name.push(".");
        name.push(ending);
        self.out.with_file_name(name)
    }

    /// The settings that reach a pixel or a file, for the report, by their flag's name in snake case.
    pub fn described(&self) -> Map<String, Value> {
        let layers: Vec<_> = self.layers.iter().map(|layer| layer.name()).collect();
        let settings = [
            ("shift", json!(self.shift)),
            ("camera_format", json!(self.camera_options.format.map(CameraFormat::word))),
            ("angle_unit", json!(self.camera_options.angle_unit.map(AngleUnit::word))),
            ("pixel_pitch", json!(self.camera_options.pixel_pitch_mm)),
            ("lens", json!(self.camera_options.lens.word())),
            ("include", json!(self.choice.include)),
            ("exclude", json!(self.choice.exclude)),
            ("masks", json!(self.masks.as_ref().map(|path| path.display().to_string()))),
            ("interpolation", json!(word(&self.interpolation))),
            ("outliers", json!(word(&self.outliers))),
            ("beta", json!(self.beta)),
            ("weights", json!(word(&self.weights))),
            ("blend", json!(word(&self.blend))),
            ("occlusion_tolerance", json!(self.occlusion_tolerance_m)),
            ("undefined", json!(self.undefined)),
            ("layers", json!(layers)),
            ("dpi", json!(self.dpi)),
            ("sidecars", json!(self.sidecars)),
            ("compress", json!(self.compression.name())),
            ("tile_size", json!(self.tile_size)),
        ];
        settings.into_iter().map(|(key, value)| (key.to_string(), value)).collect()
    }
}

/// The word by which a value is chosen.
fn word(value: &impl ValueEnum) -> String {
    value.to_possible_value().map(|word| word.get_name().to_string()).unwrap_or_default()
}

fn missing(key: &str) -> Error {
    let flag = key.replace('_', "-");
    Error::usage(format!("--{flag} is missing (in a project file: `{key}`)"))
}

fn needed<T>(value: Option<T>, key: &str) -> Result<T> {
    value.ok_or_else(|| missing(key))
}

/// A mosaic's name ends in `.tif` or `.tiff`, so that its layers' names can be made from it.
fn mosaic_file(out: PathBuf) -> Result<PathBuf> {
    let is_tiff = |path: &Path| {
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        matches!(extension.as_deref(), Some("tif" | "tiff"))
    };
    if is_tiff(&out) {
        Ok(out)
    } else {
        Err(Error::usage(format!("--out: expected a name ending in .tif, found {}", out.display())))
    }
}

/// Half of the physical memory, but no less than the least cap.
pub(super) fn default_memory_bytes() -> u64 {
    physical_bytes().map_or(MEMORY_UNKNOWN_BYTES, |bytes| bytes / 2).max(LEAST_MEMORY_BYTES)
}

/// As many threads as the process may run at once.
pub(super) fn all_processors() -> usize {
    thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::View;

    fn args() -> OrthoArgs {
        OrthoArgs {
            mesh: vec!["m.ply".into()],
            cameras: Some("sparse".into()),
            photos: Some("images".into()),
            view: Some(View::Top),
            out: Some("out/façade 1.tif".into()),
            ..Default::default()
        }
    }

    #[test]
    fn defaults_are_those_of_the_paper() {
        let config = Config::build(args()).unwrap();
        assert_eq!(config.interpolation, Interpolation::Bicubic);
        assert_eq!((config.outliers, config.beta), (Outliers::Sigma, 1.0));
        assert_eq!((config.weights, config.blend), (Weights::Area, BlendRule::Mean));
        assert_eq!((config.undefined, config.tile_size), ([0, 0, 0], 512));
        assert_eq!(config.compression, Compression::Deflate);
        assert_eq!(config.work, Path::new("out/.groundel"));
        assert!(config.threads >= 1 && config.memory_bytes >= 256 << 20);
    }

    #[test]
    fn what_is_missing_is_named_as_flag_and_as_key() {
        for name in ["mesh", "cameras", "photos", "out"] {
            let mut args = args();
            match name {
                "mesh" => args.mesh.clear(),
                "cameras" => args.cameras = None,
                "photos" => args.photos = None,
                _ => args.out = None,
            }
            let error = Config::build(args).unwrap_err().to_string();
            assert_eq!(error, format!("--{name} is missing (in a project file: `{name}`)"));
        }
    }

    #[test]
    fn layers_stand_once_in_a_fixed_order_and_beside_the_mosaic() {
        let layers = vec![Meaning::Best, Meaning::Elevation, Meaning::Best];
        let config = Config::build(OrthoArgs { layers, ..args() }).unwrap();
        assert_eq!(config.layers, [Meaning::Elevation, Meaning::Best]);
        assert_eq!(config.layer_file(Meaning::Best), Path::new("out/façade 1.best.tif"));
        assert_eq!(config.layer_file(Meaning::Mosaic), config.out);
        assert_eq!(config.frame_file(), Path::new("out/façade 1.frame.toml"));
    }

    #[test]
    fn a_mosaic_that_is_no_tiff_is_refused() {
        let out = Config::build(OrthoArgs { out: Some("o.jpg".into()), ..args() }).unwrap_err();
        assert_eq!(out.to_string(), "--out: expected a name ending in .tif, found o.jpg");
    }

    #[test]
    fn the_report_names_settings_by_their_words() {
        let settings = Config::build(args()).unwrap().described();
        assert_eq!(settings["interpolation"], "bicubic");
        assert_eq!(settings["compress"], "deflate");
        assert_eq!(settings["occlusion_tolerance"], Value::Null);
    }
}
