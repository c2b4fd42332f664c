//! (stage raster)
