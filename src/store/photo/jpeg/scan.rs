//! One pass over a JPEG's entropy-coded data, without decoding a sample.

use super::bits::BitReader;
use super::frame::{Block, Frame};
use super::huffman::{AcTable, DcTable, END_OF_BLOCK};

/// Units (MCUs) between checkpoints.
pub(super) const STEP: u32 = 32;
/// The greatest DC value, in quantisation steps: that of 8-bit samples is 1024.
const MAX_DC: i32 = 2047;
/// Most components.
pub(super) const COMPONENTS: usize = 3;

/// A state of the decoder before a unit: from here on the data can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Checkpoint {
    /// Byte of the entropy-coded data, and bits of it already read.
    pub(super) byte: u32,
    pub(super) bit: u8,
    /// DC value that the next difference of each component is added to.
    pub(super) dc: [i16; COMPONENTS],
}

/// What the pass found: checkpoints row by row, `mcus.width / STEP` (rounded up) in each, and where the data end.
#[derive(Debug)]
pub(super) struct Scanned {
    pub(super) checkpoints: Vec<Checkpoint>,
    pub(super) end: usize,
}

/// DC values as they are being summed.
pub(super) type Sums = [i32; COMPONENTS];

impl Checkpoint {
    pub(super) fn sums(&self) -> Sums {
        self.dc.map(i32::from)
    }
}

/// Reads all of the data, which begin `data` and end at a marker. `None` if they are in any way not as T.81 says: an
/// ordinary decoder is to judge them.
pub(super) fn scan(frame: &Frame, data: &[u8]) -> Option<Scanned> {
    let tables = Tables::of(frame)?;
    let (columns, rows) = (frame.mcus.width, frame.mcus.height);
    let count = columns.div_ceil(STEP) as usize * rows as usize;
    // Each unit takes a bit at least.
    if data.len() < count / 8 {
        return None;
    }
    let mut checkpoints = Vec::with_capacity(count);
    let mut reader = BitReader::new(data, 0, 0);
    let mut sums = Sums::default();
    for row in 0..rows {
        for column in 0..columns {
            let index = u64::from(row) * u64::from(columns) + u64::from(column);
            if let Some(number) = frame.restart_before(index) {
                if !reader.restart(number) {
                    return None;
                }
                sums = Sums::default();
            }
            if column.is_multiple_of(STEP) {
                checkpoints.push(checkpoint(&reader, &sums)?);
            }
            tables.skip_unit(&mut reader, &mut sums)?;
        }
    }
    Some(Scanned { checkpoints, end: reader.end()? })
}

fn checkpoint(reader: &BitReader<'_>, sums: &Sums) -> Option<Checkpoint> {
    let (byte, bit) = reader.position();
    let mut dc = [0; COMPONENTS];
    for (to, &sum) in dc.iter_mut().zip(sums) {
        *to = i16::try_from(sum).ok()?;
    }
    Some(Checkpoint { byte: u32::try_from(byte).ok()?, bit: u8::try_from(bit).ok()?, dc })
}

/// The tables of a unit's blocks.
#[derive(Debug)]
pub(super) struct Tables<'a> {
    blocks: Vec<(usize, &'a DcTable, &'a AcTable)>,
}

impl<'a> Tables<'a> {
    pub(super) fn of(frame: &'a Frame) -> Option<Self> {
        let block = |b: &Block| {
            let (dc, ac) = (frame.dc.get(b.dc)?.as_ref()?, frame.ac.get(b.ac)?.as_ref()?);
            (b.component < COMPONENTS).then_some((b.component, dc, ac))
        };
        Some(Self { blocks: frame.blocks.iter().map(block).collect::<Option<_>>()? })
    }

    /// Goes past a unit; `None` if it is not one.
    #[inline]
    pub(super) fn skip_unit(&self, reader: &mut BitReader<'_>, sums: &mut Sums) -> Option<()> {
        self.unit(reader, sums, |_, _| {}, |_, _| {})
    }

    /// Goes past a unit: `on_dc` is given each block's component and DC value, `on_ac` the bits of each other code with
    /// its magnitude, the lowest of a number, and how many they are. `None` if it is not a unit.
    ///
    /// Codes that no block may hold, values that no 8-bit picture has, and places beyond a block's end are refused.
    #[inline]
    pub(super) fn unit(
        &self,
        reader: &mut BitReader<'_>,
        sums: &mut Sums,
        mut on_dc: impl FnMut(usize, i32),
        mut on_ac: impl FnMut(u64, u32),
    ) -> Option<()> {
        for &(component, dc, ac) in &self.blocks {
            reader.need();
            let (length, magnitude) = dc.code(reader.peek())?;
            reader.take(length);
            let sum = sums[component].wrapping_add(difference(reader.peek(), magnitude));
            reader.take(magnitude);
            if sum.wrapping_add(MAX_DC).cast_unsigned() > 2 * MAX_DC.cast_unsigned() {
                return None;
            }
            sums[component] = sum;
            on_dc(component, sum);
            let mut place = 1_u32;
            while place < 64 {
                reader.need();
                let bits = reader.peek();
                let (length, step) = ac.code(bits);
                on_ac((bits >> 1) >> (63 - length), length);
                reader.take(length);
                place += step;
            }
            // Full, or ended.
            if place != 64 && place < END_OF_BLOCK {
                return None;
            }
        }
        if reader.is_beyond() { None } else { Some(()) }
    }
}

/// The signed number of `magnitude` bits at the head of `bits` (T.81, F.2.2.1, EXTEND).
#[inline]
fn difference(bits: u64, magnitude: u32) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "at most 12 bits")]
    let value = ((bits >> 1) >> (63 - magnitude)) as u32;
    // A first bit of 0 stands for a negative number.
    let is_negative = bits >> 63 == 0 && magnitude > 0;
    let offset = if is_negative { (1 << magnitude) - 1 } else { 0 };
    value.cast_signed() - offset
}
