//! Analytic scenes with known answers, for the demo, tests and benches.
//!
//! In: parameters and seeds. Out: scenes ([`Scene`]) that are exact polyhedra with an analytic texture, meshes of
//! any number of faces that are exactly those polyhedra ([`Refinement`], [`write_ply`]).

mod placement;
mod caster;
mod oracle;
mod photograph;
mod placement;
mod plane;
mod ply;
mod random;
mod refine;
mod scene;
mod shot;
mod texture;

pub use caster::{CastHit, Caster};
pub use oracle::{Oracle, Outcome, Sight, Verdict};
pub use photograph::{Depth, SKY, Sampling, photograph};
pub use placement::Placement;
pub use plane::PlaneSpec;
pub use ply::{PlyOptions, PlyScalar, write_ply};
pub use random::Random;
pub use refine::Refinement;
pub use scene::{Figure, Opening, Patch, Scene, SceneBuilder};
pub use shot::{CameraSpec, Shot, photos};
pub use texture::{Part, Texture};
