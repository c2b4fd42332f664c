//! A part of a JPEG as a small JPEG of its own: the same coefficients, bit for bit.

use super::bits::{BitReader, BitWriter};
use super::frame::{DC_CODES, Frame};
use super::scan::{COMPONENTS, Checkpoint, STEP, Tables};
use crate::geom::{PixelRect, Size};

/// Units (MCUs) that form a window, half-open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Units {
    pub(super) x0: u32,
    pub(super) y0: u32,
    pub(super) x1: u32,
    pub(super) y1: u32,
}

impl Units {
    /// The units that hold the pixels of `rect`, which lies in the photo, and one more on each side: colour that is stored
    /// smaller is interpolated between neighbours.
    pub(super) fn around(frame: &Frame, rect: PixelRect) -> Self {
        let (mcu, mcus) = (frame.mcu, frame.mcus);
        let first = |at: i64, side: u32| (index(at) / side).saturating_sub(1);
        let end = |at: i64, side: u32, count: u32| (index(at).div_ceil(side) + 1).min(count);
        Self {
            x0: first(rect.x0, mcu.width),
            y0: first(rect.y0, mcu.height),
            x1: end(rect.x1, mcu.width, mcus.width),
            y1: end(rect.y1, mcu.height, mcus.height),
        }
    }

    /// Their pixels: they end where the photo ends.
    pub(super) fn pixels(self, frame: &Frame) -> PixelRect {
        let side = |unit: u32, side: u32| i64::from(unit) * i64::from(side);
        let all = PixelRect::new(
            side(self.x0, frame.mcu.width),
            side(self.y0, frame.mcu.height),
            side(self.x1, frame.mcu.width),
            side(self.y1, frame.mcu.height),
        );
        all.intersection(&frame.size.rect())
    }
}

fn index(at: i64) -> u32 {
    u32::try_from(at).unwrap_or(0)
}

/// The entropy-coded data of one row of units from a checkpoint at or before the window's first unit.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowData<'a> {
    pub(super) checkpoint: Checkpoint,
    /// From the checkpoint's byte on.
    pub(super) data: &'a [u8],
}

/// Writes the JPEG of `units` to `out`, which is emptied; `row` gives the data of each row. `None` if they are not what
/// was scanned: the photo has changed.
pub(super) fn write<'a>(
    frame: &Frame,
    units: Units,
    mut row: impl FnMut(u32) -> Option<RowData<'a>>,
    out: &mut Vec<u8>,
) -> Option<()> {
    let tables = Tables::of(frame)?;
    let pixels = units.pixels(frame);
    let side = |length: usize| u32::try_from(length).unwrap_or(0);
    out.clear();
    frame.write_header(Size::new(side(pixels.width()), side(pixels.height())), out);
    let mut writer = BitWriter::new(out);
    let mut written = [0; COMPONENTS];
    for y in units.y0..units.y1 {
        let RowData { checkpoint, data } = row(y)?;
        let mut reader = BitReader::new(data, 0, checkpoint.bit.into());
        let mut sums = checkpoint.sums();
        let first = units.x0 / STEP * STEP;
        for x in first..units.x1 {
            let index = u64::from(y) * u64::from(frame.mcus.width) + u64::from(x);
            // A checkpoint stands past the marker.
            if let Some(number) = frame.restart_before(index).filter(|_| x > first) {
                if !reader.restart(number) {
                    return None;
                }
                sums = [0; COMPONENTS];
            }
            if x < units.x0 {
                tables.skip_unit(&mut reader, &mut sums)?;
            } else {
                copy_unit(&tables, &mut reader, &mut sums, &mut written, &mut writer)?;
            }
        }
    }
    writer.finish();
    out.extend([0xFF, 0xD9]);
    Some(())
}

/// Copies a unit: DC values as differences to those written last, all else as it is.
#[inline]
fn copy_unit(
    tables: &Tables<'_>,
    reader: &mut BitReader<'_>,
    sums: &mut [i32; COMPONENTS],
    written: &mut [i32; COMPONENTS],
    writer: &mut BitWriter<'_>,
) -> Option<()> {
    let writer = std::cell::RefCell::new(writer);
    tables.unit(
        reader,
        sums,
        |component, sum| {
            let difference = sum - std::mem::replace(&mut written[component], sum);
            let (bits, length) = difference_code(difference);
            writer.borrow_mut().put(bits, length);
        },
        |bits, length| writer.borrow_mut().put(bits, length),
    )
}

/// The code of a DC difference with its magnitude (T.81, F.1.2.1), and its length.
#[inline]
fn difference_code(difference: i32) -> (u64, u32) {
    let magnitude = 32 - difference.unsigned_abs().leading_zeros();
    // Two values within ±2047 differ by 4094 at most: magnitude 12.
    let (code, length) = DC_CODES[(magnitude as usize).min(DC_CODES.len() - 1)];
    let value = if difference < 0 { difference.wrapping_sub(1) } else { difference };
    let mask = (1_u64 << magnitude) - 1;
    (code << magnitude | (u64::from(value.cast_unsigned()) & mask), length + magnitude)
}
