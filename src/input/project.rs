//! [`Project`]: the project file, `PROJECT.toml`.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::shift::Shift;
use super::toml_file::TomlFile;
use crate::Result;
use crate::frame::{FrameSpec, FrameTable};

/// What a project file states, paths resolved against its folder.
///
/// The keys are the flags of `groundel ortho` in `snake_case`; what the file leaves out is `None` or empty. Only the
/// types and the frame are checked here: that a word such as `interpolation` is one of those allowed is checked where
/// flags are.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Project {
    /// Mesh files, in order.
    pub mesh: Vec<PathBuf>,
    /// Point clouds, in order.
    pub points: Vec<PathBuf>,
    /// Longest edge of a triangle of points, metres, perhaps infinite.
    pub max_edge: Option<f64>,
    /// Added to every vertex of every mesh and to every point, metres.
    pub shift: Option<Shift>,
    /// Camera file or folder.
    pub cameras: Option<PathBuf>,
    /// Format of the cameras, as `--camera-format`.
    pub camera_format: Option<String>,
    /// `deg`, `gon` or `rad`.
    pub angle_unit: Option<String>,
    /// Millimetres.
    pub pixel_pitch: Option<f64>,
    /// `opencv`, `classical` or `corrections`.
    pub lens: Option<String>,
    /// Bundler's list of images.
    pub image_list: Option<PathBuf>,
    /// Folder of the photos.
    pub photos: Option<PathBuf>,
    /// The table `[frame]`, checked.
    pub frame: Option<FrameSpec>,
    /// `top` or `fit`.
    pub view: Option<String>,
    /// The upward direction for `view = "fit"`, ground.
    pub up: Option<[f64; 3]>,
    /// The plane through three ground points: the origin, one along +u, one on the side of +v.
    pub plane_points: Option<[[f64; 3]; 3]>,
    /// Metres.
    pub pixel_size: Option<f64>,
    /// `1:N`, the scale of a print.
    pub scale: Option<String>,
    /// Dots per inch of a print.
    pub dpi: Option<f64>,
    /// `[u_min, v_min, u_max, v_max]`, metres.
    pub extent: Option<[f64; 4]>,
    /// `[min, max]`, metres, perhaps infinite.
    pub elevation: Option<[f64; 2]>,
    /// `sections`: FROM, TO, STEP, metres.
    pub sections: Option<[f64; 3]>,
    /// Patterns of photos to use.
    pub include: Vec<String>,
    /// Patterns of photos not to use.
    pub exclude: Vec<String>,
    /// Folder of the masks.
    pub masks: Option<PathBuf>,
    /// `even` or `paper`.
    pub colour: Option<String>,
    /// `none`, `gain` or `full`.
    pub levelling: Option<String>,
    /// Patterns of the photos whose tone counts.
    pub tone_from: Vec<String>,
    /// `guard` or `none`.
    pub edges: Option<String>,
    /// `nearest`, `bilinear` or `bicubic`.
    pub interpolation: Option<String>,
    /// `none`, `sigma` or `robust`.
    pub outliers: Option<String>,
    /// β of the outlier test.
    pub beta: Option<f64>,
    /// `area`, `equal` or `sharp`.
    pub weights: Option<String>,
    /// `mean` or `best`.
    pub blend: Option<String>,
    /// Metres.
    pub occlusion_tolerance: Option<f64>,
    /// Colour under transparent pixels.
    pub undefined: Option<[u16; 3]>,
    /// Layers to write beside the mosaic.
    pub layers: Vec<String>,
    /// A world file beside the mosaic.
    pub world_file: Option<bool>,
    /// `dxf`: a drawing beside the mosaic.
    pub cad: Option<String>,
    /// The mosaic.
    pub out: Option<PathBuf>,
    /// `deflate`, `zstd`, `lzw` or `none`.
    pub compress: Option<String>,
    /// Side of a tile of the file, pixels.
    pub tile_size: Option<u32>,
    /// `EPSG:n`.
    pub crs: Option<String>,
    /// Cap on resident memory, as `--memory`: `512MiB`.
    pub memory: Option<String>,
    /// Number of threads.
    pub threads: Option<usize>,
    /// Folder of the stores.
    pub work: Option<PathBuf>,
    /// No progress.
    pub quiet: Option<bool>,
    /// The run report.
    pub report: Option<PathBuf>,
    /// Render a mosaic of more pixels than the photos warrant.
    pub force: Option<bool>,
}

/// The file as it stands.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ProjectTable {
    #[serde(default)]
    mesh: Vec<PathBuf>,
    #[serde(default)]
    points: Vec<PathBuf>,
    max_edge: Option<f64>,
    shift: Option<Shift>,
    cameras: Option<PathBuf>,
    camera_format: Option<String>,
    angle_unit: Option<String>,
    pixel_pitch: Option<f64>,
    lens: Option<String>,
    image_list: Option<PathBuf>,
    photos: Option<PathBuf>,
    frame: Option<FrameTable>,
    view: Option<String>,
    up: Option<[f64; 3]>,
    plane_points: Option<[[f64; 3]; 3]>,
    pixel_size: Option<f64>,
    scale: Option<String>,
    dpi: Option<f64>,
    extent: Option<[f64; 4]>,
    elevation: Option<[f64; 2]>,
    sections: Option<[f64; 3]>,
    #[serde(default)]
    include: Vec<String>,
    #[serde(default)]
    exclude: Vec<String>,
    masks: Option<PathBuf>,
    colour: Option<String>,
    levelling: Option<String>,
    #[serde(default)]
    tone_from: Vec<String>,
    edges: Option<String>,
    interpolation: Option<String>,
    outliers: Option<String>,
    beta: Option<f64>,
    weights: Option<String>,
    blend: Option<String>,
    occlusion_tolerance: Option<f64>,
    undefined: Option<[u16; 3]>,
    #[serde(default)]
    layers: Vec<String>,
    world_file: Option<bool>,
    cad: Option<String>,
    out: Option<PathBuf>,
    compress: Option<String>,
    tile_size: Option<u32>,
    crs: Option<String>,
    memory: Option<String>,
    threads: Option<usize>,
    work: Option<PathBuf>,
    quiet: Option<bool>,
    report: Option<PathBuf>,
    force: Option<bool>,
}

impl Project {
    /// Reads a project file.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) if it cannot be read; [`Error::Limit`](crate::Error::Limit) above 1 MiB;
    /// [`Error::Corrupt`](crate::Error::Corrupt) with the line if it is not TOML, has an unknown key, a value of another
    /// type, or a frame that makes no sense.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let file = TomlFile::read(path)?;
        let table: ProjectTable = file.parse("a project file")?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let frame = table.frame.clone().map(FrameTable::check).transpose();
        let frame = frame.map_err(|e| file.frame_error(&["frame"], &e))?;
        Ok(table.resolved(folder, frame))
    }
}

impl ProjectTable {
    fn resolved(self, folder: &Path, frame: Option<FrameSpec>) -> Project {
        // An absolute path stays as it is.
        let at = |path: Option<PathBuf>| path.map(|p| folder.join(p));
        Project {
            mesh: self.mesh.into_iter().map(|p| folder.join(p)).collect(),
            points: self.points.into_iter().map(|p| folder.join(p)).collect(),
            max_edge: self.max_edge,
            shift: self.shift.map(|shift| match shift {
                Shift::OfOdm(path) => Shift::OfOdm(folder.join(path)),
                stated @ Shift::Stated(_) => stated,
            }),
            cameras: at(self.cameras),
            camera_format: self.camera_format,
            angle_unit: self.angle_unit,
            pixel_pitch: self.pixel_pitch,
            lens: self.lens,
            image_list: at(self.image_list),
            photos: at(self.photos),
            frame,
            view: self.view,
            up: self.up,
            plane_points: self.plane_points,
            pixel_size: self.pixel_size,
            scale: self.scale,
            dpi: self.dpi,
            extent: self.extent,
            elevation: self.elevation,
            sections: self.sections,
            include: self.include,
            exclude: self.exclude,
            masks: at(self.masks),
            colour: self.colour,
            levelling: self.levelling,
            tone_from: self.tone_from,
            edges: self.edges,
            interpolation: self.interpolation,
            outliers: self.outliers,
            beta: self.beta,
            weights: self.weights,
            blend: self.blend,
            occlusion_tolerance: self.occlusion_tolerance,
            undefined: self.undefined,
            layers: self.layers,
            world_file: self.world_file,
            cad: self.cad,
            out: at(self.out),
            compress: self.compress,
            tile_size: self.tile_size,
            crs: self.crs,
            memory: self.memory,
            threads: self.threads,
            work: at(self.work),
            quiet: self.quiet,
            report: at(self.report),
            force: self.force,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn project(text: &str) -> (PathBuf, Result<Project>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.toml");
        std::fs::write(&path, text).unwrap();
        let project = Project::read(&path);
        (folder.path().to_path_buf(), project)
    }

    #[test]
    fn every_key_is_read_and_paths_start_at_the_files_folder() {
        let (folder, project) = project(
            r#"
mesh = ["a.ply", "sub/b c.ply", "/abs/c.ply"]
points = ["cloud 1.laz"]
max_edge = inf
shift = [500000, 4200000.5, 0]
cameras = "sparse"
camera_format = "bundler"
angle_unit = "gon"
pixel_pitch = 0.005
lens = "classical"
image_list = "list.txt"
photos = "../images"
view = "top"
up = [0, 0, 1]
pixel_size = 0.002
extent = [0, 0, 1.5, 2]
elevation = [-inf, 3]
sections = [-1, 2, 0.5]
include = ["west/*"]
exclude = ["*_blur.jpg", "x"]
masks = "masks"
colour = "paper"
levelling = "gain"
tone_from = ["card.jpg"]
edges = "guard"
interpolation = "bilinear"
outliers = "none"
beta = 1.5
weights = "equal"
blend = "best"
occlusion_tolerance = 0.01
undefined = [255, 65535, 0]
layers = ["elevation", "best"]
out = "out/m.tif"
compress = "zstd"
tile_size = 256
scale = "1:50"
dpi = 300
world_file = true
cad = "dxf"
crs = "EPSG:32634"
memory = "512MiB"
threads = 2
work = "work"
quiet = true
report = "r.json"
force = false
[frame]
kind = "plane"
origin = [0, 0, 0]
u_axis = [1, 0, 0]
v_axis = [0, 0, 1]
"#,
        );
        let p = project.unwrap();
        let some = |s: &str| Some(s.to_owned());
        let at = |s: &str| Some(folder.join(s));
        assert_eq!(p.mesh[..2], [folder.join("a.ply"), folder.join("sub/b c.ply")]);
        assert_eq!(p.mesh[2], Path::new("/abs/c.ply"));
        let expected = Project {
            mesh: p.mesh.clone(),
            points: vec![folder.join("cloud 1.laz")],
            max_edge: Some(f64::INFINITY),
            shift: Some(Shift::Stated([500_000.0, 4_200_000.5, 0.0])),
            cameras: at("sparse"),
            camera_format: some("bundler"),
            angle_unit: some("gon"),
            pixel_pitch: Some(0.005),
            lens: some("classical"),
            image_list: at("list.txt"),
            photos: at("../images"),
            frame: p.frame.clone(),
            view: some("top"),
            up: Some([0.0, 0.0, 1.0]),
            plane_points: None,
            pixel_size: Some(0.002),
            scale: some("1:50"),
            dpi: Some(300.0),
            extent: Some([0.0, 0.0, 1.5, 2.0]),
            elevation: Some([f64::NEG_INFINITY, 3.0]),
            sections: Some([-1.0, 2.0, 0.5]),
            include: vec!["west/*".into()],
            exclude: vec!["*_blur.jpg".into(), "x".into()],
            masks: at("masks"),
            colour: some("paper"),
            levelling: some("gain"),
            tone_from: vec!["card.jpg".into()],
            edges: some("guard"),
            interpolation: some("bilinear"),
            outliers: some("none"),
            beta: Some(1.5),
            weights: some("equal"),
            blend: some("best"),
            occlusion_tolerance: Some(0.01),
            undefined: Some([255, 65535, 0]),
            layers: vec!["elevation".into(), "best".into()],
            world_file: Some(true),
            cad: some("dxf"),
            out: at("out/m.tif"),
            compress: some("zstd"),
            tile_size: Some(256),
            crs: some("EPSG:32634"),
            memory: some("512MiB"),
            threads: Some(2),
            work: at("work"),
            quiet: Some(true),
            report: at("r.json"),
            force: Some(false),
        };
        assert_eq!(p, expected);
        assert!(matches!(p.frame, Some(FrameSpec::Plane(_))));
    }

    #[test]
    fn an_empty_project_states_nothing() {
        assert_eq!(project("# nothing\n").1.unwrap(), Project::default());
    }

    #[test]
    fn an_unknown_key_and_a_wrong_type_are_named_with_their_line() {
        let e = project("cameras = \"s\"\npixelsize = 1\n").1.unwrap_err().to_string();
        assert!(e.contains("p.toml: line 2:") && e.contains("`pixelsize`"), "{e}");
        let e = project("\n\nmesh = \"a.ply\"\n").1.unwrap_err().to_string();
        assert!(e.contains("line 3:"), "{e}");
        let e = project("undefined = [1, 2, 65536]").1.unwrap_err().to_string();
        assert!(e.contains("line 1:") && e.contains("65536"), "{e}");
    }

    #[test]
    fn a_frame_that_makes_no_sense_is_named_with_its_line() {
        let text = "threads = 1\n[frame]\nkind = \"plane\"\norigin = [0, 0, 0]\nu_axis = [2, 0, 0]\nv_axis = [0, 0, 1]\n";
        let e = project(text).1.unwrap_err().to_string();
        assert!(e.contains("line 5, key `frame.u_axis`"), "{e}");
        let e = project("threads = 1\n[frame]\nkind = \"plane\"\n").1.unwrap_err().to_string();
        assert!(e.contains("line 2, key `frame.origin`"), "{e}");
        let e = project("[frame]\nkind = \"plane\"\nphotoo = 1\n").1.unwrap_err().to_string();
        assert!(e.contains("line 3") && e.contains("photoo"), "{e}");
    }
}
