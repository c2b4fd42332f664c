//! The parts of a file that tell it from others without reading all of it.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

/// Bytes of each of the three parts.
pub(crate) const SAMPLE_BYTES: u64 = 1 << 20;

/// Shows the first, middle and last MiB of a file of `bytes` bytes to `visit`; they overlap in a short file.
pub(crate) fn visit_samples(
    file: &mut File,
    bytes: u64,
    visit: &mut dyn FnMut(&[u8]),
) -> io::Result<()> {
    let last = bytes.saturating_sub(SAMPLE_BYTES);
    let mut sample = Vec::new();
    for start in [0, last / 2, last] {
        sample.clear();
        file.seek(SeekFrom::Start(start))?;
        Read::by_ref(file).take(SAMPLE_BYTES).read_to_end(&mut sample)?;
        visit(&sample);
    }
    Ok(())
}
