//! Layers and pixels for the tests of this module.

use super::{Colour, Depth, Layer, Meaning, Raster, SampleType};
use crate::geom::Size;
use crate::image::Image;

/// One layer of every kind: the four mosaics and the six others.
pub(super) fn all_layers() -> Vec<Layer> {
    let mut layers = Vec::new();
    for colour in [Colour::Grey, Colour::Rgb] {
        for depth in [Depth::Eight, Depth::Sixteen] {
            layers.push(Layer::mosaic(colour, depth));
        }
    }
    layers.extend(Meaning::ALL.into_iter().filter_map(Layer::of));
    layers
}

/// A hash of a number (the finaliser of splitmix64).
fn hash(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// Random samples; a third of the pixels are undefined.
pub(super) fn noise(layer: &Layer, size: Size, seed: u64) -> Raster {
    let channels = layer.channels();
    let samples = size.width as usize * size.height as usize * channels;
    let alpha = layer.meaning() == Meaning::Mosaic;
    let value = |i: usize| {
        let pixel = hash(seed << 32 ^ (i / channels) as u64);
        match (pixel.is_multiple_of(3), alpha && i % channels == channels - 1) {
            (true, true) => 0,
            (false, true) => u64::MAX,
            (true, false) if !alpha => u64::MAX,
            _ => hash(pixel ^ i as u64),
        }
    };
    let bytes = |i: usize| value(i).to_le_bytes();
    let narrow2 = |i: usize| u16::from_le_bytes([bytes(i)[0], bytes(i)[1]]);
    let narrow4 =
        |i: usize| u32::from_le_bytes([bytes(i)[0], bytes(i)[1], bytes(i)[2], bytes(i)[3]]);
    match layer.sample() {
        SampleType::U8 => Raster::U8(Image::from_data(
            size,
            channels,
            (0..samples).map(|i| bytes(i)[0]).collect(),
        )),
        SampleType::U16 => {
            Raster::U16(Image::from_data(size, channels, (0..samples).map(narrow2).collect()))
        }
        SampleType::U32 => {
            Raster::U32(Image::from_data(size, channels, (0..samples).map(narrow4).collect()))
        }
        SampleType::F32 => {
            let float = |i| match narrow4(i) {
                u32::MAX => f32::NAN,
                v => f32::from_bits(v >> 4 | 0x4000_0000),
            };
            Raster::F32(Image::from_data(size, channels, (0..samples).map(float).collect()))
        }
    }
}

/// The pixels of `rect`.
pub(super) fn cut(raster: &Raster, rect: crate::geom::PixelRect) -> Raster {
    let at = |v| usize::try_from(v).unwrap();
    let pixel = raster.channels() * raster.sample_type().bytes();
    let mut bytes = Vec::new();
    for y in rect.y0..rect.y1 {
        let mut row = Vec::new();
        raster.append_row(at(y), &mut row);
        bytes.extend_from_slice(&row[at(rect.x0) * pixel..at(rect.x1) * pixel]);
    }
    let side = |v: usize| u32::try_from(v).unwrap();
    let size = Size::new(side(rect.width()), side(rect.height()));
    Raster::from_le_bytes(raster.sample_type(), size, raster.channels(), &bytes)
}
