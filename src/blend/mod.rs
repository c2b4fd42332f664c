//! (stage blend)
