//! JSON files of cameras, streamed: what is kept is bounded, whatever the file holds.
//!
//! In: a file and the type that it should be. Out: the value, or an error with line and column. A list or an object that
//! describes photos has a million members at most; of points and what saw them an even sample is kept.

use std::fmt;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use serde::de::{DeserializeOwned, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::cameras::{MAX_PHOTOS, Thinned};
use crate::{Error, Result};

/// Most members of a sample.
const SAMPLE: usize = 1 << 17;

/// The file at `path` as a `T`; `what` it should be, for the error.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Corrupt`] with line and column if it is no such JSON.
pub(super) fn read<T: DeserializeOwned>(path: &Path, what: &str) -> Result<T> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    serde_json::from_reader(BufReader::with_capacity(1 << 16, file)).map_err(|error| {
        if error.is_io() {
            return Error::io(path, error.into());
        }
        let place = format!("line {}, column {}", error.line(), error.column());
        let said = error.to_string();
        let said = said.rsplit_once(" at line ").map_or(&*said, |(said, _)| said);
        Error::corrupt(path, place, what, said)
    })
}

/// A number, or a text that is one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Number(pub(super) f64);

/// What something is known by: a text, or a whole number or truth value as one.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Id(pub(super) String);

/// A list of at most a million items.
pub(super) fn items<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    source: D,
) -> std::result::Result<Vec<T>, D::Error> {
    source.deserialize_seq(List(Kept::All(Vec::new())))
}

/// An even sample of a list.
pub(super) fn sampled_items<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    source: D,
) -> std::result::Result<Vec<T>, D::Error> {
    source.deserialize_seq(List(Kept::Evenly(Thinned::new(SAMPLE))))
}

/// An object of at most a million members, in order; keys may repeat.
pub(super) fn members<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    source: D,
) -> std::result::Result<Vec<(String, T)>, D::Error> {
    source.deserialize_map(Object(Kept::All(Vec::new())))
}

/// An even sample of an object's members.
pub(super) fn sampled_members<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    source: D,
) -> std::result::Result<Vec<(String, T)>, D::Error> {
    source.deserialize_map(Object(Kept::Evenly(Thinned::new(SAMPLE))))
}

/// What is kept of a list.
enum Kept<T> {
    All(Vec<T>),
    Evenly(Thinned<T>),
}

impl<T> Kept<T> {
    fn take<E: serde::de::Error>(&mut self, item: T) -> std::result::Result<(), E> {
        match self {
            Self::All(items) if items.len() == MAX_PHOTOS => {
                return Err(E::custom(format!("more than {MAX_PHOTOS} entries")));
            }
            Self::All(items) => items.push(item),
            Self::Evenly(sample) => sample.offer(|| item),
        }
        Ok(())
    }

    fn into_items(self) -> Vec<T> {
        match self {
            Self::All(items) => items,
            Self::Evenly(sample) => sample.into_items(),
        }
    }
}

struct List<T>(Kept<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for List<T> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list")
    }

    fn visit_seq<A: SeqAccess<'de>>(
        mut self,
        mut list: A,
    ) -> std::result::Result<Vec<T>, A::Error> {
        while let Some(item) = list.next_element()? {
            self.0.take(item)?;
        }
        Ok(self.0.into_items())
    }

    /// Writers that know no types write an empty list as an empty text.
    fn visit_str<E: serde::de::Error>(self, text: &str) -> std::result::Result<Vec<T>, E> {
        if text.is_empty() {
            Ok(Vec::new())
        } else {
            Err(E::custom("expected a list, found a text"))
        }
    }

    /// A list that is not there.
    fn visit_unit<E>(self) -> std::result::Result<Vec<T>, E> {
        Ok(Vec::new())
    }
}

struct Object<T>(Kept<(String, T)>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Object<T> {
    type Value = Vec<(String, T)>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(
        mut self,
        mut object: A,
    ) -> std::result::Result<Vec<(String, T)>, A::Error> {
        while let Some(member) = object.next_entry()? {
            self.0.take(member)?;
        }
        Ok(self.0.into_items())
    }
}

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = Number;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a finite number, or a text that is one")
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> std::result::Result<Number, E> {
        Ok(Number(value))
    }

    fn visit_i64<E: serde::de::Error>(self, value: i64) -> std::result::Result<Number, E> {
        Ok(Number(value as f64))
    }

    fn visit_u64<E: serde::de::Error>(self, value: u64) -> std::result::Result<Number, E> {
        Ok(Number(value as f64))
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> std::result::Result<Number, E> {
        let value = text.trim().parse::<f64>().ok().filter(|v| v.is_finite());
        value.map(Number).ok_or_else(|| E::invalid_value(serde::de::Unexpected::Str(text), &self))
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(source: D) -> std::result::Result<Self, D::Error> {
        source.deserialize_any(NumberVisitor)
    }
}

struct IdVisitor;

impl Visitor<'_> for IdVisitor {
    type Value = Id;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a whole number or a text")
    }

    fn visit_u64<E: serde::de::Error>(self, value: u64) -> std::result::Result<Id, E> {
        Ok(Id(value.to_string()))
    }

    fn visit_bool<E: serde::de::Error>(self, value: bool) -> std::result::Result<Id, E> {
        Ok(Id(value.to_string()))
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> std::result::Result<Id, E> {
        Ok(Id(text.to_owned()))
    }
}

impl<'de> Deserialize<'de> for Id {
    fn deserialize<D: Deserializer<'de>>(source: D) -> std::result::Result<Self, D::Error> {
        source.deserialize_any(IdVisitor)
    }
}
