//! What is in a camera set.

use std::collections::BTreeMap;
use std::iter;
use std::path::Path;

use super::mesh::vertex_bounds;
use crate::Result;
use crate::camera::CameraSet;
use crate::geom::Bounds3;
use crate::input::{
    CameraFormat, CameraOptions, Cameras, MeshProof, Proof, open_mesh, read_cameras,
};

/// Photos, lens models, sizes, where the cameras stand, which photos cannot be used, what the tie points say and, if a
/// mesh is named, whether the cameras look at it.
///
/// # Errors
/// What reading the camera set or the mesh gives.
pub(super) fn describe(
    path: &Path,
    mesh: Option<&Path>,
    options: &CameraOptions,
) -> Result<String> {
    let Cameras { set, format, proof } = read_cameras(path, options)?;
    let count = set.names.len();
    let mut lines = vec![format!("{}: {}, {count} photos", path.display(), format.title())];
    lines.extend(lens_lines(&set));
    lines.extend(place_line(&set));
    let left_out = set.left_out.iter();
    lines.extend(left_out.map(|left| format!("left out: {}: {}", left.name, left.reason)));
    lines.extend(proof.map(|proof| {
        let Proof { ties, error_px, .. } = proof;
        format!("tie points: {ties} tried, residual {error_px:.2} px (root mean square of the best nine tenths)")
    }));
    lines.extend(proof.and_then(|proof| proof.warning()).map(|w| warning(&w)));
    if let Some(mesh) = mesh {
        lines.extend(mesh_lines((path, format, options), &set, mesh)?);
    }
    Ok(lines.join("\n") + "\n")
}

fn warning(text: &str) -> String {
    format!("warning: {text}")
}

/// Whether the cameras look at the mesh.
fn mesh_lines(
    read: (&Path, CameraFormat, &CameraOptions),
    set: &CameraSet,
    mesh: &Path,
) -> Result<Vec<String>> {
    let (Some((min, max)), _) = vertex_bounds(&*open_mesh(mesh)?)? else {
        return Ok(vec![warning(&format!("{} has no finite vertex", mesh.display()))]);
    };
    let proof = MeshProof::of(read, &set.photos, &Bounds3 { min, max })?;
    let MeshProof { photos, in_front, inside, .. } = proof;
    let line = format!(
        "mesh: in front of {in_front} and in the picture of {inside} of {photos} photos, by its bounds"
    );
    Ok(iter::once(line).chain(proof.warnings().iter().map(|w| warning(w))).collect())
}

/// A line for each lens model and photo size.
fn lens_lines(set: &CameraSet) -> Vec<String> {
    let mut kinds: BTreeMap<(&str, u32, u32), Vec<f64>> = BTreeMap::new();
    for photo in &set.photos {
        let size = photo.lens.size();
        let kind = (photo.lens.model().name(), size.width, size.height);
        kinds.entry(kind).or_default().push(photo.lens.focal_px().x);
    }
    let line = |((model, width, height), focal): (&(&str, u32, u32), &Vec<f64>)| {
        let least = focal.iter().copied().fold(f64::INFINITY, f64::min);
        let most = focal.iter().copied().fold(0.0, f64::max);
        let count = focal.len();
        format!(
            "{count} × {model}, {width} × {height} pixels, focal length {least:.1} to {most:.1} px"
        )
    };
    kinds.iter().map(line).collect()
}

/// The box in which the cameras stand.
fn place_line(set: &CameraSet) -> Option<String> {
    let centres = || set.photos.iter().map(|photo| photo.pose.centre_ground);
    // Adding zero turns −0 into 0.
    let min = centres().reduce(glam::DVec3::min)? + glam::DVec3::ZERO;
    let max = centres().reduce(glam::DVec3::max)? + glam::DVec3::ZERO;
    Some(format!(
        "camera centres: x {:.3} to {:.3}, y {:.3} to {:.3}, z {:.3} to {:.3}",
        min.x, max.x, min.y, max.y, min.z, max.z
    ))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn models_sizes_centres_and_photos_left_out_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let cameras = "1 PINHOLE 640 480 500 500 320 240\n2 EUCM 64 48 50 50 32 24 0 0\n";
        fs::write(folder.path().join("cameras.txt"), cameras).unwrap();
        let images = "1 1 0 0 0 -1 0 0 1 a b.jpg\n\n2 1 0 0 0 -3 0 -2 1 c.jpg\n\n3 1 0 0 0 0 0 0 2 f.jpg\n\n";
        fs::write(folder.path().join("images.txt"), images).unwrap();
        let told = describe(folder.path(), None, &CameraOptions::default()).unwrap();
        for line in [
            "2 × PINHOLE, 640 × 480 pixels, focal length 500.0 to 500.0 px",
            "camera centres: x 1.000 to 3.000, y 0.000 to 0.000, z 0.000 to 2.000",
        ] {
            assert!(told.lines().any(|told| told == line), "{line} is not in\n{told}");
        }
        assert!(told.lines().next().unwrap().ends_with(": COLMAP model, 3 photos"), "{told}");
        assert!(told.contains("\nleft out: f.jpg: "), "{told}");
    }
}
