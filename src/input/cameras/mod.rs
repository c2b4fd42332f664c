//! What every camera format comes to: photos with lens and pose, tie points to prove them by.
//!
//! In: what a parser of one format found, in groundel's convention already. Out: a checked
//! [`CameraSet`](crate::camera::CameraSet), proven by a sample of the tie points. [`read_cameras`] is the one way in; a
//! format is a row of [`CameraFormat`], a line of the door's detection, and a parser that returns a [`Draft`].

mod door;
mod draft;
mod mesh_proof;
mod options;
mod orientation;
mod photo_folder;
mod proof;
mod thinned;

pub use door::{Cameras, is_camera_file, read_cameras};
pub use mesh_proof::MeshProof;
pub use options::{AngleUnit, CameraFormat, CameraOptions, TableLens};
pub use proof::{Proof, Reading};

pub(super) use draft::{Draft, DraftPhoto, MAX_PHOTOS, MOST_TIES, Tie, name_fault};
pub(super) use orientation::{lens, pose, rotation_of_rows};
pub(super) use photo_folder::PhotoFolder;
pub(super) use thinned::Thinned;
