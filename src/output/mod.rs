//! (stage output)
