//! Everything that comes before the first tile: inputs → mesh store → grid → photo store → plan.

use super::super::config::Config;
use super::super::console;
use super::forecast::{Outlook, Scope};
use super::grid::grid;
use super::inputs::Inputs;
use super::job::{Job, Place};
use super::levelling;
use super::stores::{Stores, UsablePhotos};
use crate::Result;
use crate::image::{Colour, Depth};
use crate::output::Layer;
use crate::plan::{Survey, photo_needs};
use crate::render::{Budget, TileDemand};
use crate::report::StageLog;
use crate::tone::Levelling;

/// Overview levels that memory is set aside for: those of a mosaic 2¹⁰ tiles wide.
const MOST_LEVELS: u64 = 10;

/// A job that is about to be rendered.
#[derive(Debug)]
pub(in crate::cli) struct Planned {
    pub(in crate::cli) job: Job,
    pub(in crate::cli) budget: Budget,
    pub(in crate::cli) outlook: Outlook,
    /// What work lies where.
    pub(in crate::cli) survey: Survey,
    pub(in crate::cli) log: StageLog,
}

/// Plans the job that `config` asks for; warnings and photos that are left out are told.
///
/// # Errors
/// Bad input, or a job over budget.
pub(in crate::cli) fn plan(
    config: &Config,
    inputs: &Inputs,
    budget: Budget,
    place: Place<'_>,
) -> Result<Planned> {
    let mut log = StageLog::start();
    let outlook = Outlook::before(config, inputs, &budget)?;
    let mesh = log.run("mesh store", || Stores::build_mesh(config, inputs, &budget))?;
    let budget = budget.with_mesh(mesh.file_bytes());
    let photos = log.run("photo headers", || UsablePhotos::check(config, inputs))?;
    let (mosaic, needs) = log.run("grid", || {
        let mosaic = grid(config, &mesh, &inputs.cameras, &photos.photos)?;
        // Photos are levelled on a surface that no slab cuts.
        let compared = match config.levelling {
            Levelling::None => mosaic.clone(),
            Levelling::Gain | Levelling::Full => levelling::uncut(&mosaic),
        };
        let needs = photo_needs(&mesh, &compared, &mosaic.size.rect(), &photos.photos);
        Ok::<_, crate::Error>((mosaic, needs))
    })?;
    let scope = Scope { mesh: &mesh, mosaic: &mosaic, photos: &photos.photos, needs: &needs };
    let (outlook, survey) = outlook.of_all(config, &budget, &scope)?;
    let stores = log.run("photo store", || {
        Stores::build(config, inputs, mesh, (photos, &needs), (&budget, place))
    })?;
    for left_out in &stores.left_out {
        console::note(&format!("groundel: {} is left out: {}", left_out.photo, left_out.reason));
    }
    let job = log.run("plan", || Job::plan(config, inputs, mosaic, stores, place))?;
    for warning in &job.record.warnings {
        console::note(&format!("groundel: warning: {warning}"));
    }
    Ok(Planned { job, budget, outlook, survey, log })
}

/// The shares of the memory: known before anything is read, but for the colours, of which the most is assumed.
///
/// # Errors
/// If finished tiles alone take too much.
pub(in crate::cli) fn budget(config: &Config) -> Result<Budget> {
    let demand = demand_of_one(config).times(config.sections.len().max(1));
    Budget::new(config.memory_bytes, config.threads, demand)
}

/// How many sections the memory lets be made at a time.
pub(super) fn sections_at_once(config: &Config) -> usize {
    Budget::sections_at_once(config.memory_bytes, config.threads, demand_of_one(config))
}

/// What finished tiles of one section take.
fn demand_of_one(config: &Config) -> TileDemand {
    let layers = config.layers.iter().filter_map(|&meaning| Layer::of(meaning));
    let mosaic = Layer::mosaic(Colour::Rgb, Depth::Sixteen);
    tile_demand(config.tile_size, layers.chain([mosaic]), 1)
}

/// What finished tiles of these layers, which are those of so many sections, take.
pub(in crate::cli) fn tile_demand(
    tile_size: u32,
    layers: impl Iterator<Item = Layer>,
    sections: usize,
) -> TileDemand {
    let pixel_bytes = layers.map(|layer| layer.pixel_bytes() as u64).sum();
    TileDemand { tile_size, pixel_bytes, levels: MOST_LEVELS, sections: sections as u64 }
}
