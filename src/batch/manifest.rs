//! [`Manifest`]: what all parts of a job have in common.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use xxhash_rust::xxh3::xxh3_128;

use super::TileAddress;
use crate::geom::{PixelRect, Size};
use crate::output::{
    Georeference, Layer, PrintResolution, Pyramid, Sidecar, TileFormat, TileKey, write_atomically,
};
use crate::{Error, Result};

/// Version of the manifest's format.
const VERSION: u32 = 1;
/// No manifest is longer; most of it is the names of photos.
const MAX_BYTES: u64 = 64 << 20;

/// The grid, the layers and the settings of a job; kept as JSON beside the parts, replaced atomically.
///
/// Two runs with equal manifests make equal bytes, so their parts may be mixed; parts of another manifest are foreign.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    version: u32,
    width: u32,
    height: u32,
    format: TileFormat,
    layers: Vec<Layer>,
    georeference: Option<Georeference>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dpi: Option<PrintResolution>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    sidecars: Vec<Sidecar>,
    settings: String,
}

impl Manifest {
    /// The manifest of a job. `settings` is a fingerprint of everything else that decides a pixel: inputs and flags.
    ///
    /// # Errors
    /// If the size or the tile size is out of range, a layer comes twice in a section, or layers are not in the order of
    /// their sections, from 0 on.
    pub fn new(
        size: Size,
        format: TileFormat,
        layers: Vec<Layer>,
        georeference: Option<Georeference>,
        settings: impl Into<String>,
    ) -> Result<Self> {
        let manifest = Self {
            version: VERSION,
            width: size.width,
            height: size.height,
            format,
            layers,
            georeference,
            dpi: None,
            sidecars: Vec::new(),
            settings: settings.into(),
        };
        Pyramid::new(size, format.tile_size)?;
        manifest.check_layers().map_err(Error::Usage)?;
        Ok(manifest)
    }

    /// The manifest with what its files say of their size on paper, and the files that are to lie beside the mosaic.
    #[must_use]
    pub fn with_extras(mut self, dpi: Option<PrintResolution>, sidecars: Vec<Sidecar>) -> Self {
        (self.dpi, self.sidecars) = (dpi, sidecars);
        self
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// If it cannot be read or is not one of this version.
    pub fn load(path: &Path) -> Result<Self> {
        let mut text = String::new();
        File::open(path)
            .and_then(|file| file.take(MAX_BYTES).read_to_string(&mut text))
            .map_err(|e| Error::io(path, e))?;
        let manifest: Self = serde_json::from_str(&text).map_err(|e| {
            let place = format!("line {}, column {}", e.line(), e.column());
            Error::corrupt(path, place, "a job manifest", e.to_string())
        })?;
        manifest.check(path)?;
        Ok(manifest)
    }

    /// Checks a manifest that was read as a part of `path`.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if it is not one of this version.
    pub fn check(&self, path: &Path) -> Result<()> {
        let corrupt = |place: &str, expected: &str, found: String| {
            Error::corrupt(path, place, expected, found)
        };
        if self.version != VERSION {
            return Err(corrupt("key `version`", &VERSION.to_string(), self.version.to_string()));
        }
        Pyramid::new(self.size(), self.format.tile_size)
            .map_err(|e| corrupt("the grid", "a valid grid", e.to_string()))?;
        self.check_layers().map_err(|found| corrupt("key `layers`", "valid layers", found))
    }

    /// Whether `other` differs at most in its settings' fingerprint: the same grid, format and layers.
    pub fn is_like(&self, other: &Self) -> bool {
        Self { settings: other.settings.clone(), ..self.clone() } == *other
    }

    /// Writes the manifest, replacing what was there at once.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        write_atomically(path, &self.to_json())
    }

    /// Identifies the job in its parts.
    pub fn fingerprint(&self) -> u128 {
        xxh3_128(&self.to_json())
    }

    fn to_json(&self) -> Vec<u8> {
        let mut json =
            serde_json::to_vec_pretty(self).expect("texts, numbers and lists are valid JSON");
        json.push(b'\n');
        json
    }

    fn check_layers(&self) -> std::result::Result<(), String> {
        if self.layers.is_empty() {
            return Err("no layer".into());
        }
        for (i, layer) in self.layers.iter().enumerate() {
            let name = layer.meaning().name();
            if !layer.is_consistent() {
                return Err(format!("layer {name} with other samples than it has"));
            }
            let is_same =
                |l: &Layer| (l.section(), l.meaning()) == (layer.section(), layer.meaning());
            if self.layers[..i].iter().any(is_same) {
                return Err(format!("layer {name} twice"));
            }
            // Section by section, so that no number is left out.
            let before = if i == 0 { 0 } else { self.layers[i - 1].section() };
            if !(before..=before.saturating_add(u16::from(i > 0))).contains(&layer.section()) {
                let found = layer.section();
                return Err(format!("layer {name} of section {found} behind section {before}"));
            }
        }
        Ok(())
    }

    /// Number of sections: 1 for an ordinary mosaic.
    pub fn sections(&self) -> usize {
        self.layers.last().map_or(0, |layer| usize::from(layer.section()) + 1)
    }

    /// Size of the mosaic in pixels.
    pub fn size(&self) -> Size {
        Size::new(self.width, self.height)
    }

    /// Tiles and their compression.
    pub fn format(&self) -> TileFormat {
        self.format
    }

    /// The layers, in the order in which a tile's rasters come.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Where the pixels lie.
    pub fn georeference(&self) -> Option<&Georeference> {
        self.georeference.as_ref()
    }

    /// How large the pixels are on paper, if that is stated.
    pub fn resolution(&self) -> Option<PrintResolution> {
        self.dpi
    }

    /// The files that are to lie beside the mosaic, its frame not counted.
    pub fn sidecars(&self) -> &[Sidecar] {
        &self.sidecars
    }

    /// The fingerprint of the inputs and flags.
    pub fn settings(&self) -> &str {
        &self.settings
    }

    /// The levels and tiles of every file of the job.
    ///
    /// # Panics
    /// Never: the grid is checked when the manifest is made.
    pub fn pyramid(&self) -> Pyramid {
        Pyramid::new(self.size(), self.format.tile_size).expect("checked when it was made")
    }

    /// The pixels of the mosaic that a tile shows; clipped to the mosaic.
    pub fn tile_rect(&self, tile: TileAddress) -> PixelRect {
        self.pyramid().tile_rect(TileKey::from(tile))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::{Compression, Meaning};

    fn manifest(origin: f64) -> Manifest {
        let format = TileFormat { tile_size: 16, compression: Compression::Zstd };
        let layer = Layer::of(Meaning::Best).unwrap().with_item("PHOTO_0", "ä \"b\".jpg");
        let georeference =
            Georeference { origin_u: origin, origin_v: -0.1, pixel_size: 0.01, epsg: None };
        Manifest::new(Size::new(40, 30), format, vec![layer], Some(georeference), "abc").unwrap()
    }

    #[test]
    fn a_manifest_reads_back_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("manifest.json");
        for origin in [0.1 + 0.2, 1e300 / 3.0, -123_456.789_012_345_67, f64::MIN_POSITIVE] {
            let whole = manifest(origin);
            whole.save(&path).unwrap();
            let back = Manifest::load(&path).unwrap();
            assert_eq!(back, whole);
            assert_eq!(back.georeference().unwrap().origin_u.to_bits(), origin.to_bits());
            assert_eq!(back.fingerprint(), whole.fingerprint());
        }
        assert_ne!(manifest(1.0).fingerprint(), manifest(1.0 + f64::EPSILON).fingerprint());
        let resolution = PrintResolution::new(118.11);
        let whole = manifest(1.0).with_extras(resolution, vec![Sidecar::WorldFile, Sidecar::Dxf]);
        whole.save(&path).unwrap();
        assert_eq!(Manifest::load(&path).unwrap(), whole);
        assert_ne!(whole.fingerprint(), manifest(1.0).fingerprint());
    }

    #[test]
    fn layers_come_once_a_section_and_sections_in_order() {
        let with = |sections: &[u16]| {
            let layer = |&k: &u16| Layer::of(Meaning::Best).unwrap().of_section(k);
            let (of, layers) = (manifest(0.0), sections.iter().map(layer).collect());
            Manifest::new(of.size(), of.format(), layers, None, "abc")
        };
        assert_eq!(with(&[0, 1, 2]).unwrap().sections(), 3);
        for wrong in [&[0, 0][..], &[1], &[0, 2], &[0, 1, 0], &[]] {
            assert!(with(wrong).is_err(), "{wrong:?}");
        }
        // An ordinary job does not speak of sections.
        assert_eq!(manifest(0.0).sections(), 1);
        assert!(!String::from_utf8(manifest(0.0).to_json()).unwrap().contains("section"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("manifest.json");
        with(&[0, 1]).unwrap().save(&path).unwrap();
        assert_eq!(Manifest::load(&path).unwrap(), with(&[0, 1]).unwrap());
    }

    #[test]
    fn a_manifest_that_was_tampered_with_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("manifest.json");
        let text = String::from_utf8(manifest(0.0).to_json()).unwrap();
        for (from, to) in [
            ("\"version\": 1", "\"version\": 2"),
            ("\"tile_size\": 16", "\"tile_size\": 17"),
            ("\"width\": 40", "\"width\": 0"),
            ("\"channels\": 1", "\"channels\": 3"),
            ("\"settings\"", "\"stettings\""),
            ("\"settings\"", "\"dpi\": 0.5, \"settings\""),
            ("\"settings\"", "\"sidecars\": [\"dwg\"], \"settings\""),
        ] {
            assert!(text.contains(from), "{from}");
            std::fs::write(&path, text.replace(from, to)).unwrap();
            let e = Manifest::load(&path).unwrap_err();
            assert!(e.to_string().contains("manifest.json") && e.exit_code() == 2, "{e}");
        }
    }
}
