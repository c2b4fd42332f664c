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
        let renderer =
            SceneTiles::new(&self.job.scene, &self.job.canvas, manifest, self.budget.block_bytes);
        let (part, held) = (claim.part(), Some(claim.file()));
        let area = |tile| manifest.tile_rect(tile).area();
        let count = LIGHT_PER_THREAD * rayon::current_num_threads();
        let tiles = light_last(self.tiles, count, &|tile| ((self.weight)(tile), area(tile)));
        let batch = Run { manifest, part, held, others: &others, tiles: &tiles };
        let made = run(&batch, &renderer, &|p| progress.add_weighted(1, (self.weight)(p.tile)));
        progress.finish();
        let finished = made?.peak_bytes;
        self.parts.publish(claim)?;
        Ok(self.memory(renderer.peak_bytes(), finished))
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

/// The tiles, `count` of them, but at most a quarter, that are least work moved to the end, the lightest last: there some
/// threads wait for the last tiles of the others. The work of tiles of one weight goes by their area.
fn light_last(
    tiles: &[TileAddress],
    count: usize,
    work: &dyn Fn(TileAddress) -> (f64, usize),
) -> Vec<TileAddress> {
    let mut light: Vec<_> = tiles.iter().map(|&tile| (work(tile), tile)).collect();
    light.sort_by(|((a, a_area), _), ((b, b_area), _)| a.total_cmp(b).then(a_area.cmp(b_area)));
    light.truncate(count.min(tiles.len() / 4));
    let is_light: BTreeSet<_> = light.iter().map(|&(_, tile)| tile).collect();
    let others = tiles.iter().copied().filter(|tile| !is_light.contains(tile));
    others.chain(light.iter().rev().map(|&(_, tile)| tile)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lightest_tiles_come_last_and_the_others_keep_their_order() {
        let tiles: Vec<_> = (0..12).map(|x| TileAddress { x, y: 0 }).collect();
        let order = |count, work: &dyn Fn(TileAddress) -> (f64, usize)| -> Vec<u32> {
            light_last(&tiles, count, work).iter().map(|tile| tile.x).collect()
        };
        let heavy_but_for = |light: [u32; 2]| {
            move |tile: TileAddress| (if light.contains(&tile.x) { 1.0 } else { 9.0 }, 1)
        };
        assert_eq!(order(2, &heavy_but_for([3, 0])), [1, 2, 4, 5, 6, 7, 8, 9, 10, 11, 3, 0]);
        // Of one weight: by area; no more than a quarter.
        let narrow = |tile: TileAddress| (1.0, if tile.x % 4 == 3 { 10 } else { 100 });
        assert_eq!(order(99, &narrow), [0, 1, 2, 4, 5, 6, 8, 9, 10, 11, 7, 3]);
        assert_eq!(order(0, &narrow), (0..12).collect::<Vec<_>>());
    }
}
