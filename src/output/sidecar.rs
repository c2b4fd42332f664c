//! [`Sidecar`]: the small files that place a mosaic for programs that do not read GeoTIFF.

/// A file that can be asked for beside the mosaic.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Sidecar {
    /// Where the pixels lie in frame coordinates, [`super::world_file`].
    WorldFile,
    /// The picture on its plane in space, [`super::image_dxf`].
    Dxf,
}

impl Sidecar {
    /// What its name has in the place of the mosaic's `tif`.
    pub fn extension(self) -> &'static str {
        match self {
            Self::WorldFile => "tfw",
            Self::Dxf => "dxf",
        }
    }
}
