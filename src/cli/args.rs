//! [`Args`]: the command line as typed.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Arg, ArgAction, CommandFactory, FromArgMatches, Parser, Subcommand};

use super::job_args::{AssembleArgs, PlanArgs, RenderArgs};
use super::settings::{
    BlendRule, Cad, ColourRule, Edges, Interpolation, Levelling, Outliers, View, Weights,
};
use super::values;
use crate::input::{AngleUnit, CameraFormat, CameraOptions, Shift, TableLens};
use crate::output::{Compression, Meaning, PrintResolution};

/// Parsers of a path and of a pattern, which may be any text of the system.
macro_rules! path {
    () => {
        OsStringValueParser::new().try_map(values::path)
    };
}
macro_rules! pattern {
    () => {
        OsStringValueParser::new().try_map(values::pattern)
    };
}

/// The command line.
#[derive(Clone, Debug, Parser)]
#[command(name = "groundel", version, about, arg_required_else_help = false)]
#[command(after_help = EXIT_CODES)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const EXIT_CODES: &str = "\
Exit codes: 0 done; 1 done, but photos had to be left out (each is named); 2 bad input or usage;
3 over budget, nothing begun; 4 I/O error or interrupted, a retry may help.";

const PROJECT_HELP: &str = "\
A project file holds the same words in snake_case (pixel_size = 0.002, mesh = [\"a.ply\"]), paths relative
to itself, and the frame as a table [frame]. Flags override it.";

impl Args {
    /// The command line, parsed; a flag's value may begin with a minus.
    ///
    /// # Errors
    /// What clap says: a wrong usage, or that help or version was asked for.
    pub fn from_typed(
        typed: impl IntoIterator<Item = OsString>,
    ) -> std::result::Result<Self, clap::Error> {
        let command = with_short_help(Self::command());
        let command =
            command.mut_subcommands(|command| with_short_help(with_minus_values(command)));
        Self::from_arg_matches(&command.try_get_matches_from(typed)?)
    }
}

/// `command`, whose flags take values that begin with a minus.
fn with_minus_values(command: clap::Command) -> clap::Command {
    command.mut_args(|arg| {
        let takes_value = arg.get_action().takes_values() && !arg.is_positional();
        if takes_value { arg.allow_hyphen_values(true) } else { arg }
    })
}

/// `command`, whose help is one line a flag, with `-h` and `--help` alike.
fn with_short_help(command: clap::Command) -> clap::Command {
    let help = Arg::new("help").short('h').long("help").action(ArgAction::HelpShort);
    command.disable_help_flag(true).arg(help.help("Show this help"))
}

/// What to do.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Build a synthetic façade with photos and render it: the whole job, no input needed
    Demo(DemoArgs),
    /// Mesh + cameras + photos → true-orthoimage mosaic
    #[command(after_help = PROJECT_HELP)]
    Ortho(Box<OrthoArgs>),
    /// Plan a job for many processes or machines: its stores, its batches, and what it will take
    #[command(after_help = PROJECT_HELP)]
    Plan(Box<PlanArgs>),
    /// Render a batch of a planned job's tiles, or all that are missing; what is there already stays
    Render(RenderArgs),
    /// Assemble the rendered parts of a job into the final files
    Assemble(AssembleArgs),
    /// Tell what is in a mesh, camera set, photo, store, frame, project, job or mosaic
    Info {
        /// A file or a folder
        path: PathBuf,
        /// Of cameras: whether they look at this mesh
        #[arg(long, value_name = "FILE", value_parser = path!())]
        mesh: Option<PathBuf>,
        /// Of cameras: folder of the photos, for formats that do not state their sizes
        #[arg(long, value_name = "DIR", value_parser = path!())]
        photos: Option<PathBuf>,
        /// How cameras are to be read
        #[command(flatten)]
        camera: CameraArgs,
    },
    /// Tell the ground point of a mosaic's pixel, or the pixel of a ground point: column row X Y Z elevation
    Locate {
        /// The mosaic; its frame and its elevation layer lie beside it
        #[arg(value_name = "OUT.tif")]
        mosaic: PathBuf,
        /// Column and row, 0.5,0.5 the middle of the upper-left pixel; repeatable
        #[arg(long, value_name = "C,R", value_parser = values::pixel, required_unless_present = "ground")]
        pixel: Vec<[f64; 2]>,
        /// Ground point, metres; repeatable
        #[arg(long, value_name = "X,Y,Z", value_parser = values::point)]
        ground: Vec<[f64; 3]>,
        /// Elevation of the pixels, metres [default: that of the elevation layer]
        #[arg(long, value_name = "METRES", value_parser = values::metres)]
        elevation: Option<f64>,
        /// Camera set, for a perspective view of one of its photos
        #[arg(long, value_name = "PATH", value_parser = path!())]
        cameras: Option<PathBuf>,
        /// How cameras are to be read
        #[command(flatten)]
        camera: CameraArgs,
    },
    /// Compare two pictures of one size: PSNR, SSIM and shift
    Compare {
        /// A mosaic or a photo
        a: PathBuf,
        /// What it is compared with
        b: PathBuf,
        /// Where to draw the difference, four times as great, on middle grey
        #[arg(long, value_name = "FILE.png", value_parser = path!())]
        out: Option<PathBuf>,
    },
}

/// The flags that say how cameras are to be read.
#[derive(Clone, Debug, Default, PartialEq, clap::Args)]
pub struct CameraArgs {
    /// Format of the cameras: colmap, table, bundler, opensfm, openmvg, alicevision, metashape, pix4d, realitycapture, micmac [default: by content]
    #[arg(long, value_name = "NAME", help_heading = "Input", value_parser = values::camera_format)]
    pub camera_format: Option<CameraFormat>,
    /// Unit of the angles of a plain table, required there: deg, gon or rad
    #[arg(long, value_name = "UNIT", help_heading = "Input", value_parser = values::angle_unit)]
    pub angle_unit: Option<AngleUnit>,
    /// Photo pixel of a plain table in millimetres, whose c, x0, y0 are in millimetres [default: in pixels]
    #[arg(long, value_name = "MM", help_heading = "Input", value_parser = values::positive)]
    pub pixel_pitch: Option<f64>,
    /// Lens of a plain table: opencv; classical, with k1 in px⁻² (mm⁻²); corrections of measured positions, likewise [default: opencv]
    #[arg(long, value_name = "NAME", help_heading = "Input", value_parser = values::table_lens)]
    pub lens: Option<TableLens>,
    /// Bundler's list of images [default: list.txt beside the cameras]
    #[arg(long, value_name = "FILE", help_heading = "Input", value_parser = path!())]
    pub image_list: Option<PathBuf>,
}

impl CameraArgs {
    /// What the reader of cameras is told.
    pub(super) fn options(&self, photos: Option<PathBuf>, force: bool) -> CameraOptions {
        CameraOptions {
            format: self.camera_format,
            angle_unit: self.angle_unit,
            pixel_pitch_mm: self.pixel_pitch,
            lens: self.lens.unwrap_or_default(),
            image_list: self.image_list.clone(),
            photos,
            odm_offset: None,
            force,
        }
    }
}

/// The flags of `groundel demo`.
#[derive(Clone, Debug, PartialEq, Eq, clap::Args)]
pub struct DemoArgs {
    /// Folder to write to; made if need be
    #[arg(value_name = "DIR", default_value = "demo")]
    pub dir: PathBuf,
    /// The size of the paper's job: 3 million faces, seven photos of 5 megapixels, 3720 × 2775 pixels
    #[arg(long)]
    pub paper: bool,
    /// Faces of the mesh, at least [default: 300000; with --paper 3000000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1000..))]
    pub faces: Option<u64>,
    /// Write mesh, photos, cameras and project file, and render nothing
    #[arg(long)]
    pub inputs_only: bool,
    /// A street of N façades side by side, the faces spread over all; only with --inputs-only
    #[arg(long, value_name = "N", requires = "inputs_only", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub houses: Option<u32>,
    /// N photos of 24 megapixels, ten to a façade, which share four picture files; only with --inputs-only
    #[arg(long, value_name = "N", requires = "inputs_only", value_parser = clap::value_parser!(u32).range(1..=60_000))]
    pub photos: Option<u32>,
    /// Memory cap of the process, at least 256MiB [default: half of the physical memory]
    #[arg(long, value_name = "SIZE", value_parser = values::memory)]
    pub memory: Option<u64>,
    /// Threads [default: all processors]
    #[arg(long, value_name = "N", value_parser = values::threads)]
    pub threads: Option<usize>,
    /// Show no progress and no summary
    #[arg(long)]
    pub quiet: bool,
}

/// The flags of `groundel ortho`. Every one may be missing: the project file or a default steps in.
#[derive(Clone, Debug, Default, PartialEq, clap::Args)]
pub struct OrthoArgs {
    /// Project file: the same settings as TOML; flags override it
    #[arg(value_name = "PROJECT.toml")]
    pub project: Option<PathBuf>,

    /// Surface mesh: PLY, OBJ, STL, GLB, glTF (y is not turned up), XYZ triplets; text also .gz, .zst; repeatable, face ids run on
    #[arg(long, value_name = "FILE", help_heading = "Input", value_parser = path!())]
    pub mesh: Vec<PathBuf>,
    /// Point cloud, meshed over the frame's plane: LAS, LAZ, or XYZ text (x y z …); withheld and noise passed over; repeatable
    #[arg(long, value_name = "FILE", help_heading = "Input", value_parser = path!())]
    pub points: Vec<PathBuf>,
    /// Longest edge of a triangle of points, metres in the plane, or inf [default: 50 × the points' mean spacing]
    #[arg(long, value_name = "METRES", help_heading = "Input", value_parser = values::longest)]
    pub max_edge: Option<f64>,
    /// Added to every vertex of every mesh and to every point, metres: from reduced coordinates to the ground; or the coords.txt of an ODM project, added to its cameras too [default: 0,0,0]
    #[arg(long, value_name = "X,Y,Z|FILE.txt", help_heading = "Input", value_parser = values::shift)]
    pub shift: Option<Shift>,
    /// Orientations of the photos: a COLMAP model folder, or the file of another tool (--camera-format)
    #[arg(long, value_name = "PATH", help_heading = "Input", value_parser = path!())]
    pub cameras: Option<PathBuf>,
    /// How the cameras are to be read
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Folder in which the photos lie under the names of the camera set
    #[arg(long, value_name = "DIR", help_heading = "Input", value_parser = path!())]
    pub photos: Option<PathBuf>,
    /// Use only photos whose full name matches (* crosses /); repeatable [default: all]
    #[arg(long, value_name = "GLOB", help_heading = "Input", value_parser = pattern!())]
    pub include: Vec<String>,
    /// Use no photo whose full name matches (* crosses /); repeatable [default: none]
    #[arg(long, value_name = "GLOB", help_heading = "Input", value_parser = pattern!())]
    pub exclude: Vec<String>,
    /// Folder of masks, PHOTO.png or STEM.png, 0 = do not use; photos without one are used whole [default: none]
    #[arg(long, value_name = "DIR", help_heading = "Input", value_parser = path!())]
    pub masks: Option<PathBuf>,

    /// Frame file: what the mosaic is drawn on; or give --view or --plane-points
    #[arg(long, value_name = "FILE.toml", help_heading = "Frame", value_parser = path!())]
    pub frame: Option<PathBuf>,
    /// Frame without a file: top looks down with u = x, v = y; fit takes the upright plane that the photos look at
    #[arg(long, help_heading = "Frame", value_name = "NAME", value_enum, conflicts_with = "frame")]
    pub view: Option<View>,
    /// Direction that is up in the mosaic, for --view fit [default: 0,0,1]
    #[arg(long, value_name = "X,Y,Z", help_heading = "Frame", value_parser = values::direction)]
    pub up: Option<[f64; 3]>,
    /// Frame without a file: the plane through three ground points, the origin, one along +u, one on the side of +v
    #[arg(long, value_name = "A;B;C", help_heading = "Frame", value_parser = values::plane_points,
          conflicts_with_all = ["frame", "view"])]
    pub plane_points: Option<[[f64; 3]; 3]>,
    /// Side of a mosaic pixel, metres [default: the frame's, else the photos' median footprint]
    #[arg(long, value_name = "P", help_heading = "Frame", value_parser = values::positive)]
    pub pixel_size: Option<f64>,
    /// Pixel size by the scale of a print, with --dpi: N × 0.0254 / dpi metres [default: none]
    #[arg(long, value_name = "1:N", help_heading = "Frame", value_parser = values::scale)]
    pub scale: Option<f64>,
    /// Dots per inch of a print, 1 to 100000, stated in the mosaic and its layers [default: none]
    #[arg(long, value_name = "N", help_heading = "Frame", value_parser = values::dpi)]
    pub dpi: Option<PrintResolution>,
    /// Extent in frame coordinates, metres [default: the frame's, else the bounds of the mesh]
    #[arg(long, value_name = "U0,V0,U1,V1", help_heading = "Frame", value_parser = values::extent)]
    pub extent: Option<[f64; 4]>,
    /// Slab of elevations to draw, metres; inf and -inf allowed [default: the frame's, else all]
    #[arg(long, value_name = "MIN,MAX", help_heading = "Frame", value_parser = values::elevation)]
    pub elevation: Option<[f64; 2]>,
    /// Sections at these elevations, metres, one mosaic STEM_…m.tif each: the slab of each ends there; they share one grid
    #[arg(long, value_name = "FROM,TO,STEP", help_heading = "Frame", value_parser = values::sections)]
    pub sections: Option<[f64; 3]>,
    /// Projected coordinate system in metres, EPSG:n [default: the frame's, else a local one]
    #[arg(long, value_name = "EPSG:n", help_heading = "Frame", value_parser = values::crs)]
    pub crs: Option<String>,
    /// Allow a mosaic of more than 10 times the photos' pixels, and cameras that miss their own tie points
    #[arg(long, help_heading = "Frame")]
    pub force: bool,

    /// Preset of the settings below: even, or paper (Grammatikopoulos et al. 2004) [default: even]
    #[arg(long, help_heading = "Colour", value_name = "NAME", value_enum)]
    pub colour: Option<ColourRule>,
    /// Photos brought to one tone: gains, or also vignetting and a gentle field [default: full; paper: none]
    #[arg(long, help_heading = "Colour", value_name = "NAME", value_enum)]
    pub levelling: Option<Levelling>,
    /// Photos whose tone the levelled mosaic keeps, repeatable [default: the mean of all]
    #[arg(long, value_name = "GLOB", help_heading = "Colour", value_parser = pattern!())]
    pub tone_from: Vec<String>,
    /// Weights that fade towards the border of what a photo sees [default: guard; paper: none]
    #[arg(long, help_heading = "Colour", value_name = "NAME", value_enum)]
    pub edges: Option<Edges>,
    /// How photos are sampled [default: bicubic]
    #[arg(long, help_heading = "Colour", value_name = "NAME", value_enum)]
    pub interpolation: Option<Interpolation>,
    /// Outlying colours where more than two photos see a pixel [default: robust; paper: sigma]
    #[arg(long, help_heading = "Colour", value_name = "NAME", value_enum)]
    pub outliers: Option<Outliers>,
    /// Colours farther than B standard deviations from the mean are rejected by sigma [default: 1.0]
    #[arg(long, value_name = "B", help_heading = "Colour", value_parser = values::not_negative)]
    pub beta: Option<f64>,
    /// Weight of a photo: area of the face in photo pixels, all alike, or the sharpest [default: sharp; paper: area]
    #[arg(long, help_heading = "Colour", value_name = "NAME", value_enum)]
    pub weights: Option<Weights>,
    /// Weighted mean of the photos, or the heaviest photo alone [default: mean]
    #[arg(long, help_heading = "Colour", value_name = "NAME", value_enum)]
    pub blend: Option<BlendRule>,
    /// How far behind another face a point counts as seen, metres [default: 0.02 pixel]
    #[arg(long, value_name = "M", help_heading = "Colour", value_parser = values::not_negative)]
    pub occlusion_tolerance: Option<f64>,
    /// Colour under transparent pixels, in the output's range [default: 0,0,0]
    #[arg(long, value_name = "R,G,B", help_heading = "Colour", value_parser = values::colour)]
    pub undefined: Option<[u16; 3]>,

    /// The mosaic, a Cloud Optimized GeoTIFF; layers are written beside it
    #[arg(long, value_name = "FILE.tif", help_heading = "Output", value_parser = path!())]
    pub out: Option<PathBuf>,
    /// Also write STEM.LAYER.tif beside STEM.tif: elevation, face, count, used, coverage, best [default: none]
    #[arg(long, value_name = "A,B,…", help_heading = "Output", value_parser = values::layer, value_delimiter = ',')]
    pub layers: Vec<Meaning>,
    /// Also write STEM.tfw, a world file in frame coordinates; not of a perspective view
    #[arg(long, help_heading = "Output")]
    pub world_file: bool,
    /// Also write STEM.dxf, which shows the mosaic on its plane in space; of planes only [default: none]
    #[arg(long, value_name = "NAME", help_heading = "Output", value_enum)]
    pub cad: Option<Cad>,
    /// Compression of the tiles: deflate, zstd, lzw or none [default: deflate]
    #[arg(long, value_name = "NAME", help_heading = "Output", value_parser = values::compression)]
    pub compress: Option<Compression>,
    /// Side of the tiles in the files, pixels, a multiple of 16 [default: 512]
    #[arg(long, value_name = "N", help_heading = "Output", value_parser = values::tile_size)]
    pub tile_size: Option<u32>,
    /// Run report: counts, coverage, photos, times and memory [default: none]
    #[arg(long, value_name = "FILE.json", help_heading = "Output", value_parser = path!())]
    pub report: Option<PathBuf>,

    /// Memory cap of the process, at least 256MiB [default: half of the physical memory]
    #[arg(long, value_name = "SIZE", help_heading = "Run", value_parser = values::memory)]
    pub memory: Option<u64>,
    /// Threads [default: all processors]
    #[arg(long, value_name = "N", help_heading = "Run", value_parser = values::threads)]
    pub threads: Option<usize>,
    /// Folder for stores, reused when they match [default: .groundel beside the output]
    #[arg(long, value_name = "DIR", help_heading = "Run", value_parser = path!())]
    pub work: Option<PathBuf>,
    /// Show no progress and no summary
    #[arg(long, help_heading = "Run")]
    pub quiet: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ortho(arguments: &[&str]) -> OrthoArgs {
        let typed = ["groundel", "ortho"].iter().chain(arguments).map(OsString::from);
        match Args::from_typed(typed).unwrap().command {
            Command::Ortho(args) => *args,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_definition_is_consistent() {
        Args::command().debug_assert();
    }

    #[test]
    fn values_may_begin_with_a_minus() {
        let args = ortho(&["--extent", "-1,-2,3,4", "--elevation", "-inf,0.5", "--mesh", "-a.ply"]);
        assert_eq!(args.extent, Some([-1.0, -2.0, 3.0, 4.0]));
        assert_eq!(args.elevation, Some([f64::NEG_INFINITY, 0.5]));
        assert_eq!(args.mesh, [PathBuf::from("-a.ply")]);
    }

    #[test]
    fn repeated_flags_and_lists_keep_their_order() {
        let args = ortho(&["--mesh", "b.ply", "--mesh", "a.ply", "--layers", "best,face"]);
        assert_eq!(args.mesh, [PathBuf::from("b.ply"), PathBuf::from("a.ply")]);
        assert_eq!(args.layers, [Meaning::Best, Meaning::Face]);
    }

    #[test]
    fn a_project_file_needs_no_flag() {
        let args = ortho(&["p.toml", "--quiet"]);
        assert_eq!((args.project, args.quiet), (Some("p.toml".into()), true));
    }
}
