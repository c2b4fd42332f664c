//! What every camera format comes to: photos with lens and pose, tie points to prove them by.
//!
//! In: what a parser of one format found, in groundel's convention already. Out: a checked
//! [`CameraSet`](crate::camera::CameraSet), and a sample of the tie points.

mod draft;

pub(super) use draft::{Draft, DraftPhoto, Tie, name_fault};
