//! Triangle scan conversion: which pixel centres lie in a triangle.
//!
//! In: three corners in pixel coordinates (x along the columns, y along the rows, the top-left pixel's centre at
//! (0.5, 0.5)), and a rectangle to stay in. Out: each pixel of the rectangle whose centre the triangle holds, once.
//! Promise: the decision is exact for the given f64 corners and depends on nothing but them and the pixel, so a mesh
//! whose triangles share their projected vertices is watertight: every centre in a closed fan belongs to exactly one
//! triangle. For lines that are not parallel, [`RayTriangle`] makes the same promise of coverage. Knows no mesh and no
//! photo.

mod ray;
mod scan;

pub use ray::RayTriangle;
pub use scan::{Triangle, scan};
