//! (stage synthetic)
