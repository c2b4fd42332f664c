//! Frames as users write them.

use super::{Facing, FrameError, FrameSpec, FrameTable, Orientation};

fn check(text: &str) -> Result<FrameSpec, FrameError> {
    toml::from_str::<FrameTable>(text).unwrap().check()
}

fn key(text: &str) -> &'static str {
    check(text).unwrap_err().key
}

const PLANE: &str =
    "kind = 'plane'\norigin = [1, 2, 3.5]\nu_axis = [1, 0, 0]\nv_axis = [0, 0, 1]\n";
const CYLINDER: &str =
    "kind = 'cylinder'\norigin = [0, 0, 0]\naxis = [0, 0, 1]\nzero = [1, 0, 0]\nradius = 5\n";

#[test]
fn a_plane_may_be_written_with_whole_numbers_and_infinite_bounds() {
    let spec = check(&format!("{PLANE}elevation = [-inf, 4]\nextent = [0, -1, 2, 3]")).unwrap();
    let FrameSpec::Plane(plane) = spec else { panic!("{spec:?}") };
    assert_eq!(plane.elevation, Some([f64::NEG_INFINITY, 4.0]));
    assert_eq!(plane.extent, Some([0.0, -1.0, 2.0, 3.0]));
    assert_eq!((plane.pixel_size, plane.n.to_array()), (None, [0.0, -1.0, 0.0]));
}

#[test]
fn values_that_make_no_plane_are_refused_by_key() {
    assert_eq!(key("kind = 'plane'"), "origin");
    assert_eq!(key("kind = 'flat'"), "kind");
    for (line, at) in [
        ("pixel_size = 0", "pixel_size"),
        ("pixel_size = nan", "pixel_size"),
        ("pixel_size = inf", "pixel_size"),
        ("extent = [0, 0, 1, inf]", "extent"),
        ("extent = [0, 0, 0, 1]", "extent"),
        ("elevation = [4, 4]", "elevation"),
        ("elevation = [nan, 4]", "elevation"),
        ("crs = 'EPSG:32634'", "v_axis"),
        ("crs = 'WGS84'", "crs"),
        ("radius = 3", "radius"),
        ("photo = 'a.jpg'", "photo"),
    ] {
        assert_eq!(key(&format!("{PLANE}{line}")), at, "{line}");
    }
}

#[test]
fn unknown_keys_do_not_parse() {
    let e = toml::from_str::<FrameTable>(&format!("{PLANE}pixelsize = 3")).unwrap_err();
    assert!(e.to_string().contains("pixelsize"));
}

#[test]
fn values_that_make_no_cylinder_are_refused_by_key() {
    let spec = check(&format!("{CYLINDER}facing = 'inside'")).unwrap();
    assert!(matches!(&spec, FrameSpec::Cylinder(c) if c.facing == Facing::Inside));
    assert_eq!(key(CYLINDER), "facing");
    assert_eq!(key(&format!("{CYLINDER}facing = 'up'")), "facing");
    let outside = format!("{CYLINDER}facing = 'outside'\n");
    assert_eq!(key(&format!("{outside}extent = [0, 0, 31.5, 1]")), "extent");
    assert!(check(&format!("{outside}extent = [0, 0, 31.4, 1]")).is_ok());
    assert_eq!(key(&format!("{outside}crs = 'EPSG:32634'")), "crs");
    assert_eq!(key(&outside.replace("radius = 5", "radius = -5")), "radius");
    assert_eq!(key(&outside.replace("zero = [1, 0, 0]", "zero = [0.6, 0, 0.8]")), "zero");
}

#[test]
fn a_perspective_is_a_photo_or_a_camera_with_a_pose() {
    let spec = check("kind = 'perspective'\nphoto = 'IMG 1.jpg'\ndistorted = true").unwrap();
    let FrameSpec::Perspective(p) = &spec else { unreachable!() };
    let name = "IMG 1.jpg".to_owned();
    assert_eq!(p.orientation, Orientation::OfPhoto { name, distorted: true });

    let camera = "camera = { model = 'PINHOLE', width = 4, height = 3, params = [5, 5, 2, 1.5] }\n";
    let pose = "pose = { rotation = [1, 0, 0, 0], translation = [0, 0, 1] }\n";
    let head = "kind = 'perspective'\n";
    assert!(check(&format!("{head}{camera}{pose}")).is_ok());
    assert_eq!(key(&format!("{head}{camera}")), "pose");
    assert_eq!(key(&format!("{head}{pose}")), "camera");
    assert_eq!(key(head), "camera");
    assert_eq!(key(&format!("{head}{camera}{pose}photo = 'a'")), "photo");
    assert_eq!(key(&format!("{head}{camera}{pose}distorted = true")), "distorted");
    assert_eq!(key(&format!("{head}photo = 'a'\npixel_size = 1")), "pixel_size");
    assert_eq!(key(&format!("{head}photo = 'a'\nextent = [0, 0, 1, 1]")), "extent");
    assert_eq!(key(&format!("{head}{}{pose}", camera.replace("PINHOLE", "HOLE"))), "camera");
    assert_eq!(key(&format!("{head}{}{pose}", camera.replace("PINHOLE", "FOV"))), "camera");
    assert_eq!(key(&format!("{head}{camera}{}", pose.replace("[1, 0", "[0, 0"))), "pose");
}
