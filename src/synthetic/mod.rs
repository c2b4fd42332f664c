//! Analytic scenes with known answers, for the demo, tests and benches.
//!
//! In: parameters and seeds. Out: scenes ([`Scene`]) that are exact polyhedra with an analytic texture, meshes of
//! any number of faces that are exactly those polyhedra ([`Refinement`], [`write_ply`]).

mod placement;
mod ply;
mod random;
mod refine;
mod scene;
mod texture;

pub use placement::Placement;
pub use ply::{PlyOptions, PlyScalar, write_ply};
pub use random::Random;
pub use refine::Refinement;
pub use scene::{Figure, Opening, Patch, Scene, SceneBuilder};
pub use texture::{Part, Texture};
