//! [`read`]: from the document to a draft.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat3, DVec3};

use super::markers;
use super::sensor::sensor_lens;
use crate::camera::{Lens, Pose};
use crate::input::cameras::{CameraOptions, Draft, DraftPhoto, MAX_PHOTOS, pose, rotation_of_rows};
use crate::input::labels::PhotoLabels;
use crate::input::xml::{Node, read_xml};
use crate::{Error, Result};

/// Elements that are of no use here, and may be large.
const SKIP: &[&str] = &[
    "covariance",
    "rotation_covariance",
    "location_covariance",
    "rolling_shutter",
    "partition",
    "region",
    "settings",
    "meta",
    "bands",
    "vignetting",
];

/// A sensor's lens, or why its photos are left out.
type SensorLens = std::result::Result<Lens, String>;

/// Whether a file that begins with `head` may be such a document.
pub(in crate::input) fn is_metashape(head: &str) -> bool {
    head.starts_with('<') && head.contains("<document") && head.contains("<chunk")
}

/// Reads the cameras of the document at `path`; labels are matched with the photos of the folder in `options`.
///
/// # Errors
/// Those of [`read_xml`]; [`Error::Corrupt`] with the line for what is no such document; [`Error::Unsupported`] for one
/// of several chunks or in geocentric coordinates.
pub(in crate::input) fn read(path: &Path, options: &CameraOptions) -> Result<Draft> {
    let document = read_xml(path, SKIP)?;
    let chunk = the_chunk(path, document.root())?;
    let frames = Frames::of(path, chunk)?;
    let mut sensors = BTreeMap::new();
    for sensor in chunk.needed_child("sensors")?.children_named("sensor") {
        sensors.insert(sensor.needed_attribute("id")?, sensor_lens(path, sensor)?);
    }
    let labels = PhotoLabels::of(options.photos.as_deref())?;
    let mut cameras = Vec::new();
    collect(chunk.needed_child("cameras")?, &mut cameras);
    let mut draft = Draft::default();
    let mut numbers = BTreeMap::new();
    for camera in cameras {
        if draft.photos.len() == MAX_PHOTOS {
            let limit = MAX_PHOTOS as u64;
            let what = format!("{}: cameras", path.display());
            return Err(Error::Limit { what, limit, found: limit + 1 });
        }
        let label = camera.needed_attribute("label")?;
        let oriented = oriented(camera, &sensors, &frames)?;
        if let Some(id) = camera.attribute("id") {
            numbers.insert(id, draft.photos.len());
        }
        let (name, orientation) = match labels.name_of(label) {
            Ok(name) => (name, oriented),
            Err(reason) => (label.to_owned(), oriented.and(Err(reason))),
        };
        draft.photos.push(DraftPhoto { name, place: camera.place(), orientation });
    }
    draft.ties = markers::ties(chunk, &numbers)?;
    Ok(draft)
}

/// The one chunk of the document, in metres or in a system of its own.
fn the_chunk<'a>(path: &Path, root: Node<'a>) -> Result<Node<'a>> {
    if root.name() != "document" {
        return Err(
            root.corrupt("the <document> of Metashape's cameras", format!("<{}>", root.name()))
        );
    }
    let chunk = root.needed_child("chunk")?;
    if root.children_named("chunk").count() > 1 {
        return Err(Error::unsupported(path, "a document of several chunks"));
    }
    let crs = chunk.child("reference").map(Node::text).unwrap_or_default();
    let is_metric = ["LOCAL_CS", "GEOCCS"].iter().any(|word| crs.starts_with(word));
    if is_metric || crs.is_empty() {
        return Ok(chunk);
    }
    // The transform of such a chunk leads to geocentric coordinates, where no exported mesh of it lies.
    let word = crs.split('[').next().unwrap_or_default().chars().take(20).collect::<String>();
    Err(Error::Unsupported {
        path: path.to_path_buf(),
        what: format!("a chunk whose coordinate system is a {word}"),
        hint: Some(
            "its cameras are geocentric: set the chunk to local coordinates before exporting cameras and mesh, \
             or export omega, phi, kappa and give them as a plain table"
                .into(),
        ),
    })
}

/// All cameras, those in groups too.
fn collect<'a>(parent: Node<'a>, cameras: &mut Vec<Node<'a>>) {
    for child in parent.children() {
        match child.name() {
            "camera" => cameras.push(child),
            "group" => collect(child, cameras),
            _ => {}
        }
    }
}

/// Lens and pose of a camera; inside, why it is left out.
fn oriented(
    camera: Node,
    sensors: &BTreeMap<&str, SensorLens>,
    frames: &Frames,
) -> Result<std::result::Result<(Lens, Pose), String>> {
    if matches!(camera.attribute("enabled"), Some("0" | "false")) {
        return Ok(Err("disabled in Metashape".into()));
    }
    let Some(transform) = camera.child("transform") else {
        let reason = match camera.attribute("master_id") {
            Some(_) => "a camera of a rig: its pose stands with its master",
            None => "not aligned in Metashape",
        };
        return Ok(Err(reason.into()));
    };
    let ground_from_chunk = match frames.of_camera(camera) {
        Ok(frame) => frame,
        Err(reason) => return Ok(Err(reason)),
    };
    let id = camera.needed_attribute("sensor_id")?;
    let lens = match sensors.get(id) {
        Some(Ok(lens)) => *lens,
        Some(Err(reason)) => return Ok(Err(reason.clone())),
        None => return Err(camera.corrupt("the id of a sensor", format!("{id:?}"))),
    };
    let (chunk_from_camera, centre_chunk) = rigid(transform)?;
    let rotation = (ground_from_chunk.rotation * chunk_from_camera).transpose();
    let pose = pose(rotation, ground_from_chunk.apply(centre_chunk))
        .map_err(|e| transform.corrupt(e.expected, e.found))?;
    Ok(Ok((lens, pose)))
}

/// Rotation and translation of a 4 × 4 matrix, row by row.
fn rigid(transform: Node) -> Result<(DMat3, DVec3)> {
    let m: [f64; 16] = transform.numbers()?;
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(
            transform.corrupt("0 0 0 1 as the matrix's last row", format!("{:?}", &m[12..]))
        );
    }
    let row = |i: usize| [m[4 * i], m[4 * i + 1], m[4 * i + 2]];
    Ok((rotation_of_rows([row(0), row(1), row(2)]), DVec3::new(m[3], m[7], m[11])))
}

/// From a chunk, or a component of it, to the ground: `scale · rotation · p + translation`.
#[derive(Debug, Clone, Copy)]
struct Similarity {
    rotation: DMat3,
    translation: DVec3,
    scale: f64,
}

impl Similarity {
    const NONE: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO, scale: 1.0 };

    /// From a `<transform>` with rotation, translation and scale, each perhaps missing, or with a 4 × 4 matrix.
    fn of(transform: Node) -> Result<Self> {
        if transform.children().next().is_none() && !transform.text().is_empty() {
            let (matrix, translation) = rigid(transform)?;
            let scale = matrix.determinant().abs().cbrt();
            return Self { rotation: matrix * scale.recip(), translation, scale }
                .checked(transform);
        }
        let mut found = Self::NONE;
        if let Some(node) = transform.child("rotation") {
            let m: [f64; 9] = node.numbers()?;
            let row = |i: usize| [m[3 * i], m[3 * i + 1], m[3 * i + 2]];
            found.rotation = rotation_of_rows([row(0), row(1), row(2)]);
        }
        if let Some(node) = transform.child("translation") {
            found.translation = DVec3::from(node.numbers::<3>()?);
        }
        if let Some(node) = transform.child("scale") {
            found.scale = node.number()?;
        }
        found.checked(transform)
    }

    /// The same, its rotation a true one.
    fn checked(self, transform: Node) -> Result<Self> {
        if !(self.scale > 0.0 && self.scale.is_finite()) {
            return Err(transform.corrupt("a scale above 0", self.scale.to_string()));
        }
        let pose = pose(self.rotation, self.translation)
            .map_err(|e| transform.corrupt(e.expected, e.found))?;
        Ok(Self { rotation: pose.rotation, ..self })
    }

    fn apply(&self, p: DVec3) -> DVec3 {
        self.rotation * (p * self.scale) + self.translation
    }
}

/// The frames of a chunk and of its components.
struct Frames<'a> {
    chunk: Similarity,
    /// By the component's id; none: the component is not placed.
    components: BTreeMap<&'a str, Option<Similarity>>,
}

impl<'a> Frames<'a> {
    fn of(path: &Path, chunk: Node<'a>) -> Result<Self> {
        let frame = |node: Node| node.child("transform").map(Similarity::of).transpose();
        let mut components = BTreeMap::new();
        for component in
            chunk.child("components").iter().flat_map(|all| all.children_named("component"))
        {
            let id = component.needed_attribute("id")?;
            if components.insert(id, frame(component)?).is_some() {
                let place = component.place();
                return Err(Error::corrupt(path, place, "a component id of its own", id));
            }
        }
        Ok(Self { chunk: frame(chunk)?.unwrap_or(Similarity::NONE), components })
    }

    /// The way to the ground for a camera, or why there is none.
    fn of_camera(&self, camera: Node) -> std::result::Result<Similarity, String> {
        let Some(id) = camera.attribute("component_id") else { return Ok(self.chunk) };
        match self.components.get(id) {
            Some(Some(frame)) => Ok(*frame),
            // The chunk's transform is that of its only component.
            Some(None) if self.components.len() == 1 => Ok(self.chunk),
            None if self.components.is_empty() => Ok(self.chunk),
            _ => Err(format!("its component {id} has no place on the ground")),
        }
    }
}
