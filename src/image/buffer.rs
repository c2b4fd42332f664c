//! [`Image`] and [`ImageView`].

use crate::geom::Size;

/// An owned image of `height × width × channels` samples, row-major, interleaved.
#[derive(Debug, Clone, PartialEq)]
pub struct Image<T> {
    size: Size,
    channels: usize,
    data: Vec<T>,
}

/// A borrowed image of `height × width × channels` samples, row-major, interleaved, rows contiguous.
#[derive(Debug, Clone, Copy)]
pub struct ImageView<'a, T> {
    size: Size,
    channels: usize,
    data: &'a [T],
}

/// An image of 8- or 16-bit samples, as photographs and mosaics have.
#[derive(Debug, Clone, PartialEq)]
pub enum Samples {
    /// Samples 0 to 255.
    U8(Image<u8>),
    /// Samples 0 to 65535.
    U16(Image<u16>),
}

impl<T: Copy> Image<T> {
    /// An image with every sample `value`.
    pub fn filled(size: Size, channels: usize, value: T) -> Self {
        Self { size, channels, data: vec![value; len(size, channels)] }
    }

    /// An image over existing samples.
    ///
    /// # Panics
    /// If the number of samples is not `height × width × channels`.
    pub fn from_data(size: Size, channels: usize, data: Vec<T>) -> Self {
        assert_eq!(data.len(), len(size, channels), "samples must match the size");
        Self { size, channels, data }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Samples a pixel.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// All samples.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All samples, to write.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The samples, without the shape.
    pub fn into_data(self) -> Vec<T> {
        self.data
    }

    /// The samples of pixel `(x, y)`.
    ///
    /// # Panics
    /// If the pixel is outside.
    pub fn pixel(&self, x: usize, y: usize) -> &[T] {
        self.view().pixel(x, y)
    }

    /// The samples of pixel `(x, y)`, to write.
    ///
    /// # Panics
    /// If the pixel is outside.
    pub fn pixel_mut(&mut self, x: usize, y: usize) -> &mut [T] {
        assert!(x < self.size.width as usize, "pixel outside the image");
        let at = (y * self.size.width as usize + x) * self.channels;
        &mut self.data[at..at + self.channels]
    }

    /// The image, borrowed.
    pub fn view(&self) -> ImageView<'_, T> {
        ImageView { size: self.size, channels: self.channels, data: &self.data }
    }
}

impl<'a, T: Copy> ImageView<'a, T> {
    /// A borrowed image over existing samples.
    ///
    /// # Panics
    /// If the number of samples is not `height × width × channels`.
    pub fn new(size: Size, channels: usize, data: &'a [T]) -> Self {
        assert_eq!(data.len(), len(size, channels), "samples must match the size");
        Self { size, channels, data }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Samples a pixel.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// All samples.
    pub fn data(&self) -> &'a [T] {
        self.data
    }

    /// Row `y`: `width × channels` samples.
    ///
    /// # Panics
    /// If the row is outside.
    pub fn row(&self, y: usize) -> &'a [T] {
        let stride = self.size.width as usize * self.channels;
        &self.data[y * stride..(y + 1) * stride]
    }

    /// The samples of pixel `(x, y)`.
    ///
    /// # Panics
    /// If the pixel is outside.
    pub fn pixel(&self, x: usize, y: usize) -> &'a [T] {
        assert!(x < self.size.width as usize, "pixel outside the image");
        let at = (y * self.size.width as usize + x) * self.channels;
        &self.data[at..at + self.channels]
    }
}

impl Samples {
    /// Width and height in pixels.
    pub fn size(&self) -> Size {
        match self {
            Self::U8(i) => i.size(),
            Self::U16(i) => i.size(),
        }
    }

    /// Samples a pixel.
    pub fn channels(&self) -> usize {
        match self {
            Self::U8(i) => i.channels(),
            Self::U16(i) => i.channels(),
        }
    }

    /// Bits a sample: 8 or 16.
    pub fn bits(&self) -> u32 {
        match self {
            Self::U8(_) => 8,
            Self::U16(_) => 16,
        }
    }
}

fn len(size: Size, channels: usize) -> usize {
    size.width as usize * size.height as usize * channels
}
