//! Space-filling curves: neighbours on the curve are neighbours in space.
//!
//! J. Skilling (2004), "Programming the Hilbert curve", AIP Conference Proceedings 707, 381–387,
//! doi:10.1063/1.1751381. Departure: the transposed index is interleaved into one integer.

/// Position on the Hilbert curve of a cell of a 2-D grid of 2³¹ × 2³¹ cells or fewer.
///
/// `bits` (1 to 31) is the number of bits of each coordinate; the result has `2 · bits` bits.
pub fn hilbert2(cell: [u32; 2], bits: u32) -> u64 {
    let mut axes = cell;
    transpose(&mut axes, bits);
    interleave(axes, bits)
}

/// Position on the Hilbert curve of a cell of a 3-D grid; `bits` is 1 to 21, the result has `3 · bits` bits.
pub fn hilbert3(cell: [u32; 3], bits: u32) -> u64 {
    let mut axes = cell;
    transpose(&mut axes, bits);
    interleave(axes, bits)
}

/// Skilling's `AxestoTranspose`: coordinates to the transposed Hilbert index, in place.
fn transpose<const N: usize>(x: &mut [u32; N], bits: u32) {
    // Inverse undo, from the highest bit down.
    let top = 1_u32 << (bits - 1);
    let mut q = top;
    while q > 1 {
        let p = q - 1;
        for i in 0..N {
            if x[i] & q != 0 {
                x[0] ^= p;
            } else {
                let t = (x[0] ^ x[i]) & p;
                x[0] ^= t;
                x[i] ^= t;
            }
        }
        q >>= 1;
    }
    // Gray encode.
    for i in 1..N {
        x[i] ^= x[i - 1];
    }
    let mut t = 0;
    q = top;
    while q > 1 {
        if x[N - 1] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    for v in x {
        *v ^= t;
    }
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
