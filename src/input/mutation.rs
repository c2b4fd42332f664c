//! Damaged copies of good files, for tests: what a parser makes of them must be an error or cameras, never a panic.

/// Bytes that mean something to the formats of cameras.
const BYTES: &[u8] = b"<>&\"'/=-+.,;#019eEnaif \n\0\xff";

/// `count` damaged copies of `good`, the same each time: a few bytes replaced, a stretch left out or repeated, an end
/// cut off.
pub(in crate::input) fn damaged(good: &[u8], count: u64) -> impl Iterator<Item = Vec<u8>> {
    (0..count).map(move |seed| {
        // Numbers of Marsaglia's xorshift generator (2003, doi:10.18637/jss.v008.i14).
        let mut state = 0x9e37_79b9_7f4a_7c15_u64 ^ (seed + 1).wrapping_mul(0x2545_f491_4f6c_dd1d);
        let mut below = |n: usize| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            usize::try_from(state % n.max(1) as u64).expect("below a usize")
        };
        let mut bad = good.to_vec();
        match below(4) {
            0 => bad.truncate(below(good.len())),
            1 => {
                let from = below(good.len());
                let to = (from + below(40)).min(good.len());
                bad.drain(from..to);
            }
            2 => {
                let from = below(good.len());
                let to = (from + below(40)).min(good.len());
                let twice = good[from..to].to_vec();
                bad.splice(to..to, twice);
            }
            _ => {
                for _ in 0..=below(3) {
                    let at = below(bad.len());
                    bad[at] = BYTES[below(BYTES.len())];
                }
            }
        }
        bad
    })
}
