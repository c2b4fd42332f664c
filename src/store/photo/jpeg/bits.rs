//! The bits of a JPEG's entropy-coded data, read and written.

/// Bits before which the buffer is filled again: a code of 16 with a magnitude of 15 fits.
const LOW_BITS: u32 = 32;

/// Reads bits from the highest of each byte on. A zero byte after FF is skipped; a marker ends the data: zeros follow.
#[derive(Debug, Clone)]
pub(super) struct BitReader<'a> {
    data: &'a [u8],
    /// The byte that is next into the buffer.
    at: usize,
    /// The next bits, from the highest on.
    buffer: u64,
    /// Bits in the buffer.
    count: u32,
    /// Those of them, the last ones, that follow the end of the data.
    padding: u32,
}

impl<'a> BitReader<'a> {
    /// From bit `bit` (0 to 7) of the byte at `at`, which no zero to be skipped may be.
    pub(super) fn new(data: &'a [u8], at: usize, bit: u32) -> Self {
        let mut reader = Self { data, at, buffer: 0, count: 0, padding: 0 };
        reader.fill();
        reader.take(bit & 7);
        reader
    }

    /// Sees to it that 32 bits are there.
    #[inline]
    pub(super) fn need(&mut self) {
        if self.count < LOW_BITS {
            self.fill();
        }
    }

    /// The next bits, from the highest on.
    #[inline]
    pub(super) fn peek(&self) -> u64 {
        self.buffer
    }

    /// Goes on by `bits`, at most those that [`Self::need`] saw to.
    #[inline]
    pub(super) fn take(&mut self, bits: u32) {
        self.buffer = self.buffer.wrapping_shl(bits);
        self.count = self.count.wrapping_sub(bits);
    }

    #[inline]
    fn fill(&mut self) {
        if let Some(Ok(bytes)) =
            self.data.get(self.at..self.at.wrapping_add(8)).map(TryInto::try_into)
        {
            let bytes = u64::from_be_bytes(bytes);
            if !has_ff(bytes) {
                // What does not count yet comes again, the same, with the next filling.
                self.buffer |= bytes >> self.count;
                let whole = (63 - self.count) >> 3;
                self.at += whole as usize;
                self.count += whole * 8;
                return;
            }
        }
        self.fill_slowly();
    }

    #[cold]
    #[inline(never)]
    fn fill_slowly(&mut self) {
        while self.count <= 56 {
            let byte = match self.data.get(self.at..) {
                Some([0xFF, 0, ..]) => {
                    self.at += 2;
                    0xFF
                }
                None | Some([] | [0xFF, ..]) => {
                    self.padding += 8;
                    self.count += 8;
                    continue;
                }
                Some([byte, ..]) => {
                    self.at += 1;
                    *byte
                }
            };
            self.buffer |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    /// Whether more was read than there is.
    #[inline]
    pub(super) fn is_beyond(&self) -> bool {
        self.count < self.padding
    }

    /// Bits in the buffer that are data.
    fn left(&self) -> u32 {
        self.count.saturating_sub(self.padding)
    }

    /// Where the next bit is: the byte, and the bits of it already read (0 to 7).
    pub(super) fn position(&self) -> (usize, u32) {
        let bytes = self.left().div_ceil(8);
        let mut at = self.at;
        for _ in 0..bytes {
            at -= 1;
            if at > 0 && self.data.get(at - 1..=at).is_some_and(|two| two == [0xFF, 0]) {
                at -= 1;
            }
        }
        (at, bytes * 8 - self.left())
    }

    /// The byte of the marker that follows, if not one whole byte of data is left before it.
    pub(super) fn end(&self) -> Option<usize> {
        let is_marker = match self.data.get(self.at..) {
            Some([0xFF, code, ..]) => *code != 0,
            _ => false,
        };
        (self.left() < 8 && !self.is_beyond() && is_marker).then_some(self.at)
    }

    /// Goes on past restart marker `number` (0 to 7), if it follows.
    pub(super) fn restart(&mut self, number: u64) -> bool {
        let Some(mut at) = self.end() else { return false };
        while self.data.get(at + 1) == Some(&0xFF) {
            at += 1;
        }
        if self.data.get(at + 1).map(|&code| u64::from(code)) != Some(0xD0 + number % 8) {
            return false;
        }
        *self = Self::new(self.data, at + 2, 0);
        true
    }
}

/// Whether one of the bytes is FF (Mycroft 1987: a byte of the complement is zero).
#[inline]
fn has_ff(bytes: u64) -> bool {
    let inverse = !bytes;
    inverse.wrapping_sub(0x0101_0101_0101_0101) & bytes & 0x8080_8080_8080_8080 != 0
}

/// Writes bits to a stream, a zero byte after each FF.
#[derive(Debug)]
pub(super) struct BitWriter<'a> {
    out: &'a mut Vec<u8>,
    /// The last `count` bits are not written yet.
    buffer: u64,
    count: u32,
}

impl<'a> BitWriter<'a> {
    pub(super) fn new(out: &'a mut Vec<u8>) -> Self {
        Self { out, buffer: 0, count: 0 }
    }

    /// Writes the lowest `bits` (at most 32) of `value`, which has no others.
    #[inline]
    pub(super) fn put(&mut self, value: u64, bits: u32) {
        self.buffer = self.buffer.wrapping_shl(bits) | value;
        self.count = self.count.wrapping_add(bits);
        if self.count >= 32 {
            self.count -= 32;
            let word = ((self.buffer >> self.count) & 0xFFFF_FFFF) as u32;
            let bytes = word.to_be_bytes();
            if bytes.contains(&0xFF) {
                for byte in bytes {
                    self.byte(byte);
                }
            } else {
                self.out.extend_from_slice(&bytes);
            }
        }
    }

    fn byte(&mut self, byte: u8) {
        self.out.push(byte);
        if byte == 0xFF {
            self.out.push(0);
        }
    }

    /// Fills the last byte with ones.
    pub(super) fn finish(mut self) {
        let fill = self.count.wrapping_neg() & 7;
        let mut left = self.buffer << fill | ((1 << fill) - 1);
        let bytes = (self.count + fill) / 8;
        left <<= 64 - 8 * bytes.max(1);
        for byte in left.to_be_bytes().into_iter().take(bytes as usize) {
            self.byte(byte);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::Random;
    use super::*;

    #[test]
    fn bits_come_back_as_they_were_written_and_positions_lead_to_them() {
        let mut random = Random(5);
        let pieces: Vec<(u64, u32)> = (0..5000)
            .map(|_| {
                let bits = u32::try_from(random.below(32)).unwrap();
                // Mostly ones, so that FF occurs.
                let value = (random.below(1 << 31) | random.below(1 << 31)) & ((1 << bits) - 1);
                (value, bits)
            })
            .collect();
        let mut bytes = Vec::new();
        let mut writer = BitWriter::new(&mut bytes);
        for &(value, bits) in &pieces {
            writer.put(value, bits);
        }
        writer.finish();
        assert!(bytes.windows(2).filter(|w| w == &[0xFF, 0]).count() > 50);
        bytes.extend([0xFF, 0xD3, 0x12]);
        let mut reader = BitReader::new(&bytes, 0, 0);
        let read = |reader: &mut BitReader<'_>, bits: u32| {
            reader.need();
            let value = if bits == 0 { 0 } else { reader.peek() >> (64 - bits) };
            reader.take(bits);
            value
        };
        for &(value, bits) in &pieces {
            let (at, bit) = reader.position();
            assert_eq!(read(&mut BitReader::new(&bytes, at, bit), bits), value);
            assert!(reader.end().is_none() || bits < 8);
            assert_eq!(read(&mut reader, bits), value);
        }
        assert!(!reader.is_beyond());
        assert_eq!(reader.end(), Some(bytes.len() - 3));
        assert!(!reader.clone().restart(2));
        assert!(reader.restart(11));
        assert_eq!(reader.position(), (bytes.len() - 1, 0));
        assert_eq!(read(&mut reader, 8), 0x12);
        read(&mut reader, 1);
        assert!(reader.is_beyond());
    }

    #[test]
    fn every_ff_is_seen_and_nothing_else() {
        let mut random = Random(9);
        for _ in 0..20_000 {
            let bytes: [u8; 8] = std::array::from_fn(|_| match random.below(12) {
                0 => 0xFF,
                1 => 0xFE,
                2 => 0x00,
                3 => 0x7F,
                4 => 0x80,
                _ => u8::try_from(random.below(256)).unwrap(),
            });
            assert_eq!(has_ff(u64::from_be_bytes(bytes)), bytes.contains(&0xFF), "{bytes:?}");
        }
    }
}
