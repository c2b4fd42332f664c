//! [`Node`]: an element of a document, and what is asked of it.

use std::path::Path;

use crate::{Error, Result};

/// An element.
#[derive(Debug, Default)]
pub(super) struct Element {
    pub(super) name: String,
    /// The line on which its start tag ends, the first being 1.
    pub(super) line: u64,
    pub(super) attributes: Vec<(String, String)>,
    /// Its text without that of its children.
    pub(super) text: String,
    pub(super) children: Vec<Self>,
}

/// An element of the document at a path.
#[derive(Debug, Clone, Copy)]
pub(in crate::input) struct Node<'a> {
    pub(super) path: &'a Path,
    pub(super) element: &'a Element,
}

impl<'a> Node<'a> {
    /// Its name, without prefix.
    pub(in crate::input) fn name(self) -> &'a str {
        &self.element.name
    }

    /// Where it stands, for errors.
    pub(in crate::input) fn place(self) -> String {
        format!("line {}", self.element.line)
    }

    /// An error at this element.
    pub(in crate::input) fn corrupt(
        self,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Error {
        Error::corrupt(self.path, self.place(), expected, found)
    }

    /// The value of an attribute.
    pub(in crate::input) fn attribute(self, name: &str) -> Option<&'a str> {
        let found = self.element.attributes.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str())
    }

    /// The value of an attribute that must be there.
    pub(in crate::input) fn needed_attribute(self, name: &str) -> Result<&'a str> {
        self.attribute(name).ok_or_else(|| {
            self.corrupt(format!("an attribute {name}"), format!("<{}>", self.name()))
        })
    }

    /// All children, in order.
    pub(in crate::input) fn children(self) -> impl Iterator<Item = Self> {
        self.element.children.iter().map(move |element| Self { path: self.path, element })
    }

    /// The children of that name, in order.
    pub(in crate::input) fn children_named(self, name: &str) -> impl Iterator<Item = Self> {
        self.children().filter(move |child| child.name() == name)
    }

    /// The first child of that name.
    pub(in crate::input) fn child(self, name: &str) -> Option<Self> {
        self.children().find(|child| child.name() == name)
    }

    /// The first child of that name, which must be there.
    pub(in crate::input) fn needed_child(self, name: &str) -> Result<Self> {
        self.child(name).ok_or_else(|| {
            self.corrupt(format!("an element <{name}>"), format!("<{}> without", self.name()))
        })
    }

    /// The first element of that name below this one, at any depth, or this one.
    pub(in crate::input) fn find(self, name: &str) -> Option<Self> {
        if self.name() == name {
            return Some(self);
        }
        self.children().find_map(|child| child.find(name))
    }

    /// Its text, without blanks at either end.
    pub(in crate::input) fn text(self) -> &'a str {
        self.element.text.trim()
    }

    /// Its text as `N` finite numbers.
    pub(in crate::input) fn numbers<const N: usize>(self) -> Result<[f64; N]> {
        self.numbers_in(self.text())
    }

    /// `text`, which belongs to this element, as `N` finite numbers.
    pub(in crate::input) fn numbers_in<const N: usize>(self, text: &str) -> Result<[f64; N]> {
        let expected = || match N {
            1 => format!("a finite number in <{}>", self.name()),
            _ => format!("{N} finite numbers in <{}>", self.name()),
        };
        let mut numbers = [0.0; N];
        let mut words = text.split_ascii_whitespace();
        for number in &mut numbers {
            let word = words.next().ok_or_else(|| self.corrupt(expected(), "fewer"))?;
            let value: Option<f64> = word.parse().ok().filter(|v: &f64| v.is_finite());
            *number = value.ok_or_else(|| self.corrupt(expected(), format!("{word:?}")))?;
        }
        match words.next() {
            None => Ok(numbers),
            Some(word) => Err(self.corrupt(expected(), format!("{word:?} beyond them"))),
        }
    }

    /// Its text as a finite number.
    pub(in crate::input) fn number(self) -> Result<f64> {
        self.numbers::<1>().map(|[number]| number)
    }

    /// An attribute that must be there, as a whole number.
    pub(in crate::input) fn whole_attribute(self, name: &str) -> Result<u32> {
        let text = self.needed_attribute(name)?;
        text.trim().parse().ok().ok_or_else(|| {
            self.corrupt(format!("a whole number as attribute {name}"), format!("{text:?}"))
        })
    }
}
