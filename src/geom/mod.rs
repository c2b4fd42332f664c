//! Points, rectangles, boxes and exact predicates: the vocabulary of every other module.
//!
//! Frames of coordinates, all right-handed: `ground` (project metres, f64); `local` = ground minus the mesh
//! store's origin, exact on the store's lattice; `camera` (metres, x right, y down, z forward); `photo`
//! (pixels, the top-left pixel's *centre* at (0.5, 0.5)); `mosaic` (pixels, likewise). Rectangles are half-open.

mod bounds;
mod coordinates;
mod faces;
mod hilbert;
mod lanes;
mod memory;
mod mesh_source;
mod point_source;
mod predicates;
mod rect;

pub use bounds::{Bounds2, Bounds3};
pub use coordinates::Coordinates;
pub use faces::{FaceBlock, FaceId};
pub use hilbert::{hilbert2, hilbert3, hilbert3_lanes};
pub use lanes::{Kernel, LANES, run_baseline, run_widest};
pub use memory::held_bytes;
pub use mesh_source::{
    FaceStream, MeshSource, PolygonFan, TriangleChunk, VertexStream, f32_spacing,
};
pub use point_source::{POINT_LIMIT_M, PointSource, PointStream};
pub use predicates::{incircle, orient2d};
pub use rect::{HaloRect, PixelRect, Size};
