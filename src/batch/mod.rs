//! (stage batch)
