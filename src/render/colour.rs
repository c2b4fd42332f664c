//! Windows, samples and blend of a block, sub-block by sub-block.

use glam::DVec2;

use crate::Result;
use crate::blend::{OrthoTile, SampleTile};
use crate::geom::{Bounds2, PixelRect, Size, held_bytes};
use crate::image::{Image, Samples, Window};
use crate::sample::{level_of, sample_into, taps_of};
use crate::surface::SurfaceTile;
use crate::visibility::{SUB_BLOCK, ViewTile};

use super::Scene;
use super::masking::Masking;
use super::sections::Findings;
use super::tile::View;

/// Largest window, pixels of level 0: points whose taps lie farther apart are sampled in parts. Four photo tiles; half of it on
/// coarser levels, whose windows are widened to whole pixels.
const WINDOW_AREA: usize = 4 * 256 * 256;

/// Pixels of a window for each of its points, and beside them: where depth jumps, neighbours in the mosaic lie far apart in a
/// photo, and all that lies between them need not be decoded.
const POINT_AREA: usize = 16;
const LEAST_AREA: usize = 64 * 64;

/// Pixels of a photo that are fetched ahead for each of a block, at most: more lies around few points.
const AHEAD: usize = 16;

/// Colours one block after another, reusing its memory.
#[derive(Debug)]
pub(super) struct Colouring {
    masking: Masking,
    sampler: Sampler,
    samples: SampleTile,
    pub(super) findings: Findings,
}

impl Colouring {
    pub(super) fn new(scene: &Scene) -> Self {
        Self {
            masking: Masking::default(),
            sampler: Sampler::default(),
            samples: SampleTile::new(),
            findings: Findings::new(scene),
        }
    }

    /// Memory held, bytes.
    pub(super) fn memory_bytes(&self) -> u64 {
        let sampler = &self.sampler;
        let window = match &sampler.window.samples {
            Samples::U8(image) => image.data().len(),
            Samples::U16(image) => 2 * image.data().len(),
        };
        self.samples.memory_bytes()
            + window as u64
            + held_bytes(&sampler.levels)
            + held_bytes(&sampler.chosen)
            + held_bytes(&sampler.positions)
            + held_bytes(&sampler.sampled)
            + held_bytes(&sampler.colours)
            + self.findings.memory_bytes()
    }

    /// Stages 3 to 5 of a block of a section: samples of every view, outliers, blend.
    pub(super) fn block(
        &mut self,
        (scene, section): (&Scene, usize),
        surface: &SurfaceTile,
        views: &mut [View],
        tile: &mut OrthoTile,
    ) -> Result<()> {
        tile.set_surface(surface.rect, |k| {
            surface.face_at(k).map(|f| (surface.elevations[k], f.id))
        });
        scene.pixels.prefetch(views.iter().filter_map(|view| {
            let photo = usize::from(scene.photos[view.photo].index);
            let around = pixels_around(&view.points.photo_bounds()?);
            (around.area() <= AHEAD * surface.rect.area()).then_some((photo, around))
        }))?;
        for (k, sub) in surface.rect.blocks(SUB_BLOCK).enumerate() {
            self.samples.begin(sub);
            for view in &mut *views {
                let photo = &scene.photos[view.photo];
                let seen = view.points.seen_in(k);
                let view = &mut view.tile;
                view.view(surface, &scene.mosaic, &photo.view, sub, seen);
                if let Some(masks) = &scene.masks {
                    self.masking.apply(masks, photo.index.into(), view)?;
                }
                if view.is_empty() {
                    continue;
                }
                self.sampler.sample(scene, usize::from(photo.index), view)?;
                let colours = &self.sampler.colours;
                self.samples.push(photo.index, photo.gain, &view.pixels, colours, &view.weights);
            }
            self.findings.blend(scene, section, surface, &mut self.samples, tile);
        }
        Ok(())
    }
}

/// The pixels around some photo positions, taps counted.
#[expect(clippy::cast_possible_truncation, reason = "positions lie in the frame")]
fn pixels_around(bounds: &Bounds2) -> PixelRect {
    let (min, max) = (bounds.min.floor(), bounds.max.ceil());
    PixelRect::new(min.x as i64 - 2, min.y as i64 - 2, max.x as i64 + 2, max.y as i64 + 2)
}

/// Samples the points of one view after another, reusing its memory.
#[derive(Debug)]
struct Sampler {
    window: Window,
    levels: Vec<u32>,
    /// Points of one level.
    chosen: Vec<u32>,
    positions: Vec<DVec2>,
    sampled: Vec<[f32; 3]>,
    /// Colour of each point of the view last sampled, in the photo's range.
    colours: Vec<[f32; 3]>,
}

impl Default for Sampler {
    fn default() -> Self {
        let samples = Samples::U8(Image::filled(Size::new(0, 0), 1, 0));
        Self {
            window: Window { level: 0, rect: PixelRect::default(), samples },
            levels: Vec::new(),
            chosen: Vec::new(),
            positions: Vec::new(),
            sampled: Vec::new(),
            colours: Vec::new(),
        }
    }
}

impl Sampler {
    /// Samples every point of `view` from photo `k` of the store, each at the level of its own footprint.
    fn sample(&mut self, scene: &Scene, k: usize, view: &ViewTile) -> Result<()> {
        let levels = scene.pixels.levels(k);
        let greatest = view.footprints_squared.iter().fold(0.0, |max: f64, &f| max.max(f));
        if level_of(greatest, levels) == 0 {
            return self.sample_finest(scene, k, &view.positions);
        }
        self.levels.clear();
        self.levels.extend(view.footprints_squared.iter().map(|&f| level_of(f, levels)));
        self.colours.clear();
        self.colours.resize(view.positions.len(), [0.0; 3]);
        for level in 0..levels {
            let mut chosen = std::mem::take(&mut self.chosen);
            chosen.clear();
            chosen
                .extend((0_u32..).zip(&self.levels).filter(|(_, l)| **l == level).map(|(i, _)| i));
            let done = self.sample_chosen(scene, (k, level), &view.positions, &mut chosen);
            self.chosen = chosen;
            done?;
        }
        Ok(())
    }

    /// Samples all points at level 0.
    fn sample_finest(&mut self, scene: &Scene, k: usize, positions: &[DVec2]) -> Result<()> {
        self.colours.clear();
        self.colours.resize(positions.len(), [0.0; 3]);
        let rect = taps_of(scene.interpolation, positions, 0);
        if is_close(&rect, positions.len(), 0) {
            scene.pixels.window_into(k, 0, rect, &mut self.window)?;
            sample_into(&self.window, scene.interpolation, positions, &mut self.colours);
            return Ok(());
        }
        let mut chosen = std::mem::take(&mut self.chosen);
        chosen.clear();
        chosen.extend((0_u32..).zip(positions).map(|(i, _)| i));
        let done = self.sample_chosen(scene, (k, 0), positions, &mut chosen);
        self.chosen = chosen;
        done
    }

    /// Samples the `chosen` points at one level of a photo: in one window if they lie close together there, else in two parts,
    /// each on its side of the middle of what they span. The order of `chosen` changes; each colour is that of its point alone.
    fn sample_chosen(
        &mut self,
        scene: &Scene,
        (k, level): (usize, u32),
        positions: &[DVec2],
        chosen: &mut [u32],
    ) -> Result<()> {
        if chosen.is_empty() {
            return Ok(());
        }
        self.positions.clear();
        self.positions.extend(chosen.iter().map(|&i| positions[i as usize]));
        let rect = taps_of(scene.interpolation, &self.positions, level);
        let spanned = Bounds2::of(self.positions.iter().copied());
        let middle = (spanned.min + spanned.max) / 2.0;
        let is_wide = spanned.max.x - spanned.min.x >= spanned.max.y - spanned.min.y;
        let is_first = |&i: &u32| {
            let position = positions[i as usize];
            if is_wide { position.x < middle.x } else { position.y < middle.y }
        };
        let first = if is_close(&rect, chosen.len(), level) { 0 } else { parted(chosen, is_first) };
        // All on one side: they lie at one place.
        if first > 0 && first < chosen.len() {
            let (low, high) = chosen.split_at_mut(first);
            self.sample_chosen(scene, (k, level), positions, low)?;
            return self.sample_chosen(scene, (k, level), positions, high);
        }
        scene.pixels.window_into(k, level, rect, &mut self.window)?;
        self.sampled.clear();
        self.sampled.resize(chosen.len(), [0.0; 3]);
        sample_into(&self.window, scene.interpolation, &self.positions, &mut self.sampled);
        for (&i, &colour) in chosen.iter().zip(&self.sampled) {
            self.colours[i as usize] = colour;
        }
        Ok(())
    }
}

/// Whether a window of a level is worth reading for so many points.
fn is_close(rect: &PixelRect, points: usize, level: u32) -> bool {
    let most = if level == 0 { WINDOW_AREA } else { (WINDOW_AREA / 2) >> (2 * level.min(16)) };
    points < 2 || rect.area() <= (LEAST_AREA + POINT_AREA * points).min(most)
}

/// Moves the numbers for which `is_first` says yes to the front; how many there are.
fn parted(numbers: &mut [u32], is_first: impl Fn(&u32) -> bool) -> usize {
    let mut first = 0;
    for at in 0..numbers.len() {
        if is_first(&numbers[at]) {
            numbers.swap(first, at);
            first += 1;
        }
    }
    first
}
