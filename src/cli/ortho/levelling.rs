//! `--levelling`: the tones of a job's photos, solved once, before the first tile.

use rayon::prelude::*;

use super::super::config::Config;
use super::super::job::{Levelled, Rendering};
use super::job::{canvas, scene};
use super::stores::Stores;
use crate::camera::{Lens, Photo};
use crate::frame::Mosaic;
use crate::input::glob_matches;
use crate::render::{Canvas, Observed, Renderer, Scene, observed_blocks};
use crate::tone::{Levelling, PhotoTone, Problem, solve};
use crate::{Error, Result};

/// Blocks that one renderer observes after another.
const BLOCKS_AT_ONCE: usize = 8;
/// What a renderer that observes may hold, bytes: its blocks are small.
const BLOCK_BYTES: u64 = 16 << 20;
/// Cameras whose focal lengths differ by less than this part are one.
const FOCAL_SLACK: f64 = 0.05;
/// A mosaic of fewer pixels is a sample, in which few points are no wonder.
const WORTH_A_WARNING: u64 = 1_000_000;
/// Fewer points in all say nothing.
const FEWEST_POINTS: usize = 30;

/// How each photo of the stores is levelled, in their order.
#[derive(Debug, Default)]
pub(super) struct LevelledPhotos {
    /// `None` for a photo that is taken as it is.
    pub(super) photos: Vec<Option<Levelled>>,
    /// What the user should know.
    pub(super) warning: Option<String>,
}

impl LevelledPhotos {
    fn none(photos: usize, warning: Option<String>) -> Self {
        Self { photos: vec![None; photos], warning }
    }

    /// The tones alone.
    pub(super) fn tones(&self) -> Vec<Option<&PhotoTone>> {
        self.photos.iter().map(|of| of.as_ref().map(|levelled| &levelled.tone)).collect()
    }
}

/// Solves the tones of the photos in `stores`, which come back.
///
/// The surface that is looked at is not cut by a slab: photos have the same tone in every section.
///
/// # Errors
/// Those of reading the stores; [`Error::Usage`] if `--tone-from` names no photo that is used.
pub(super) fn levelled(
    config: &Config,
    mosaic: &Mosaic,
    rendering: &Rendering,
    stores: Stores,
    names: usize,
) -> Result<(Stores, LevelledPhotos)> {
    let tone_from = tone_from(config, &stores.photos)?;
    let count = stores.photos.len();
    if config.levelling == Levelling::None || count < 2 {
        return Ok((stores, LevelledPhotos::none(count, None)));
    }
    let canvas = canvas(&[uncut(mosaic)], rendering, stores.mesh.origin());
    let (photos, left_out) = (stores.photos.clone(), stores.left_out.clone());
    let scene = scene(rendering, stores, &vec![None; count], names)?;
    let observed = observe(&scene, &canvas, mosaic)?;
    let problem = Problem {
        photos: cameras(&photos),
        observations: observed.observations,
        points: observed.points,
        tone_from,
    };
    let levelled = if problem.points.len() < FEWEST_POINTS {
        let found = problem.points.len();
        let text = || format!("photos are not levelled: two see no more than {found} points");
        let is_large = mosaic.size.area() >= WORTH_A_WARNING;
        LevelledPhotos::none(count, is_large.then(text))
    } else {
        let tones = solve(&problem, config.levelling);
        let both = tones.photos.into_iter().zip(tones.fits);
        let of = |(tone, fit)| Some(Levelled { tone, fit });
        LevelledPhotos { photos: both.map(of).collect(), warning: None }
    };
    let Scene { mesh, pixels, masks, .. } = scene;
    Ok((Stores { mesh, pixels, masks, photos, left_out }, levelled))
}

/// The mosaic without a slab.
pub(super) fn uncut(mosaic: &Mosaic) -> Mosaic {
    Mosaic { slab: [f64::NEG_INFINITY, f64::INFINITY], ..mosaic.clone() }
}

/// What the photos show of points spread over the mosaic, in the order of the blocks whatever the threads.
fn observe(scene: &Scene, canvas: &Canvas, mosaic: &Mosaic) -> Result<Observed> {
    let blocks = observed_blocks(mosaic.size, scene.photos.len());
    let of = |blocks: &[_]| -> Result<Observed> {
        let mut renderer = Renderer::new(scene, canvas, BLOCK_BYTES);
        let mut observed = Observed::default();
        for block in blocks {
            observed.extend(&renderer.observe(*block)?);
        }
        Ok(observed)
    };
    let parts: Vec<_> = blocks.par_chunks(BLOCKS_AT_ONCE).map(of).collect::<Result<_>>()?;
    let mut all = Observed::default();
    for part in &parts {
        all.extend(part);
    }
    Ok(all)
}

/// For each photo its camera, by size and focal length, and its frame's width over its height.
fn cameras(photos: &[Photo]) -> Vec<(usize, f64)> {
    let mut known: Vec<&Lens> = Vec::new();
    let is_one = |a: &Lens, b: &Lens| {
        let ratio = a.focal_px().x / b.focal_px().x;
        a.size() == b.size() && (ratio - 1.0).abs() < FOCAL_SLACK
    };
    let mut found = Vec::new();
    for photo in photos {
        let aspect = f64::from(photo.lens.size().width) / f64::from(photo.lens.size().height);
        let at = known.iter().position(|lens| is_one(lens, &photo.lens)).unwrap_or(known.len());
        if at == known.len() {
            known.push(&photo.lens);
        }
        found.push((at, aspect));
    }
    found
}

/// The photos that `--tone-from` names, as indices.
fn tone_from(config: &Config, photos: &[Photo]) -> Result<Vec<u32>> {
    let mut all = Vec::new();
    for pattern in &config.tone_from {
        let named = (0..).zip(photos).filter(|(_, photo)| glob_matches(pattern, &photo.name));
        let before = all.len();
        all.extend(named.map(|(k, _): (u32, _)| k));
        if all.len() == before {
            return Err(Error::usage(format!(
                "--tone-from {pattern}: no photo that is used has such a name"
            )));
        }
    }
    Ok(all)
}
