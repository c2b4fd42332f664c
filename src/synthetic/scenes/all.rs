//! The list of all test scenes.

use super::{
    columns, grid_aligned, hidden_section, huge_and_tiny, oblique, photo_inside, radial, sub_pixel,
    through_photo_plane, untidy, wide_angle,
};
use crate::synthetic::TestScene;

/// All test scenes.
pub fn all() -> Vec<TestScene> {
    [
        columns,
        oblique,
        radial,
        wide_angle,
        hidden_section,
        grid_aligned,
        sub_pixel,
        untidy,
        huge_and_tiny,
        through_photo_plane,
        photo_inside,
    ]
    .into_iter()
    .map(|make| make())
    .collect()
}
