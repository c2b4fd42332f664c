//! [`Raster`]: the pixels of one tile of one layer, in the layer's sample type.

use crate::geom::Size;
use crate::image::Image;

/// Type of a layer's samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SampleType {
    /// Unsigned, 8 bit.
    U8,
    /// Unsigned, 16 bit.
    U16,
    /// Unsigned, 32 bit.
    U32,
    /// IEEE 754, 32 bit.
    F32,
}

/// An image of one of the sample types a layer can have: `height × width × channels`, row-major.
#[derive(Debug, Clone, PartialEq)]
pub enum Raster {
    /// 8-bit samples: mosaic, count, used, coverage.
    U8(Image<u8>),
    /// 16-bit samples: mosaic, best.
    U16(Image<u16>),
    /// 32-bit integers: face.
    U32(Image<u32>),
    /// Floating point: elevation.
    F32(Image<f32>),
}

impl SampleType {
    /// Bytes a sample.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Bits a sample.
    pub fn bits(self) -> u16 {
        match self {
            Self::U8 => 8,
            Self::U16 => 16,
            Self::U32 | Self::F32 => 32,
        }
    }

    /// Whether the samples are floating point.
    pub fn is_float(self) -> bool {
        self == Self::F32
    }
}

impl Raster {
    /// Width and height in pixels.
    pub fn size(&self) -> Size {
        match self {
            Self::U8(i) => i.size(),
            Self::U16(i) => i.size(),
            Self::U32(i) => i.size(),
            Self::F32(i) => i.size(),
        }
    }

    /// Samples a pixel.
    pub fn channels(&self) -> usize {
        match self {
            Self::U8(i) => i.channels(),
            Self::U16(i) => i.channels(),
            Self::U32(i) => i.channels(),
            Self::F32(i) => i.channels(),
        }
    }

    /// Bytes of the samples.
    pub fn bytes(&self) -> u64 {
        self.size().area() * (self.channels() * self.sample_type().bytes()) as u64
    }

    /// Type of the samples.
    pub fn sample_type(&self) -> SampleType {
        match self {
            Self::U8(_) => SampleType::U8,
            Self::U16(_) => SampleType::U16,
            Self::U32(_) => SampleType::U32,
            Self::F32(_) => SampleType::F32,
        }
    }

    /// The image, if its samples are of this type.
    pub fn as_u8(&self) -> Option<&Image<u8>> {
        if let Self::U8(i) = self { Some(i) } else { None }
    }

    /// The image, if its samples are of this type.
    pub fn as_u16(&self) -> Option<&Image<u16>> {
        if let Self::U16(i) = self { Some(i) } else { None }
    }

    /// The image, if its samples are of this type.
    pub fn as_u32(&self) -> Option<&Image<u32>> {
        if let Self::U32(i) = self { Some(i) } else { None }
    }

    /// The image, if its samples are of this type.
    pub fn as_f32(&self) -> Option<&Image<f32>> {
        if let Self::F32(i) = self { Some(i) } else { None }
    }

    /// Whether the other has the same pixels, bit by bit: not a number is the same as itself.
    pub fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::F32(a), Self::F32(b)) => {
                let bits = |of: &Image<f32>, k: usize| of.data()[k].to_bits();
                let alike = a.size() == b.size() && a.channels() == b.channels();
                alike && (0..a.data().len()).all(|k| bits(a, k) == bits(b, k))
            }
            _ => self == other,
        }
    }

    /// Appends row `y` to `out` as little-endian bytes; every NaN as the one quiet NaN 0x7fc00000, so that equal
    /// pixels are equal bytes.
    ///
    /// # Panics
    /// If the row is outside.
    pub(super) fn append_row(&self, y: usize, out: &mut Vec<u8>) {
        match self {
            Self::U8(i) => out.extend_from_slice(i.view().row(y)),
            Self::U16(i) => out.extend(i.view().row(y).iter().flat_map(|v| v.to_le_bytes())),
            Self::U32(i) => out.extend(i.view().row(y).iter().flat_map(|v| v.to_le_bytes())),
            Self::F32(i) => out.extend(i.view().row(y).iter().flat_map(|v| canonical(*v))),
        }
    }

    /// The raster whose rows, one after the other, are the little-endian samples `bytes`.
    ///
    /// # Panics
    /// If the number of bytes is not `height × width × channels × sample bytes`.
    pub(super) fn from_le_bytes(
        sample: SampleType,
        size: Size,
        channels: usize,
        bytes: &[u8],
    ) -> Self {
        match sample {
            SampleType::U8 => Self::U8(Image::from_data(size, channels, bytes.to_vec())),
            SampleType::U16 => {
                Self::U16(Image::from_data(size, channels, samples(bytes, u16::from_le_bytes)))
            }
            SampleType::U32 => {
                Self::U32(Image::from_data(size, channels, samples(bytes, u32::from_le_bytes)))
            }
            SampleType::F32 => {
                Self::F32(Image::from_data(size, channels, samples(bytes, f32::from_le_bytes)))
            }
        }
    }
}

fn canonical(v: f32) -> [u8; 4] {
    if v.is_nan() { f32::NAN.to_le_bytes() } else { v.to_le_bytes() }
}

fn samples<const N: usize, T>(bytes: &[u8], read: impl Fn([u8; N]) -> T) -> Vec<T> {
    bytes.as_chunks::<N>().0.iter().map(|b| read(*b)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rasters_are_the_same_bit_by_bit() {
        let of =
            |values: [f32; 2]| Raster::F32(Image::from_data(Size::new(2, 1), 1, values.to_vec()));
        assert!(of([f32::NAN, 1.0]).is_same(&of([f32::NAN, 1.0])));
        assert!(!of([0.0, 1.0]).is_same(&of([-0.0, 1.0])));
        assert!(!of([0.0, 1.0]).is_same(&of([0.0, f32::NAN])));
        let bytes = |v: u8| Raster::U8(Image::filled(Size::new(2, 1), 1, v));
        assert!(bytes(3).is_same(&bytes(3)) && !bytes(3).is_same(&bytes(4)));
        assert!(!bytes(0).is_same(&of([0.0, 0.0])));
    }
}
