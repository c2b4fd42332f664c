//! Huffman tables of a JPEG (ITU-T T.81, annex C), as a scan over its codes needs them.

/// Bits that a table is looked up by; longer codes are rare.
const LOOK_BITS: u32 = 10;
/// Longest code.
const CODE_BITS: u32 = 16;
/// What the end of a block adds to the place in the block: from any place more than [`INVALID`] does.
pub(super) const END_OF_BLOCK: u32 = 128;
/// What a code that no block may hold adds to the place in the block.
const INVALID: u32 = 64;
/// Most magnitude bits of an 8-bit JPEG's coefficients: DC differences, others.
const DC_BITS: u8 = 11;
const AC_BITS: u8 = 10;

/// What a code stands for, packed: bits to take (code and magnitude, or code alone), and the meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Symbol(u16);

impl Symbol {
    const NONE: Self = Self(0);

    fn new(bits: u32, meaning: u32) -> Self {
        Self(u16::try_from(meaning << 8 | bits).unwrap_or(0))
    }

    #[inline]
    fn bits(self) -> u32 {
        u32::from(self.0 & 255)
    }

    #[inline]
    fn meaning(self) -> u32 {
        u32::from(self.0 >> 8)
    }
}

/// A table: from codes to symbols.
#[derive(Debug, Clone)]
struct Table {
    /// By the next bits; [`Symbol::NONE`] where the code is longer, or there is none.
    look: Box<[Symbol; 1 << LOOK_BITS]>,
    /// By length: the code past the last of that length, and the place of its code 0 among the symbols.
    ends: [(u32, u32); CODE_BITS as usize + 1],
    symbols: Vec<Symbol>,
}

impl Table {
    /// From the number of codes of each length and their values; `None` if they are not prefix codes.
    fn new(counts: &[u8; 16], values: &[u8], symbol: impl Fn(u8, u32) -> Symbol) -> Option<Self> {
        let mut look = Box::new([Symbol::NONE; 1 << LOOK_BITS]);
        let mut ends = [(0, 0); CODE_BITS as usize + 1];
        let mut symbols = Vec::with_capacity(values.len());
        let mut code = 0_u32;
        for (length, &count) in (1..=CODE_BITS).zip(counts) {
            let first = u32::try_from(symbols.len()).ok()?;
            for &value in values.get(symbols.len()..symbols.len() + usize::from(count))? {
                if code >> length != 0 {
                    return None;
                }
                let symbol = symbol(value, length);
                if length <= LOOK_BITS {
                    let span = 1 << (LOOK_BITS - length);
                    let from = (code as usize) * span;
                    look[from..from + span].fill(symbol);
                }
                symbols.push(symbol);
                code += 1;
            }
            ends[length as usize] = (code, first.wrapping_sub(code - u32::from(count)));
            code <<= 1;
        }
        (symbols.len() == values.len()).then_some(Self { look, ends, symbols })
    }

    /// The symbol at the head of `bits`, the next ones from the highest; [`Symbol::NONE`] if there is no such code.
    #[inline]
    fn symbol(&self, bits: u64) -> Symbol {
        let symbol = self.look[(bits >> (64 - LOOK_BITS)) as usize];
        if symbol == Symbol::NONE { self.long(bits) } else { symbol }
    }

    #[cold]
    #[inline(never)]
    fn long(&self, bits: u64) -> Symbol {
        let found = (LOOK_BITS + 1..=CODE_BITS).find_map(|length| {
            let code = u32::try_from(bits >> (64 - length)).ok()?;
            let (end, first) = self.ends[length as usize];
            // Codes of a length are consecutive; shorter ones are less.
            (code < end).then(|| self.symbols.get(first.wrapping_add(code) as usize).copied())
        });
        found.flatten().unwrap_or(Symbol::NONE)
    }
}

/// A table of DC differences.
#[derive(Debug, Clone)]
pub(super) struct DcTable(Table);

impl DcTable {
    pub(super) fn new(counts: &[u8; 16], values: &[u8]) -> Option<Self> {
        let symbol = |value: u8, length: u32| {
            let is_valid = value <= DC_BITS;
            Symbol::new(length, if is_valid { u32::from(value) + 1 } else { INVALID })
        };
        Table::new(counts, values, symbol).map(Self)
    }

    /// Bits of the code and of the magnitude that follows it; `None` if there is no such code.
    #[inline]
    pub(super) fn code(&self, bits: u64) -> Option<(u32, u32)> {
        let symbol = self.0.symbol(bits);
        let meaning = symbol.meaning();
        (meaning.wrapping_sub(1) <= u32::from(DC_BITS)).then(|| (symbol.bits(), meaning - 1))
    }
}

/// A table of the other coefficients.
#[derive(Debug, Clone)]
pub(super) struct AcTable(Table);

impl AcTable {
    pub(super) fn new(counts: &[u8; 16], values: &[u8]) -> Option<Self> {
        let symbol = |value: u8, length: u32| {
            let (run, size) = (u32::from(value >> 4), value & 15);
            match (run, size) {
                (0, 0) => Symbol::new(length, END_OF_BLOCK),
                (15, 0) => Symbol::new(length, 16),
                (_, 1..=AC_BITS) => Symbol::new(length + u32::from(size), run + 1),
                _ => Symbol::new(length, INVALID),
            }
        };
        Table::new(counts, values, symbol).map(Self)
    }

    /// Bits of the code with its magnitude, and what they add to the place in the block: more than 64 at its end. A code
    /// that no block may hold leaves the place between 65 and 127.
    #[inline]
    pub(super) fn code(&self, bits: u64) -> (u32, u32) {
        let symbol = self.0.symbol(bits);
        if symbol == Symbol::NONE { (0, INVALID) } else { (symbol.bits(), symbol.meaning()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_found_short_and_long() {
        // One code of each length: 0, 10, 110, …
        let counts = [1; 16];
        let values: Vec<u8> = (0..16).map(|k| k << 4 | 1).collect();
        let table = AcTable::new(&counts, &values).unwrap();
        for length in 1..=16_u32 {
            let bits = !(u64::MAX >> (length - 1));
            assert_eq!(table.code(bits), (length + 1, length), "{length}");
        }
        assert_eq!(table.code(u64::MAX), (0, INVALID));
    }

    #[test]
    fn codes_that_overlap_or_lack_values_make_no_table() {
        let mut counts = [0; 16];
        counts[0] = 3;
        assert!(AcTable::new(&counts, &[0, 1, 2]).is_none());
        counts[0] = 2;
        assert!(AcTable::new(&counts, &[0]).is_none());
        assert!(AcTable::new(&counts, &[0, 1, 2]).is_none());
        assert!(AcTable::new(&counts, &[0, 1]).is_some());
    }

    #[test]
    fn magnitudes_beyond_eight_bits_and_runs_of_nothing_are_no_codes() {
        let mut counts = [0; 16];
        counts[1] = 4;
        let ac = AcTable::new(&counts, &[0x00, 0xF0, 0x50, 0x0B]).unwrap();
        let at = |code: u64| ac.code(code << 62);
        assert_eq!([at(0), at(1)], [(2, END_OF_BLOCK), (2, 16)]);
        assert_eq!([at(2).1, at(3).1], [INVALID; 2]);
        let dc = DcTable::new(&counts, &[0, 11, 12, 255]).unwrap();
        let at = |code: u64| dc.code(code << 62);
        assert_eq!([at(0), at(1), at(2), at(3)], [Some((2, 0)), Some((2, 11)), None, None]);
    }
}
