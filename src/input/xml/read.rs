//! [`read_xml`]: from bytes to elements, within limits.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::escape::resolve_predefined_entity;
use quick_xml::events::{BytesRef, BytesStart, Event};
use quick_xml::reader::Reader;

use super::element::{Element, Node};
use crate::{Error, Result};

/// The greatest file, bytes: a hundred thousand cameras with all that Metashape says of them.
const MAX_BYTES: u64 = 1 << 29;
/// The greatest tag or stretch of text, bytes.
const MAX_TOKEN: u64 = 1 << 22;
/// The deepest nesting of elements.
const MAX_DEPTH: usize = 64;
/// The most elements that are held: some 200 bytes each.
const MAX_ELEMENTS: u64 = 4_000_000;

/// A document.
#[derive(Debug)]
pub(in crate::input) struct Document<'a> {
    path: &'a Path,
    root: Element,
}

impl Document<'_> {
    /// Its outermost element.
    pub(in crate::input) fn root(&self) -> Node<'_> {
        Node { path: self.path, element: &self.root }
    }
}

/// Reads the document at `path` without the elements named in `skip`, nor what is in them.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Corrupt`] with the line for what is not well-formed, not UTF-8, has a
/// document type or an entity of its own; [`Error::Limit`] for a file, a tag, a nesting or a number of elements beyond any
/// that a camera file needs.
pub(in crate::input) fn read_xml<'a>(path: &'a Path, skip: &[&str]) -> Result<Document<'a>> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let found = file.metadata().map_err(|e| Error::io(path, e))?.len();
    if found > MAX_BYTES {
        return Err(limit(path, "bytes", MAX_BYTES, found));
    }
    let source = Source { inner: BufReader::new(file.take(MAX_BYTES)), line: 1, token: 0 };
    let mut reader = Reader::from_reader(source);
    let mut tree =
        Tree { path, skip, open: Vec::new(), depth: 0, skipped: None, count: 0, root: None };
    let mut buffer = Vec::new();
    loop {
        buffer.clear();
        reader.get_mut().token = 0;
        let event = reader.read_event_into(&mut buffer);
        let line = reader.get_ref().line;
        match event {
            Ok(Event::Eof) => break,
            Ok(event) => tree.take(event, line)?,
            Err(quick_xml::Error::Io(e)) if reader.get_ref().token > MAX_TOKEN => {
                let what = format!("bytes of {e}, line {line}");
                return Err(limit(path, &what, MAX_TOKEN, reader.get_ref().token));
            }
            Err(quick_xml::Error::Io(e)) => {
                return Err(Error::io(path, io::Error::new(e.kind(), e)));
            }
            Err(e) => {
                return Err(Error::corrupt(
                    path,
                    format!("line {line}"),
                    "well-formed XML",
                    e.to_string(),
                ));
            }
        }
    }
    let line = reader.get_ref().line;
    tree.finish(line)
}

fn limit(path: &Path, what: &str, limit: u64, found: u64) -> Error {
    Error::Limit { what: format!("{}: {what}", path.display()), limit, found }
}

/// A file that counts lines and the bytes of the current token.
struct Source {
    inner: BufReader<io::Take<File>>,
    line: u64,
    token: u64,
}

impl Read for Source {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(to)?;
        self.consume(read);
        Ok(read)
    }
}

impl BufRead for Source {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.token > MAX_TOKEN {
            return Err(io::Error::other("one tag or text"));
        }
        self.inner.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        let passed = self.inner.buffer().get(..count).unwrap_or_default();
        self.line += passed.iter().map(|&b| u64::from(b == b'\n')).sum::<u64>();
        self.token += count as u64;
        self.inner.consume(count);
    }
}

/// The elements that are open, and the root once it is closed.
struct Tree<'a, 'b> {
    path: &'a Path,
    skip: &'b [&'b str],
    open: Vec<Element>,
    /// Open elements, skipped ones too.
    depth: usize,
    /// The depth outside the element that is skipped, if one is.
    skipped: Option<usize>,
    count: u64,
    root: Option<Element>,
}

impl<'a> Tree<'a, '_> {
    fn take(&mut self, event: Event, line: u64) -> Result<()> {
        match event {
            Event::Start(tag) => self.start(&tag, line),
            Event::Empty(tag) => {
                self.start(&tag, line)?;
                self.end();
                Ok(())
            }
            Event::End(_) => {
                self.end();
                Ok(())
            }
            Event::Text(text) => self.text(&text.xml_content(XmlVersion::Implicit1_0), line),
            Event::CData(text) => self.text(&text.xml_content(XmlVersion::Implicit1_0), line),
            Event::GeneralRef(reference) => {
                let text = self.resolved(&reference, line)?;
                self.text(&text, line)
            }
            Event::DocType(_) => {
                Err(self.corrupt(line, "a document without a document type", "<!DOCTYPE"))
            }
            Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::Eof => Ok(()),
        }
    }

    fn start(&mut self, tag: &BytesStart, line: u64) -> Result<()> {
        let name = tag.local_name().as_ref().to_owned();
        if self.depth == MAX_DEPTH {
            return Err(limit(
                self.path,
                &format!("nested elements, line {line}"),
                MAX_DEPTH as u64,
                MAX_DEPTH as u64 + 1,
            ));
        }
        self.depth += 1;
        if self.skipped.is_some() {
            return Ok(());
        }
        if self.skip.contains(&name.as_str()) {
            self.skipped = Some(self.depth - 1);
            return Ok(());
        }
        if self.root.is_some() {
            return Err(self.corrupt(
                line,
                "one outermost element",
                format!("<{name}> after its end"),
            ));
        }
        self.count += 1;
        if self.count > MAX_ELEMENTS {
            return Err(limit(self.path, "elements", MAX_ELEMENTS, self.count));
        }
        let mut attributes = Vec::new();
        for attribute in tag.attributes() {
            let wrong = |e: &dyn std::fmt::Display| {
                self.corrupt(line, format!("well-formed attributes of <{name}>"), e.to_string())
            };
            let attribute = attribute.map_err(|e| wrong(&e))?;
            let value =
                attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|e| wrong(&e))?;
            attributes.push((attribute.key.local_name().as_ref().to_owned(), value.into_owned()));
        }
        self.open.push(Element { name, line, attributes, ..Element::default() });
        Ok(())
    }

    /// Closes the innermost element; that its name is right has been checked.
    fn end(&mut self) {
        self.depth = self.depth.saturating_sub(1);
        if let Some(outside) = self.skipped {
            if self.depth == outside {
                self.skipped = None;
            }
            return;
        }
        let Some(closed) = self.open.pop() else { return };
        match self.open.last_mut() {
            Some(parent) => parent.children.push(closed),
            None => self.root = Some(closed),
        }
    }

    fn text(&mut self, text: &str, line: u64) -> Result<()> {
        if self.skipped.is_some() {
            return Ok(());
        }
        match self.open.last_mut() {
            Some(element) => element.text.push_str(text),
            None if text.trim().is_empty() => {}
            None => return Err(self.corrupt(line, "an element", "text outside all elements")),
        }
        Ok(())
    }

    /// The text of a reference: a character, or one of the five entities of XML.
    fn resolved(&self, reference: &BytesRef, line: u64) -> Result<String> {
        let character = reference
            .resolve_char_ref()
            .map_err(|e| self.corrupt(line, "a character reference", e.to_string()))?;
        if let Some(character) = character {
            return Ok(character.to_string());
        }
        let name: &str = reference;
        let known = resolve_predefined_entity(name).map(str::to_owned);
        known.ok_or_else(|| self.corrupt(line, "an entity of XML itself", format!("&{name};")))
    }

    fn finish(self, line: u64) -> Result<Document<'a>> {
        if let Some(open) = self.open.last() {
            let found = "the end of the file";
            return Err(self.corrupt(
                line,
                format!("the end of <{}>, line {}", open.name, open.line),
                found,
            ));
        }
        match self.root {
            Some(root) => Ok(Document { path: self.path, root }),
            None => Err(self.corrupt(line, "an element", "the end of the file")),
        }
    }

    fn corrupt(&self, line: u64, expected: impl Into<String>, found: impl Into<String>) -> Error {
        Error::corrupt(self.path, format!("line {line}"), expected, found)
    }
}
