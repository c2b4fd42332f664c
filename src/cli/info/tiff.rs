//! What is in a TIFF file: a mosaic, a layer, or someone else's.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;

use tiff::TiffError;
use tiff::decoder::Decoder;
use tiff::tags::{CompressionMethod, Tag};

use crate::{Error, Result};

/// Overviews of a mosaic halve its sides, which are less than 2^31: more directories are a fault.
const MOST_DIRECTORIES: u64 = 64;
/// GDAL's metadata, XML.
const GDAL_METADATA: Tag = Tag::Unknown(42112);
/// GeoKeys that name a reference system: projected, geographic.
const CRS_KEYS: [u16; 2] = [3072, 2048];

type Reader = Decoder<BufReader<File>>;

/// Size, samples, tiles, overviews, georeference and metadata of the TIFF file at `path`, a line each.
///
/// # Errors
/// [`Error::Io`] or [`Error::Corrupt`].
pub(super) fn describe(path: &Path) -> Result<String> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let bytes = file.metadata().map_err(|e| Error::io(path, e))?.len();
    let fault = |error| tiff_error(path, error);
    let mut decoder = Decoder::new(BufReader::new(file)).map_err(fault)?;
    let mut lines = vec![format!("{}: TIFF, {bytes} bytes", path.display())];
    lines.extend(image_lines(&mut decoder).map_err(fault)?);
    lines.extend(resolution_line(&mut decoder).map_err(fault)?);
    lines.extend(profile_line(&mut decoder));
    lines.extend(place_lines(&mut decoder).map_err(fault)?);
    lines.extend(metadata_lines(&mut decoder).map_err(fault)?);
    lines.push(overview_line(path, &mut decoder)?);
    Ok(lines.join("\n") + "\n")
}

fn tiff_error(path: &Path, error: TiffError) -> Error {
    match error {
        TiffError::IoError(source) if source.kind() != io::ErrorKind::UnexpectedEof => {
            Error::io(path, source)
        }
        other => Error::corrupt(path, "directory", "a TIFF file", other.to_string()),
    }
}

fn image_lines(decoder: &mut Reader) -> std::result::Result<Vec<String>, TiffError> {
    let (width, height) = decoder.dimensions()?;
    let samples: u16 = decoder.find_tag_unsigned(Tag::SamplesPerPixel)?.unwrap_or(1);
    let bits = decoder.find_tag_unsigned_vec::<u16>(Tag::BitsPerSample)?.unwrap_or_default();
    let format = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat)?.unwrap_or_default();
    let kind = match format.first() {
        Some(2) => "signed",
        Some(3) => "floating point",
        _ => "unsigned",
    };
    let photometric = match decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation)? {
        Some(2) => "RGB",
        Some(3) => "palette",
        Some(6) => "YCbCr",
        _ => "grey",
    };
    let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples)?.unwrap_or_default();
    let alpha = if extra.contains(&2) { " + alpha" } else { "" };
    let (chunk_width, chunk_height) = decoder.chunk_dimensions();
    let chunks = match decoder.get_chunk_type() {
        tiff::decoder::ChunkType::Tile => "tiles",
        tiff::decoder::ChunkType::Strip => "strips",
    };
    let compression = compression(decoder.find_tag_unsigned(Tag::Compression)?.unwrap_or(1));
    Ok(vec![
        format!("size: {width} × {height} pixels"),
        format!(
            "samples: {samples} × {} bit {kind}, {photometric}{alpha}",
            bits.first().unwrap_or(&1)
        ),
        format!("{chunks}: {chunk_width} × {chunk_height}, {compression}"),
    ])
}

/// Pixels on paper, if the file says how many to an inch or a centimetre.
fn resolution_line(decoder: &mut Reader) -> std::result::Result<Option<String>, TiffError> {
    let unit = match decoder.find_tag_unsigned::<u16>(Tag::ResolutionUnit)?.unwrap_or(2) {
        2 => "dpi",
        3 => "pixels a centimetre",
        _ => return Ok(None),
    };
    let rational = |value: tiff::decoder::ifd::Value| match value {
        tiff::decoder::ifd::Value::Rational(above, below) if below > 0 => {
            Some(f64::from(above) / f64::from(below))
        }
        _ => None,
    };
    let across = decoder.find_tag(Tag::XResolution)?.and_then(rational);
    let down = decoder.find_tag(Tag::YResolution)?.and_then(rational);
    Ok(across.zip(down).map(|(x, y)| {
        if x.to_bits() == y.to_bits() {
            format!("resolution: {x} {unit}")
        } else {
            format!("resolution: {x} × {y} {unit}")
        }
    }))
}

/// The colour profile's length, if there is one.
fn profile_line(decoder: &mut Reader) -> Option<String> {
    let profile = decoder.image_ifd().find_entry(Tag::IccProfile)?;
    Some(format!("colour profile: ICC, {} bytes", profile.count()))
}

fn compression(code: u16) -> String {
    match CompressionMethod::from_u16_exhaustive(code) {
        CompressionMethod::None => "not compressed".into(),
        CompressionMethod::LZW => "lzw".into(),
        CompressionMethod::Deflate | CompressionMethod::OldDeflate => "deflate".into(),
        CompressionMethod::ZSTD => "zstd".into(),
        CompressionMethod::ModernJPEG => "jpeg".into(),
        _ => format!("compression {code}"),
    }
}

/// Pixel size, upper-left corner and reference system, as far as the file has them.
fn place_lines(decoder: &mut Reader) -> std::result::Result<Vec<String>, TiffError> {
    let mut lines = Vec::new();
    let scale = doubles(decoder, Tag::ModelPixelScaleTag)?;
    let tie = doubles(decoder, Tag::ModelTiepointTag)?;
    if let [x, y, ..] = scale[..] {
        lines.push(format!("pixel size: {x} × {y}"));
    }
    if let [_, _, _, x, y, ..] = tie[..] {
        lines.push(format!("upper-left corner: {x}, {y}"));
    }
    let transformation = doubles(decoder, Tag::ModelTransformationTag)?;
    if !transformation.is_empty() {
        lines.push(format!("transformation: {transformation:?}"));
    }
    let keys = decoder.find_tag_unsigned_vec::<u16>(Tag::GeoKeyDirectoryTag)?.unwrap_or_default();
    let code_of =
        |key| keys.chunks_exact(4).skip(1).find(|entry| entry[0] == key).map(|entry| entry[3]);
    // 32767 is "user-defined": then the text says what it is.
    let code = CRS_KEYS.into_iter().find_map(code_of).filter(|code| *code != 32767);
    let text = match decoder.find_tag(Tag::GeoAsciiParamsTag)? {
        Some(value) => value.into_string()?.trim_end_matches(['|', '\0']).replace('|', "; "),
        None => String::new(),
    };
    match code {
        Some(code) => {
            let line = format!("reference system: EPSG:{code} {text}");
            lines.push(line.trim_end().to_string());
        }
        None if !text.is_empty() => lines.push(format!("reference system: {text}")),
        None => {}
    }
    Ok(lines)
}

fn doubles(decoder: &mut Reader, tag: Tag) -> std::result::Result<Vec<f64>, TiffError> {
    decoder.find_tag(tag)?.map_or(Ok(Vec::new()), tiff::decoder::ifd::Value::into_f64_vec)
}

/// The value of undefined pixels and GDAL's metadata items.
fn metadata_lines(decoder: &mut Reader) -> std::result::Result<Vec<String>, TiffError> {
    let mut lines = Vec::new();
    if let Some(nodata) = decoder.find_tag(Tag::GdalNodata)? {
        lines.push(format!("nodata: {}", nodata.into_string()?.trim_end_matches('\0').trim()));
    }
    if let Some(xml) = decoder.find_tag(GDAL_METADATA)? {
        lines.extend(items(&xml.into_string()?));
    }
    Ok(lines)
}

/// `name: value` of each `<Item name="…">…</Item>`; further lines of a value are indented.
fn items(xml: &str) -> Vec<String> {
    let item = |part: &str| {
        let (head, rest) = part.split_once('>')?;
        let value = rest.split_once("</Item>")?.0;
        let name = head.split_once("name=\"")?.1.split_once('"')?.0;
        // GDAL escapes a value on its own, and then once more as XML.
        let value = unescaped(&unescaped(value)).trim_end().replace('\n', "\n  ");
        Some(format!("{}: {value}", unescaped(name)))
    };
    xml.split("<Item").skip(1).filter_map(item).collect()
}

fn unescaped(text: &str) -> String {
    let text = text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"");
    text.replace("&apos;", "'").replace("&amp;", "&")
}

fn overview_line(path: &Path, decoder: &mut Reader) -> Result<String> {
    let fault = |error| tiff_error(path, error);
    let mut sizes = Vec::new();
    let mut directories = 1;
    while decoder.more_images() {
        directories += 1;
        if directories > MOST_DIRECTORIES {
            let what = format!("{}: directories", path.display());
            return Err(Error::Limit { what, limit: MOST_DIRECTORIES, found: directories });
        }
        decoder.next_image().map_err(fault)?;
        let (width, height) = decoder.dimensions().map_err(fault)?;
        sizes.push(format!("{width} × {height}"));
    }
    Ok(format!("overviews: {}", if sizes.is_empty() { "none".into() } else { sizes.join(", ") }))
}

#[cfg(test)]
mod tests {
    use tiff::encoder::{TiffEncoder, colortype};

    use super::*;

    /// A small file with georeference, metadata and one overview, written by another hand than ours.
    fn written(folder: &Path) -> std::path::PathBuf {
        let path = folder.join("a b.tif");
        let mut encoder = TiffEncoder::new(File::create(&path).unwrap()).unwrap();
        let mut image = encoder.new_image::<colortype::Gray32Float>(6, 4).unwrap();
        let tags = image.encoder();
        tags.write_tag(Tag::ModelPixelScaleTag, &[0.002_f64, 0.002, 0.0][..]).unwrap();
        tags.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, -1.5, 7.25, 0.0_f64][..]).unwrap();
        tags.write_tag(Tag::GeoKeyDirectoryTag, &[1_u16, 1, 0, 1, 3072, 0, 1, 32634][..]).unwrap();
        tags.write_tag(Tag::GdalNodata, "nan").unwrap();
        image
            .resolution(tiff::tags::ResolutionUnit::Inch, tiff::encoder::Rational { n: 145, d: 2 });
        let tags = image.encoder();
        let xml =
            "<GDALMetadata>\n<Item name=\"LAYER\">a &amp;lt; b\nc &amp;amp;</Item></GDALMetadata>";
        tags.write_tag(GDAL_METADATA, xml).unwrap();
        image.write_data(&[0.5_f32; 24]).unwrap();
        encoder.write_image::<colortype::Gray32Float>(3, 2, &[0.5; 6]).unwrap();
        path
    }

    #[test]
    fn size_samples_place_metadata_and_overviews_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let told = describe(&written(folder.path())).unwrap();
        for line in [
            "size: 6 × 4 pixels",
            "samples: 1 × 32 bit floating point, grey",
            "resolution: 72.5 dpi",
            "pixel size: 0.002 × 0.002",
            "upper-left corner: -1.5, 7.25",
            "reference system: EPSG:32634",
            "nodata: nan",
            "LAYER: a < b",
            "  c &",
            "overviews: 3 × 2",
        ] {
            assert!(told.lines().any(|told| told == line), "{line} is not in\n{told}");
        }
    }

    #[test]
    fn a_cut_file_is_an_error_with_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = written(folder.path());
        let whole = std::fs::read(&path).unwrap();
        for len in 0..whole.len().min(200) {
            std::fs::write(&path, &whole[..len]).unwrap();
            let error = describe(&path).unwrap_err();
            assert!(error.to_string().contains("a b.tif"), "{len}: {error}");
            assert_eq!(error.exit_code(), 2, "{len}: {error}");
        }
    }
}
