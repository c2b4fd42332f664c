//! Analytic scenes with known answers, for the demo, tests and benches.
//!
//! In: parameters and seeds. Out:
//! - [`Scene`]: an exact polyhedron with an analytic [`Texture`], and [`facade()`], the one of the demo;
//! - [`Refinement`]: its mesh at any number of faces, streamed, and [`write_ply`];
//! - [`Caster`] and [`photograph()`]: photographs by exact rays through an exact lens;
//! - [`scenes`]: a [`TestScene`] for each way in which an orthoimage goes wrong;
//! - [`Oracle`]: brute-force answers to what a mosaic pixel shows and which photos see it;
//! - [`FacadeSet`], [`StreetSet`] and the functions that write a project's files;
//! - [`likeness`]: how near a mosaic comes to the known answer.
//!
//! Promises: the same numbers, files and pictures on every machine and for any number of threads. The oracle shares no
//! code with the engine but lenses and poses. Nothing here is needed to render a mosaic.

mod caster;
mod facade;
mod facade_set;
mod files;
mod metrics;
mod oracle;
mod photograph;
mod placement;
mod plane;
mod ply;
mod random;
mod refine;
mod scene;
pub mod scenes;
mod shift;
mod shot;
mod source;
mod street_set;
mod test_scene;
mod texture;

pub use caster::{CastHit, Caster};
pub use facade::{FACADE_SIZE, HOUSE_STEP_M, facade, row_of_facades};
pub use facade_set::{FacadeSet, Written};
pub use files::{names, write_colmap, write_picture, write_project, write_triangles};
pub use metrics::{Likeness, Plane, likeness, ssim};
pub use oracle::{Oracle, Outcome, Sight, Verdict};
pub use photograph::{Depth, SKY, Sampling, photograph};
pub use placement::Placement;
pub use plane::PlaneSpec;
pub use ply::{PlyOptions, PlyScalar, write_ply};
pub use random::Random;
pub use refine::Refinement;
pub use scene::{Figure, Opening, Patch, Scene, SceneBuilder};
pub use shift::{Shift, shift};
pub use shot::{CameraSpec, Shot, photos};
pub use street_set::{PHOTOS_PER_HOUSE, PICTURES, StreetSet};
pub use test_scene::TestScene;
pub use texture::{Part, Texture};
