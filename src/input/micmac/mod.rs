//! `MicMac`'s cameras: a folder of `Orientation-PHOTO.xml`, each with its calibration in itself or in a file beside it.
//!
//! Format: `MicMac`'s `ParamChantierPhotogram.xml` and its `MakeExplicite`, `cDistModStdPhpgr`. Under the convention
//! `eConvApero_DistM2C`, the only one read, `CodageMatr` is ground from camera, row by row, camera axes x right, y down, z
//! forward; `Centre` is the projection centre; an ideal position `PP + F (x/z, y/z)` is distorted about `CDist`, all in
//! pixels: `P1 (r² + 2 x²) + 2 P2 x y` is added to x, so that `P1`, `P2` are OpenCV's p2, p1. `MicMac` takes the value of a
//! pixel at whole coordinates: half a pixel is added. The points of `Verif`, where there are any, are the tie points.

mod calibration;
mod folder;

pub(super) use folder::{is_folder, read};

#[cfg(test)]
mod tests;
