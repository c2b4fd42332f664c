//! [`Frame`]: what a JPEG's header says, of the kind of JPEG that can be read in windows.

use super::huffman::{AcTable, DcTable};
use crate::geom::Size;

/// Most bytes of the segments that are kept: tables and headers are a few hundred.
const MAX_KEPT_BYTES: usize = 1 << 14;
/// Most marker segments before the scan.
const MAX_SEGMENTS: usize = 4096;
/// Code lengths of the table by which DC differences are written: those of T.81, table K.3, and one for the greatest
/// difference between any two values. Magnitudes 0 to 12.
pub(super) const DC_COUNTS: [u8; 16] = [0, 1, 5, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0];
/// The codes of that table by magnitude, and their lengths.
pub(super) const DC_CODES: [(u64, u32); 13] = [
    (0b00, 2),
    (0b010, 3),
    (0b011, 3),
    (0b100, 3),
    (0b101, 3),
    (0b110, 3),
    (0b1110, 4),
    (0b1_1110, 5),
    (0b11_1110, 6),
    (0b111_1110, 7),
    (0b1111_1110, 8),
    (0b1_1111_1110, 9),
    (0b11_1111_1110, 10),
];

/// A block of 8 × 8 samples of an MCU: its component and its tables.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    pub(super) component: usize,
    pub(super) dc: usize,
    pub(super) ac: usize,
}

/// A baseline or extended sequential JPEG of 8 bits, all components in one scan, as its header says.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(super) size: Size,
    pub(super) channels: usize,
    /// Width and height of a minimum coded unit, pixels.
    pub(super) mcu: Size,
    /// Columns and rows of such units.
    pub(super) mcus: Size,
    /// Units between restart markers; 0: none.
    pub(super) restart: u64,
    /// The blocks of a unit, in order.
    pub(super) blocks: Vec<Block>,
    /// Tables by number.
    pub(super) dc: [Option<DcTable>; 4],
    pub(super) ac: [Option<AcTable>; 4],
    /// The header's segments that matter: they make the same frame.
    pub(super) kept: Vec<u8>,
    /// A header for windows: up to the scan, DC differences in the table above, no restart markers.
    window_header: Vec<u8>,
    /// Where the size stands in it.
    size_at: usize,
}

impl Frame {
    /// Reads a header; with the offset of the entropy-coded data. `None` for any other JPEG, and for a header that is
    /// unusual or not in order: an ordinary decoder is to judge it.
    pub(super) fn parse(bytes: &[u8]) -> Option<(Self, usize)> {
        let mut parts = Parts::default();
        let mut at = 2;
        if bytes.get(..2)? != [0xFF, 0xD8] {
            return None;
        }
        for _ in 0..MAX_SEGMENTS {
            if *bytes.get(at)? != 0xFF {
                return None;
            }
            while *bytes.get(at + 1)? == 0xFF {
                at += 1;
            }
            let length =
                usize::from(u16::from_be_bytes([*bytes.get(at + 2)?, *bytes.get(at + 3)?]));
            let whole = bytes.get(at..at + 2 + length)?;
            at += 2 + length;
            if parts.segment(whole)? == Scan::Begins {
                return Some((parts.frame()?, at));
            }
        }
        None
    }

    /// The header of a window of so many pixels.
    pub(super) fn write_header(&self, size: Size, out: &mut Vec<u8>) {
        let begin = out.len();
        out.extend_from_slice(&self.window_header);
        let side = |side: u32| u16::try_from(side).unwrap_or(u16::MAX).to_be_bytes();
        let at = begin + self.size_at;
        out[at..at + 2].copy_from_slice(&side(size.height));
        out[at + 2..at + 4].copy_from_slice(&side(size.width));
    }

    /// Whether a restart marker stands before unit `index`, counted along the rows; its number.
    pub(super) fn restart_before(&self, index: u64) -> Option<u64> {
        (self.restart > 0 && index > 0 && index.is_multiple_of(self.restart))
            .then(|| index / self.restart - 1)
    }
}

#[derive(Debug, PartialEq, Eq)]
enum Scan {
    Comes,
    Begins,
}

/// What was read so far.
#[derive(Debug, Default)]
struct Parts {
    size: Option<Size>,
    /// Number, factors across and down of each component.
    components: Vec<(u8, u32, u32)>,
    restart: u64,
    dc: [Option<DcTable>; 4],
    ac: [Option<AcTable>; 4],
    /// Tables of each component, by the scan.
    tables: Vec<(usize, usize)>,
    has_adobe: bool,
    kept: Vec<u8>,
    window_header: Vec<u8>,
    size_at: usize,
}

impl Parts {
    /// Takes a segment, marker and length included.
    fn segment(&mut self, whole: &[u8]) -> Option<Scan> {
        let (code, payload) = (whole[1], whole.get(4..)?);
        match code {
            0xC0 | 0xC1 => self.start_of_frame(payload)?,
            0xC4 => self.huffman_tables(payload)?,
            0xDA => self.start_of_scan(payload)?,
            0xDD => {
                let &[high, low] = payload else { return None };
                self.restart = u16::from_be_bytes([high, low]).into();
            }
            // Adobe's: it says how colours are stored. Two of them might contradict each other.
            0xEE if std::mem::replace(&mut self.has_adobe, true) => return None,
            0xDB | 0xEE => {}
            // Other applications' segments and comments say nothing about samples.
            0xE0..=0xEF | 0xFE => return Some(Scan::Comes),
            _ => return None,
        }
        if self.kept.is_empty() {
            self.kept.extend([0xFF, 0xD8]);
            self.window_header.extend([0xFF, 0xD8]);
        }
        self.kept.extend_from_slice(whole);
        if code == 0xDA {
            self.write_dc_tables();
        }
        if matches!(code, 0xC0 | 0xC1) {
            self.size_at = self.window_header.len() + 5;
        }
        if code != 0xDD {
            self.window_header.extend_from_slice(whole);
        }
        let is_small = self.kept.len() <= MAX_KEPT_BYTES;
        is_small.then_some(if code == 0xDA { Scan::Begins } else { Scan::Comes })
    }

    fn start_of_frame(&mut self, payload: &[u8]) -> Option<()> {
        let &[8, h1, h0, w1, w0, count, ref components @ ..] = payload else { return None };
        let side = |high, low| u32::from(u16::from_be_bytes([high, low]));
        let size = Size::new(side(w1, w0), side(h1, h0));
        if self.size.replace(size).is_some()
            || size.area() == 0
            || !matches!(count, 1 | 3)
            || components.len() != 3 * usize::from(count)
        {
            return None;
        }
        let component = |c: &[u8]| (c[0], u32::from(c[1] >> 4), u32::from(c[1] & 15));
        self.components = components.chunks_exact(3).map(component).collect();
        let (across, down) = (self.components[0].1, self.components[0].2);
        let is_usual = |&(_, h, v): &(u8, u32, u32)| {
            (1..=4).contains(&h)
                && (1..=4).contains(&v)
                && across.is_multiple_of(h)
                && down.is_multiple_of(v)
        };
        let is_single = count > 1 || (across, down) == (1, 1);
        (self.components.iter().all(is_usual) && is_single).then_some(())
    }

    fn huffman_tables(&mut self, mut payload: &[u8]) -> Option<()> {
        while let Some((&class, rest)) = payload.split_first() {
            let counts: &[u8; 16] = rest.first_chunk()?;
            let total = counts.iter().map(|&n| usize::from(n)).sum::<usize>();
            let values = rest.get(16..16 + total)?;
            payload = &rest[16 + total..];
            let number = usize::from(class & 15);
            match class >> 4 {
                0 => *self.dc.get_mut(number)? = Some(DcTable::new(counts, values)?),
                1 => *self.ac.get_mut(number)? = Some(AcTable::new(counts, values)?),
                _ => return None,
            }
        }
        Some(())
    }

    fn start_of_scan(&mut self, payload: &[u8]) -> Option<()> {
        let (&count, rest) = payload.split_first()?;
        let (components, spectral) = rest.split_at_checked(2 * usize::from(count))?;
        if spectral != [0, 63, 0] || usize::from(count) != self.components.len() {
            return None;
        }
        for (chosen, component) in components.chunks_exact(2).zip(&self.components) {
            let (dc, ac) = (usize::from(chosen[1] >> 4), usize::from(chosen[1] & 15));
            let has_tables = self.dc.get(dc)?.is_some() && self.ac.get(ac)?.is_some();
            if chosen[0] != component.0 || !has_tables {
                return None;
            }
            self.tables.push((dc, ac));
        }
        let mut numbers: Vec<_> = self.components.iter().map(|c| c.0).collect();
        numbers.sort_unstable();
        numbers.dedup();
        (numbers.len() == self.components.len()).then_some(())
    }

    /// Defines the DC tables that the scan uses anew.
    fn write_dc_tables(&mut self) {
        let mut used: Vec<_> = self.tables.iter().map(|&(dc, _)| dc).collect();
        used.sort_unstable();
        used.dedup();
        for number in used {
            self.window_header.extend([0xFF, 0xC4, 0, 32]);
            self.window_header.push(u8::try_from(number).unwrap_or(0));
            self.window_header.extend(DC_COUNTS);
            self.window_header.extend(0..13_u8);
        }
    }

    fn frame(self) -> Option<Frame> {
        let size = self.size?;
        let &(_, across, down) = self.components.first()?;
        let mcu = Size::new(8 * across, 8 * down);
        let mcus = Size::new(size.width.div_ceil(mcu.width), size.height.div_ceil(mcu.height));
        let each = self.components.iter().zip(&self.tables).enumerate();
        let blocks = each.flat_map(|(component, (&(_, h, v), &(dc, ac)))| {
            (0..h * v).map(move |_| Block { component, dc, ac })
        });
        Some(Frame {
            size,
            channels: self.components.len(),
            mcu,
            mcus,
            restart: self.restart,
            blocks: blocks.collect(),
            dc: self.dc,
            ac: self.ac,
            kept: self.kept,
            window_header: self.window_header,
            size_at: self.size_at,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_codes_of_differences_are_those_of_their_table() {
        let values: Vec<u8> = (0..13).collect();
        // The greatest magnitude is beyond what a photo's own table may hold.
        let table = DcTable::new(&DC_COUNTS, &values).unwrap();
        for (magnitude, &(code, length)) in (0..12).zip(&DC_CODES) {
            assert_eq!(table.code(code << (64 - length)), Some((length, magnitude)));
        }
        let total: u32 = DC_COUNTS.iter().map(|&n| u32::from(n)).sum();
        assert_eq!((total, DC_CODES[12]), (13, (0b11_1111_1110, 10)));
    }
}
