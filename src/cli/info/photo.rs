//! What is in a photo.

use std::path::Path;

use crate::Result;
use crate::input::photo::{JpegCoding, PhotoFormat, read_photo_header};

/// Format, size, channels and depth of a photo; its EXIF data play no part in an orthoimage.
///
/// # Errors
/// What reading the file gives.
pub(super) fn describe(path: &Path) -> Result<String> {
    let header = read_photo_header(path)?;
    let format = match header.format {
        PhotoFormat::Jpeg { coding: JpegCoding::Progressive, .. } => "JPEG, progressive",
        PhotoFormat::Jpeg { .. } => "JPEG",
        PhotoFormat::Png { interlaced: true } => "PNG, interlaced",
        PhotoFormat::Png { interlaced: false } => "PNG",
        PhotoFormat::Tiff { .. } => "TIFF",
    };
    let channels = if header.channels == 1 { "grey" } else { "RGB" };
    let lines = [
        format!("{}: photo, {format}, {} bytes", path.display(), header.file_bytes),
        format!("size: {} × {} pixels", header.size.width, header.size.height),
        format!("samples: {channels}, {} bit", header.bits),
    ];
    Ok(lines.join("\n") + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn format_size_and_samples_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a b.png");
        ::image::save_buffer(&path, &[7; 24], 4, 3, ::image::ExtendedColorType::L16).unwrap();
        let told = describe(&path).unwrap();
        assert!(told.contains("a b.png: photo, PNG, "), "{told}");
        assert!(told.ends_with("size: 4 × 3 pixels\nsamples: grey, 16 bit\n"), "{told}");
    }
}
