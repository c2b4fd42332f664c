//! XML as other tools write it, read whole into elements, each asked through its [`Node`].
//!
//! In: a file. Out: its elements with the line of each. Promises: nothing beyond the limits of [`read_xml`] is held;
//! no document type, so no entity but the five of XML itself is ever expanded; names stand without their prefix.

mod element;
mod read;

pub(super) use element::Node;
pub(super) use read::read_xml;

#[cfg(test)]
mod tests;
