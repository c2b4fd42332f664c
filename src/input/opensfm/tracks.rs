//! [`read`]: `tracks.csv`, which photo saw which point where.
//!
//! After a line with the version, a line is: photo, track, feature, x, y and more, parted by tabs.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read as _};
use std::path::Path;

use glam::{DVec2, DVec3};

use crate::geom::Size;
use crate::input::cameras::{MOST_TIES, Thinned, Tie};
use crate::{Error, Result};

/// The longest line, bytes: a name, and numbers.
const MAX_LINE: usize = 1 << 13;

/// The tie points of the photos in `photos` (number and size by name) and of `points` (sorted by id); none without a
/// file at `path`.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Corrupt`] with the line for anything that is no track.
pub(super) fn read(
    path: &Path,
    photos: &BTreeMap<String, (usize, Size)>,
    points: &[(String, DVec3)],
) -> Result<Vec<Tie>> {
    let file = match File::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(e) => return Err(Error::io(path, e)),
    };
    let mut file = BufReader::with_capacity(1 << 16, file);
    let (mut line, mut number) = (Vec::new(), 0_u64);
    let mut ties = Thinned::new(MOST_TIES);
    loop {
        line.clear();
        number += 1;
        let read = file.by_ref().take(MAX_LINE as u64).read_until(b'\n', &mut line);
        if read.map_err(|e| Error::io(path, e))? == 0 {
            return Ok(ties.into_items());
        }
        if number == 1 && line.starts_with(b"OPENSFM_TRACKS_VERSION") {
            continue;
        }
        let track = str::from_utf8(&line).ok().filter(|_| line.len() < MAX_LINE);
        let Some(Track { photo, id, position }) = track.and_then(Track::of) else {
            let found = "something else";
            return Err(Error::corrupt(path, format!("line {number}"), "a track", found));
        };
        let point = points.binary_search_by(|point| point.0.as_str().cmp(id)).ok();
        if let (Some(&(photo, size)), Some(point)) = (photos.get(photo), point) {
            let size = DVec2::new(f64::from(size.width), f64::from(size.height));
            let position_px = position * size.max_element() + 0.5 * size;
            ties.offer(|| Tie { photo, position_px, point_ground: points[point].1 });
        }
    }
}

/// A line of the file.
struct Track<'a> {
    photo: &'a str,
    id: &'a str,
    position: DVec2,
}

impl<'a> Track<'a> {
    fn of(line: &'a str) -> Option<Self> {
        let mut words = line.trim_end_matches(['\n', '\r']).split('\t');
        let (photo, id) = (words.next()?, words.next()?);
        words.next()?;
        let position = DVec2::new(words.next()?.parse().ok()?, words.next()?.parse().ok()?);
        Some(Self { photo, id, position })
    }
}
