//! `CalibrationInternConique`: the lens.

use std::path::Path;

use crate::Result;
use crate::camera::{Lens, LensModel};
use crate::geom::Size;
use crate::input::cameras::lens;
use crate::input::xml::Node;

/// The convention that is read.
pub(super) const CONVENTION: &str = "eConvApero_DistM2C";

/// A distortion in pixels.
#[derive(Debug, Default)]
struct Distortion {
    /// From the photo's corner, in `MicMac`'s coordinates; none: the principal point.
    centre: Option<[f64; 2]>,
    /// Of r², r⁴, r⁶, r⁸.
    radial: [f64; 4],
    /// P1, P2.
    decentering: [f64; 2],
}

/// The lens of a calibration in the file at `path`; inside, why its photos are left out.
///
/// # Errors
/// [`crate::Error::Corrupt`] for what is no calibration, or for numbers that make no lens.
pub(super) fn lens_of(path: &Path, node: Node) -> Result<std::result::Result<Lens, String>> {
    if let Some(reason) = other_convention(node) {
        return Ok(Err(reason));
    }
    if node.child("OrIntGlob").is_some() {
        return Ok(Err("a calibration with OrIntGlob is not supported".into()));
    }
    let [px, py] = node.needed_child("PP")?.numbers()?;
    let f = node.needed_child("F")?.number()?;
    let size = size(node.needed_child("SzIm")?)?;
    let parts: Vec<_> = node.children_named("CalibDistortion").collect();
    let distortion = match parts.as_slice() {
        [] => Distortion::default(),
        [part] => match distortion(*part)? {
            Ok(distortion) => distortion,
            Err(reason) => return Ok(Err(reason)),
        },
        _ => return Ok(Err("a calibration of several distortions is not supported".into())),
    };
    // From pixels to parts of the focal length.
    let mut power = 1.0;
    let [k1, k2, k3, k4] = distortion.radial.map(|k| {
        power *= f * f;
        k * power
    });
    let [p1, p2] = distortion.decentering.map(|p| p * f);
    let [dx, dy] = distortion.centre.map_or([0.0; 2], |[x, y]| [x - px, y - py]);
    let params = [f, f, px + 0.5, py + 0.5, 0.0, k1, k2, k3, k4, p2, p1, dx, dy];
    lens((path, &node.place()), LensModel::BrownOffCentre, size, &params)
}

/// The reason to leave a photo out, if the element has another convention.
pub(super) fn other_convention(node: Node) -> Option<String> {
    let convention = node.child("KnownConv")?.text();
    (convention != CONVENTION).then(|| format!("the convention {convention} is not supported"))
}

fn size(node: Node) -> Result<Size> {
    let [width, height] = node.numbers::<2>()?;
    let is_whole = |v: f64| v >= 0.0 && v <= f64::from(u32::MAX) && v.fract() == 0.0;
    if !(is_whole(width) && is_whole(height)) {
        return Err(node.corrupt("a width and a height in pixels", node.text()));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
    Ok(Size::new(width as u32, height as u32))
}

/// One distortion; inside, why it cannot be used.
fn distortion(node: Node) -> Result<std::result::Result<Distortion, String>> {
    let Some(model) = node.children().next() else { return Ok(Ok(Distortion::default())) };
    match model.name() {
        "ModNoDist" => Ok(Ok(Distortion::default())),
        "ModRad" => radial(model),
        "ModPhgrStd" => {
            let mut found = match radial(model.needed_child("RadialePart")?)? {
                Ok(found) => found,
                Err(reason) => return Ok(Err(reason)),
            };
            let term = |name: &str| model.child(name).map_or(Ok(0.0), Node::number);
            found.decentering = [term("P1")?, term("P2")?];
            if term("b1")? != 0.0 || term("b2")? != 0.0 {
                return Ok(Err("a calibration with b1 or b2 is not supported".into()));
            }
            Ok(Ok(found))
        }
        "ModUnif" => {
            let kind = model.child("TypeModele").map_or("ModUnif", Node::text);
            Ok(Err(format!("the distortion {kind} is not supported")))
        }
        name => Ok(Err(format!("the distortion {name} is not supported"))),
    }
}

fn radial(node: Node) -> Result<std::result::Result<Distortion, String>> {
    let mut found = Distortion::default();
    if let Some(centre) = node.child("CDist") {
        found.centre = Some(centre.numbers()?);
    }
    for (i, coefficient) in node.children_named("CoeffDist").enumerate() {
        let value = coefficient.number()?;
        match found.radial.get_mut(i) {
            Some(k) => *k = value,
            None if value == 0.0 => {}
            None => return Ok(Err("more than four radial terms are not supported".into())),
        }
    }
    Ok(Ok(found))
}
