//! [`Georeference`]: where the pixels lie, as GeoTIFF keys.
//!
//! Position: `ModelTiepointTag` binds the upper-left corner of pixel (0, 0) to `(origin_u, origin_v)`, and
//! `ModelPixelScaleTag` is the pixel size twice; both are the very doubles of the frame, so what GDAL reads as
//! geotransform equals them to the last bit. `GTRasterTypeGeoKey` (1025) is 1, pixel is area.
//!
//! With an EPSG code: `GTModelTypeGeoKey` (1024) = 1 (projected), `ProjectedCSTypeGeoKey` (3072) = the code,
//! `ProjLinearUnitsGeoKey` (3076) = 9001 (metre).
//!
//! Without: the plane's own frame, u to the right and v up, in metres. `GTModelTypeGeoKey` (1024) = 32767
//! (user-defined), `GTCitationGeoKey` (1026) = `groundel plane frame`, `ProjLinearUnitsGeoKey` (3076) = 9001. GDAL
//! reads it as `LOCAL_CS["groundel plane frame", UNIT["metre", 1, …]]`, a local engineering frame.

use super::ifd::Directory;
use crate::{Error, Result};

/// Name of the frame of a mosaic without a CRS.
const LOCAL_FRAME: &str = "groundel plane frame";
/// EPSG code of the metre.
const METRE: u16 = 9001;

/// Where the upper-left corner of the mosaic lies, how big a pixel is, and in which frame.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Georeference {
    /// u of the left edge, metres: `u_min`.
    pub origin_u: f64,
    /// v of the upper edge, metres: `v_max`.
    pub origin_v: f64,
    /// Side of a pixel, metres; columns run along +u, rows along −v.
    pub pixel_size: f64,
    /// Code of a projected CRS in metres; none: the plane's own frame.
    pub epsg: Option<u16>,
}

/// The code of `EPSG:n`, if it is known, projected and in metres.
///
/// # Errors
/// [`Error::Usage`] that names what was asked for and what is wrong with it.
pub fn parse_crs(text: &str) -> Result<u16> {
    let fault = |found: String| {
        Error::usage(format!("CRS {text}: expected a projected EPSG code in metres, found {found}"))
    };
    let digits = text
        .split_once(':')
        .filter(|(authority, _)| authority.eq_ignore_ascii_case("EPSG"))
        .map(|(_, code)| code)
        .ok_or_else(|| fault("something else than EPSG:n".into()))?;
    let code = digits.parse().ok().ok_or_else(|| fault("no number below 65536".into()))?;
    let wkt = crs_definitions::from_code(code).ok_or_else(|| fault("an unknown code".into()))?.wkt;
    match wkt.split_once('[').map(|(kind, _)| kind) {
        Some("PROJCS") => {}
        Some("COMPD_CS") => {
            return Err(fault("a compound CRS; give the code of its horizontal part".into()));
        }
        Some("GEOCCS") => return Err(fault("a geocentric CRS".into())),
        _ => return Err(fault("a geographic CRS".into())),
    }
    // The unit of the projected CRS is its last; that of the angles stands before.
    let unit = wkt.rsplit_once("UNIT[").map_or("", |(_, unit)| unit);
    if unit.starts_with("\"metre\",1,") {
        Ok(code)
    } else {
        let name = unit.split('"').nth(1).unwrap_or("unknown");
        Err(fault(format!("a projected CRS in the unit {name}")))
    }
}

impl Georeference {
    /// Adds the tags of the georeference.
    pub(super) fn add_tags(&self, directory: &mut Directory) {
        directory.doubles(33550, &[self.pixel_size, self.pixel_size, 0.0]);
        directory.doubles(33922, &[0.0, 0.0, 0.0, self.origin_u, self.origin_v, 0.0]);
        if let Some(code) = self.epsg {
            directory.shorts(
                34735,
                &[
                    1, 1, 0, 4, // version 1.1.0, four keys
                    1024, 0, 1, 1, // projected
                    1025, 0, 1, 1, // pixel is area
                    3072, 0, 1, code, //
                    3076, 0, 1, METRE,
                ],
            );
        } else {
            // A citation ends with a bar, which counts.
            let citation = format!("{LOCAL_FRAME}|");
            let len = u16::try_from(citation.len()).expect("a short name");
            directory.shorts(
                34735,
                &[
                    1, 1, 0, 4, // version 1.1.0, four keys
                    1024, 0, 1, 32767, // user-defined
                    1025, 0, 1, 1, // pixel is area
                    1026, 34737, len, 0, // citation
                    3076, 0, 1, METRE,
                ],
            );
            directory.ascii(34737, &citation);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_known_projected_metres_pass_and_the_message_names_the_code() {
        for (text, code) in [("EPSG:32634", 32634), ("epsg:28992", 28992), ("EPSG:2180", 2180)] {
            assert_eq!(parse_crs(text).unwrap(), code);
        }
        for (text, reason) in [
            ("EPSG:4326", "geographic"),
            ("EPSG:4978", "geocentric"),
            ("EPSG:7415", "compound"),
            ("EPSG:2263", "US survey foot"),
            ("EPSG:1", "unknown"),
            ("EPSG:99999", "65536"),
            ("32634", "EPSG:n"),
            ("EPSG:", "65536"),
        ] {
            let e = parse_crs(text).unwrap_err();
            let message = e.to_string();
            assert!(message.contains(text) && message.contains(reason), "{message}");
            assert_eq!(e.exit_code(), 2);
        }
    }
}
