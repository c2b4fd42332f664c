//! The project file: the settings of `groundel ortho` as TOML, under what the flags say.

use std::path::Path;

use clap::ValueEnum;

use super::args::{CameraArgs, OrthoArgs};
use super::sections;
use super::settings;
use super::values;
use crate::frame::FrameSpec;
use crate::input::Project;
use crate::{Error, Result};

/// `args` with every setting that they leave open taken from the project file they name, and its `[frame]`.
///
/// # Errors
/// What reading the file gives, and [`Error::Usage`] naming file and key whose value makes no sense.
pub(super) fn merged(args: OrthoArgs) -> Result<(OrthoArgs, Option<FrameSpec>)> {
    let Some(path) = args.project.clone() else { return Ok((args, None)) };
    let mut project = Project::read(&path)?;
    let frame = project.frame.take();
    if frame.is_some() && project.view.is_some() {
        let path = path.display();
        return Err(Error::usage(format!("{path}: keys `frame` and `view`: only one of them")));
    }
    let below = checked(&path, project)?;
    Ok((over(args, below), frame))
}

/// The settings of a project file, each checked as its flag is.
fn checked(path: &Path, project: Project) -> Result<OrthoArgs> {
    let keys = Keys { path };
    let layers = project.layers.iter().map(|name| keys.value("layers", values::layer(name)));
    Ok(OrthoArgs {
        project: None,
        mesh: project.mesh,
        points: project.points,
        max_edge: keys.check("max_edge", project.max_edge, values::check_longest)?,
        shift: keys.check("shift", project.shift, values::check_shift)?,
        cameras: project.cameras,
        camera: CameraArgs {
            camera_format: keys.check(
                "camera_format",
                project.camera_format.as_deref(),
                values::camera_format,
            )?,
            angle_unit: keys.check(
                "angle_unit",
                project.angle_unit.as_deref(),
                values::angle_unit,
            )?,
            pixel_pitch: keys.check("pixel_pitch", project.pixel_pitch, values::check_positive)?,
            lens: keys.check("lens", project.lens.as_deref(), values::table_lens)?,
            image_list: project.image_list,
        },
        photos: project.photos,
        include: project.include,
        exclude: project.exclude,
        masks: project.masks,
        frame: None,
        view: keys.word("view", project.view.as_deref())?,
        up: keys.check("up", project.up, values::check_direction)?,
        plane_points: keys.check(
            "plane_points",
            project.plane_points,
            values::check_plane_points,
        )?,
        pixel_size: keys.check("pixel_size", project.pixel_size, values::check_positive)?,
        scale: keys.check("scale", project.scale.as_deref(), values::scale)?,
        dpi: keys.check("dpi", project.dpi, values::check_dpi)?,
        extent: keys.check("extent", project.extent, values::check_extent)?,
        elevation: keys.check("elevation", project.elevation, values::check_elevation)?,
        sections: keys.check("sections", project.sections, sections::check)?,
        crs: keys.check("crs", project.crs.as_deref(), values::crs)?,
        force: project.force.unwrap_or(false),
        colour: keys.word("colour", project.colour.as_deref())?,
        levelling: keys.word("levelling", project.levelling.as_deref())?,
        tone_from: project.tone_from,
        edges: keys.word("edges", project.edges.as_deref())?,
        interpolation: keys.word("interpolation", project.interpolation.as_deref())?,
        outliers: keys.word("outliers", project.outliers.as_deref())?,
        beta: keys.check("beta", project.beta, values::check_not_negative)?,
        weights: keys.word("weights", project.weights.as_deref())?,
        blend: keys.word("blend", project.blend.as_deref())?,
        occlusion_tolerance: keys.check(
            "occlusion_tolerance",
            project.occlusion_tolerance,
            values::check_not_negative,
        )?,
        undefined: project.undefined,
        out: project.out,
        layers: layers.collect::<Result<_>>()?,
        world_file: project.world_file.unwrap_or(false),
        cad: keys.word("cad", project.cad.as_deref())?,
        compress: keys.check("compress", project.compress.as_deref(), values::compression)?,
        tile_size: keys.check("tile_size", project.tile_size, values::check_tile_size)?,
        report: project.report,
        memory: keys.check("memory", project.memory.as_deref(), values::memory)?,
        threads: keys.check("threads", project.threads, values::check_threads)?,
        work: project.work,
        quiet: project.quiet.unwrap_or(false),
    })
}

/// Names the file and the key in what is wrong with a value.
struct Keys<'a> {
    path: &'a Path,
}

impl Keys<'_> {
    fn value<T>(&self, key: &str, checked: std::result::Result<T, String>) -> Result<T> {
        let name = |fault| Error::usage(format!("{}: key `{key}`: {fault}", self.path.display()));
        checked.map_err(name)
    }

    fn check<T, U>(
        &self,
        key: &str,
        value: Option<T>,
        check: impl Fn(T) -> std::result::Result<U, String>,
    ) -> Result<Option<U>> {
        value.map(|value| self.value(key, check(value))).transpose()
    }

    fn word<T: ValueEnum>(&self, key: &str, value: Option<&str>) -> Result<Option<T>> {
        self.check(key, value, settings::word)
    }
}

/// `flags` where they say something, else what stands `below`.
fn over(flags: OrthoArgs, below: OrthoArgs) -> OrthoArgs {
    // A scale and a pixel size are two ways to say one thing.
    let size_by_flag = flags.pixel_size.is_some() || flags.scale.is_some();
    // A direction belongs to the view that it was given with.
    let frame_by_flag =
        flags.frame.is_some() || flags.view.is_some() || flags.plane_points.is_some();
    OrthoArgs {
        project: flags.project,
        mesh: either(flags.mesh, below.mesh),
        points: either(flags.points, below.points),
        max_edge: flags.max_edge.or(below.max_edge),
        shift: flags.shift.or(below.shift),
        cameras: flags.cameras.or(below.cameras),
        camera: camera_over(flags.camera, below.camera),
        photos: flags.photos.or(below.photos),
        include: either(flags.include, below.include),
        exclude: either(flags.exclude, below.exclude),
        masks: flags.masks.or(below.masks),
        view: if frame_by_flag { flags.view } else { below.view },
        up: if frame_by_flag { flags.up } else { flags.up.or(below.up) },
        plane_points: if frame_by_flag { flags.plane_points } else { below.plane_points },
        frame: flags.frame,
        pixel_size: if size_by_flag { flags.pixel_size } else { below.pixel_size },
        scale: if size_by_flag { flags.scale } else { below.scale },
        dpi: flags.dpi.or(below.dpi),
        extent: flags.extent.or(below.extent),
        elevation: flags.elevation.or(below.elevation),
        sections: flags.sections.or(below.sections),
        crs: flags.crs.or(below.crs),
        force: flags.force || below.force,
        colour: flags.colour.or(below.colour),
        levelling: flags.levelling.or(below.levelling),
        tone_from: either(flags.tone_from, below.tone_from),
        edges: flags.edges.or(below.edges),
        interpolation: flags.interpolation.or(below.interpolation),
        outliers: flags.outliers.or(below.outliers),
        beta: flags.beta.or(below.beta),
        weights: flags.weights.or(below.weights),
        blend: flags.blend.or(below.blend),
        occlusion_tolerance: flags.occlusion_tolerance.or(below.occlusion_tolerance),
        undefined: flags.undefined.or(below.undefined),
        out: flags.out.or(below.out),
        layers: either(flags.layers, below.layers),
        world_file: flags.world_file || below.world_file,
        cad: flags.cad.or(below.cad),
        compress: flags.compress.or(below.compress),
        tile_size: flags.tile_size.or(below.tile_size),
        report: flags.report.or(below.report),
        memory: flags.memory.or(below.memory),
        threads: flags.threads.or(below.threads),
        work: flags.work.or(below.work),
        quiet: flags.quiet || below.quiet,
    }
}

fn camera_over(flags: CameraArgs, below: CameraArgs) -> CameraArgs {
    CameraArgs {
        camera_format: flags.camera_format.or(below.camera_format),
        angle_unit: flags.angle_unit.or(below.angle_unit),
        pixel_pitch: flags.pixel_pitch.or(below.pixel_pitch),
        lens: flags.lens.or(below.lens),
        image_list: flags.image_list.or(below.image_list),
    }
}

/// A list given by flags replaces that of the project file.
fn either<T>(flags: Vec<T>, below: Vec<T>) -> Vec<T> {
    if flags.is_empty() { below } else { flags }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::cli::{Interpolation, View};
    use crate::output::{Compression, Meaning};

    /// What `args` and a project file of this text make.
    fn merge(args: OrthoArgs, text: &str) -> Result<(OrthoArgs, Option<FrameSpec>)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.toml");
        fs::write(&path, text).unwrap();
        merged(OrthoArgs { project: Some(path), ..args })
    }

    const FRAME: &str =
        "[frame]\nkind = \"plane\"\norigin = [0, 0, 0]\nu_axis = [1, 0, 0]\nv_axis = [0, 0, 1]\n";

    #[test]
    fn flags_override_the_project_and_the_rest_comes_from_it() {
        let args = OrthoArgs {
            mesh: vec!["flag.ply".into()],
            interpolation: Some(Interpolation::Nearest),
            layers: vec![Meaning::Best],
            ..Default::default()
        };
        let text = "mesh = [\"a.ply\", \"b.ply\"]\ninterpolation = \"bilinear\"\nlayers = [\"face\"]\n\
                    memory = \"1GiB\"\ncompress = \"zstd\"\nquiet = true\n";
        let (merged, frame) = merge(args, &format!("{text}{FRAME}")).unwrap();
        assert_eq!(merged.mesh, [Path::new("flag.ply")]);
        assert_eq!(merged.interpolation, Some(Interpolation::Nearest));
        assert_eq!(merged.layers, [Meaning::Best]);
        assert_eq!((merged.memory, merged.quiet), (Some(1 << 30), true));
        assert_eq!(merged.compress, Some(Compression::Zstd));
        assert!(matches!(frame, Some(FrameSpec::Plane(_))));
    }

    #[test]
    fn a_value_that_makes_no_sense_is_named_with_file_and_key() {
        for (text, key, expected) in [
            ("interpolation = \"cubic\"", "interpolation", "nearest, bilinear, bicubic"),
            ("outliers = \"no\"", "outliers", "none, sigma, robust"),
            ("colour = \"Even\"", "colour", "even, paper"),
            ("levelling = \"yes\"", "levelling", "none, gain, full"),
            ("edges = \"soft\"", "edges", "none, guard"),
            ("layers = [\"face\", \"depth\"]", "layers", "elevation, face"),
            ("compress = \"jpeg\"", "compress", "deflate, zstd"),
            ("memory = \"10MiB\"", "memory", "256 MiB"),
            ("tile_size = 100", "tile_size", "multiple of 16"),
            ("pixel_size = -1.0", "pixel_size", "greater than 0"),
            ("pixel_size = nan", "pixel_size", "greater than 0"),
            ("extent = [0, 0, 0, 1]", "extent", "U0 less than U1"),
            ("elevation = [1, 1]", "elevation", "MIN less than MAX"),
            ("elevation = [nan, 1]", "elevation", "MIN less than MAX"),
            ("sections = [1, 0, 1]", "sections", "not above TO"),
            ("sections = [0, 1, 1e-4]", "sections", "at most 1000"),
            ("threads = 0", "threads", "1 to"),
            ("beta = -1.0", "beta", "at least 0"),
            ("crs = \"32634\"", "crs", "EPSG:"),
            ("up = [0, 0, 0]", "up", "direction"),
            ("shift = [0, nan, 0]", "shift", "finite"),
            ("camera_format = \"COLMAP\"", "camera_format", "colmap, table"),
            ("angle_unit = \"grad\"", "angle_unit", "deg, gon, rad"),
            ("max_edge = 0.0", "max_edge", "greater than 0, or inf"),
            ("max_edge = nan", "max_edge", "greater than 0, or inf"),
            ("pixel_pitch = 0.0", "pixel_pitch", "greater than 0"),
            ("lens = \"brown\"", "lens", "opencv, classical"),
            ("scale = \"50\"", "scale", "1:N"),
            ("dpi = 0", "dpi", "1 to 100000"),
            ("cad = \"dwg\"", "cad", "dxf"),
        ] {
            let error = merge(OrthoArgs::default(), text).unwrap_err();
            let message = error.to_string();
            let named = message.contains("p.toml: ") && message.contains(&format!("key `{key}`"));
            assert!(named && message.contains(expected), "{text}: {message}");
            assert_eq!(error.exit_code(), 2);
        }
    }

    #[test]
    fn a_frame_by_flag_replaces_the_projects_view_and_its_direction() {
        let args = OrthoArgs { frame: Some("f.toml".into()), ..Default::default() };
        let (merged, _) = merge(args, "view = \"fit\"\nup = [0, 0, 1]").unwrap();
        assert_eq!((merged.view, merged.up), (None, None));
        let args = OrthoArgs { view: Some(View::Top), ..Default::default() };
        let (merged, frame) = merge(args, FRAME).unwrap();
        assert!(merged.view == Some(View::Top) && frame.is_some());
    }

    #[test]
    fn a_project_with_both_frame_and_view_is_refused() {
        let error = merge(OrthoArgs::default(), &format!("view = \"top\"\n{FRAME}")).unwrap_err();
        assert!(error.to_string().contains("only one of them"), "{error}");
    }
}
