//! groundel: true orthoimages from a 3-D surface mesh and oriented photographs.
//!
//! *Groundel*: a ground element, the surface unit that one mosaic pixel shows (Grammatikopoulos et al. 2004,
//! after "pixel"). Every pixel of the mosaic is coloured from the original photographs, by a rule that looks at
//! nothing but the plan and the pixel. This page is the architecture document.
//!
//! # The data path
//!
//! ```text
//! meshes, point clouds, cameras, photos      input, frame, camera
//!   → TIN, mesh store, photo store           store     immutable files, in pieces that fit the memory
//!   → plan                                   plan      the mosaic's extent and pixel size; what cannot be made is refused
//!   → for each tile                          render    threads, caches, the memory budget
//!       which face each pixel shows          surface
//!       which photos see that point          visibility
//!       their colours there                  sample
//!       one pixel of them                    blend
//!   → part files → mosaic, layers            batch, output
//!   → what was found                         report
//! ```
//!
//! Whatever is global is solved once, before the first tile, and stands in the plan. A tile is then a pure
//! function of the plan and its number, so that any thread may compute it, in any order, to the same bytes.
//!
//! # The modules, in reading order
//!
//! Each may name only the modules in its last column, and [`Error`] and [`Result`]; `tests/architecture.rs`
//! holds the source to this table. The stages are [`surface`], [`visibility`], [`sample`] and [`blend`]:
//! functions of values, without I/O, threads, clock or environment.
//!
//! | module | what it is | may use |
//! |---|---|---|
//! | [`geom`] | points, rectangles, boxes, exact predicates, borrowed blocks of faces | – |
//! | [`image`] | row-major pixel buffers, owned and borrowed | geom |
//! | [`camera`] | lens models and pose | geom |
//! | [`frame`] | what the mosaic is drawn on; mosaic ↔ ground | geom camera |
//! | [`raster`] | triangle scan conversion and fill rule, lines through triangles; knows no mesh and no photo | geom image |
//! | [`synthetic`] | analytic scenes with known answers, for the demo, tests and benches | geom image camera frame |
//! | [`input`] | foreign formats, checked at the door, streamed | geom camera frame |
//! | [`store`] | our immutable files: TINs of point clouds, mesh partitions, photo tiles and indexes | geom image camera input |
//! | [`plan`] | default plane, extent and pixel size, what is needed of each photo, and the checks before the first tile | geom camera frame store |
//! | [`surface`] | what the projection sees: elevation and face per mosaic pixel | geom image frame raster |
//! | [`visibility`] | where one photo sees that surface | geom image camera frame raster surface |
//! | [`sample`] | colour of the visible pixels from one photo window | geom image visibility |
//! | [`tone`] | exposure, white balance and vignetting of photos: model, robust solution, application | geom |
//! | [`blend`] | many samples → one pixel: outliers, weights | geom image sample |
//! | [`output`] | tiled BigTIFF/GeoTIFF/COG, overviews, frame sidecars; knows no rendering | geom image frame |
//! | [`render`] | joins the stages for one tile; threads, caches, memory budget | geom image camera frame store plan surface visibility sample tone blend |
//! | [`batch`] | manifest, parts, resume and assembly of tile batches | geom image store plan render output |
//! | [`report`] | what a run found, as JSON and as a short text | geom image plan |
//! | [`cli`] | `Args` (as typed) → `Config` (as built) → command; the only module that prints | all but the stages |
//!
//! # Promises
//!
//! 1. **Memory**: a cap on the resident memory of the process, whatever the size of mesh, photos and mosaic;
//!    what cannot be done within it is refused before the start.
//! 2. **Bit-exact**: same inputs and settings, same bytes, for any number of threads, memory cap and order;
//!    same pixels for any tile size.
//! 3. **Exact visibility**: which face a pixel shows, whether a photo sees it and which pyramid level is sampled
//!    are decided by tests in `f64` on the pixel, the face and the photo alone. An acceleration may only skip
//!    what it proves.
//! 4. **Nothing lost**: no half-written file under a final name.
//! 5. **No silent wrong picture**: a missing photo, a cut file, a hole or a NaN is reported, counted, and shows
//!    in the exit code.
//! 6. **Exact georeference**: a pixel size of 0.01 is 0.01 in the file, to the last bit.
//!
//! # Frames of coordinates
//!
//! `ground`: project metres, `f64`. `local`: ground minus the mesh store's origin. `camera`: metres, x right,
//! y down, z forward. `photo` and `mosaic`: pixels, the centre of the top-left one at (0.5, 0.5). Transforms are
//! named destination-from-source: `photo_from_ground`.

pub mod batch;
pub mod blend;
pub mod camera;
pub mod cli;
mod error;
pub mod frame;
pub mod geom;
pub mod image;
pub mod input;
pub mod output;
pub mod plan;
pub mod raster;
pub mod render;
pub mod report;
pub mod sample;
pub mod store;
pub mod surface;
pub mod synthetic;
pub mod tone;
pub mod visibility;

pub use error::{Error, Result};
