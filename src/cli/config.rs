//! [`Config`]: the settings of a run as built, typed and complete.

use std::path::PathBuf;
use std::thread;

use clap::ValueEnum;
use glam::DVec3;
use serde_json::{Map, Value, json};

use super::args::OrthoArgs;
use super::choice::PhotoChoice;
use super::frame_choice::{self, FrameChoice};
use super::job::{self, JobFolder};
use super::print_size;
use super::project;
use super::sections;
use super::settings::{BlendRule, ColourRule, Edges, Interpolation, Levelling, Outliers, Weights};
use super::sidecars;
use super::values::LEAST_MEMORY_BYTES;
use crate::frame::FrameSpec;
use crate::input::{AngleUnit, CameraFormat, CameraOptions, Shift};
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
    /// The point clouds, whose triangles' ids run on behind those of the meshes.
    pub points: Vec<PathBuf>,
    /// Longest edge of a triangle of points, metres in the plane; `None`: by their spacing.
    pub max_edge_m: Option<f64>,
    /// Added to every vertex of every mesh and to every point, metres.
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
    /// The elevations of the sections to make, ascending; empty for an ordinary mosaic.
    pub sections: Vec<f64>,
    /// Allow a mosaic of more than 10 times the photos' pixels.
    pub force: bool,
    /// How photos are brought to one tone.
    pub levelling: Levelling,
    /// Patterns of the photos whose tone counts; empty: all.
    pub tone_from: Vec<String>,
    /// What a sample weighs near the border of what its photo sees.
    pub edges: Edges,
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
        Self::of_merged(args, frame)
    }

    /// The same for a job in the folder `job`: its stores lie there, and its files go nowhere yet.
    ///
    /// # Errors
    /// As [`Self::build`]; [`Error::Usage`] for a work folder.
    pub(super) fn build_for(job: &JobFolder, args: OrthoArgs) -> Result<Self> {
        if args.work.is_some() {
            return Err(Error::usage("--work does not go with `plan`: the stores lie in the job"));
        }
        let (args, frame) = project::merged(args)?;
        let (work, out) = (Some(job.stores()), Some(job.path().join("mosaic.tif")));
        Self::of_merged(OrthoArgs { work, out, report: None, ..args }, frame)
    }

    fn of_merged(args: OrthoArgs, frame: Option<FrameSpec>) -> Result<Self> {
        let args = print_size::resolved(args)?;
        let out = job::check_name(needed(args.out.clone(), "out")?)?;
        check_surface(&args)?;
        let cameras = needed(args.cameras.clone(), "cameras")?;
        let photos = needed(args.photos.clone(), "photos")?;
        let sections = args.sections.map(sections::elevations).unwrap_or_default();
        let frame = sections::over_all(frame_choice::frame(&args, frame)?, &sections)?;
        let sidecars = sidecars::asked(&args, &frame)?;
        // `+ 0.0` turns −0 into 0.
        let shift = args.shift.as_ref().map_or(Ok([0.0; 3]), Shift::metres)?.map(|v| v + 0.0);
        let odm_offset = match args.shift {
            Some(Shift::OfOdm(_)) => Some(DVec3::from(shift)),
            _ => None,
        };
        let preset = Preset::of(args.colour.unwrap_or_default());
        let camera_options = args.camera.options(args.photos.clone(), args.force);
        Ok(Self {
            cameras,
            camera_options: CameraOptions { odm_offset, ..camera_options },
            photos,
            frame,
            sections,
            meshes: args.mesh,
            points: args.points,
            max_edge_m: args.max_edge,
            shift,
            choice: PhotoChoice { include: args.include, exclude: args.exclude },
            masks: args.masks,
            force: args.force,
            levelling: args.levelling.unwrap_or(preset.levelling),
            tone_from: args.tone_from,
            edges: args.edges.unwrap_or(preset.edges),
            interpolation: args.interpolation.unwrap_or_default(),
            outliers: args.outliers.unwrap_or(preset.outliers),
            beta: args.beta.unwrap_or(1.0),
            weights: args.weights.unwrap_or(preset.weights),
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

    /// The mosaics, one a section from the lowest.
    pub fn mosaic_files(&self) -> Vec<PathBuf> {
        if self.sections.is_empty() {
            return vec![self.out.clone()];
        }
        self.sections.iter().map(|&elevation| sections::file(&self.out, elevation)).collect()
    }

    /// All files that are written, the report not counted: of each mosaic its layers, its frame, itself.
    pub fn files(&self) -> Vec<PathBuf> {
        let of = |mosaic: PathBuf| {
            let layers = self.layers.iter().map(|&layer| job::layer_file(&mosaic, layer));
            let sidecars = self.sidecars.iter().map(|&kind| job::sidecar_file(&mosaic, kind));
            let frame = job::frame_file(&mosaic);
            let mut files: Vec<_> = layers.chain(sidecars).chain([frame]).collect();
            files.push(mosaic);
            files
        };
        self.mosaic_files().into_iter().flat_map(of).collect()
    }

    /// The settings that reach a pixel or a file, for the report, by their flag's name in snake case.
    pub fn described(&self) -> Map<String, Value> {
        let layers: Vec<_> = self.layers.iter().map(|layer| layer.name()).collect();
        let settings = [
            ("max_edge", json!(self.max_edge_m)),
            ("shift", json!(self.shift)),
            ("camera_format", json!(self.camera_options.format.map(CameraFormat::word))),
            ("angle_unit", json!(self.camera_options.angle_unit.map(AngleUnit::word))),
            ("pixel_pitch", json!(self.camera_options.pixel_pitch_mm)),
            ("lens", json!(self.camera_options.lens.word())),
            ("include", json!(self.choice.include)),
            ("exclude", json!(self.choice.exclude)),
            ("masks", json!(self.masks.as_ref().map(|path| path.display().to_string()))),
            ("levelling", json!(word(&self.levelling))),
            ("tone_from", json!(self.tone_from)),
            ("edges", json!(word(&self.edges))),
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
        let sections = (!self.sections.is_empty()).then(|| ("sections", json!(self.sections)));
        let all = settings.into_iter().chain(sections);
        all.map(|(key, value)| (key.to_string(), value)).collect()
    }
}

/// What a rule sets unless it is said otherwise.
struct Preset {
    levelling: Levelling,
    edges: Edges,
    outliers: Outliers,
    weights: Weights,
}

impl Preset {
    fn of(rule: ColourRule) -> Self {
        match rule {
            ColourRule::Even => Self {
                levelling: Levelling::Full,
                edges: Edges::Guard,
                outliers: Outliers::Robust,
                weights: Weights::Sharp,
            },
            ColourRule::Paper => Self {
                levelling: Levelling::None,
                edges: Edges::None,
                outliers: Outliers::Sigma,
                weights: Weights::Area,
            },
        }
    }
}

/// The word by which a value is chosen.
fn word(value: &impl ValueEnum) -> String {
    value.to_possible_value().map(|word| word.get_name().to_string()).unwrap_or_default()
}

/// A surface is given, as meshes or as points.
fn check_surface(args: &OrthoArgs) -> Result<()> {
    match (args.mesh.is_empty(), args.points.is_empty(), args.max_edge) {
        (true, true, _) => Err(Error::usage(
            "--mesh or --points is missing (in a project file: `mesh` or `points`)",
        )),
        (_, true, Some(_)) => {
            Err(Error::usage("--max-edge goes with --points only (in a project file: `max_edge`)"))
        }
        _ => Ok(()),
    }
}

fn missing(key: &str) -> Error {
    let flag = key.replace('_', "-");
    Error::usage(format!("--{flag} is missing (in a project file: `{key}`)"))
}

fn needed<T>(value: Option<T>, key: &str) -> Result<T> {
    value.ok_or_else(|| missing(key))
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
    use std::path::Path;

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
    fn a_rule_sets_what_is_not_said_and_the_default_is_even() {
        let config = Config::build(args()).unwrap();
        assert_eq!(config.interpolation, Interpolation::Bicubic);
        assert_eq!((config.levelling, config.edges), (Levelling::Full, Edges::Guard));
        assert_eq!((config.outliers, config.weights), (Outliers::Robust, Weights::Sharp));
        let paper = OrthoArgs { colour: Some(ColourRule::Paper), ..args() };
        let paper = Config::build(OrthoArgs { levelling: Some(Levelling::Gain), ..paper }).unwrap();
        assert_eq!((paper.levelling, paper.edges), (Levelling::Gain, Edges::None));
        assert_eq!((paper.outliers, paper.beta), (Outliers::Sigma, 1.0));
        assert_eq!((paper.weights, paper.blend), (Weights::Area, BlendRule::Mean));
        assert_eq!((config.undefined, config.tile_size), ([0, 0, 0], 512));
        assert_eq!(config.compression, Compression::Deflate);
        assert_eq!(config.work, Path::new("out/.groundel"));
        assert!(config.threads >= 1 && config.memory_bytes >= 256 << 20);
    }

    #[test]
    fn what_is_missing_is_named_as_flag_and_as_key() {
        let none = Config::build(OrthoArgs { mesh: Vec::new(), ..args() }).unwrap_err().to_string();
        assert!(none.starts_with("--mesh or --points is missing"), "{none}");
        for name in ["cameras", "photos", "out"] {
            let mut args = args();
            match name {
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
        let files = ["elevation.tif", "best.tif", "frame.toml", "tif"];
        assert_eq!(config.files(), files.map(|end| PathBuf::from(format!("out/façade 1.{end}"))));
        let sections = Some([-1.0, 0.0, 1.0]);
        let config = Config::build(OrthoArgs { sections, layers: vec![Meaning::Best], ..args() });
        let files = ["-1m.best.tif", "-1m.frame.toml", "-1m.tif"].into_iter().chain([
            "0m.best.tif",
            "0m.frame.toml",
            "0m.tif",
        ]);
        let files: Vec<_> = files.map(|end| PathBuf::from(format!("out/façade 1_{end}"))).collect();
        assert_eq!(config.unwrap().files(), files);
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
