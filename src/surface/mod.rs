//! (stage surface)
