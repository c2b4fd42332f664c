//! Tiles to bytes and back.
//!
//! Prediction, in wrapping arithmetic, then Zstandard:
//! 1. RGB becomes (G, R − G, B − G);
//! 2. each of these becomes a plane, each sample of which is the difference to its left neighbour;
//! 3. the planes follow one another; a 16-bit plane is split in its low and its high bytes.
//!
//! Measured on eight-bit photos of façades (0.22–0.31 B/px as JPEG) on one busy core, encoding and decoding in
//! Mpx/s, B/px: Zstandard 1 alone 29, 77, 2.13; left differences 23, 51, 1.52; as here but with default matching 21,
//! 59, 1.26; differences to the row above 22, 46, 1.23; as here 31, 60, 1.23.

use std::path::Path;

use zstd::bulk::{Compressor, Decompressor};
use zstd::zstd_safe::CParameter;

use crate::input::photo::Rows;
use crate::{Error, Result};

/// Zstandard's level; fewer and longer matches than its default, as in noise short ones cost time and win nothing.
const LEVEL: i32 = 1;
const MIN_MATCH: u32 = 7;
const HASH_LOG: u32 = 10;

/// A sample of a photo: `u8` or `u16`.
pub(super) trait Sample: Copy + Default + Send + Sync + 'static {
    fn minus(self, other: Self) -> Self;
    fn plus(self, other: Self) -> Self;
    /// The mean of `count` samples that add up to `sum`, rounded half up; `count` is 1, 2 or 4.
    fn mean(sum: u32, count: u32) -> Self;
    fn widen(self) -> u32;
    /// The rows, if they have this type.
    fn rows(rows: Rows<'_>) -> Option<&[Self]>;
    /// Planes of `plane` samples each as bytes; `scratch` may hold them.
    fn planes_to_bytes<'a>(planes: &'a [Self], plane: usize, scratch: &'a mut Vec<u8>) -> &'a [u8];
    /// The inverse; `words` may hold them.
    fn planes_from_bytes<'a>(bytes: &'a [u8], plane: usize, words: &'a mut Vec<u16>) -> &'a [Self];
}

impl Sample for u8 {
    fn minus(self, other: Self) -> Self {
        self.wrapping_sub(other)
    }

    fn plus(self, other: Self) -> Self {
        self.wrapping_add(other)
    }

    #[expect(clippy::cast_possible_truncation, reason = "a mean of u8 is a u8")]
    fn mean(sum: u32, count: u32) -> Self {
        ((sum + count / 2) / count) as Self
    }

    fn widen(self) -> u32 {
        self.into()
    }

    fn rows(rows: Rows<'_>) -> Option<&[Self]> {
        match rows {
            Rows::U8(samples) => Some(samples),
            Rows::U16(_) => None,
        }
    }

    fn planes_to_bytes<'a>(planes: &'a [Self], _: usize, _: &'a mut Vec<u8>) -> &'a [u8] {
        planes
    }

    fn planes_from_bytes<'a>(bytes: &'a [u8], _: usize, _: &'a mut Vec<u16>) -> &'a [Self] {
        bytes
    }
}

impl Sample for u16 {
    fn minus(self, other: Self) -> Self {
        self.wrapping_sub(other)
    }

    fn plus(self, other: Self) -> Self {
        self.wrapping_add(other)
    }

    #[expect(clippy::cast_possible_truncation, reason = "a mean of u16 is a u16")]
    fn mean(sum: u32, count: u32) -> Self {
        ((sum + count / 2) / count) as Self
    }

    fn widen(self) -> u32 {
        self.into()
    }

    fn rows(rows: Rows<'_>) -> Option<&[Self]> {
        match rows {
            Rows::U16(samples) => Some(samples),
            Rows::U8(_) => None,
        }
    }

    fn planes_to_bytes<'a>(planes: &'a [Self], plane: usize, scratch: &'a mut Vec<u8>) -> &'a [u8] {
        scratch.clear();
        for samples in planes.chunks_exact(plane) {
            scratch.extend(samples.iter().map(|s| s.to_le_bytes()[0]));
            scratch.extend(samples.iter().map(|s| s.to_le_bytes()[1]));
        }
        scratch
    }

    fn planes_from_bytes<'a>(bytes: &'a [u8], plane: usize, words: &'a mut Vec<u16>) -> &'a [Self] {
        words.clear();
        for both in bytes.chunks_exact(2 * plane) {
            let (low, high) = both.split_at(plane);
            words.extend(low.iter().zip(high).map(|(&l, &h)| Self::from_le_bytes([l, h])));
        }
        words
    }
}

/// A tile's place in a buffer of rows: `height` rows of `width × channels` samples, `stride` samples apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct TileView<'a, S> {
    pub(super) samples: &'a [S],
    pub(super) stride: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) channels: usize,
}

impl<S: Copy> TileView<'_, S> {
    /// The samples of the tile alone.
    pub(super) fn to_vec(self) -> Vec<S> {
        let row = self.width * self.channels;
        let mut all = Vec::with_capacity(row * self.height);
        self.samples
            .chunks(self.stride)
            .take(self.height)
            .for_each(|r| all.extend_from_slice(&r[..row]));
        all
    }
}

/// Encodes tiles; keeps its buffers from one to the next.
pub(super) struct Encoder<S> {
    zstd: Compressor<'static>,
    planes: Vec<S>,
    bytes: Vec<u8>,
    stored: Vec<u8>,
}

impl<S: Sample> Encoder<S> {
    /// # Errors
    /// [`Error::Io`] at `path` if Zstandard cannot be set up (no memory).
    pub(super) fn new(path: &Path) -> Result<Self> {
        let mut zstd = Compressor::new(LEVEL).map_err(|e| Error::io(path, e))?;
        for parameter in [CParameter::MinMatch(MIN_MATCH), CParameter::HashLog(HASH_LOG)] {
            zstd.set_parameter(parameter).map_err(|e| Error::io(path, e))?;
        }
        Ok(Self { zstd, planes: Vec::new(), bytes: Vec::new(), stored: Vec::new() })
    }

    /// The stored form of a tile; `path` is for messages.
    pub(super) fn encode(&mut self, tile: TileView<'_, S>, path: &Path) -> Result<&[u8]> {
        let plane = tile.width * tile.height;
        self.planes.resize(plane * tile.channels, S::default());
        let row_samples = tile.width * tile.channels;
        let rows =
            tile.samples.chunks(tile.stride).take(tile.height).map(|row| &row[..row_samples]);
        if tile.channels == 3 {
            let (green, rest) = self.planes.split_at_mut(plane);
            let (red, blue) = rest.split_at_mut(plane);
            let planes = green
                .chunks_exact_mut(tile.width)
                .zip(red.chunks_exact_mut(tile.width))
                .zip(blue.chunks_exact_mut(tile.width));
            for (row, ((green, red), blue)) in rows.zip(planes) {
                split_rgb(row, green, red, blue);
            }
        } else {
            for (row, grey) in rows.zip(self.planes.chunks_exact_mut(tile.width)) {
                let mut left = S::default();
                for (&sample, out) in row.iter().zip(grey) {
                    *out = sample.minus(left);
                    left = sample;
                }
            }
        }
        let bytes = S::planes_to_bytes(&self.planes, plane, &mut self.bytes);
        self.stored.clear();
        self.stored.reserve(zstd::zstd_safe::compress_bound(bytes.len()));
        self.zstd.compress_to_buffer(bytes, &mut self.stored).map_err(|e| Error::io(path, e))?;
        Ok(&self.stored)
    }
}

fn split_rgb<S: Sample>(row: &[S], green: &mut [S], red: &mut [S], blue: &mut [S]) {
    let mut left = [S::default(); 3];
    let planes = green.iter_mut().zip(red).zip(blue);
    for (pixel, ((green, red), blue)) in row.chunks_exact(3).zip(planes) {
        let here = [pixel[1], pixel[0].minus(pixel[1]), pixel[2].minus(pixel[1])];
        *green = here[0].minus(left[0]);
        *red = here[1].minus(left[1]);
        *blue = here[2].minus(left[2]);
        left = here;
    }
}

/// Decodes tiles; keeps its buffers from one to the next.
pub(super) struct Decoder {
    zstd: Decompressor<'static>,
    bytes: Vec<u8>,
    words: Vec<u16>,
}

impl Decoder {
    pub(super) fn new() -> std::io::Result<Self> {
        Ok(Self { zstd: Decompressor::new()?, bytes: Vec::new(), words: Vec::new() })
    }

    /// Decodes a stored tile of `width × … × channels` into all of `tile`.
    ///
    /// # Errors
    /// What is wrong with the stored bytes, in words.
    pub(super) fn decode<S: Sample>(
        &mut self,
        stored: &[u8],
        width: usize,
        channels: usize,
        tile: &mut [S],
    ) -> std::result::Result<(), String> {
        let expected = std::mem::size_of_val(tile);
        self.bytes.resize(expected, 0);
        let length = self
            .zstd
            .decompress_to_buffer(stored, &mut self.bytes[..])
            .map_err(|e| e.to_string())?;
        if length != expected {
            return Err(format!("{length} bytes where {expected} should be"));
        }
        let plane = tile.len() / channels;
        let planes = S::planes_from_bytes(&self.bytes, plane, &mut self.words);
        if channels == 3 {
            let (green, rest) = planes.split_at(plane);
            let (red, blue) = rest.split_at(plane);
            let planes = green
                .chunks_exact(width)
                .zip(red.chunks_exact(width))
                .zip(blue.chunks_exact(width));
            for (row, ((green, red), blue)) in tile.chunks_exact_mut(3 * width).zip(planes) {
                join_rgb(green, red, blue, row);
            }
        } else {
            for (row, grey) in tile.chunks_exact_mut(width).zip(planes.chunks_exact(width)) {
                let mut left = S::default();
                for (out, &difference) in row.iter_mut().zip(grey) {
                    left = left.plus(difference);
                    *out = left;
                }
            }
        }
        Ok(())
    }
}

fn join_rgb<S: Sample>(green: &[S], red: &[S], blue: &[S], row: &mut [S]) {
    let mut left = [S::default(); 3];
    let planes = green.iter().zip(red).zip(blue);
    for (pixel, ((&green, &red), &blue)) in row.chunks_exact_mut(3).zip(planes) {
        left = [left[0].plus(green), left[1].plus(red), left[2].plus(blue)];
        pixel[0] = left[1].plus(left[0]);
        pixel[1] = left[0];
        pixel[2] = left[2].plus(left[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::Random;
    use super::*;

    fn round_trip<S: Sample + PartialEq + std::fmt::Debug>(sample: impl Fn(u64) -> S) {
        let path = Path::new("t");
        let mut encoder = Encoder::new(path).unwrap();
        let mut decoder = Decoder::new().unwrap();
        let mut random = Random(11);
        for (width, height, channels) in [(256, 256, 3), (1, 1, 1), (7, 256, 3), (256, 3, 1)] {
            let stride = (width + 5) * channels;
            let rows: Vec<S> =
                (0..stride * height).map(|_| sample(random.below(1 << 16))).collect();
            // The view begins one pixel into the rows.
            let samples = &rows[channels..];
            let view = TileView { samples, stride, width, height, channels };
            let stored = encoder.encode(view, path).unwrap().to_vec();
            let mut tile = vec![S::default(); width * height * channels];
            decoder.decode(&stored, width, channels, &mut tile).unwrap();
            for (row, expected) in tile.chunks(width * channels).zip(samples.chunks(stride)) {
                assert_eq!(row, &expected[..width * channels]);
            }
            assert!(decoder.decode(&stored, width, channels, &mut tile[1..]).is_err());
        }
    }

    #[test]
    fn a_tile_comes_back_as_it_was() {
        round_trip(|v| u8::try_from(v & 255).unwrap());
        round_trip(|v| u16::try_from(v).unwrap());
    }

    #[test]
    fn means_round_half_up_and_do_not_overflow() {
        assert_eq!([u8::mean(5, 2), u8::mean(6, 4), u8::mean(5, 4), u8::mean(9, 1)], [3, 2, 1, 9]);
        assert_eq!([u8::mean(4 * 255, 4), u8::mean(2 * 255, 2)], [255; 2]);
        assert_eq!(u16::mean(4 * 65535, 4), 65535);
    }
}
