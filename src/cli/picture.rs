//! Reads a whole TIFF file of moderate size back, with a decoder that is not our own.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use tiff::TiffError;
use tiff::decoder::{Decoder, DecodingResult};

use crate::geom::Size;
use crate::{Error, Result};

/// The full resolution of a TIFF file: `height × width × channels`, row-major.
#[derive(Debug)]
pub(super) struct Picture {
    pub(super) size: Size,
    pub(super) channels: usize,
    pub(super) samples: DecodingResult,
}

impl Picture {
    /// Reads the first directory of the file at `path`.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Corrupt`].
    pub(super) fn read(path: &Path) -> Result<Self> {
        Self::read_at_most(path, u64::MAX)
    }

    /// The same, if it has no more pixels than `most`.
    ///
    /// # Errors
    /// The same, and [`Error::Limit`].
    pub(super) fn read_at_most(path: &Path, most: u64) -> Result<Self> {
        let fault = |error: TiffError| match error {
            TiffError::IoError(source) => Error::io(path, source),
            other => Error::corrupt(path, "first directory", "a TIFF file", other.to_string()),
        };
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let mut decoder = Decoder::new(BufReader::new(file)).map_err(fault)?;
        let (width, height) = decoder.dimensions().map_err(fault)?;
        let (limit, found) = (most, u64::from(width) * u64::from(height));
        if found > limit {
            return Err(Error::Limit { what: format!("{}: pixels", path.display()), limit, found });
        }
        let channels = decoder.colortype().map_err(fault)?.num_samples().into();
        let samples = decoder.read_image().map_err(fault)?;
        Ok(Self { size: Size::new(width, height), channels, samples })
    }
}
