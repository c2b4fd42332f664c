//! [`BatchRun`]: the tiles of one batch, rendered into its part.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::super::console;
use super::super::ortho::Job;
use super::super::progress::Progress;
use crate::Result;
use crate::batch::{Claim, PartState, Parts, Rivals, Run, SceneTiles, TileAddress, completed, run};
use crate::render::Budget;
use crate::report::MemoryUse;

/// Tiles of a batch that are kept for the end, for each thread.
const LIGHT_PER_THREAD: usize = 4;

/// A batch to be rendered by all threads of the current rayon pool.
pub(in crate::cli) struct BatchRun<'a> {
    pub(in crate::cli) job: &'a Job,
    pub(in crate::cli) budget: &'a Budget,
    pub(in crate::cli) parts: &'a Parts,
    pub(in crate::cli) batch: u32,
    /// Its tiles, in order.
    pub(in crate::cli) tiles: &'a [TileAddress],
    pub(in crate::cli) rivals: Rivals,
    /// The work of a tile, for the time that is left.
    pub(in crate::cli) weight: &'a (dyn Fn(TileAddress) -> f64 + Sync),
    pub(in crate::cli) quiet: bool,
}

impl BatchRun<'_> {
    /// Renders what is missing, and gives the part its name; who held how much memory meanwhile.
    ///
    /// # Errors
    /// Those of the stores and the disk; what was finished before is kept for the next run.
    pub(in crate::cli) fn run(&self) -> Result<Vec<MemoryUse>> {
        let manifest = &self.job.record.manifest;
        let claim = self.parts.claim(self.batch, self.rivals)?;
        let others = self.kept()?;
        let done = self.done(&claim, &others)?;
        if !done.is_empty() && !self.quiet {
            let (done, all) = (done.len(), self.tiles.len());
            console::note(&format!("groundel: going on after {done} of {all} tiles"));
        }
        let sum =
            |tiles: &mut dyn Iterator<Item = TileAddress>| tiles.map(self.weight).sum::<f64>();
        let left = sum(&mut self.tiles.iter().copied()) - sum(&mut done.iter().copied());
        let count = (self.tiles.len() - done.len()) as u64;
        let progress = Progress::start("rendering", "tiles", count, self.quiet).weighted(left);
        let renderer = SceneTiles::new(&self.job.scene, manifest, self.budget.block_bytes);
        let (part, held) = (claim.part(), Some(claim.file()));
        let tiles = self.light_last();
        let batch = Run { manifest, part, held, others: &others, tiles: &tiles };
        let made = run(&batch, &renderer, &|p| progress.add_weighted(1, (self.weight)(p.tile)));
        progress.finish();
        let finished = made?.peak_bytes;
        self.parts.publish(claim)?;
        Ok(self.memory(renderer.peak_bytes(), finished))
    }

    /// The tiles, a few that are little work moved to the end: there some threads wait for the last tiles of the others.
    fn light_last(&self) -> Vec<TileAddress> {
        let count = (LIGHT_PER_THREAD * rayon::current_num_threads()).min(self.tiles.len() / 4);
        let area = |tile| self.job.record.manifest.tile_rect(tile).area();
        let work = |&tile: &TileAddress| ((self.weight)(tile), area(tile), tile);
        let mut light: Vec<_> = self.tiles.iter().map(work).collect();
        light.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        light.truncate(count);
        let is_light: BTreeSet<_> = light.iter().map(|&(.., tile)| tile).collect();
        let others = self.tiles.iter().copied().filter(|tile| !is_light.contains(tile));
        others.chain(light.iter().rev().map(|&(.., tile)| tile)).collect()
    }

    /// The parts of an earlier plan of which tiles are kept.
    fn kept(&self) -> Result<Vec<PathBuf>> {
        let manifest = &self.job.record.manifest;
        let mut kept = Vec::new();
        for path in self.parts.kept()? {
            if matches!(PartState::of(&path, manifest)?, PartState::Own(_)) {
                kept.push(path);
            }
        }
        Ok(kept)
    }

    /// The tiles of the batch that are there already.
    fn done(&self, claim: &Claim, others: &[PathBuf]) -> Result<BTreeSet<TileAddress>> {
        let manifest = &self.job.record.manifest;
        let mut done = BTreeSet::new();
        for path in others.iter().map(PathBuf::as_path).chain([claim.part()]) {
            done.extend(completed(manifest, path)?);
        }
        let own: BTreeSet<_> = self.tiles.iter().copied().collect();
        Ok(done.intersection(&own).copied().collect())
    }

    fn memory(&self, block_bytes: u64, finished_bytes: u64) -> Vec<MemoryUse> {
        let (scene, budget) = (&self.job.scene, self.budget);
        let threads = rayon::current_num_threads() as u64;
        // Those of masks counted.
        let stores = [Some(&scene.pixels), scene.masks.as_ref()];
        let photo_bytes = stores.into_iter().flatten().map(|s| s.statistics().peak_bytes).sum();
        let held = |consumer: &str, share_bytes, peak_bytes| MemoryUse {
            consumer: consumer.into(),
            share_bytes,
            peak_bytes,
        };
        vec![
            held("mesh store", budget.mesh_bytes, scene.mesh.held_bytes()),
            held("photo tiles", budget.photo_bytes, photo_bytes),
            held("blocks", budget.block_bytes * threads, block_bytes * threads),
            held("finished tiles", budget.output_bytes, finished_bytes),
        ]
    }
}
