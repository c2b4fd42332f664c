//! Reading TOML files, with errors that name the line; the frame file.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use serde::de::DeserializeOwned;
use toml::de::DeTable;

use crate::frame::{FrameError, FrameSpec, FrameTable};
use crate::{Error, Result};

/// The greatest frame or project file, bytes: a thousand times what one needs.
const MAX_BYTES: u64 = 1 << 20;

/// A TOML file's text, and the way from its keys to its lines.
pub(super) struct TomlFile<'a> {
    path: &'a Path,
    text: String,
}

/// Reads and checks a frame file.
///
/// # Errors
/// [`Error::Io`] if it cannot be read; [`Error::Limit`] above 1 MiB; [`Error::Corrupt`] with line and key if it is not TOML,
/// has an unknown key, or a value that makes no sense.
pub fn read_frame(path: impl AsRef<Path>) -> Result<FrameSpec> {
    let file = TomlFile::read(path.as_ref())?;
    let table: FrameTable = file.parse("a frame file")?;
    table.check().map_err(|e| file.frame_error(&[], &e))
}

impl<'a> TomlFile<'a> {
    pub(super) fn read(path: &'a Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, e))?;
        let mut bytes = Vec::new();
        file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, e))?;
        if bytes.len() as u64 > MAX_BYTES {
            let what = format!("{}: bytes of a TOML file", path.display());
            return Err(Error::Limit { what, limit: MAX_BYTES, found: bytes.len() as u64 });
        }
        let text = String::from_utf8(bytes).map_err(|e| {
            let place = format!("byte {}", e.utf8_error().valid_up_to());
            Error::corrupt(path, place, "text in UTF-8", "other bytes")
        })?;
        Ok(Self { path, text })
    }

    /// The file as a `T`; `what` it should be, for the error.
    pub(super) fn parse<T: DeserializeOwned>(&self, what: &str) -> Result<T> {
        toml::from_str(&self.text).map_err(|e| {
            let place = match e.span() {
                Some(span) => format!("line {}", self.line_at(span.start)),
                None => "the whole".to_owned(),
            };
            Error::corrupt(self.path, place, what, e.message().replace('\n', "; "))
        })
    }

    /// A frame's error, with the line of its key in the table at `table` (empty: the whole file).
    pub(super) fn frame_error(&self, table: &[&str], error: &FrameError) -> Error {
        let keys = [table, &[error.key]].concat();
        let name = keys.join(".");
        // A key that is missing has no line; that of its table is the next best.
        let line = self.line_of(&keys).or_else(|| self.line_of(table));
        let place = match line {
            Some(line) => format!("line {line}, key `{name}`"),
            None => format!("key `{name}`"),
        };
        Error::corrupt(self.path, place, error.expected.clone(), error.found.clone())
    }

    /// The line on which a key stands, the first being 1.
    fn line_of(&self, keys: &[&str]) -> Option<usize> {
        let (last, tables) = keys.split_last()?;
        let root = DeTable::parse(&self.text).ok()?;
        let table = tables.iter().try_fold(root.get_ref(), |table, key| {
            let (_, value) = table.iter().find(|(k, _)| k.get_ref() == key)?;
            value.get_ref().as_table()
        })?;
        let (key, _) = table.iter().find(|(k, _)| k.get_ref() == last)?;
        Some(self.line_at(key.span().start))
    }

    fn line_at(&self, byte: usize) -> usize {
        1 + self.text.bytes().take(byte).filter(|&b| b == b'\n').count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(text: &[u8]) -> Result<FrameSpec> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.toml");
        std::fs::write(&path, text).unwrap();
        read_frame(&path)
    }

    fn message(text: &str) -> String {
        let error = frame(text.as_bytes()).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        error.to_string()
    }

    #[test]
    fn a_frame_files_errors_name_line_and_key() {
        let good = "kind = \"plane\"\norigin = [0, 0, 0]\nu_axis = [1, 0, 0]\nv_axis = [0, 1, 0]\n";
        assert!(matches!(frame(good.as_bytes()), Ok(FrameSpec::Plane(_))));

        let e = message(&format!("{good}pixel_sise = 0.1\n"));
        assert!(e.contains("f.toml: line 5:") && e.contains("pixel_sise"), "{e}");
        let e = message(&good.replace("[0, 0, 0]", "[0, 0]"));
        assert!(e.contains("line 2:"), "{e}");
        let e = message(&good.replace("v_axis = [0, 1, 0]", "# that\nv_axis = [0, 0.9, 0]"));
        assert!(e.contains("line 5, key `v_axis`") && e.contains("0.9"), "{e}");
        let e = message("kind = \"plane\"\n");
        assert!(e.contains("key `origin`"), "{e}");
        let e = message("kind = \"plane\"\norigin = [0, 0\nu_axis = 3");
        assert!(e.contains("f.toml: line "), "{e}");
        let e = message("kind = \"plane\"\nkind = \"plane\"\n");
        assert!(e.contains("line 2") && e.contains("duplicate"), "{e}");
    }

    #[test]
    fn a_file_that_is_no_text_or_too_great_is_refused() {
        let e = frame(b"kind = \"pl\xff\"").unwrap_err().to_string();
        assert!(e.contains("byte 10") && e.contains("UTF-8"), "{e}");
        let big = vec![b'#'; usize::try_from(MAX_BYTES).unwrap() + 1];
        assert!(matches!(frame(&big), Err(Error::Limit { .. })));
        let missing = read_frame("/no/such/frame.toml").unwrap_err();
        assert!(matches!(missing, Error::Io { .. }) && missing.exit_code() == 2);
    }
}
