//! What stands in a foreign file: its bytes, or what gzip or Zstandard made of them.
//!
//! In: a file, known by its first bytes. Out: a stream, decompressed as it is read, from the start each time. Memory:
//! the window of the decompressor, at most 8 MiB, however large the content is. A stream that is cut or damaged is an
//! error, never a short content.

use std::fmt;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use flate2::read::MultiGzDecoder;

use crate::{Error, Result};

/// Greatest window of a Zstandard stream, as a power of two: that of `zstd -19`. Windows up to 2 GiB are for the
/// options `--ultra` and `--long`.
const ZSTD_WINDOW_LOG2: u32 = 23;

/// How a file is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compression {
    /// Not at all.
    None,
    /// gzip, perhaps of several members.
    Gzip,
    /// Zstandard, perhaps of several frames.
    Zstd,
}

impl Compression {
    /// The compression of a file that begins with `head`.
    pub(super) fn of(head: &[u8]) -> Self {
        match head {
            [0x1f, 0x8b, 8, ..] => Self::Gzip,
            [0x28, 0xb5, 0x2f, 0xfd, ..] => Self::Zstd,
            _ => Self::None,
        }
    }
}

/// The content of a file, read forwards.
pub(super) enum Content<'a> {
    File(File),
    Gzip(Box<MultiGzDecoder<File>>),
    Zstd(Box<zstd::Decoder<'static, BufReader<File>>>),
    Memory(&'a [u8]),
}

impl Content<'_> {
    /// The content of a file, decompressed if its first bytes say so, and how many bytes the file itself has.
    pub(super) fn open(path: &Path) -> Result<(Self, u64)> {
        let io = |e| Error::io(path, e);
        let mut file = File::open(path).map_err(io)?;
        let file_bytes = file.metadata().map_err(io)?.len();
        let mut head = Vec::new();
        Read::by_ref(&mut file).take(4).read_to_end(&mut head).map_err(io)?;
        file.seek(SeekFrom::Start(0)).map_err(io)?;
        let content = match Compression::of(&head) {
            Compression::None => Self::File(file),
            Compression::Gzip => Self::Gzip(Box::new(MultiGzDecoder::new(file))),
            Compression::Zstd => {
                let mut decoder = zstd::Decoder::new(file).map_err(io)?;
                decoder.window_log_max(ZSTD_WINDOW_LOG2).map_err(io)?;
                Self::Zstd(Box::new(decoder))
            }
        };
        Ok((content, file_bytes))
    }

    /// How it is compressed.
    pub(super) fn compression(&self) -> Compression {
        match self {
            Self::File(_) | Self::Memory(_) => Compression::None,
            Self::Gzip(_) => Compression::Gzip,
            Self::Zstd(_) => Compression::Zstd,
        }
    }

    /// The error for a reading of the file at `path` that failed behind `offset` bytes of content.
    #[cold]
    pub(super) fn error(&self, path: &Path, offset: u64, error: io::Error) -> Error {
        let stream = match self.compression() {
            Compression::Gzip => "gzip",
            Compression::Zstd => "Zstandard",
            Compression::None => return Error::io(path, error),
        };
        // The system's own errors are not the stream's.
        if error.raw_os_error().is_some() {
            return Error::io(path, error);
        }
        let said = error.to_string();
        if said.contains("too much memory") {
            let window = 1 << (ZSTD_WINDOW_LOG2 - 20);
            return Error::Unsupported {
                path: path.to_path_buf(),
                what: format!("a Zstandard window above {window} MiB"),
                hint: Some("compress it without --ultra and --long".to_owned()),
            };
        }
        let place = format!("{stream} stream, behind byte {offset} of its content");
        let found = match error.kind() {
            io::ErrorKind::UnexpectedEof => "the end of the file".to_owned(),
            _ => said,
        };
        Error::corrupt(path, place, "a whole stream", found)
    }
}

impl Read for Content<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(out),
            Self::Gzip(decoder) => decoder.read(out),
            Self::Zstd(decoder) => decoder.read(out),
            Self::Memory(bytes) => bytes.read(out),
        }
    }
}

impl fmt::Debug for Content<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Content({:?})", self.compression())
    }
}
