//! Marker segments of a JPEG file (ITU-T T.81): its header, and whether all of it is there.

use std::io::{BufRead, ErrorKind, Seek};
use std::path::Path;

use super::{PhotoFormat, PhotoHeader};
use crate::geom::Size;
use crate::{Error, Result};

/// First bytes of every JPEG file: start of image, then a marker.
pub(super) const SIGNATURE: &[u8] = b"\xFF\xD8\xFF";
/// Most marker segments before the first scan; a photo has some tens (an ICC profile or a preview takes several).
const MAX_SEGMENTS: u64 = 4096;

/// How a JPEG's scans are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JpegCoding {
    /// Sequential, all components in one scan: decoded without keeping coefficients.
    Sequential,
    /// Sequential, one scan after the other for its components: the decoder keeps the whole picture's samples.
    SequentialScans,
    /// Progressive: the decoder keeps the whole picture's coefficients.
    Progressive,
}

/// The frame header (SOF): size and components.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Frame {
    size: Size,
    is_progressive: bool,
    components: Vec<Component>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Component {
    id: u8,
    horizontal: u8,
    vertical: u8,
}

impl Frame {
    fn max_horizontal(&self) -> u8 {
        self.components.iter().map(|c| c.horizontal).max().unwrap_or(1)
    }

    fn max_vertical(&self) -> u8 {
        self.components.iter().map(|c| c.vertical).max().unwrap_or(1)
    }

    /// Minimum coded units of a scan that holds every component.
    fn mcus(&self) -> u64 {
        let across = self.size.width.div_ceil(8 * u32::from(self.max_horizontal()));
        let down = self.size.height.div_ceil(8 * u32::from(self.max_vertical()));
        u64::from(across) * u64::from(down)
    }

    /// Blocks of 8 × 8 samples of all components in such a unit.
    fn blocks_in_mcu(&self) -> u64 {
        self.components.iter().map(|c| u64::from(c.horizontal) * u64::from(c.vertical)).sum()
    }

    fn quarter_coefficients(&self) -> u64 {
        let whole = u64::from(self.max_horizontal()) * u64::from(self.max_vertical());
        (4 * self.blocks_in_mcu()).div_ceil(whole)
    }
}

/// Reads the segments up to the first scan from the start of `reader`.
pub(super) fn read_header<R: BufRead + Seek>(
    reader: &mut R,
    path: &Path,
    file_bytes: u64,
) -> Result<PhotoHeader> {
    let mut segments = Segments::after_start(reader, path)?;
    let mut frame = None;
    let mut adobe_transform = None;
    for _ in 0..MAX_SEGMENTS {
        let at = segments.at;
        let marker = segments.marker()?;
        match marker {
            0xC0..=0xC2 => {
                if frame.is_some() {
                    return Err(corrupt(path, at, "one frame header", "a second one"));
                }
                frame = Some(parse_frame(path, at, marker, &segments.payload()?)?);
            }
            0xC3 | 0xC5..=0xC7 | 0xC9..=0xCC | 0xCD..=0xCF => {
                return Err(Error::unsupported(path, process_name(marker)));
            }
            0xEE => adobe_transform = parse_adobe(&segments.payload()?).or(adobe_transform),
            0xDA => {
                let frame = frame
                    .ok_or_else(|| corrupt(path, at, "a frame header first", "a scan header"))?;
                let in_scan = parse_scan(path, at, &segments.payload()?, &frame)?.len();
                return finish_header(path, &frame, in_scan, adobe_transform, file_bytes);
            }
            0x00..=0xBF | 0xC8 | 0xD0..=0xD9 => {
                let found = format!("marker FF{marker:02X}");
                return Err(corrupt(path, at, "a marker segment before the first scan", found));
            }
            _ => segments.skip()?,
        }
    }
    let what = format!("{}: marker segments before the first scan", path.display());
    Err(Error::Limit { what, limit: MAX_SEGMENTS, found: MAX_SEGMENTS + 1 })
}

fn finish_header(
    path: &Path,
    frame: &Frame,
    in_scan: usize,
    adobe_transform: Option<u8>,
    file_bytes: u64,
) -> Result<PhotoHeader> {
    let is_rgb = frame.components.iter().map(|c| c.id).eq(*b"RGB");
    if frame.components.len() == 3 && adobe_transform == Some(0) && !is_rgb {
        return Err(Error::unsupported(path, "an RGB JPEG (Adobe transform 0)"));
    }
    let coding = if frame.is_progressive {
        JpegCoding::Progressive
    } else if in_scan == frame.components.len() {
        JpegCoding::Sequential
    } else {
        JpegCoding::SequentialScans
    };
    if coding == JpegCoding::SequentialScans && frame.max_vertical() > 1 {
        // zune-jpeg 0.5.15 decodes these without an error, but wrongly.
        return Err(Error::Unsupported {
            path: path.to_path_buf(),
            what: "a sequential JPEG in several scans with vertical subsampling".to_string(),
            hint: Some("save it again as an ordinary JPEG".to_string()),
        });
    }
    // A block takes at least one bit.
    let blocks = frame.mcus() * frame.blocks_in_mcu();
    if file_bytes < blocks / 8 {
        let expected = format!("at least {} bytes for {} blocks", blocks / 8, blocks);
        return Err(Error::corrupt(path, "length", expected, file_bytes.to_string()));
    }
    Ok(PhotoHeader {
        format: PhotoFormat::Jpeg { coding, quarter_coefficients: frame.quarter_coefficients() },
        size: frame.size,
        channels: frame.components.len(),
        bits: 8,
        file_bytes,
    })
}

/// What a start-of-frame marker other than 0, 1 and 2 (or DAC) stands for.
fn process_name(marker: u8) -> &'static str {
    match marker {
        0xC3 | 0xC7 | 0xCB | 0xCF => "a lossless JPEG",
        0xC5 | 0xC6 | 0xCD | 0xCE => "a hierarchical JPEG",
        _ => "an arithmetic-coded JPEG",
    }
}

fn parse_frame(path: &Path, at: u64, marker: u8, payload: &[u8]) -> Result<Frame> {
    let [precision, h1, h0, w1, w0, count, rest @ ..] = payload else {
        return Err(corrupt(path, at, "a frame header", "a shorter segment"));
    };
    if *precision != 8 {
        return Err(Error::unsupported(path, format!("a JPEG of {precision} bits a sample")));
    }
    let size =
        Size::new(u16::from_be_bytes([*w1, *w0]).into(), u16::from_be_bytes([*h1, *h0]).into());
    if size.width == 0 {
        return Err(corrupt(path, at, "a width in pixels", "0"));
    }
    if size.height == 0 {
        return Err(Error::unsupported(path, "a JPEG that gives its height after the first scan"));
    }
    if rest.len() != 3 * usize::from(*count) || *count == 0 {
        return Err(corrupt(
            path,
            at,
            "3 bytes for each component",
            format!("{} bytes", rest.len()),
        ));
    }
    match count {
        1 | 3 => {}
        4 => {
            return Err(Error::Unsupported {
                path: path.to_path_buf(),
                what: "a CMYK or YCCK JPEG".to_string(),
                hint: Some("convert it to RGB".to_string()),
            });
        }
        n => return Err(Error::unsupported(path, format!("a JPEG of {n} components"))),
    }
    let mut components: Vec<_> = rest
        .chunks_exact(3)
        .map(|c| Component { id: c[0], horizontal: c[1] >> 4, vertical: c[1] & 15 })
        .collect();
    if let [only] = &mut components[..] {
        // The factors of a single component mean nothing (T.81, A.2.2).
        (only.horizontal, only.vertical) = (1, 1);
    }
    let frame = Frame { size, is_progressive: marker == 0xC2, components };
    check_sampling(path, at, &frame)?;
    Ok(frame)
}

/// Lets pass the sampling factors that the decoder handles rightly: brightness at full size, the others smaller by
/// whole factors, powers of two across.
fn check_sampling(path: &Path, at: u64, frame: &Frame) -> Result<()> {
    let factors = frame
        .components
        .iter()
        .map(|c| format!("{}×{}", c.horizontal, c.vertical))
        .collect::<Vec<_>>()
        .join(" ");
    let legal = 1..=4;
    if frame
        .components
        .iter()
        .any(|c| !legal.contains(&c.horizontal) || !legal.contains(&c.vertical))
    {
        return Err(corrupt(path, at, "sampling factors from 1 to 4", factors));
    }
    let (across, down) = (frame.max_horizontal(), frame.max_vertical());
    let is_handled = frame.components[0].horizontal == across
        && frame.components[0].vertical == down
        && frame.components.iter().all(|c| {
            c.horizontal.is_power_of_two() && across % c.horizontal == 0 && down % c.vertical == 0
        });
    if !is_handled {
        return Err(Error::unsupported(path, format!("a JPEG with sampling factors {factors}")));
    }
    Ok(())
}

/// The colour transform of an Adobe APP14 segment, if it is one.
fn parse_adobe(payload: &[u8]) -> Option<u8> {
    if payload.starts_with(b"Adobe") { payload.get(11).copied() } else { None }
}

/// Indices of the components in a scan.
fn parse_scan(path: &Path, at: u64, payload: &[u8], frame: &Frame) -> Result<Vec<usize>> {
    let count = usize::from(payload.first().copied().unwrap_or(0));
    if count == 0 || payload.len() != 4 + 2 * count {
        return Err(corrupt(path, at, "a scan header", format!("{} bytes", payload.len())));
    }
    let position =
        |id: u8| {
            frame.components.iter().position(|c| c.id == id).ok_or_else(|| {
                corrupt(path, at, "a component of the frame", format!("component {id}"))
            })
        };
    payload[1..=2 * count].chunks_exact(2).map(|c| position(c[0])).collect()
}

/// Reads marker segments from a stream.
pub(super) struct Segments<'a, R> {
    reader: &'a mut R,
    path: &'a Path,
    at: u64,
}

impl<'a, R: BufRead + Seek> Segments<'a, R> {
    /// The segments of a JPEG from the first marker after the start of the image; `reader` stands at the file's start.
    pub(super) fn after_start(reader: &'a mut R, path: &'a Path) -> Result<Self> {
        reader.seek_relative(2).map_err(|e| Error::io(path, e))?;
        Ok(Self { reader, path, at: 2 })
    }

    fn bytes(&mut self, buffer: &mut [u8]) -> Result<()> {
        self.reader.read_exact(buffer).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => {
                corrupt(self.path, self.at, "a marker segment", "the end of the file")
            }
            _ => Error::io(self.path, e),
        })?;
        self.at += buffer.len() as u64;
        Ok(())
    }

    pub(super) fn marker(&mut self) -> Result<u8> {
        let mut byte = [0];
        self.bytes(&mut byte)?;
        if byte != [0xFF] {
            let found = format!("{:02X}", byte[0]);
            return Err(corrupt(self.path, self.at - 1, "a marker (FF …)", found));
        }
        while byte == [0xFF] {
            self.bytes(&mut byte)?;
        }
        Ok(byte[0])
    }

    fn length(&mut self) -> Result<u16> {
        let mut length = [0; 2];
        self.bytes(&mut length)?;
        u16::from_be_bytes(length)
            .checked_sub(2)
            .ok_or_else(|| corrupt(self.path, self.at - 2, "a segment length of 2 or more", "less"))
    }

    pub(super) fn payload(&mut self) -> Result<Vec<u8>> {
        let mut payload = vec![0; self.length()?.into()];
        self.bytes(&mut payload)?;
        Ok(payload)
    }

    pub(super) fn skip(&mut self) -> Result<()> {
        let length = self.length()?;
        self.reader.seek_relative(length.into()).map_err(|e| Error::io(self.path, e))?;
        self.at += u64::from(length);
        Ok(())
    }
}

/// Checks that a JPEG's stream is there to its end: every component has a scan, a sequential one no two, restart
/// markers are as many as the picture needs, and an end-of-image marker closes it. What follows that is not looked at.
///
/// The decoder alone does not find all of this, even when strict: a stream that lacks the end of its last row of
/// blocks, or one that was cut and closed, may pass.
///
/// # Errors
/// [`Error::Corrupt`] with the byte.
pub(super) fn check_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut frame: Option<Frame> = None;
    let mut scans_of = [0_u32; 4];
    let mut restart_interval = 0;
    let mut at = 2;
    loop {
        let (marker, payload, next) = segment(path, bytes, at)?;
        match marker {
            0xC0..=0xC2 => frame = Some(parse_frame(path, at as u64, marker, payload)?),
            0xDD if payload.len() == 2 => {
                restart_interval = u64::from(u16::from_be_bytes([payload[0], payload[1]]));
            }
            0xD9 => return check_scans(path, at, frame.as_ref(), scans_of),
            _ => {}
        }
        at = next;
        if marker == 0xDA {
            let frame = frame
                .as_ref()
                .ok_or_else(|| corrupt(path, at as u64, "a frame header first", "a scan header"))?;
            let components = parse_scan(path, at as u64, payload, frame)?;
            for &component in &components {
                scans_of[component] += 1;
            }
            let (end, restarts) = scan_end(path, bytes, at)?;
            let is_all = components.len() == frame.components.len();
            if is_all && !frame.is_progressive && restart_interval > 0 {
                let needed = frame.mcus().div_ceil(restart_interval) - 1;
                if restarts < needed {
                    let expected = format!("{needed} restart markers in the scan");
                    return Err(corrupt(path, end as u64, expected, restarts.to_string()));
                }
            }
            at = end;
        }
    }
}

fn check_scans(path: &Path, at: usize, frame: Option<&Frame>, scans_of: [u32; 4]) -> Result<()> {
    let frame =
        frame.ok_or_else(|| corrupt(path, at as u64, "a frame header", "the end of the image"))?;
    for (component, &scans) in scans_of.iter().take(frame.components.len()).enumerate() {
        if scans == 0 || (scans > 1 && !frame.is_progressive) {
            let expected = format!("scans for component {component}");
            return Err(corrupt(path, at as u64, expected, format!("{scans} of them")));
        }
    }
    Ok(())
}

/// The marker segment at `at`: marker, payload (empty for the end of the image), offset past it.
fn segment<'a>(path: &Path, bytes: &'a [u8], at: usize) -> Result<(u8, &'a [u8], usize)> {
    let cut = || corrupt(path, bytes.len() as u64, "an end-of-image marker", "the end of the file");
    if *bytes.get(at).ok_or_else(cut)? != 0xFF {
        return Err(corrupt(path, at as u64, "a marker (FF …)", format!("{:02X}", bytes[at])));
    }
    let code = at + bytes[at..].iter().position(|&b| b != 0xFF).ok_or_else(cut)?;
    if bytes[code] == 0xD9 {
        return Ok((0xD9, &[], code + 1));
    }
    let length = bytes.get(code + 1..code + 3).ok_or_else(cut)?;
    let length = usize::from(u16::from_be_bytes([length[0], length[1]])).max(2);
    let payload = bytes.get(code + 3..code + 1 + length).ok_or_else(cut)?;
    Ok((bytes[code], payload, code + 1 + length))
}

/// Where the entropy-coded data that begins at `at` ends (at a marker), and the number of restart markers in it.
fn scan_end(path: &Path, bytes: &[u8], mut at: usize) -> Result<(usize, u64)> {
    let cut = || corrupt(path, bytes.len() as u64, "an end-of-image marker", "the end of the file");
    let mut restarts = 0;
    loop {
        at += bytes[at..].iter().position(|&b| b == 0xFF).ok_or_else(cut)?;
        match bytes.get(at + 1).ok_or_else(cut)? {
            0x00 => at += 2,
            0xD0..=0xD7 => {
                restarts += 1;
                at += 2;
            }
            0xFF => at += 1,
            _ => return Ok((at, restarts)),
        }
    }
}

fn corrupt(path: &Path, at: u64, expected: impl Into<String>, found: impl Into<String>) -> Error {
    Error::corrupt(path, format!("byte {at}"), expected, found)
}
