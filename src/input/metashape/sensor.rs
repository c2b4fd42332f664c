//! A sensor and its calibration: the lens of its photos.

use crate::Result;
use crate::camera::{Lens, LensModel};
use crate::geom::Size;
use crate::input::cameras::lens;
use crate::input::xml::Node;

/// The terms of a calibration, in the order in which they are held.
const TERMS: [&str; 13] =
    ["f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4"];

/// The lens of a sensor; inside, why its photos are left out.
///
/// # Errors
/// [`crate::Error::Corrupt`] for what is no sensor, or for numbers that make no lens.
pub(super) fn sensor_lens(
    path: &std::path::Path,
    sensor: Node,
) -> Result<std::result::Result<Lens, String>> {
    let Some(calibration) = calibration(sensor) else {
        return Ok(Err("its sensor has no adjusted calibration".into()));
    };
    let kind = calibration.attribute("type").or(sensor.attribute("type")).unwrap_or("frame");
    let model = match kind {
        "frame" => LensModel::Brown,
        "fisheye" | "equidistant_fisheye" => LensModel::BrownFisheye,
        _ => return Ok(Err(format!("a sensor of type {kind} is not supported"))),
    };
    let size = resolution(sensor.needed_child("resolution")?)?;
    if let Some(own) = calibration.child("resolution")
        && resolution(own)? != size
    {
        return Ok(Err("its calibration is for photos of another size".into()));
    }
    let [f, cx, cy, b1, b2, k1, k2, k3, k4, p1, p2, p3, p4] = match terms(calibration)? {
        Ok(terms) => terms,
        Err(reason) => return Ok(Err(reason)),
    };
    if (p3, p4) != (0.0, 0.0) {
        return Ok(Err("a calibration with p3 or p4 is not supported".into()));
    }
    let cx = 0.5 * f64::from(size.width) + cx;
    let cy = 0.5 * f64::from(size.height) + cy;
    // OpenCV's p1 is Metashape's p2, and the other way round.
    let params = [f + b1, f, cx, cy, b2, k1, k2, k3, k4, p2, p1];
    lens((path, &calibration.place()), model, size, &params)
}

/// The adjusted calibration, or the only one that was never to be adjusted.
fn calibration(sensor: Node) -> Option<Node> {
    let of_class = |class: Option<&str>| {
        sensor.children_named("calibration").find(|c| c.attribute("class") == class)
    };
    let is_fixed = || {
        let mut properties = sensor.children_named("property");
        properties
            .any(|p| p.attribute("name") == Some("fixed") && p.attribute("value") == Some("true"))
    };
    of_class(Some("adjusted"))
        .or_else(|| of_class(None))
        .or_else(|| of_class(Some("initial")).filter(|_| is_fixed()))
}

fn resolution(node: Node) -> Result<Size> {
    Ok(Size::new(node.whole_attribute("width")?, node.whole_attribute("height")?))
}

/// The [`TERMS`] of a calibration, 0 where not given; inside, why they are not enough.
fn terms(calibration: Node) -> Result<std::result::Result<[f64; 13], String>> {
    let mut terms = [0.0; 13];
    for child in calibration.children() {
        let name = child.name();
        if let Some(at) = TERMS.iter().position(|term| *term == name) {
            terms[at] = child.number()?;
        } else if !matches!(name, "resolution" | "date" | "projection" | "width" | "height")
            && child.text().parse() != Ok(0.0)
        {
            return Ok(Err(format!("a calibration with <{name}> is not supported")));
        }
    }
    if calibration.child("f").is_none() {
        return Ok(Err("its calibration has no <f>".into()));
    }
    Ok(Ok(terms))
}
