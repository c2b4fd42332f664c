//! The binary form: `cameras.bin` and `images.bin`, little-endian.
//!
//! ```text
//! cameras.bin  u64 count, then per camera: u32 id, i32 model, u64 width, u64 height, f64 × parameters of the model
//! images.bin   u64 count, then per photo: u32 id, f64 × 4 quaternion, f64 × 3 translation, u32 camera, name, byte 0,
//!              u64 count of keypoints, then per keypoint: f64 x, f64 y, u64 point id, all bits set without one
//! points3D.bin u64 count, then per point: u64 id, f64 × 3 position, u8 × 3 colour, f64 error,
//!              u64 length of the track, then per element: u32 photo, u32 keypoint
//! ```

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read as _};
use std::path::Path;

use glam::{DVec2, DVec3};

use super::model::{CameraRecord, ImageRecord, Keypoint, MAX_NAME, Model, WantedPoints, limit};
use crate::camera::LensModel;
use crate::input::cameras::Draft;
use crate::{Error, Result};

/// Bytes of a keypoint.
const KEYPOINT: u64 = 24;
/// Bytes of an element of a track.
const TRACK_ELEMENT: u64 = 8;

/// Reads the files.
pub(super) fn read(cameras: &Path, images: &Path, points: Option<&Path>) -> Result<Draft> {
    let mut model = Model::new(cameras, images);
    read_cameras(cameras, &mut model)?;
    read_images(images, &mut model)?;
    let (mut draft, mut wanted) = model.finish()?;
    if let Some(points) = points.filter(|_| !wanted.is_empty()) {
        read_points(points, &mut wanted)?;
    }
    draft.ties = wanted.into_ties();
    Ok(draft)
}

fn read_cameras(path: &Path, model: &mut Model) -> Result<()> {
    let mut file = Reader::open(path)?;
    let count = file.u64("the number of cameras")?;
    limit(path, "cameras", count)?;
    for _ in 0..count {
        let place = file.place();
        let id = file.u32("a camera id")?;
        let model_place = file.place();
        let number = file.i32("a camera model")?;
        // The number of parameters depends on the model: without it the rest of the file has no meaning.
        let Some(lens_model) = LensModel::from_id(number) else {
            let found = format!("{number} for camera {id}");
            return Err(Error::corrupt(path, model_place, "a camera model id of 0 to 17", found));
        };
        let size = [file.u64("a width")?, file.u64("a height")?];
        let mut params = [0.0; LensModel::MAX_PARAMS];
        let params = &mut params[..lens_model.param_count()];
        for param in params.iter_mut() {
            *param = file.f64("a camera parameter")?;
        }
        model.add_camera(&place, &CameraRecord { id, model: lens_model, size, params })?;
    }
    file.expect_end()
}

fn read_images(path: &Path, model: &mut Model) -> Result<()> {
    let mut file = Reader::open(path)?;
    let count = file.u64("the number of photos")?;
    limit(path, "photos", count)?;
    let mut name = Vec::new();
    for _ in 0..count {
        let place = file.place();
        file.u32("a photo id")?;
        let mut pose = [0.0; 7];
        for value in &mut pose {
            *value = file.f64("a pose")?;
        }
        let [qw, qx, qy, qz, tx, ty, tz] = pose;
        let camera = file.u32("a camera id")?;
        let name_place = file.place();
        file.name(&mut name)?;
        let name = std::str::from_utf8(&name).map_err(|e| {
            let found = format!("other bytes after {} of them", e.valid_up_to());
            Error::corrupt(path, name_place, "a photo name in UTF-8", found)
        })?;
        let record =
            ImageRecord { quaternion: [qw, qx, qy, qz], translation: [tx, ty, tz], camera, name };
        model.add_image(place, &record)?;
        let keypoints = file.u64("the number of keypoints")?;
        file.expect_room(keypoints, KEYPOINT, "keypoints")?;
        for _ in 0..keypoints {
            let [x, y, point] = [0; 3].map(|_: u8| file.bytes::<8>("a keypoint"));
            let (x, y, point) = (x?, y?, u64::from_le_bytes(point?));
            if point != u64::MAX {
                model.add_keypoint(|| Keypoint {
                    position_px: DVec2::new(f64::from_le_bytes(x), f64::from_le_bytes(y)),
                    point,
                });
            }
        }
    }
    file.expect_end()
}

fn read_points(path: &Path, wanted: &mut WantedPoints) -> Result<()> {
    let mut file = Reader::open(path)?;
    let count = file.u64("the number of points")?;
    for _ in 0..count {
        let id = file.u64("a point id")?;
        let mut position = [0.0; 3];
        for value in &mut position {
            *value = file.f64("a position")?;
        }
        wanted.add(id, DVec3::from(position));
        file.bytes::<11>("colour and error of a point")?;
        let track = file.u64("the length of a track")?;
        file.skip(track, TRACK_ELEMENT, "elements of a track")?;
    }
    file.expect_end()
}

/// A file read from front to end that knows its place.
struct Reader<'a> {
    path: &'a Path,
    inner: BufReader<File>,
    offset: u64,
    len: u64,
}

impl<'a> Reader<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let len = file.metadata().map_err(|e| Error::io(path, e))?.len();
        Ok(Self { path, inner: BufReader::with_capacity(1 << 16, file), offset: 0, len })
    }

    fn place(&self) -> String {
        format!("byte {}", self.offset)
    }

    fn corrupt(&self, expected: &str, found: impl Into<String>) -> Error {
        Error::corrupt(self.path, self.place(), expected, found)
    }

    fn bytes<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        match self.inner.read_exact(&mut bytes) {
            Ok(()) => {
                self.offset += N as u64;
                Ok(bytes)
            }
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => {
                Err(self.corrupt(what, "the end of the file"))
            }
            Err(e) => Err(Error::io(self.path, e)),
        }
    }

    fn u32(&mut self, what: &str) -> Result<u32> {
        self.bytes(what).map(u32::from_le_bytes)
    }

    fn i32(&mut self, what: &str) -> Result<i32> {
        self.bytes(what).map(i32::from_le_bytes)
    }

    fn u64(&mut self, what: &str) -> Result<u64> {
        self.bytes(what).map(u64::from_le_bytes)
    }

    fn f64(&mut self, what: &str) -> Result<f64> {
        self.bytes(what).map(f64::from_le_bytes)
    }

    /// A name that ends with a byte 0, without it.
    fn name(&mut self, name: &mut Vec<u8>) -> Result<()> {
        name.clear();
        loop {
            match self.bytes("the rest of a photo name")? {
                [0] => return Ok(()),
                [byte] => name.push(byte),
            }
            if name.len() > MAX_NAME {
                return Err(self.corrupt("a photo name of at most 4096 bytes", "a longer one"));
            }
        }
    }

    /// The bytes of `count` items of `size` bytes, all of which the file must hold.
    fn expect_room(&self, count: u64, size: u64, what: &str) -> Result<(u64, i64)> {
        let left = self.len.saturating_sub(self.offset);
        let bytes = count.checked_mul(size).filter(|&bytes| bytes <= left);
        bytes.and_then(|b| Some((b, i64::try_from(b).ok()?))).ok_or_else(|| {
            let found = format!("{left} bytes to the end of the file");
            self.corrupt(&format!("{count} {what} of {size} bytes"), found)
        })
    }

    /// Passes over `count` items of `size` bytes.
    fn skip(&mut self, count: u64, size: u64, what: &str) -> Result<()> {
        let (bytes, step) = self.expect_room(count, size, what)?;
        self.inner.seek_relative(step).map_err(|e| Error::io(self.path, e))?;
        self.offset += bytes;
        Ok(())
    }

    fn expect_end(&self) -> Result<()> {
        if self.offset == self.len {
            return Ok(());
        }
        let found = format!("{} bytes more", self.len.saturating_sub(self.offset));
        Err(self.corrupt("the end of the file", found))
    }
}
