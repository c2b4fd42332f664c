//! Row-major pixel buffers, owned and borrowed.
//!
//! Samples of a pixel are interleaved: an image is `height × width × channels`. Nothing here reads or writes files.

mod buffer;
mod format;
mod window;

pub use buffer::{Image, ImageView, Samples};
pub use format::{Colour, Depth};
pub use window::Window;
