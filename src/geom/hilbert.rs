//! Space-filling curves: neighbours on the curve are neighbours in space.
//!
//! J. Skilling (2004), "Programming the Hilbert curve", AIP Conference Proceedings 707, 381–387,
//! doi:10.1063/1.1751381. Departures: the transposed index is interleaved into one integer; masks stand for the
//! branches, which no processor can predict.

/// Position on the Hilbert curve of a cell of a 2-D grid of 2³¹ × 2³¹ cells or fewer.
///
/// `bits` (1 to 31) is the number of bits of each coordinate; the result has `2 · bits` bits.
pub fn hilbert2(cell: [u32; 2], bits: u32) -> u64 {
    let mut axes = cell.map(|x| [x]);
    transpose(&mut axes, bits);
    interleave(axes.map(|[x]| x), bits)
}

/// Position on the Hilbert curve of a cell of a 3-D grid; `bits` is 1 to 21, the result has `3 · bits` bits.
pub fn hilbert3(cell: [u32; 3], bits: u32) -> u64 {
    let [key] = hilbert3_lanes(cell.map(|x| [x]), bits);
    key
}

/// Positions of `L` cells at once, given by axis: one takes as long as several, because each step waits for the one
/// before.
pub fn hilbert3_lanes<const L: usize>(mut cells: [[u32; L]; 3], bits: u32) -> [u64; L] {
    transpose(&mut cells, bits);
    let [x, y, z] = cells;
    std::array::from_fn(|l| spread(x[l]) << 2 | spread(y[l]) << 1 | spread(z[l]))
}

/// The low 21 bits of `x`, two zero bits between each and the next.
#[inline]
fn spread(x: u32) -> u64 {
    let x = u64::from(x & 0x1f_ffff);
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Skilling's `AxestoTranspose`: coordinates of `L` cells to their transposed Hilbert indices, in place.
#[expect(clippy::needless_range_loop, reason = "two axes are changed at once, lane by lane")]
fn transpose<const N: usize, const L: usize>(x: &mut [[u32; L]; N], bits: u32) {
    // Inverse undo, from the highest bit down.
    for bit in (1..bits).rev() {
        let p = (1_u32 << bit) - 1;
        for i in 0..N {
            for l in 0..L {
                // Where the bit is set, the first axis's low bits are inverted; else exchanged with this axis's.
                let set = mask(x[i][l] >> bit & 1);
                let exchanged = (x[0][l] ^ x[i][l]) & p & !set;
                x[0][l] ^= (p & set) | exchanged;
                x[i][l] ^= exchanged;
            }
        }
    }
    // Gray encode.
    for i in 1..N {
        for l in 0..L {
            x[i][l] ^= x[i - 1][l];
        }
    }
    let mut t = [0; L];
    for bit in 1..bits {
        for l in 0..L {
            t[l] ^= ((1 << bit) - 1) & mask(x[N - 1][l] >> bit & 1);
        }
    }
    for axis in x {
        for l in 0..L {
            axis[l] ^= t[l];
        }
    }
}

/// All bits set for 1, none for 0.
#[inline]
fn mask(bit: u32) -> u32 {
    bit.wrapping_neg()
}

/// The transposed index as one integer: bit `b` of axis 0 first, then of axis 1, …
fn interleave<const N: usize>(x: [u32; N], bits: u32) -> u64 {
    let mut key = 0;
    for b in (0..bits).rev() {
        for v in x {
            key = key << 1 | u64::from(v >> b & 1);
        }
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_every_cell_once_and_steps_to_a_neighbour() {
        let side = 16_u32;
        let mut at = vec![None; (side * side) as usize];
        for y in 0..side {
            for x in 0..side {
                let k = usize::try_from(hilbert2([x, y], 4)).unwrap();
                assert!(at[k].replace([x, y]).is_none());
            }
        }
        for pair in at.windows(2) {
            let (a, b) = (pair[0].unwrap(), pair[1].unwrap());
            assert_eq!(a[0].abs_diff(b[0]) + a[1].abs_diff(b[1]), 1);
        }
    }

    #[test]
    fn a_key_keeps_every_bit_of_the_largest_grid() {
        let last = (1 << 21) - 1;
        let mut keys = [0, 1, last - 1, last].map(|x| hilbert3([x, x, x], 21));
        assert!(keys.iter().all(|key| key >> 63 == 0));
        keys.sort_unstable();
        assert!(keys.windows(2).all(|pair| pair[0] != pair[1]));
        assert_eq!(interleave([last, 0, 5], 21), spread(last) << 2 | spread(5));
    }

    #[test]
    fn lanes_do_not_mix() {
        let cells = [[3, 0, 77, 1 << 19], [9, 5, 0, 1234], [1, 1 << 18, 6, 7]];
        let single = |l: usize| hilbert3(cells.map(|axis| axis[l]), 20);
        assert_eq!(hilbert3_lanes(cells, 20), [0, 1, 2, 3].map(single));
    }

    #[test]
    fn the_curve_in_three_dimensions_steps_to_a_neighbour() {
        let mut at = vec![None; 512];
        for k in 0..512_u32 {
            let cell = [k & 7, k >> 3 & 7, k >> 6];
            let i = usize::try_from(hilbert3(cell, 3)).unwrap();
            assert!(at[i].replace(cell).is_none());
        }
        for pair in at.windows(2) {
            let (a, b) = (pair[0].unwrap(), pair[1].unwrap());
            assert_eq!((0..3).map(|i| a[i].abs_diff(b[i])).sum::<u32>(), 1);
        }
    }
}
