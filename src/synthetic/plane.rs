//! [`PlaneSpec`]: the plane frame of a scene's mosaic, as a frame file states it.

use std::fmt::Write;

use glam::{DVec2, DVec3};

use super::Placement;
use crate::geom::Size;

/// A plane frame as `frame.toml` states it; all numbers are written so that they read back to the same bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneSpec {
    /// Ground point of u = v = 0, elevation 0; metres.
    pub origin: DVec3,
    /// Columns run along +u.
    pub u_axis: DVec3,
    /// Rows run along −v.
    pub v_axis: DVec3,
    /// Metres.
    pub pixel_size: f64,
    /// `[u_min, v_min, u_max, v_max]`, metres.
    pub extent: [f64; 4],
    /// Slab, metres along n = u × v; unbounded if `None`.
    pub elevation: Option<[f64; 2]>,
}

impl PlaneSpec {
    /// The frame whose u, v and elevation are a placed scene's x, y and z, over `extent`, without a slab.
    pub fn of_scene(placement: &Placement, pixel_size: f64, extent: [f64; 4]) -> Self {
        let Placement { origin, u, v } = *placement;
        Self { origin, u_axis: u, v_axis: v, pixel_size, extent, elevation: None }
    }

    /// The direction towards the viewer.
    pub fn n(&self) -> DVec3 {
        self.u_axis.cross(self.v_axis)
    }

    /// Least and greatest elevation, perhaps infinite.
    pub fn slab(&self) -> [f64; 2] {
        self.elevation.unwrap_or([f64::NEG_INFINITY, f64::INFINITY])
    }

    /// The mosaic's size.
    ///
    /// # Panics
    /// If the extent is empty or more than 2³² pixels wide or high.
    pub fn size(&self) -> Size {
        let [u0, v0, u1, v1] = self.extent;
        let count = |length: f64| {
            let pixels = (length / self.pixel_size - 1e-9).ceil();
            assert!((1.0..4_294_967_296.0).contains(&pixels), "an extent of {pixels} pixels");
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "just checked"
            )]
            let pixels = pixels as u32;
            pixels
        };
        Size::new(count(u1 - u0), count(v1 - v0))
    }

    /// (u, v) of a position in mosaic pixels, the top-left pixel's centre at (0.5, 0.5).
    pub fn plane_from_pixel(&self, position: DVec2) -> DVec2 {
        let [u_min, _, _, v_max] = self.extent;
        DVec2::new(u_min + position.x * self.pixel_size, v_max - position.y * self.pixel_size)
    }

    /// The keys of the frame, without a table header.
    pub fn to_toml(&self) -> String {
        let list = |numbers: &[f64]| {
            let numbers: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
            format!("[{}]", numbers.join(", "))
        };
        let mut text = format!(
            "kind = \"plane\"\norigin = {}\nu_axis = {}\nv_axis = {}\npixel_size = {:?}\nextent = {}\n",
            list(&self.origin.to_array()),
            list(&self.u_axis.to_array()),
            list(&self.v_axis.to_array()),
            self.pixel_size,
            list(&self.extent),
        );
        if let Some(slab) = self.elevation {
            writeln!(text, "elevation = {}", list(&slab)).expect("a string takes all");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frame_file_reads_back_to_the_same_bits() {
        let placement = Placement::upright(DVec3::new(500_000.1, 4_200_000.7, 1e-7), 0.3);
        let mut spec = PlaneSpec::of_scene(&placement, 0.1 + 0.2, [-1.0, 0.0, 7.4, 5.5]);
        spec.elevation = Some([f64::NEG_INFINITY, -0.5]);
        let table: toml::Table = spec.to_toml().parse().unwrap();
        let read = |key: &str| -> Vec<u64> {
            let list = table[key].as_array().unwrap().iter();
            list.map(|v| v.as_float().unwrap().to_bits()).collect()
        };
        let bits = |v: &[f64]| -> Vec<u64> { v.iter().map(|x| x.to_bits()).collect() };
        assert_eq!(read("origin"), bits(&spec.origin.to_array()));
        assert_eq!(read("u_axis"), bits(&spec.u_axis.to_array()));
        assert_eq!(read("v_axis"), bits(&spec.v_axis.to_array()));
        assert_eq!(read("extent"), bits(&spec.extent));
        assert_eq!(read("elevation"), bits(&spec.slab()));
        assert_eq!(table["pixel_size"].as_float().unwrap().to_bits(), spec.pixel_size.to_bits());
    }

    #[test]
    fn a_whole_number_of_pixels_is_not_rounded_up() {
        let spec = PlaneSpec::of_scene(&Placement::IDENTITY, 0.1, [0.0, 0.0, 0.3, 0.71]);
        assert_eq!(spec.size(), Size::new(3, 8));
        assert!(
            (spec.plane_from_pixel(DVec2::new(0.5, 0.5)) - DVec2::new(0.05, 0.66)).length() < 1e-15
        );
    }
}
