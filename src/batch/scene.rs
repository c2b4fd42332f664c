//! [`SceneTiles`]: a [`Scene`] as the renderer of a job's tiles.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::{Manifest, Rendered, TileAddress, TileRenderer, notes};
use crate::image::Samples;
use crate::output::{Layer, Meaning, Raster};
use crate::render::{Canvas, OrthoTile, PhotoStats, Renderer, Scene, Statistics};
use crate::{Error, Result};

/// Renders the tiles of a job; the note of a tile is its statistics.
#[derive(Debug)]
pub struct SceneTiles<'a> {
    scene: &'a Scene,
    canvas: &'a Canvas,
    manifest: &'a Manifest,
    block_bytes: u64,
    /// Memory of the thread that held most.
    peak_bytes: AtomicU64,
}

impl<'a> SceneTiles<'a> {
    /// A renderer of the job's tiles whose threads keep their working memory within about `block_bytes` each. The
    /// manifest has the canvas's sections.
    pub fn new(
        scene: &'a Scene,
        canvas: &'a Canvas,
        manifest: &'a Manifest,
        block_bytes: u64,
    ) -> Self {
        Self { scene, canvas, manifest, block_bytes, peak_bytes: AtomicU64::new(0) }
    }

    /// The most working memory that one thread held so far, bytes.
    pub fn peak_bytes(&self) -> u64 {
        self.peak_bytes.load(Ordering::Relaxed)
    }
}

impl<'a> TileRenderer for SceneTiles<'a> {
    type Scratch = Renderer<'a>;

    fn scratch(&self) -> Renderer<'a> {
        Renderer::new(self.scene, self.canvas, self.block_bytes)
    }

    fn render(&self, tile: TileAddress, renderer: &mut Renderer<'a>) -> Result<Rendered> {
        let tiles = renderer.section_tiles(self.manifest.tile_rect(tile))?;
        self.peak_bytes.fetch_max(renderer.memory_bytes(), Ordering::Relaxed);
        let of_layer = |l: &Layer| raster(&tiles[usize::from(l.section())], l.meaning());
        let rasters = self.manifest.layers().iter().map(of_layer).collect();
        Ok(Rendered { rasters, note: to_notes(&renderer.take_statistics()) })
    }
}

/// The sums of what was found on all tiles of some parts, one a section, for a camera set of `photos`. The counts are
/// integers: their sum does not depend on the order of the tiles.
///
/// # Errors
/// As [`notes`], or if a note is not one of [`SceneTiles`].
pub fn statistics(
    manifest: &Manifest,
    parts: &[PathBuf],
    photos: usize,
) -> Result<Vec<Statistics>> {
    let mut sums = vec![Statistics::new(photos); manifest.sections()];
    notes(manifest, parts, &mut |note| {
        let path = parts.first().map_or(Path::new("parts"), PathBuf::as_path);
        let bad =
            || Error::corrupt(path, "note of a tile", "statistics of this job", "other bytes");
        add_notes(&mut sums, note).ok_or_else(bad)
    })?;
    Ok(sums)
}

/// The notes of all sections: that of a single one as it is, else each after its length (u32, little-endian).
fn to_notes(found: &[Statistics]) -> Vec<u8> {
    if let [found] = found {
        return to_note(found);
    }
    let mut notes = Vec::new();
    for note in found.iter().map(to_note) {
        notes.extend(u32::try_from(note.len()).unwrap_or(u32::MAX).to_le_bytes());
        notes.extend(note);
    }
    notes
}

/// Adds what the notes of all sections say; `None` if they are no such notes.
fn add_notes(sums: &mut [Statistics], mut notes: &[u8]) -> Option<()> {
    if let [sum] = sums {
        return add_note(sum, notes);
    }
    for sum in sums {
        let (length, rest) = notes.split_first_chunk::<4>()?;
        let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
        let (note, rest) = rest.split_at_checked(length)?;
        add_note(sum, note)?;
        notes = rest;
    }
    notes.is_empty().then_some(())
}

/// Statistics as bytes, what is zero left out: `(value u8, pixels u64)` after their number (u32), then
/// `(photo u32, seen, used, rejected, compared, residual u64)`; little-endian.
fn to_note(found: &Statistics) -> Vec<u8> {
    let counts = || (0..=u8::MAX).zip(&found.counts).filter(|(_, pixels)| **pixels > 0);
    let mut note = u32::try_from(counts().count()).unwrap_or(u32::MAX).to_le_bytes().to_vec();
    for (value, pixels) in counts() {
        note.push(value);
        note.extend(pixels.to_le_bytes());
    }
    for (photo, p) in (0_u32..).zip(&found.photos).filter(|(_, p)| **p != PhotoStats::default()) {
        note.extend(photo.to_le_bytes());
        for number in [p.seen, p.used, p.rejected, p.compared, p.residual_256] {
            note.extend(number.to_le_bytes());
        }
    }
    note
}

/// Adds what a note says; `None` if it is no such note.
fn add_note(sum: &mut Statistics, note: &[u8]) -> Option<()> {
    let (number, rest) = note.split_first_chunk::<4>()?;
    let (counts, photos) =
        rest.split_at_checked(usize::try_from(u32::from_le_bytes(*number)).ok()?.checked_mul(9)?)?;
    for count in counts.as_chunks::<9>().0 {
        let (value, pixels) = count.split_first_chunk::<1>()?;
        let slot = sum.counts.get_mut(usize::from(value[0]))?;
        *slot = slot.checked_add(u64::from_le_bytes(*pixels.first_chunk()?))?;
    }
    let (photos, []) = photos.as_chunks::<44>() else { return None };
    for photo in photos {
        let (index, numbers) = photo.split_first_chunk::<4>()?;
        let to = sum.photos.get_mut(usize::try_from(u32::from_le_bytes(*index)).ok()?)?;
        let slots =
            [&mut to.seen, &mut to.used, &mut to.rejected, &mut to.compared, &mut to.residual_256];
        for (slot, number) in slots.into_iter().zip(numbers.as_chunks::<8>().0) {
            *slot = slot.checked_add(u64::from_le_bytes(*number))?;
        }
    }
    Some(())
}

/// One layer of a tile.
fn raster(tile: &OrthoTile, meaning: Meaning) -> Raster {
    match meaning {
        Meaning::Mosaic => match &tile.colour {
            Samples::U8(image) => Raster::U8(image.clone()),
            Samples::U16(image) => Raster::U16(image.clone()),
        },
        Meaning::Elevation => Raster::F32(tile.elevation.clone()),
        Meaning::Face => Raster::U32(tile.face.clone()),
        Meaning::Count => Raster::U8(tile.count.clone()),
        Meaning::Used => Raster::U8(tile.used.clone()),
        Meaning::Coverage => Raster::U8(tile.coverage.clone()),
        Meaning::Best => Raster::U16(tile.best.clone()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_add_up_to_the_statistics_and_other_bytes_are_refused() {
        let mut found = Statistics::new(3);
        (found.counts[0], found.counts[2], found.counts[255]) = (5, u64::from(u32::MAX) + 9, 1);
        found.photos[2] =
            PhotoStats { seen: 1, used: 2, rejected: 3, compared: 4, residual_256: 1 << 40 };
        let note = to_note(&found);
        let mut sum = Statistics::new(3);
        add_note(&mut sum, &note).unwrap();
        assert_eq!(sum, found);
        add_note(&mut sum, &note).unwrap();
        let mut twice = found.clone();
        twice.merge(&found);
        assert_eq!(sum, twice);
        for cut in 0..note.len() {
            let whole = add_note(&mut Statistics::new(3), &note[..cut]);
            // Cut behind the counts, it is the note of a tile that no photo sees.
            assert_eq!(whole.is_some(), cut == 4 + 3 * 9, "{cut}");
        }
        assert!(add_note(&mut Statistics::new(2), &note).is_none());
    }

    #[test]
    fn notes_of_sections_stay_apart_and_those_of_one_are_a_note_alone() {
        let found = |k: u64| {
            let mut found = Statistics::new(3);
            found.counts[1] = 7 * k;
            found.photos[1].seen = k;
            found
        };
        assert_eq!(to_notes(&[found(2)]), to_note(&found(2)));
        let all = [found(2), found(0), found(5)];
        let notes = to_notes(&all);
        let mut sums = vec![Statistics::new(3); 3];
        add_notes(&mut sums, &notes).unwrap();
        assert_eq!(sums, all);
        for cut in 0..notes.len() {
            assert!(add_notes(&mut sums, &notes[..cut]).is_none(), "{cut}");
        }
        assert!(add_notes(&mut sums, &[&notes[..], &[0]].concat()).is_none());
        assert!(add_notes(&mut [Statistics::new(3), Statistics::new(3)], &notes).is_none());
    }
}
