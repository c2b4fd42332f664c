//! OpenSfM's and ODM's `reconstruction.json`, with `tracks.csv` beside it for the tie points.
//!
//! Format: OpenSfM's documentation, *Geometric models* and *Reconstruction file format*. A shot's `rotation` is
//! axis-angle, `camera_from_ground`, `X_camera = R X + t`, camera axes x right, y down, z forward. Positions are divided by the
//! greater side of the photo and begin at its centre: pixels are `max(w, h) x + w / 2`. Only the first reconstruction of the
//! file is used: the others are in frames of their own.

mod camera;
mod reconstruction;
mod tracks;

pub(super) use reconstruction::read;
