//! [`Renderer::tile`]: the data path of one rectangle of the mosaic.

use crate::Result;
use crate::blend::{OrthoTile, Outliers, SampleTile, Statistics, Weights};
use crate::geom::{Bounds3, HaloRect, PixelRect, held_bytes};
use crate::store::mesh::{PartitionBuffer, PartitionId};
use crate::surface::{SurfaceBuilder, SurfaceTile};
use crate::visibility::{
    BlockPoints, EdgeMap, OcclusionScratch, PointCells, RayPoints, SUB_BLOCK, Sight, ViewTile,
};

use super::colour::{Colouring, Sampler, Section};
use super::sections::{Above, greatest_around};
use super::{Canvas, Scene};

/// Largest side of a block, pixels: larger ones save little, because shafts overlap only at their borders.
const BLOCK: i64 = 256;

/// Smallest side of a block: it is rendered whatever it costs.
const LEAST_BLOCK: i64 = 16;

/// Samples of one sub-block are held at once.
const SUB_BLOCK_AREA: u64 = SUB_BLOCK.unsigned_abs() * SUB_BLOCK.unsigned_abs();

/// Bytes a pixel of a block's surface: elevation, face, point; bytes a face that shows, and a vertex of one.
const SURFACE_BYTES: u64 = 8 + 4 + 24;
const FACE_BYTES: u64 = 48;
const VERTEX_BYTES: u64 = 24;

/// Bytes a pixel of a block where lines are not parallel: its line in the block, its ray's cell, its line on the surface.
const LINE_BYTES: u64 = 24 + 8 + 16 + 12 + 24;

/// Bytes a pixel of a block and a photo that may see it: listed pixel, sorted point, its cell, distance to the border;
/// bytes a face and a vertex there.
const VIEW_BYTES: u64 = 3 + 20 + 8 + 2;
const FACE_VIEW_BYTES: u64 = 16;
const VERTEX_VIEW_BYTES: u64 = 24;

/// What each photo of the scene needs while a block is rendered.
#[derive(Debug, Default)]
pub(super) struct View {
    /// Index in [`Scene::photos`].
    pub(super) photo: usize,
    pub(super) points: BlockPoints,
    pub(super) cells: PointCells,
    pub(super) edges: EdgeMap,
    pub(super) tile: ViewTile,
}

/// Renders one rectangle after another, reusing its memory: one for each thread.
#[derive(Debug)]
pub struct Renderer<'a> {
    pub(super) scene: &'a Scene,
    canvas: &'a Canvas,
    block_bytes: u64,
    surface: SurfaceBuilder,
    partition: PartitionBuffer,
    column: Vec<PartitionId>,
    shaft: Vec<PartitionId>,
    visits: Vec<(PartitionId, u32)>,
    rays: RayPoints,
    occlusion: OcclusionScratch,
    pub(super) views: Vec<View>,
    colouring: Colouring,
    /// Samples of points that are observed.
    pub(super) observer: Sampler,
    above: Above,
}

impl<'a> Renderer<'a> {
    /// A renderer of `scene` on `canvas` that keeps its own memory within about `block_bytes`.
    pub fn new(scene: &'a Scene, canvas: &'a Canvas, block_bytes: u64) -> Self {
        Self {
            scene,
            canvas,
            block_bytes,
            surface: SurfaceBuilder::default(),
            partition: PartitionBuffer::default(),
            column: Vec::new(),
            shaft: Vec::new(),
            visits: Vec::new(),
            rays: RayPoints::default(),
            occlusion: OcclusionScratch::default(),
            views: Vec::new(),
            colouring: Colouring::new(scene, canvas),
            above: Above::default(),
            observer: Sampler::default(),
        }
    }

    /// Renders `rect` of the mosaic, of several sections the highest.
    ///
    /// # Errors
    /// Those of reading the stores.
    #[expect(clippy::missing_panics_doc, reason = "it cannot fail, as the expectation says")]
    pub fn tile(&mut self, rect: PixelRect) -> Result<OrthoTile> {
        Ok(self.section_tiles(rect)?.pop().expect("at least one section"))
    }

    /// Renders `rect` of every section, from the lowest; of an ordinary mosaic one tile.
    ///
    /// # Errors
    /// Those of reading the stores.
    pub fn section_tiles(&mut self, rect: PixelRect) -> Result<Vec<OrthoTile>> {
        let mut tiles = vec![OrthoTile::new(rect, &self.scene.blend); self.canvas.sections()];
        for block in rect.blocks(BLOCK) {
            self.block(block, &mut tiles)?;
        }
        self.colouring.findings.count_tiles(&tiles);
        Ok(tiles)
    }

    /// Memory held, bytes: it never shrinks, so this is its peak.
    pub fn memory_bytes(&self) -> u64 {
        let views = self.views.iter().map(|v| {
            v.points.memory_bytes()
                + v.cells.memory_bytes()
                + v.tile.memory_bytes()
                + v.edges.memory_bytes()
        });
        self.surface.memory_bytes()
            + self.partition.memory_bytes() as u64
            + self.rays.memory_bytes()
            + self.occlusion.memory_bytes()
            + self.colouring.memory_bytes()
            + held_bytes(&self.column)
            + held_bytes(&self.shaft)
            + held_bytes(&self.visits)
            + self.above.memory_bytes()
            + views.sum::<u64>()
    }

    /// What was found since the last call, one a section, from the lowest.
    pub fn take_statistics(&mut self) -> Vec<Statistics> {
        self.colouring.findings.take(self.scene, self.canvas)
    }

    /// Renders a block of all sections, or its quarters where it would need more memory than there is. No section needs
    /// more than the highest.
    fn block(&mut self, rect: PixelRect, tiles: &mut [OrthoTile]) -> Result<()> {
        let highest = tiles.len() - 1;
        self.find_column(rect, highest);
        if self.column.is_empty() {
            return Ok(());
        }
        let side = (rect.x1 - rect.x0).max(rect.y1 - rect.y0);
        if self.forecast_bytes() > self.block_bytes && side > LEAST_BLOCK {
            // Sub-blocks stay whole where they can, so that quarters do not make windows smaller than they need be.
            let half = ((side / 2) + 15) / 16 * 16;
            return rect
                .blocks(half.min(side - 1))
                .try_for_each(|quarter| self.block(quarter, tiles));
        }
        self.load_surface(highest)?;
        self.surface.finish(&self.canvas.mosaic);
        let around = if highest > 0 { greatest_around(self.surface.tile()) } else { Vec::new() };
        self.colour(highest, &around, None, &mut tiles[highest])?;
        if highest > 0 && !self.surface.tile().is_empty() {
            self.above.start(rect, &around);
            for section in (0..highest).rev() {
                let (below, above) = tiles.split_at_mut(section + 1);
                self.lower_section(section, &mut below[section], &above[0])?;
            }
        }
        Ok(())
    }

    /// Renders the block that the section above was rendered of: what that shows within this section's slab is the same
    /// here, the rest is rendered.
    fn lower_section(
        &mut self,
        section: usize,
        tile: &mut OrthoTile,
        above: &OrthoTile,
    ) -> Result<()> {
        let mosaic = self.canvas.section(section);
        let [_, greatest] = mosaic.slab();
        tile.copy_pixels(above, self.above.rect(), |k| !self.above.is_open(k, greatest));
        let Some(open) = self.above.open_bounds(greatest) else { return Ok(()) };
        self.find_column(open, section);
        self.load_surface(section)?;
        let is_open = self.above.open_pixels(open, greatest);
        if self.scene.halo() == 0 {
            self.surface.retain(|k| is_open[k]);
        }
        self.surface.finish(mosaic);
        let around = greatest_around(self.surface.tile());
        if !self.surface.tile().is_empty() {
            self.colour(section, &around, Some(&is_open), tile)?;
        }
        self.above.enter(open, &around, greatest);
        Ok(())
    }

    /// Stages 2 to 5 of a block of a section, whose surface is known; of the inner pixels only those that are open, if that
    /// is said.
    fn colour(
        &mut self,
        section: usize,
        around: &[f64],
        is_open: Option<&[bool]>,
        tile: &mut OrthoTile,
    ) -> Result<()> {
        let views = self.visibility()?;
        let (surface, views) = (self.surface.tile(), &mut self.views[..views]);
        let to =
            Section { scene: self.scene, canvas: self.canvas, number: section, is_open, around };
        self.colouring.block(&to, surface, views, tile)
    }

    /// Starts the surface of `rect`, and of the halo that its colours need, in a section, and finds the partitions that it
    /// may show.
    fn find_column(&mut self, rect: PixelRect, section: usize) {
        self.find_column_of(HaloRect::around(rect, self.scene.halo()), section);
    }

    fn find_column_of(&mut self, area: HaloRect, section: usize) {
        let mosaic = self.canvas.section(section);
        self.column.clear();
        self.surface.start(mosaic, area);
        let block = self.surface.block();
        self.scene.mesh.query(|bounds| block.may_show(mosaic, bounds), &mut self.column);
        self.column.sort_unstable();
    }

    /// Stages 1 and 2 of a rectangle of the highest section: the number of views.
    pub(super) fn look(&mut self, area: HaloRect) -> Result<usize> {
        let highest = self.canvas.sections() - 1;
        self.find_column_of(area, highest);
        self.load_surface(highest)?;
        self.surface.finish(&self.canvas.mosaic);
        self.visibility()
    }

    /// How far from the border of what view `k` sees the pixels lie, of what [`Self::look`] looked at.
    pub(super) fn find_edges(&mut self, k: usize) -> Result<()> {
        let to = Section::highest(self.scene, self.canvas);
        self.colouring.find_edges(&to, self.surface.tile(), &mut self.views[k])
    }

    /// What view `k` sees of the rectangle that [`Self::look`] looked at, one sub-block.
    pub(super) fn take_view(&mut self, k: usize, rect: PixelRect) -> Result<()> {
        let to = Section::highest(self.scene, self.canvas);
        self.colouring.take_view(&to, self.surface.tile(), (0, rect), &mut self.views[k])
    }

    /// Memory for a block of which every pixel is seen by every photo that may see its partitions.
    fn forecast_bytes(&self) -> u64 {
        let mesh = &self.scene.mesh;
        let bounds =
            self.column.iter().fold(Bounds3::EMPTY, |all, &p| all.union(mesh.partition_bounds(p)));
        let bounds = self.surface.block().shown_bounds(&self.canvas.mosaic, &bounds);
        let views = self.scene.photos.iter().filter(|p| p.view.may_see(&bounds)).count();
        let (area, views) = (self.surface.tile().rect.area() as u64, views as u64);
        let sample_bytes = match self.scene.blend.outliers {
            Outliers::Robust => SampleTile::BYTES_A_SOFT_SAMPLE,
            Outliers::None | Outliers::Sigma => SampleTile::BYTES_A_SAMPLE,
        };
        let samples = area.min(SUB_BLOCK_AREA) * sample_bytes as u64;
        let lines = if self.canvas.mosaic.is_parallel() { 0 } else { LINE_BYTES };
        // A pixel shows one face at most. Of faces smaller than pixels, no two that show need share a vertex.
        let column: u64 = self.column.iter().map(|&p| mesh.partition_triangles(p) as u64).sum();
        let (faces, vertices) = (column.min(area), column.min(3 * area));
        let needed = area * (SURFACE_BYTES + lines + VIEW_BYTES * views)
            + faces * (FACE_BYTES + FACE_VIEW_BYTES * views)
            + vertices * (VERTEX_BYTES + VERTEX_VIEW_BYTES * views)
            + samples * views;
        // A list that grows may hold more than it needs.
        needed + needed / 2
    }

    /// Stage 1: which face each pixel shows; the surface is still to be finished.
    fn load_surface(&mut self, section: usize) -> Result<()> {
        let mosaic = self.canvas.section(section);
        for &id in &self.column {
            self.scene.mesh.load(id, &mut self.partition)?;
            self.surface.add(mosaic, &self.partition.block());
        }
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
                    Sight { photo, surface: self.surface.tile(), tolerance: self.canvas.tolerance };
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
            let sight = Sight { photo: &p.view, surface, tolerance: self.canvas.tolerance };
            view.points.start(&sight, &mut self.rays);
            if !view.points.is_empty() {
                view.cells.start(&sight, &mut self.rays);
                view.tile.start_block(surface, self.scene.blend.weights == Weights::Sharp);
                count += 1;
            }
        }
        count
    }
}
