//! (stage render)
