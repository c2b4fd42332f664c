//! (stage visibility)
