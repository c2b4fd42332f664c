//! [`Renderer::tile`]: the data path of one rectangle of the mosaic.

use crate::Result;
use crate::blend::{OrthoTile, SampleTile, Statistics};
use crate::geom::{Bounds3, PixelRect, held_bytes};
use crate::store::mesh::{PartitionBuffer, PartitionId};
use crate::surface::{SurfaceBuilder, SurfaceTile};
use crate::visibility::{
    BlockPoints, OcclusionScratch, PointCells, RayPoints, SUB_BLOCK, Sight, ViewTile,
};

use super::Scene;
use super::colour::Colouring;

/// Largest side of a block, pixels: larger ones save little, because shafts overlap only at their borders.
const BLOCK: i64 = 256;

/// Smallest side of a block: it is rendered whatever it costs.
const LEAST_BLOCK: i64 = 16;

/// Samples of one sub-block are held at once.
const SUB_BLOCK_AREA: u64 = SUB_BLOCK.unsigned_abs() * SUB_BLOCK.unsigned_abs();

/// Bytes a pixel of a block's surface: elevation, face, point, and a face with its vertices for every pixel.
const SURFACE_BYTES: u64 = 8 + 4 + 24 + 48 + 24;

/// Bytes a pixel of a block where lines are not parallel: its line in the block, its ray's cell, its line on the surface.
const LINE_BYTES: u64 = 24 + 8 + 16 + 12 + 24;

/// Bytes a pixel of a block and a photo that may see it: listed pixel, sorted point, its cell, face and vertex.
const VIEW_BYTES: u64 = 3 + 20 + 8 + 16 + 24;

/// What each photo of the scene needs while a block is rendered.
#[derive(Debug, Default)]
pub(super) struct View {
    /// Index in [`Scene::photos`].
    pub(super) photo: usize,
    pub(super) points: BlockPoints,
    pub(super) cells: PointCells,
    pub(super) tile: ViewTile,
}

/// Renders one rectangle after another, reusing its memory: one for each thread.
#[derive(Debug)]
pub struct Renderer<'a> {
    scene: &'a Scene,
    block_bytes: u64,
    surface: SurfaceBuilder,
    partition: PartitionBuffer,
    column: Vec<PartitionId>,
    shaft: Vec<PartitionId>,
    visits: Vec<(PartitionId, u32)>,
    rays: RayPoints,
    occlusion: OcclusionScratch,
    views: Vec<View>,
    colouring: Colouring,
}

impl<'a> Renderer<'a> {
    /// A renderer of `scene` that keeps its own memory within about `block_bytes`.
    pub fn new(scene: &'a Scene, block_bytes: u64) -> Self {
        Self {
            scene,
            block_bytes,
            surface: SurfaceBuilder::default(),
            partition: PartitionBuffer::default(),
            column: Vec::new(),
            shaft: Vec::new(),
            visits: Vec::new(),
            rays: RayPoints::default(),
            occlusion: OcclusionScratch::default(),
            views: Vec::new(),
            colouring: Colouring::new(scene),
        }
    }

    /// Renders `rect` of the mosaic.
    ///
    /// # Errors
    /// Those of reading the stores.
    pub fn tile(&mut self, rect: PixelRect) -> Result<OrthoTile> {
        let mut tile = OrthoTile::new(rect, &self.scene.blend);
        for block in rect.blocks(BLOCK) {
            self.block(block, &mut tile)?;
        }
        self.colouring.statistics.count_tile(&tile);
        Ok(tile)
    }

    /// Memory held, bytes: it never shrinks, so this is its peak.
    pub fn memory_bytes(&self) -> u64 {
        let views = self
            .views
            .iter()
            .map(|v| v.points.memory_bytes() + v.cells.memory_bytes() + v.tile.memory_bytes());
        self.surface.memory_bytes()
            + self.partition.memory_bytes() as u64
            + self.rays.memory_bytes()
            + self.occlusion.memory_bytes()
            + self.colouring.memory_bytes()
            + held_bytes(&self.column)
            + held_bytes(&self.shaft)
            + held_bytes(&self.visits)
            + views.sum::<u64>()
    }

    /// What was found since the last call.
    pub fn take_statistics(&mut self) -> Statistics {
        std::mem::replace(&mut self.colouring.statistics, Statistics::new(self.scene.names))
    }

    /// Renders a block, or its quarters where it would need more memory than there is.
    fn block(&mut self, rect: PixelRect, tile: &mut OrthoTile) -> Result<()> {
        self.find_column(rect);
        if self.column.is_empty() {
            return Ok(());
        }
        let side = (rect.x1 - rect.x0).max(rect.y1 - rect.y0);
        if self.forecast_bytes(rect) > self.block_bytes && side > LEAST_BLOCK {
            // Sub-blocks stay whole where they can, so that quarters do not make windows smaller than they need be.
            let half = ((side / 2) + 15) / 16 * 16;
            return rect
                .blocks(half.min(side - 1))
                .try_for_each(|quarter| self.block(quarter, tile));
        }
        self.surface()?;
        let views = self.visibility()?;
        self.colouring.block(self.scene, self.surface.tile(), &mut self.views[..views], tile)
    }

    /// Starts the surface of `rect`, and finds the partitions that it may show.
    fn find_column(&mut self, rect: PixelRect) {
        let mosaic = &self.scene.mosaic;
        self.column.clear();
        self.surface.start(mosaic, rect);
        let block = self.surface.block();
        self.scene.mesh.query(|bounds| block.may_show(mosaic, bounds), &mut self.column);
        self.column.sort_unstable();
    }

    /// Memory for a block of which every pixel is seen by every photo that may see its partitions.
    fn forecast_bytes(&self, rect: PixelRect) -> u64 {
        let mesh = &self.scene.mesh;
        let bounds =
            self.column.iter().fold(Bounds3::EMPTY, |all, &p| all.union(mesh.partition_bounds(p)));
        let bounds = self.surface.block().shown_bounds(&self.scene.mosaic, &bounds);
        let views = self.scene.photos.iter().filter(|p| p.view.may_see(&bounds)).count();
        let (area, views) = (rect.area() as u64, views as u64);
        let samples = area.min(SUB_BLOCK_AREA) * SampleTile::BYTES_A_SAMPLE as u64;
        let lines = if self.scene.mosaic.is_parallel() { 0 } else { LINE_BYTES };
        let needed = area * (SURFACE_BYTES + lines + VIEW_BYTES * views) + samples * views;
        // A list that grows may hold more than it needs.
        needed + needed / 2
    }

    /// Stage 1: which face each pixel shows.
    fn surface(&mut self) -> Result<()> {
        for &id in &self.column {
            self.scene.mesh.load(id, &mut self.partition)?;
            self.surface.add(&self.scene.mosaic, &self.partition.block());
        }
        self.surface.finish(&self.scene.mosaic);
        Ok(())
    }

    /// Stage 2: which photos see it; the number of views. Each partition in some photo's shaft is loaded once and
    /// shown to all of them.
    fn visibility(&mut self) -> Result<usize> {
        let count = self.start_views();
        self.visits.clear();
        for (k, view) in self.views[..count].iter().enumerate() {
            self.shaft.clear();
            self.scene.mesh.query(|bounds| view.cells.may_be_hidden_by(bounds), &mut self.shaft);
            let k = u32::try_from(k).expect("fewer than 2³² photos");
            self.visits.extend(self.shaft.iter().map(|&p| (p, k)));
        }
        self.visits.sort_unstable();
        for visits in self.visits.chunk_by(|a, b| a.0 == b.0) {
            let partition = visits[0].0;
            self.scene.mesh.load(partition, &mut self.partition)?;
            let block = self.partition.block();
            for &(_, k) in visits {
                let View { photo, points, cells, .. } = &mut self.views[k as usize];
                let photo = &self.scene.photos[*photo].view;
                let sight =
                    Sight { photo, surface: self.surface.tile(), tolerance: self.scene.tolerance };
                cells.occlude(&sight, &block, points, &mut self.occlusion);
            }
        }
        Ok(count)
    }

    /// Lists the points of the block that each photo may see; the number of photos that may see any.
    fn start_views(&mut self) -> usize {
        let surface: &SurfaceTile = self.surface.tile();
        let bounds = Bounds3::of(surface.points.iter().filter(|p| !p.is_nan()));
        let mut count = 0;
        for (photo, p) in self.scene.photos.iter().enumerate() {
            if bounds.is_empty() || !p.view.may_see(&bounds) {
                continue;
            }
            if self.views.len() == count {
                self.views.push(View::default());
            }
            let view = &mut self.views[count];
            view.photo = photo;
            let sight = Sight { photo: &p.view, surface, tolerance: self.scene.tolerance };
            view.points.start(&sight, &mut self.rays);
            if !view.points.is_empty() {
                view.cells.start(&sight, &mut self.rays);
                view.tile.start_block(surface);
                count += 1;
            }
        }
        count
    }
}
