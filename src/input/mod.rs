//! (stage input)
