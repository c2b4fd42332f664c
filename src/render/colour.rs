//! Windows, samples and blend of a block, sub-block by sub-block.

use glam::DVec2;

use crate::Result;
use crate::blend::{Edges, OrthoTile, Outliers, PhotoSamples, SampleTile, SoftSamples};
use crate::geom::{Bounds2, PixelRect, Size, held_bytes};
use crate::image::{Image, Samples, Window};
use crate::sample::{Interpolation, level_of, sample_into, taps_of};
use crate::surface::SurfaceTile;
use crate::visibility::{SUB_BLOCK, ViewTile};

use super::fading::Fading;
use super::masking::Masking;
use super::sections::Findings;
use super::tile::View;
use super::{Canvas, Scene};

/// Largest window, pixels of level 0: points whose taps lie farther apart are sampled in parts. Four photo tiles; half of it on
/// coarser levels, whose windows are widened to whole pixels.
const WINDOW_AREA: usize = 4 * 256 * 256;

/// Pixels of a window for each of its points, and beside them: where depth jumps, neighbours in the mosaic lie far apart in a
/// photo, and all that lies between them need not be decoded.
const POINT_AREA: usize = 16;
const LEAST_AREA: usize = 64 * 64;

/// Pixels of a photo that are fetched ahead for each of a block, at most: more lies around few points.
const AHEAD: usize = 16;

/// A block's section, and what is to be known of it beside its surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Section<'a> {
    pub(super) scene: &'a Scene,
    pub(super) canvas: &'a Canvas,
    /// From the lowest.
    pub(super) number: usize,
    /// Which of the inner pixels, row-major, are to be coloured; `None`: all.
    pub(super) is_open: Option<&'a [bool]>,
    /// What [`greatest_around`](super::sections::greatest_around) says; empty where there is one section.
    pub(super) around: &'a [f64],
}

/// How colours are compared: bilinear, two levels above that of the pixel's footprint. There a colour is a mean over
/// some four mosaic pixels square, and half a pixel between photos makes little of a difference.
pub(super) const COARSE: (Interpolation, u32) = (Interpolation::Bilinear, 2);

impl<'a> Section<'a> {
    /// The highest section, all its pixels.
    pub(super) fn highest(scene: &'a Scene, canvas: &'a Canvas) -> Self {
        Self { scene, canvas, number: canvas.sections() - 1, is_open: None, around: &[] }
    }
}

/// Colours one block after another, reusing its memory.
#[derive(Debug)]
pub(super) struct Colouring {
    masking: Masking,
    sampler: Sampler,
    /// Of the same points, from coarser levels.
    coarse: Sampler,
    fading: Fading,
    samples: SampleTile,
    is_kept: Vec<bool>,
    pub(super) findings: Findings,
}

impl Colouring {
    pub(super) fn new(scene: &Scene, canvas: &Canvas) -> Self {
        Self {
            masking: Masking::default(),
            sampler: Sampler::default(),
            coarse: Sampler::default(),
            fading: Fading::default(),
            samples: SampleTile::new(),
            is_kept: Vec::new(),
            findings: Findings::new(scene, canvas),
        }
    }

    /// Memory held, bytes.
    pub(super) fn memory_bytes(&self) -> u64 {
        self.samples.memory_bytes()
            + self.sampler.memory_bytes()
            + self.coarse.memory_bytes()
            + self.fading.memory_bytes()
            + held_bytes(&self.is_kept)
            + self.findings.memory_bytes()
    }

    /// Stages 3 to 5 of a block of a section: samples of every view, outliers, blend.
    pub(super) fn block(
        &mut self,
        to: &Section<'_>,
        surface: &SurfaceTile,
        views: &mut [View],
        tile: &mut OrthoTile,
    ) -> Result<()> {
        let (scene, inner) = (to.scene, surface.inner);
        tile.set_surface(inner, |k| {
            let at = surface.pixel_in(inner, k);
            let is_open = to.is_open.is_none_or(|is_open| is_open[k]);
            let face = surface.face_at(at).filter(|_| is_open);
            face.map(|f| (surface.elevations[at], f.id))
        });
        scene.pixels.prefetch(views.iter().filter_map(|view| {
            let photo = usize::from(scene.photos[view.photo].index);
            let around = pixels_around(&view.points.photo_bounds()?);
            (around.area() <= AHEAD * inner.area()).then_some((photo, around))
        }))?;
        if scene.blend.edges == Edges::Guard {
            for view in &mut *views {
                self.find_edges(to, surface, view)?;
            }
        }
        for (k, sub) in inner.blocks(SUB_BLOCK).enumerate() {
            self.samples.begin(sub);
            for view in &mut *views {
                self.take_view(to, surface, (k, sub), view)?;
                if !view.tile.is_empty() {
                    self.sample(scene, sub, view)?;
                }
            }
            self.findings.blend(to, inner, &mut self.samples, tile);
        }
        Ok(())
    }

    /// How far from the border of what a view sees its pixels lie.
    pub(super) fn find_edges(
        &mut self,
        to: &Section<'_>,
        surface: &SurfaceTile,
        view: &mut View,
    ) -> Result<()> {
        let photo = &to.scene.photos[view.photo];
        view.edges.start(surface);
        let masks = to.scene.masks.as_ref().filter(|masks| masks.has(photo.index.into()));
        let Some(masks) = masks else {
            view.edges.see(surface, &view.points);
            view.edges.finish();
            return Ok(());
        };
        // What is masked is not seen: that is known of photo positions only.
        let mosaic = to.canvas.section(to.number);
        for (k, part) in surface.halo().blocks(SUB_BLOCK).enumerate() {
            let seen = view.points.seen_in(k);
            view.tile.view(surface, mosaic, &photo.view, part, seen);
            self.masking.apply(masks, photo.index.into(), &mut view.tile)?;
            view.edges.see_pixels(surface, part, &view.tile.pixels);
        }
        view.edges.finish();
        Ok(())
    }

    /// Stage 2 for the pixels of a sub-block: what a view sees of them, if they are to be coloured.
    pub(super) fn take_view(
        &mut self,
        to: &Section<'_>,
        surface: &SurfaceTile,
        (k, sub): (usize, PixelRect),
        view: &mut View,
    ) -> Result<()> {
        let photo = &to.scene.photos[view.photo];
        let (mosaic, seen) = (to.canvas.section(to.number), view.points.seen_in(k));
        view.tile.view(surface, mosaic, &photo.view, sub, seen);
        if let Some(masks) = &to.scene.masks {
            self.masking.apply(masks, photo.index.into(), &mut view.tile)?;
        }
        if let Some(is_open) = to.is_open {
            let inner = surface.inner;
            let inside = |v: i64| usize::try_from(v).expect("inside the block");
            let first = inside(sub.y0 - inner.y0) * inner.width() + inside(sub.x0 - inner.x0);
            let at =
                |pixel: usize| first + pixel / sub.width() * inner.width() + pixel % sub.width();
            self.is_kept.clear();
            self.is_kept.extend(view.tile.pixels.iter().map(|&pixel| is_open[at(pixel as usize)]));
            view.tile.retain(&self.is_kept);
        }
        Ok(())
    }

    /// Stage 3: the samples of a view.
    fn sample(&mut self, scene: &Scene, sub: PixelRect, view: &View) -> Result<()> {
        let photo = &scene.photos[view.photo];
        let (number, points) = (usize::from(photo.index), &view.tile);
        let fine = (scene.interpolation, 0);
        self.sampler.sample(scene, number, points, fine)?;
        let is_robust = scene.blend.outliers == Outliers::Robust;
        if is_robust {
            self.coarse.sample(scene, number, points, COARSE)?;
        }
        if let Some(tone) = &photo.tone {
            let range = scene.range_of(number);
            let (fine, coarse) = (&mut self.sampler.colours[..], &mut self.coarse.colours[..]);
            if is_robust {
                tone.apply(&points.positions, [fine, coarse], range);
            } else {
                tone.apply(&points.positions, [fine], range);
            }
        }
        self.fading.weigh(scene, photo, sub, view);
        let Fading { quality, guards, fades, .. } = &self.fading;
        let weights = self.fading.weights(view);
        let soft = SoftSamples { coarse: &self.coarse.colours, quality, guards, fades };
        self.samples.push(&PhotoSamples {
            photo: photo.index,
            gain: photo.gain,
            pixels: &points.pixels,
            colours: &self.sampler.colours,
            weights,
            soft: is_robust.then_some(soft),
        });
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
pub(super) struct Sampler {
    interpolation: Interpolation,
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
            interpolation: Interpolation::default(),
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
    /// Memory held, bytes.
    fn memory_bytes(&self) -> u64 {
        let window = match &self.window.samples {
            Samples::U8(image) => image.data().len(),
            Samples::U16(image) => 2 * image.data().len(),
        };
        window as u64
            + held_bytes(&self.levels)
            + held_bytes(&self.chosen)
            + held_bytes(&self.positions)
            + held_bytes(&self.sampled)
            + held_bytes(&self.colours)
    }

    /// The colours of the points that were sampled last, in the photo's range.
    pub(super) fn colours(&self) -> &[[f32; 3]] {
        &self.colours
    }

    /// Samples every point of `view` from photo `k` of the store, each so many levels above that of its own footprint.
    pub(super) fn sample(
        &mut self,
        scene: &Scene,
        k: usize,
        view: &ViewTile,
        (interpolation, above): (Interpolation, u32),
    ) -> Result<()> {
        self.interpolation = interpolation;
        let levels = scene.pixels.levels(k);
        let last = levels.saturating_sub(1);
        let level = |&f: &f64| (level_of(f, levels) + above).min(last);
        let ends = view.footprints_squared.iter().fold([f64::INFINITY, 0.0], |[low, high], &f| {
            // What is not a number counts as 0, as it does for the level.
            let f = f.max(0.0);
            [f.min(low), f.max(high)]
        });
        let [least, greatest] = ends.map(|f| level(&f));
        if least >= greatest {
            return self.sample_level(scene, (k, greatest), &view.positions);
        }
        self.levels.clear();
        self.levels.extend(view.footprints_squared.iter().map(level));
        self.colours.clear();
        self.colours.resize(view.positions.len(), [0.0; 3]);
        for level in least..=greatest {
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

    /// Samples all points at one level.
    fn sample_level(
        &mut self,
        scene: &Scene,
        (k, level): (usize, u32),
        positions: &[DVec2],
    ) -> Result<()> {
        self.colours.clear();
        self.colours.resize(positions.len(), [0.0; 3]);
        let rect = taps_of(self.interpolation, positions, level);
        if is_close(&rect, positions.len(), level) {
            scene.pixels.window_into(k, level, rect, &mut self.window)?;
            sample_into(&self.window, self.interpolation, positions, &mut self.colours);
            return Ok(());
        }
        let mut chosen = std::mem::take(&mut self.chosen);
        chosen.clear();
        chosen.extend((0_u32..).zip(positions).map(|(i, _)| i));
        let done = self.sample_chosen(scene, (k, level), positions, &mut chosen);
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
        let rect = taps_of(self.interpolation, &self.positions, level);
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
        sample_into(&self.window, self.interpolation, &self.positions, &mut self.sampled);
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
