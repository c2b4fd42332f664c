//! Analytic scenes with known answers, for the demo, tests and benches.
//!
//! In: parameters and seeds. Out: scenes ([`Scene`]) that are exact polyhedra with an analytic texture, meshes of
//! any number of faces that are exactly those polyhedra ([`Refinement`], [`write_ply`]).

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
mod test_scene;
mod texture;

pub use caster::{CastHit, Caster};
pub use facade::{FACADE_SIZE, facade};
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
pub use test_scene::TestScene;
pub use texture::{Part, Texture};
