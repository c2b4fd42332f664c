//! [`OrthoTile`]: the finished pixels of a rectangle of the mosaic.

use std::ops::Range;

use super::Settings;
use crate::geom::{FaceId, PixelRect, Size};
use crate::image::{Colour, Depth, Image, Samples};

/// Colour and layers of a rectangle of the mosaic; every image has the rectangle's size.
#[derive(Debug, Clone, PartialEq)]
pub struct OrthoTile {
    /// The rectangle, in mosaic pixels.
    pub rect: PixelRect,
    /// Colour and alpha, `height × width × (2 | 4)`. Alpha is 0, and the colour that of the settings, where there is
    /// no surface or no photo; else alpha is 255 or 65535.
    pub colour: Samples,
    /// Elevation, metres; NaN where there is no surface.
    pub elevation: Image<f32>,
    /// Face id; [`FaceId::NONE`] where there is no surface.
    pub face: Image<u32>,
    /// Photos that see the pixel, at most 254; [`Self::NO_SURFACE`].
    pub count: Image<u8>,
    /// Photos left after the outlier test, at most 254; [`Self::NO_SURFACE`].
    pub used: Image<u8>,
    /// 0, 1, 2 photos, 3 = more than two; [`Self::NO_SURFACE`].
    pub coverage: Image<u8>,
    /// Index of the heaviest kept photo in the whole camera set; [`Self::NO_PHOTO`].
    pub best: Image<u16>,
}

impl OrthoTile {
    /// Stands in `count`, `used` and `coverage` where there is no surface.
    pub const NO_SURFACE: u8 = u8::MAX;
    /// Stands in `best` where no photo sees the pixel.
    pub const NO_PHOTO: u16 = u16::MAX;
    /// The greatest number of photos that `count` and `used` can tell.
    pub const MAX_COUNT: u8 = 254;

    /// A tile without any surface, in the colour and depth of the settings.
    ///
    /// # Panics
    /// If a side of the rectangle is 2³² or more.
    pub fn new(rect: PixelRect, settings: &Settings) -> Self {
        let side = |n: usize| u32::try_from(n).expect("a tile's side has 32 bits");
        let size = Size::new(side(rect.width()), side(rect.height()));
        Self {
            rect,
            colour: undefined(size, settings),
            elevation: Image::filled(size, 1, f32::NAN),
            face: Image::filled(size, 1, FaceId::NONE.0),
            count: Image::filled(size, 1, Self::NO_SURFACE),
            used: Image::filled(size, 1, Self::NO_SURFACE),
            coverage: Image::filled(size, 1, Self::NO_SURFACE),
            best: Image::filled(size, 1, Self::NO_PHOTO),
        }
    }

    /// Sets the surface in `part` of the tile: `surface(k)` is the elevation, metres, and the face of its pixel `k`,
    /// row-major, or `None`. Until it is blended, a pixel with a surface is one that no photo sees.
    ///
    /// # Panics
    /// If `part` is not inside the tile.
    pub fn set_surface(
        &mut self,
        part: PixelRect,
        surface: impl Fn(usize) -> Option<(f64, FaceId)>,
    ) {
        let width = part.width();
        for row in (0..part.area()).step_by(width.max(1)) {
            let at = self.index(part, row);
            let range = at..at + width;
            let elevations = &mut self.elevation.data_mut()[range.clone()];
            let faces = &mut self.face.data_mut()[range.clone()];
            let counts = &mut self.count.data_mut()[range.clone()];
            let used = &mut self.used.data_mut()[range.clone()];
            let coverage = &mut self.coverage.data_mut()[range];
            for column in 0..width {
                let Some((elevation, face)) = surface(row + column) else { continue };
                #[expect(clippy::cast_possible_truncation, reason = "the layer is f32")]
                let rounded = elevation as f32;
                (elevations[column], faces[column]) = (rounded, face.0);
                (counts[column], used[column], coverage[column]) = (0, 0, 0);
            }
        }
    }

    /// Takes over the pixels `k` of `part`, row-major, for which `is_same` holds from another tile of the same rectangle
    /// and settings: colour and all layers.
    ///
    /// # Panics
    /// If `part` is not inside the tile, or the other tile is another one's.
    pub fn copy_pixels(&mut self, from: &Self, part: PixelRect, is_same: impl Fn(usize) -> bool) {
        assert_eq!(self.rect, from.rect, "tiles of one rectangle");
        let width = part.width();
        for row in (0..part.area()).step_by(width.max(1)) {
            let at = self.index(part, row);
            let mut next = 0;
            while next < width {
                let first = next;
                let same = is_same(row + first);
                while next < width && is_same(row + next) == same {
                    next += 1;
                }
                if same {
                    self.copy_run(from, at + first..at + next);
                }
            }
        }
    }

    /// Takes over pixels that lie side by side.
    fn copy_run(&mut self, from: &Self, run: Range<usize>) {
        fn copy<T: Copy>(to: &mut Image<T>, from: &Image<T>, run: &Range<usize>) {
            let channels = to.channels();
            let run = run.start * channels..run.end * channels;
            to.data_mut()[run.clone()].copy_from_slice(&from.data()[run]);
        }
        match (&mut self.colour, &from.colour) {
            (Samples::U8(to), Samples::U8(from)) => copy(to, from, &run),
            (Samples::U16(to), Samples::U16(from)) => copy(to, from, &run),
            _ => unreachable!("tiles of one depth"),
        }
        copy(&mut self.elevation, &from.elevation, &run);
        copy(&mut self.face, &from.face, &run);
        copy(&mut self.count, &from.count, &run);
        copy(&mut self.used, &from.used, &run);
        copy(&mut self.coverage, &from.coverage, &run);
        copy(&mut self.best, &from.best, &run);
    }

    /// Index in the tile of pixel `k` of `part`, both row-major.
    ///
    /// # Panics
    /// If `part` is not inside the tile.
    pub(super) fn index(&self, part: PixelRect, k: usize) -> usize {
        assert!(self.rect.contains(&part), "{part:?} is not inside the tile {:?}", self.rect);
        let inside = |v: i64| usize::try_from(v).expect("contained");
        let (x, y) = (k % part.width(), k / part.width());
        (inside(part.y0 - self.rect.y0) + y) * self.rect.width()
            + inside(part.x0 - self.rect.x0)
            + x
    }
}

/// An image of the settings' undefined colour, alpha 0.
fn undefined(size: Size, settings: &Settings) -> Samples {
    let colours = settings.colour.channels();
    let pixel: Vec<u16> = settings.undefined[..colours].iter().copied().chain([0]).collect();
    let samples = pixel.iter().copied().cycle();
    let len = usize::try_from(size.area()).expect("a tile fits in memory") * pixel.len();
    match settings.depth {
        Depth::Eight => {
            let narrow = |v: u16| u8::try_from(v).unwrap_or(u8::MAX);
            let data = samples.map(narrow).take(len).collect();
            Samples::U8(Image::from_data(size, pixel.len(), data))
        }
        Depth::Sixteen => {
            Samples::U16(Image::from_data(size, pixel.len(), samples.take(len).collect()))
        }
    }
}

/// The mosaic's colour that a tile's samples are.
pub(super) fn colour_of(samples: &Samples) -> Colour {
    if samples.channels() == 2 { Colour::Grey } else { Colour::Rgb }
}
