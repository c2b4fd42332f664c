//! One tile of one layer: raster to compressed bytes and back.

use super::codec::{Scratch, TileDamage};
use super::predictor::Predictor;
use super::{Compression, Layer, Meaning, Raster};
use crate::geom::Size;

/// The predictor of a layer's tiles: none when they are not compressed, and none for palette indices, whose
/// differences mean nothing.
pub(super) fn predictor(layer: &Layer, compression: Compression) -> Predictor {
    if compression == Compression::None || layer.meaning() == Meaning::Coverage {
        Predictor::None
    } else if layer.sample().is_float() {
        Predictor::FloatingPoint
    } else {
        Predictor::Horizontal
    }
}

/// The compressed bytes of a tile: a pure function of the layer, the pixels, the tile size and the compression.
///
/// `raster` is at most `tile_size` wide and high; what it lacks to the right and below (a tile that hangs over the
/// mosaic's edge) is filled with nodata, or with zeros for the mosaic.
///
/// # Panics
/// If the raster is greater than a tile, or its samples are not the layer's.
pub fn encode_tile(
    layer: &Layer,
    raster: &Raster,
    tile_size: u32,
    compression: Compression,
    scratch: &mut Scratch,
) -> Vec<u8> {
    let size = raster.size();
    assert!(layer.fits(raster), "the raster has the layer's samples");
    assert!(size.width <= tile_size && size.height <= tile_size, "the raster fits in the tile");
    let row_bytes = tile_size as usize * layer.pixel_bytes();
    let predictor = predictor(layer, compression);
    let padding = layer.padding();
    // Rows as they stand, each filled up to the tile's width …
    scratch.bytes.clear();
    for y in 0..tile_size as usize {
        if y < size.height as usize {
            raster.append_row(y, &mut scratch.bytes);
        }
        let missing = (y + 1) * row_bytes - scratch.bytes.len();
        scratch.bytes.extend(padding.iter().cycle().take(missing));
    }
    // … predicted, and packed.
    for row in scratch.bytes.chunks_exact_mut(row_bytes) {
        predictor.apply(row, layer.sample(), layer.channels(), &mut scratch.row);
    }
    compression.compress(scratch)
}

/// The upper-left `size` pixels of the tile that [`encode_tile`] made `bytes` from.
///
/// # Errors
/// If the bytes are no such tile.
///
/// # Panics
/// If `size` is greater than a tile.
pub fn decode_tile(
    layer: &Layer,
    bytes: &[u8],
    size: Size,
    tile_size: u32,
    compression: Compression,
    scratch: &mut Scratch,
) -> Result<Raster, TileDamage> {
    assert!(size.width <= tile_size && size.height <= tile_size, "a part of the tile is asked for");
    let row_bytes = tile_size as usize * layer.pixel_bytes();
    let mut rows = compression.decompress(bytes, row_bytes * tile_size as usize)?;
    let predictor = predictor(layer, compression);
    let kept = size.width as usize * layer.pixel_bytes();
    scratch.bytes.clear();
    for row in rows.chunks_exact_mut(row_bytes).take(size.height as usize) {
        predictor.undo(row, layer.sample(), layer.channels(), &mut scratch.row);
        scratch.bytes.extend_from_slice(&row[..kept]);
    }
    Ok(Raster::from_le_bytes(layer.sample(), size, layer.channels(), &scratch.bytes))
}

#[cfg(test)]
mod tests {
    use super::super::test_pixels::{all_layers, noise};
    use super::*;

    const ALL: [Compression; 4] =
        [Compression::Deflate, Compression::Zstd, Compression::Lzw, Compression::None];

    #[test]
    fn every_layer_survives_every_compression() {
        let mut scratch = Scratch::default();
        for layer in all_layers() {
            for compression in ALL {
                for (w, h) in [(32, 32), (1, 1), (31, 7)] {
                    let raster = noise(&layer, Size::new(w, h), 5);
                    let bytes = encode_tile(&layer, &raster, 32, compression, &mut scratch);
                    let back =
                        decode_tile(&layer, &bytes, raster.size(), 32, compression, &mut scratch)
                            .unwrap();
                    // Bytes, not values: NaN differs from itself.
                    assert_eq!(
                        encode_tile(&layer, &back, 32, compression, &mut scratch),
                        bytes,
                        "{layer:?} {compression:?}"
                    );
                    assert_eq!(format!("{back:?}"), format!("{raster:?}"));
                }
            }
        }
    }

    #[test]
    fn beyond_the_edge_stands_nodata_and_for_the_mosaic_zero() {
        let mut scratch = Scratch::default();
        for layer in all_layers() {
            let raster = noise(&layer, Size::new(3, 2), 9);
            let bytes = encode_tile(&layer, &raster, 16, Compression::None, &mut scratch);
            let pixel = layer.pixel_bytes();
            assert_eq!(bytes.len(), 256 * pixel);
            assert_eq!(bytes[3 * pixel..4 * pixel], layer.padding()[..], "{layer:?}");
            assert_eq!(bytes[255 * pixel..], layer.padding()[..], "{layer:?}");
        }
    }

    #[test]
    fn all_nan_are_stored_as_one() {
        let layer = Layer::of(Meaning::Elevation).unwrap();
        let size = Size::new(1, 1);
        let of =
            |bits| Raster::F32(crate::image::Image::from_data(size, 1, vec![f32::from_bits(bits)]));
        let mut scratch = Scratch::default();
        let mut bytes = |r: &Raster| encode_tile(&layer, r, 16, Compression::Deflate, &mut scratch);
        assert_eq!(bytes(&of(0xffc0_1234)), bytes(&of(0x7fc0_0000)));
    }
}
