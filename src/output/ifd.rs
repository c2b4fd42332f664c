//! TIFF directories (IFDs), classic and BigTIFF, little-endian.

/// The two kinds of TIFF file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flavour {
    /// Offsets of 32 bits: files below 4 GiB.
    Classic,
    /// Offsets of 64 bits.
    Big,
}

/// A directory: entries by tag.
#[derive(Debug)]
pub(super) struct Directory {
    flavour: Flavour,
    entries: Vec<Entry>,
}

#[derive(Debug)]
struct Entry {
    tag: u16,
    kind: u16,
    count: u64,
    value: Vec<u8>,
}

const ASCII: u16 = 2;
const SHORT: u16 = 3;
const LONG: u16 = 4;
const RATIONAL: u16 = 5;
const UNDEFINED: u16 = 7;
const DOUBLE: u16 = 12;
const LONG8: u16 = 16;

impl Flavour {
    /// Header of a file whose first directory stands at `first`.
    pub(super) fn header(self, first: u64) -> Vec<u8> {
        let mut bytes = match self {
            Self::Classic => b"II\x2a\0".to_vec(),
            Self::Big => b"II\x2b\0\x08\0\0\0".to_vec(),
        };
        self.put_offset(first, &mut bytes);
        bytes
    }

    /// Bytes of an offset, and of an entry's value that stands in the entry.
    pub(super) fn offset_bytes(self) -> usize {
        match self {
            Self::Classic => 4,
            Self::Big => 8,
        }
    }

    fn put_offset(self, offset: u64, out: &mut Vec<u8>) {
        match self {
            Self::Classic => out.extend(narrow(offset).to_le_bytes()),
            Self::Big => out.extend(offset.to_le_bytes()),
        }
    }

    /// Bytes of a directory of `entries` entries, without the values that stand outside.
    fn directory_bytes(self, entries: usize) -> usize {
        match self {
            Self::Classic => 2 + 12 * entries + 4,
            Self::Big => 8 + 20 * entries + 8,
        }
    }
}

/// A value of a classic file, which is chosen only if every one of them has 32 bits.
fn narrow(v: u64) -> u32 {
    u32::try_from(v).expect("a classic file ends below 4 GiB")
}

impl Directory {
    pub(super) fn new(flavour: Flavour) -> Self {
        Self { flavour, entries: Vec::new() }
    }

    pub(super) fn shorts(&mut self, tag: u16, values: &[u16]) {
        self.add(tag, SHORT, values.len(), values.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    pub(super) fn longs(&mut self, tag: u16, values: &[u32]) {
        self.add(tag, LONG, values.len(), values.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    pub(super) fn doubles(&mut self, tag: u16, values: &[f64]) {
        self.add(tag, DOUBLE, values.len(), values.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    pub(super) fn rational(&mut self, tag: u16, numerator: u32, denominator: u32) {
        let parts = [numerator, denominator];
        self.add(tag, RATIONAL, 1, parts.iter().flat_map(|v| v.to_le_bytes()).collect());
    }

    /// Bytes that mean nothing to TIFF.
    pub(super) fn bytes(&mut self, tag: u16, bytes: &[u8]) {
        self.add(tag, UNDEFINED, bytes.len(), bytes.to_vec());
    }

    /// A text, which ends at its first NUL.
    pub(super) fn ascii(&mut self, tag: u16, text: &str) {
        let mut bytes: Vec<u8> = text.bytes().take_while(|b| *b != 0).collect();
        bytes.push(0);
        self.add(tag, ASCII, bytes.len(), bytes);
    }

    /// Offsets into the file, as wide as its flavour has them.
    pub(super) fn offsets(&mut self, tag: u16, values: &[u64]) {
        let mut bytes = Vec::with_capacity(values.len() * self.flavour.offset_bytes());
        for v in values {
            self.flavour.put_offset(*v, &mut bytes);
        }
        let kind = match self.flavour {
            Flavour::Classic => LONG,
            Flavour::Big => LONG8,
        };
        self.add(tag, kind, values.len(), bytes);
    }

    fn add(&mut self, tag: u16, kind: u16, count: usize, value: Vec<u8>) {
        self.entries.push(Entry { tag, kind, count: count as u64, value });
    }

    /// Length of the directory with all its values; even.
    pub(super) fn len(&self) -> u64 {
        let inline = self.flavour.offset_bytes();
        let outside: usize = self
            .entries
            .iter()
            .map(|e| e.value.len())
            .filter(|n| *n > inline)
            .map(|n| n.next_multiple_of(2))
            .sum();
        (self.flavour.directory_bytes(self.entries.len()) + outside) as u64
    }

    /// The directory as it stands at `at`, its outside values behind it; the next directory stands at `next`
    /// (0: there is none).
    pub(super) fn into_bytes(mut self, at: u64, next: u64) -> Vec<u8> {
        self.entries.sort_by_key(|e| e.tag);
        let inline = self.flavour.offset_bytes();
        let own = self.flavour.directory_bytes(self.entries.len());
        let mut bytes = Vec::with_capacity(own);
        let mut outside = Vec::new();
        match self.flavour {
            Flavour::Classic => {
                let count = u16::try_from(self.entries.len()).expect("some twenty entries");
                bytes.extend(count.to_le_bytes());
            }
            Flavour::Big => bytes.extend((self.entries.len() as u64).to_le_bytes()),
        }
        for entry in &self.entries {
            bytes.extend(entry.tag.to_le_bytes());
            bytes.extend(entry.kind.to_le_bytes());
            self.flavour.put_offset(entry.count, &mut bytes);
            if entry.value.len() <= inline {
                let end = bytes.len() + inline;
                bytes.extend(&entry.value);
                bytes.resize(end, 0);
            } else {
                self.flavour.put_offset(at + (own + outside.len()) as u64, &mut bytes);
                outside.extend(&entry.value);
                outside.resize(outside.len().next_multiple_of(2), 0);
            }
        }
        self.flavour.put_offset(next, &mut bytes);
        bytes.append(&mut outside);
        bytes
    }
}
