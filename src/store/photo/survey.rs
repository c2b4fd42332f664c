//! What is known of photos before any is decoded.

use std::path::{Path, PathBuf};

use xxhash_rust::xxh3::xxh3_128;

use super::build::{Content, PhotoFingerprint, PhotoTiles};
use super::format::Shape;
use super::parallel::{Budget, in_parallel};
use super::prepared::{Demand, PreparedPhoto};
use crate::geom::Size;
use crate::input::photo::{PhotoHeader, read_mask_header, read_photo_header};
use crate::{Error, Result};

/// A photo to prepare.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PhotoSource {
    /// Its name in the job, unique.
    pub name: String,
    /// The file.
    pub path: PathBuf,
    /// The size that its camera expects, if it is known.
    pub expected: Option<Size>,
    /// What is needed of it; `None`: nothing. Then its header alone is read.
    pub demand: Option<Demand>,
}

/// A photo that has to be left out of the job.
#[derive(Debug)]
pub struct LeftOut {
    /// Why: the message names the file.
    pub reason: Error,
    /// Expected and found size, if only the size is wrong: when all differ by one factor, the photos were resized.
    pub sizes: Option<(Size, Size)>,
}

/// Reads the header of every photo, in parallel: in the order of `sources`, or why a photo has to be left out: it is
/// missing, unreadable, unsupported or of another size than expected.
///
/// # Errors
/// [`Error::Io`] for a photo that is there but cannot be read.
pub fn check_headers(
    sources: &[PhotoSource],
    threads: usize,
) -> Result<Vec<std::result::Result<PhotoHeader, LeftOut>>> {
    in_parallel(sources.len(), threads, &Budget::unlimited(), |i| {
        checked_header(Content::Photo, &sources[i])
    })
}

/// What is known of a photo.
pub(super) enum Survey {
    /// It is left out, or not needed.
    Known(std::result::Result<PreparedPhoto, LeftOut>),
    /// It is to be read.
    Needed(Needed),
}

/// A photo to be read, its header checked.
pub(super) struct Needed {
    pub(super) header: PhotoHeader,
    pub(super) shape: Shape,
    pub(super) demand: Demand,
    pub(super) fingerprint: PhotoFingerprint,
    /// Where its store file and its index belong.
    pub(super) store: PathBuf,
    pub(super) index: PathBuf,
    /// The store file that is there and matches.
    pub(super) existing: Option<PhotoTiles>,
}

/// The header of a picture, if it is there and of the size that is expected.
fn checked_header(
    content: Content,
    source: &PhotoSource,
) -> Result<std::result::Result<PhotoHeader, LeftOut>> {
    let header = match content {
        Content::Photo => read_photo_header(&source.path),
        Content::Mask => read_mask_header(&source.path),
    };
    let header = left_out_or_fatal(header, &source.path)?;
    Ok(header.and_then(|header| match source.expected {
        Some(expected) if expected != header.size => {
            let pixels = |size: Size| format!("{} × {} pixels", size.width, size.height);
            let text = format!("{}, as its camera says", pixels(expected));
            let reason = Error::corrupt(&source.path, "size", text, pixels(header.size));
            Err(LeftOut { reason, sizes: Some((expected, header.size)) })
        }
        _ => Ok(header),
    }))
}

/// Looks at a photo's header and, if it is needed, for its store file in `folder`.
///
/// # Errors
/// A failure that ends the preparation.
pub(super) fn survey(content: Content, source: &PhotoSource, folder: &Path) -> Result<Survey> {
    let header = match checked_header(content, source)? {
        Ok(header) => header,
        Err(left_out) => return Ok(Survey::Known(Err(left_out))),
    };
    let shape = content.shape(&header);
    let Some(demand) = source.demand else {
        return Ok(Survey::Known(Ok(PreparedPhoto::unread(&source.path, shape))));
    };
    let fingerprint = PhotoFingerprint::of(&source.name, &source.path);
    let fingerprint = match left_out_or_fatal(fingerprint, &source.path)? {
        Ok(fingerprint) => fingerprint,
        Err(left_out) => return Ok(Survey::Known(Err(left_out))),
    };
    let stem = store_stem(&source.name);
    let store = folder.join(format!("{stem}.tiles"));
    let index = folder.join(format!("{stem}.index"));
    // Not there, stale, cut or foreign: a new one takes its place.
    let existing =
        PhotoTiles::open_checked(&store).ok().filter(|tiles| tiles.fingerprint() == fingerprint);
    Ok(Survey::Needed(Needed { header, shape, demand, fingerprint, store, index, existing }))
}

/// How a photo's store files are named: names may hold folders and any character.
fn store_stem(name: &str) -> String {
    format!("{:032x}", xxh3_128(name.as_bytes()))
}

/// Tells a photo that is to be left out from a failure that ends the preparation: of a disk, or of the store.
pub(super) fn left_out_or_fatal<T>(
    result: Result<T>,
    photo: &Path,
) -> Result<std::result::Result<T, LeftOut>> {
    use std::io::ErrorKind::{IsADirectory, NotADirectory, NotFound, PermissionDenied};
    match result {
        Ok(value) => Ok(Ok(value)),
        Err(Error::Io { path, source })
            if path != photo
                || !matches!(
                    source.kind(),
                    IsADirectory | NotADirectory | NotFound | PermissionDenied
                ) =>
        {
            Err(Error::Io { path, source })
        }
        Err(reason) => Ok(Err(LeftOut { reason, sizes: None })),
    }
}
