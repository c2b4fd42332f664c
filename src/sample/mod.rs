//! (stage sample)
