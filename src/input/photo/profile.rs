//! [`read_profile`]: the ICC colour profile that a photo's file carries.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use flate2::bufread::ZlibDecoder;

use super::jpeg::Segments;
use super::tiff::{Directory, tag};
use super::{PhotoFormat, PhotoHeader};
use crate::{Error, Result};

/// Most bytes of a profile: 4 MiB; those of cameras have some kilobytes, those of printers a megabyte.
pub const MAX_PROFILE_BYTES: u64 = 4 << 20;
/// Most chunks or segments looked through before the pixels; a photo has some tens.
const MAX_SEGMENTS: usize = 4096;
/// What an APP2 segment with a part of a profile begins with (ICC.1:2022, annex B.4).
const APP2_NAME: &[u8] = b"ICC_PROFILE\0";
/// Bytes of a profile's header.
const HEADER_BYTES: usize = 128;

/// The profile of a photo.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Profile {
    /// There is none.
    Missing,
    /// Its bytes, at most [`MAX_PROFILE_BYTES`]; length and signature fit.
    Found(Vec<u8>),
    /// There is one that cannot be used, and why: it plays no part in the pixels, so that the photo is used.
    Ignored(String),
}

/// Channels of the device that a profile describes: 1 for grey, 3 for RGB; `None` for anything else.
pub fn profile_channels(profile: &[u8]) -> Option<usize> {
    match profile.get(16..20)? {
        b"GRAY" => Some(1),
        b"RGB " => Some(3),
        _ => None,
    }
}

/// Reads the profile of the photo at `path`: from the APP2 segments of a JPEG, the `iCCP` chunk of a PNG, or tag 34675
/// of a TIFF. `header` is the file's own, from [`super::read_photo_header`].
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Corrupt`] if its structure is broken before the profile.
pub fn read_profile(path: &Path, header: &PhotoHeader) -> Result<Profile> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let mut reader = BufReader::new(file);
    match header.format {
        PhotoFormat::Jpeg { .. } => of_jpeg(&mut reader, path),
        PhotoFormat::Png { .. } => of_png(&mut reader).map_err(|e| Error::io(path, e)),
        PhotoFormat::Tiff { .. } => {
            let mut directory = Directory::read(reader, path, header.file_bytes)?;
            match directory.byte_count(tag::ICC_PROFILE) {
                None => Ok(Profile::Missing),
                Some(bytes) if bytes > MAX_PROFILE_BYTES => Ok(too_long(bytes)),
                Some(_) => match directory.bytes(tag::ICC_PROFILE, MAX_PROFILE_BYTES) {
                    Ok(profile) => Ok(checked(profile.unwrap_or_default())),
                    Err(Error::Io { path, source }) => Err(Error::Io { path, source }),
                    Err(e) => Ok(Profile::Ignored(e.to_string())),
                },
            }
        }
    }
}

/// The parts of the APP2 segments, in the order of their numbers.
fn of_jpeg<R: BufRead + Seek>(reader: &mut R, path: &Path) -> Result<Profile> {
    let mut segments = Segments::after_start(reader, path)?;
    let mut parts: BTreeMap<u8, Vec<u8>> = BTreeMap::new();
    let (mut total, mut stated) = (0, None);
    for _ in 0..MAX_SEGMENTS {
        match segments.marker()? {
            0xE2 => {
                let payload = segments.payload()?;
                let Some([number, count, part @ ..]) = payload.strip_prefix(APP2_NAME) else {
                    continue;
                };
                total += part.len() as u64;
                if total > MAX_PROFILE_BYTES {
                    return Ok(too_long(total));
                }
                if *stated.get_or_insert(*count) != *count
                    || parts.insert(*number, part.to_vec()).is_some()
                {
                    return Ok(Profile::Ignored("its parts contradict each other".into()));
                }
            }
            0xDA | 0xD9 => break,
            _ => segments.skip()?,
        }
    }
    let Some(count) = stated else { return Ok(Profile::Missing) };
    if !parts.keys().copied().eq(1..=count) {
        let found = parts.len();
        return Ok(Profile::Ignored(format!("{found} of its {count} parts are there")));
    }
    Ok(checked(parts.into_values().flatten().collect()))
}

/// The `iCCP` chunk: a name, a zero, the compression method (0), the profile as a zlib stream.
fn of_png<R: BufRead + Seek>(reader: &mut R) -> std::io::Result<Profile> {
    reader.seek(SeekFrom::Start(8))?;
    for _ in 0..MAX_SEGMENTS {
        let mut head = [0; 8];
        reader.read_exact(&mut head)?;
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]);
        match &head[4..] {
            b"IDAT" | b"IEND" => break,
            b"iCCP" if u64::from(length) > 2 * MAX_PROFILE_BYTES => {
                return Ok(too_long(length.into()));
            }
            b"iCCP" => {
                let mut chunk = Vec::new();
                reader.by_ref().take(u64::from(length) + 4).read_to_end(&mut chunk)?;
                return Ok(of_chunk(&chunk));
            }
            // Chunk and checksum.
            _ => reader.seek_relative(i64::from(length) + 4)?,
        }
    }
    Ok(Profile::Missing)
}

/// The profile in the data and checksum of an `iCCP` chunk.
fn of_chunk(chunk: &[u8]) -> Profile {
    let broken = |what: &str| Profile::Ignored(format!("its PNG chunk is broken: {what}"));
    let Some((data, crc)) = chunk.split_last_chunk::<4>() else { return broken("it is cut") };
    let mut hash = crc32fast::Hasher::new();
    hash.update(b"iCCP");
    hash.update(data);
    if hash.finalize() != u32::from_be_bytes(*crc) {
        return broken("its checksum is another one");
    }
    let zero = data.iter().take(80).position(|&b| b == 0);
    let Some([0, packed @ ..]) = zero.map(|at| &data[at + 1..]) else {
        return broken("it is compressed in an unknown way");
    };
    let mut profile = Vec::new();
    let inflated = ZlibDecoder::new(packed).take(MAX_PROFILE_BYTES + 1).read_to_end(&mut profile);
    match inflated {
        Err(e) => broken(&e.to_string()),
        Ok(_) if profile.len() as u64 > MAX_PROFILE_BYTES => too_long(profile.len() as u64),
        Ok(_) => checked(profile),
    }
}

/// A profile, if it may be one: the header is there and states no more bytes than there are.
fn checked(profile: Vec<u8>) -> Profile {
    let word = |at: usize| profile.get(at..at + 4).and_then(|b| b.try_into().ok());
    let stated = word(0).map_or(0, u32::from_be_bytes);
    if profile.len() < HEADER_BYTES || word(36) != Some(*b"acsp") {
        Profile::Ignored("it is no ICC profile".into())
    } else if u64::from(stated) > profile.len() as u64 {
        Profile::Ignored(format!("it is cut: {} of {stated} bytes are there", profile.len()))
    } else {
        Profile::Found(profile)
    }
}

fn too_long(bytes: u64) -> Profile {
    Profile::Ignored(format!("it has {bytes} bytes or more, and the limit is {MAX_PROFILE_BYTES}"))
}

#[cfg(test)]
mod tests {
    use super::super::read_photo_header;
    use super::*;

    /// A profile that tells itself from others by `mark`.
    fn profile(length: usize, mark: u8) -> Vec<u8> {
        let mut profile = vec![mark; length];
        profile[..4].copy_from_slice(&u32::try_from(length).unwrap().to_be_bytes());
        profile[16..20].copy_from_slice(b"RGB ");
        profile[36..40].copy_from_slice(b"acsp");
        profile
    }

    fn read(name: &str, bytes: &[u8]) -> Profile {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read_profile(&path, &read_photo_header(&path).unwrap()).unwrap()
    }

    fn asset(name: &str) -> Vec<u8> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/photo");
        std::fs::read(folder.join(name)).unwrap()
    }

    /// A JPEG with APP2 segments of a profile: number, count, part.
    fn jpeg(parts: &[(u8, u8, &[u8])]) -> Vec<u8> {
        let plain = asset("grey.jpg");
        let mut bytes = plain[..2].to_vec();
        for (number, count, part) in parts {
            bytes.extend([0xFF, 0xE2]);
            bytes.extend(u16::try_from(part.len() + 16).unwrap().to_be_bytes());
            bytes.extend([APP2_NAME, &[*number, *count], part].concat());
        }
        bytes.extend(&plain[2..]);
        bytes
    }

    fn png(chunk: &[u8]) -> Vec<u8> {
        let plain = asset("plain.png");
        let mut own = b"iCCP".to_vec();
        own.extend(chunk);
        let length = u32::try_from(chunk.len()).unwrap().to_be_bytes();
        let crc = crc32fast::hash(&own).to_be_bytes();
        [&plain[..33], &length, &own, &crc, &plain[33..]].concat()
    }

    fn packed(profile: &[u8]) -> Vec<u8> {
        let level = flate2::Compression::default();
        let mut encoder = flate2::write::ZlibEncoder::new(b"name\0\0".to_vec(), level);
        std::io::Write::write_all(&mut encoder, profile).unwrap();
        encoder.finish().unwrap()
    }

    fn ignored(profile: &Profile, words: &str) {
        assert!(matches!(profile, Profile::Ignored(why) if why.contains(words)), "{profile:?}");
    }

    #[test]
    fn a_jpeg_s_profile_is_put_together_in_the_order_of_its_parts() {
        let whole = profile(100_000, 7);
        let (a, b) = whole.split_at(60_000);
        assert_eq!(read("a.jpg", &jpeg(&[(2, 2, b), (1, 2, a)])), Profile::Found(whole.clone()));
        assert_eq!(read("a.jpg", &jpeg(&[])), Profile::Missing);
        ignored(&read("a.jpg", &jpeg(&[(1, 2, a)])), "1 of its 2 parts");
        ignored(&read("a.jpg", &jpeg(&[(1, 2, a), (1, 2, b)])), "contradict");
        ignored(&read("a.jpg", &jpeg(&[(1, 2, a), (2, 3, b)])), "contradict");
        ignored(&read("a.jpg", &jpeg(&[(1, 1, a)])), "60000 of 100000 bytes");
        ignored(&read("a.jpg", &jpeg(&[(1, 1, b"else")])), "no ICC profile");
        let long: Vec<_> = (1..=70).map(|k| (k, 70, &whole[..65_000])).collect();
        ignored(&read("a.jpg", &jpeg(&long)), "the limit is 4194304");
    }

    #[test]
    fn a_png_s_profile_is_inflated_up_to_a_limit() {
        let whole = profile(3000, 9);
        assert_eq!(read("a.png", &png(&packed(&whole))), Profile::Found(whole.clone()));
        assert_eq!(read("a.png", &asset("plain.png")), Profile::Missing);
        ignored(&read("a.png", &png(&packed(&profile(5 << 20, 0)))), "the limit is 4194304");
        ignored(&read("a.png", &png(b"name\0\x01abc")), "unknown way");
        ignored(&read("a.png", &png(b"name\0\0abc")), "broken");
        let mut damaged = png(&packed(&whole));
        damaged[60] ^= 1;
        ignored(&read("a.png", &damaged), "checksum");
        assert_eq!((profile_channels(&whole), profile_channels(b"")), (Some(3), None));
    }
}
