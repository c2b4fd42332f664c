//! [`frame_toml`]: the frame as the text of `<stem>.frame.toml`.

use std::fmt::Debug;

use super::mosaic::{CentralView, Mosaic, MosaicFrame};
use super::spec::Orientation;
use super::table::{CameraTable, PoseTable};

/// The frame file of a mosaic.
///
/// Numbers are the shortest that read back to the same bits, always with a point or an exponent; `elevation` is left out
/// when it is unbounded. Reading the text and writing the mosaic it gives yields the same bytes.
pub fn frame_toml(mosaic: &Mosaic) -> String {
    let mut text = String::new();
    let grid = key("pixel_size", &mosaic.pixel_size) + &key("extent", &mosaic.extent);
    match &mosaic.frame {
        MosaicFrame::Plane(plane) => {
            text += &key("kind", &"plane");
            text += &key("origin", &plane.origin.to_array());
            text += &key("u_axis", &plane.u.to_array());
            text += &key("v_axis", &plane.v.to_array());
            text += &grid;
        }
        MosaicFrame::Cylinder(cylinder) => {
            text += &key("kind", &"cylinder");
            text += &key("origin", &cylinder.origin.to_array());
            text += &key("axis", &cylinder.axis.to_array());
            text += &key("zero", &cylinder.zero.to_array());
            text += &key("radius", &cylinder.radius);
            text += &key("facing", &cylinder.facing.name());
            text += &grid;
        }
        MosaicFrame::Perspective(view) => {
            text += &key("kind", &"perspective");
            text += &orientation(view);
        }
    }
    if mosaic.slab.iter().any(|e| e.is_finite()) {
        text += &key("elevation", &mosaic.slab);
    }
    if let Some(crs) = mosaic.plane().and_then(|plane| plane.crs.as_ref()) {
        text += &key("crs", crs);
    }
    text
}

/// The camera of a perspective view, as it was stated.
fn orientation(view: &CentralView) -> String {
    match &view.stated {
        Orientation::OfPhoto { name, distorted } => {
            // A name may hold what TOML must escape.
            let name = toml::Value::String(name.clone());
            let distorted = if *distorted { key("distorted", &true) } else { String::new() };
            format!("photo = {name}\n{distorted}")
        }
        Orientation::Given(camera) => {
            let CameraTable { model, width, height, params } = &camera.camera;
            let PoseTable { rotation, translation } = &camera.pose_table;
            format!(
                "camera = {{ model = {model:?}, width = {width}, height = {height}, params = {params:?} }}\n\
                 pose = {{ rotation = {rotation:?}, translation = {translation:?} }}\n"
            )
        }
    }
}

/// A key with its value. Debug forms are TOML: of f64 ("0.002", "1e-7", "-0.0", "inf") the shortest that reads back to
/// the same bits, of arrays of them, and of a string of plain characters.
fn key(key: &str, value: &impl Debug) -> String {
    format!("{key} = {value:?}\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{FrameSpec, FrameTable, Plane};

    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

    fn read(text: &str) -> Plane {
        let table: FrameTable = toml::from_str(text).unwrap();
        match table.check().unwrap() {
            FrameSpec::Plane(plane) => plane,
            other => unreachable!("{other:?}"),
        }
    }

    /// Writes, reads, writes again; both texts must be equal, and so must be the mosaics.
    fn assert_round_trip(mosaic: &Mosaic) -> String {
        let text = frame_toml(mosaic);
        let plane = read(&text);
        let slab = plane.elevation.unwrap_or(ALL);
        let (p, e) = (plane.pixel_size.unwrap(), plane.extent.unwrap());
        let again = Mosaic::new(plane, p, e, slab).unwrap();
        assert_eq!(frame_toml(&again), text);
        let bits = |m: &Mosaic| {
            let plane = m.plane().unwrap();
            let plane = [plane.origin, plane.u, plane.v, plane.n].map(|v| v.to_array());
            let rest = [m.pixel_size, m.slab[0], m.slab[1]];
            let all = plane.concat().into_iter().chain(m.extent).chain(rest);
            all.map(f64::to_bits).collect::<Vec<_>>()
        };
        assert_eq!(bits(&again), bits(mosaic));
        assert_eq!(again.size, mosaic.size);
        text
    }

    #[test]
    fn a_frame_is_written_key_by_key() {
        let plane = Plane::top().with_crs("EPSG:32634").unwrap();
        let extent = [500_000.0, 4_000_000.5, 500_010.0, 4_000_020.0];
        let m = Mosaic::new(plane, 0.01, extent, [f64::NEG_INFINITY, 12.0]).unwrap();
        let expected = "kind = \"plane\"
origin = [0.0, 0.0, 0.0]
u_axis = [1.0, 0.0, 0.0]
v_axis = [0.0, 1.0, 0.0]
pixel_size = 0.01
extent = [500000.0, 4000000.5, 500010.0, 4000020.0]
elevation = [-inf, 12.0]
crs = \"EPSG:32634\"
";
        assert_eq!(assert_round_trip(&m), expected);
    }

    #[test]
    fn an_unbounded_slab_is_not_written() {
        let m = Mosaic::new(Plane::top(), 1.0, [0.0, 0.0, 2.0, 2.0], ALL).unwrap();
        assert!(!assert_round_trip(&m).contains("elevation"));
    }

    #[test]
    fn odd_numbers_survive_to_the_last_bit() {
        let u = [0.679_064_334_075_875_6, 0.734_078_762_930_850_5, -0.0];
        let origin = [-0.0, 1e22, 1.0 / 3.0];
        let plane = Plane::new(origin, u, [0.0, -0.0, -1.0]).unwrap();
        let third = 1.0 / 3.0;
        for slab in [[-1e-7, f64::INFINITY], [f64::MIN, f64::MAX], [-0.0, 5e-324]] {
            let extent = [-1e-300, -0.0, 0.1 + 0.2, 1e3 + third];
            let m = Mosaic::new(plane.clone(), third * 1e-5, extent, slab).unwrap();
            assert_round_trip(&m);
        }
    }

    #[test]
    fn axes_that_had_to_be_squared_are_written_squared() {
        let plane = Plane::new([0.0; 3], [0.600_000_1, 0.8, 0.0], [-0.8, 0.599_999_9, 0.0]);
        let m = Mosaic::new(plane.unwrap(), 0.5, [0.0, 0.0, 2.0, 2.0], ALL).unwrap();
        assert_round_trip(&m);
    }
}
