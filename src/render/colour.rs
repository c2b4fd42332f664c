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

/// Largest window, pixels: points whose taps lie farther apart are sampled in parts. Four photo tiles.
const WINDOW_AREA: usize = 4 * 256 * 256;

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
            Some((photo, pixels_around(&view.points.photo_bounds()?)))
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
            let done = self.sample_level(scene, k, view, level, &chosen);
            self.chosen = chosen;
            done?;
        }
        Ok(())
    }

    /// Samples all points at level 0.
    fn sample_finest(&mut self, scene: &Scene, k: usize, positions: &[DVec2]) -> Result<()> {
        let mut colours = std::mem::take(&mut self.colours);
        colours.clear();
        colours.resize(positions.len(), [0.0; 3]);
        let done = self.sample_part(scene, k, positions, &mut colours);
        self.colours = colours;
        done
    }

    /// Samples some points at level 0: in one window, or in halves where that would be too large.
    fn sample_part(
        &mut self,
        scene: &Scene,
        k: usize,
        positions: &[DVec2],
        out: &mut [[f32; 3]],
    ) -> Result<()> {
        let rect = taps_of(scene.interpolation, positions, 0);
        if rect.area() > WINDOW_AREA && positions.len() > 1 {
            let (first, second) = positions.split_at(positions.len() / 2);
            let (to_first, to_second) = out.split_at_mut(first.len());
            self.sample_part(scene, k, first, to_first)?;
            return self.sample_part(scene, k, second, to_second);
        }
        scene.pixels.window_into(k, 0, rect, &mut self.window)?;
        sample_into(&self.window, scene.interpolation, positions, out);
        Ok(())
    }

    /// Samples the `chosen` points at one level: in one window, or in halves where that would be too large.
    fn sample_level(
        &mut self,
        scene: &Scene,
        k: usize,
        view: &ViewTile,
        level: u32,
        chosen: &[u32],
    ) -> Result<()> {
        if chosen.is_empty() {
            return Ok(());
        }
        self.positions.clear();
        self.positions.extend(chosen.iter().map(|&i| view.positions[i as usize]));
        let rect = taps_of(scene.interpolation, &self.positions, level);
        if rect.area() > WINDOW_AREA && chosen.len() > 1 {
            let (first, second) = chosen.split_at(chosen.len() / 2);
            self.sample_level(scene, k, view, level, first)?;
            return self.sample_level(scene, k, view, level, second);
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
