//! What is in a frame file or a project file.

use std::path::Path;

use crate::frame::{FrameSpec, Plane};
use crate::input::{Project, Shift, read_frame};
use crate::{Error, Result};

/// The frame, or the inputs, outputs and frame of a project.
///
/// # Errors
/// What reading the file gives.
pub(super) fn describe(path: &Path) -> Result<String> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?;
    // A frame file has its kind at the top, a project has it in a table.
    let is_frame =
        toml::from_str::<toml::Table>(&text).is_ok_and(|table| table.contains_key("kind"));
    let mut lines = Vec::new();
    if is_frame {
        lines.push(format!("{}: frame file", path.display()));
        lines.extend(frame_lines(&read_frame(path)?));
    } else {
        let project = Project::read(path)?;
        lines.push(format!("{}: project file", path.display()));
        lines.extend(project.mesh.iter().map(|mesh| format!("mesh: {}", mesh.display())));
        lines.extend(project.shift.map(|shift| match shift {
            Shift::Stated(metres) => format!("shift: {metres:?} m"),
            Shift::OfOdm(path) => format!("shift: that in {}", path.display()),
        }));
        let paths =
            [("cameras", &project.cameras), ("photos", &project.photos), ("out", &project.out)];
        let named = |(key, path): (&str, &Option<std::path::PathBuf>)| {
            path.as_ref().map(|path| format!("{key}: {}", path.display()))
        };
        lines.extend(paths.into_iter().filter_map(named));
        lines.extend(project.frame.iter().flat_map(frame_lines));
    }
    Ok(lines.join("\n") + "\n")
}

fn frame_lines(frame: &FrameSpec) -> Vec<String> {
    match frame {
        FrameSpec::Plane(plane) => plane_lines(plane),
        FrameSpec::Cylinder(cylinder) => {
            vec![format!("frame: cylinder, radius {} m", cylinder.radius)]
        }
        FrameSpec::Perspective(_) => vec!["frame: perspective".into()],
    }
}

fn plane_lines(plane: &Plane) -> Vec<String> {
    let [origin, u, v, n] = [plane.origin, plane.u, plane.v, plane.n].map(|v| v.to_array());
    let mut lines = vec![
        "frame: plane".to_string(),
        format!("origin: {origin:?}"),
        format!("u (columns): {u:?}"),
        format!("v (against the rows): {v:?}"),
        format!("n (towards the viewer): {n:?}"),
    ];
    lines.extend(plane.pixel_size.map(|size| format!("pixel size: {size} m")));
    lines.extend(plane.extent.map(|extent| format!("extent: {extent:?} m")));
    lines.extend(plane.elevation.map(|[min, max]| format!("elevation: {min} to {max} m")));
    lines.extend(plane.crs.as_ref().map(|crs| format!("reference system: {crs}")));
    lines
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const PLANE: &str = "kind = \"plane\"\norigin = [1, 2, 3]\nu_axis = [1, 0, 0]\nv_axis = [0, 0, 1]\n\
                         pixel_size = 0.01\nelevation = [-inf, 2]\n";

    fn told(text: &str) -> Result<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.toml");
        fs::write(&path, text).unwrap();
        describe(&path)
    }

    #[test]
    fn a_frame_file_is_told_with_its_normal() {
        let told = told(PLANE).unwrap();
        assert!(told.contains(": frame file\nframe: plane\norigin: [1.0, 2.0, 3.0]\n"), "{told}");
        assert!(
            told.contains("n (towards the viewer): [0.0, -1.0, 0.0]\npixel size: 0.01 m\n"),
            "{told}"
        );
        assert!(told.ends_with("elevation: -inf to 2 m\n"), "{told}");
    }

    #[test]
    fn a_project_file_is_told_with_its_inputs_and_frame() {
        let told =
            told(&format!("mesh = [\"a.ply\"]\ncameras = \"sparse\"\n[frame]\n{PLANE}")).unwrap();
        assert!(
            told.contains(": project file\nmesh: ") && told.contains("a.ply\ncameras: "),
            "{told}"
        );
        assert!(told.contains("\nframe: plane\n"), "{told}");
        assert!(super::tests::told("mseh = 1").is_err());
    }
}
