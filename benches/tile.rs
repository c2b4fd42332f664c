//! Pixels a second of a block of 256 × 256 pixels of the façade: its surface, one photo's visibility, and all of it
//! through the renderer. Stores are in memory, the photos' tiles decoded.

mod scene;

use std::path::Path;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use groundel::camera::Photo;
use groundel::frame::Block;
use groundel::geom::PixelRect;
use groundel::image::Samples;
use groundel::input::photo::read_photo_header;
use groundel::render::{
    BlendSettings, Canvas, Interpolation, OrthoTile, Renderer, Scene, ScenePhoto, Tolerance,
};
use groundel::store::mesh::{PartitionBuffer, PartitionId};
use groundel::store::photo::{PhotoFingerprint, PhotoStore, PhotoTiles};
use groundel::surface::SurfaceBuilder;
use groundel::synthetic::{Caster, Sampling, photograph, photos, write_picture};
use groundel::visibility::{
    BlockPoints, OcclusionScratch, PointCells, RayPoints, SUB_BLOCK, Sight,
};

/// A block in the middle of the mosaic.
const BLOCK: PixelRect = PixelRect { x0: 256, y0: 128, x1: 512, y1: 384 };

/// Pixels of the block that show no surface, at most: it lies within the façade.
const MOST_EMPTY: usize = 100;

/// Everything that a tile is rendered from, made in `folder`.
fn whole_scene(folder: &Path) -> (Scene, Canvas) {
    let set = scene::facade();
    let mesh = scene::mesh_store(&scene::write_mesh(folder).0, folder);
    let photos = photos(&set.shots()).expect("seven photos").photos;
    let pixels = pixels(folder, &Caster::of_scene(&set.scene()), &photos);
    let origin = mesh.origin();
    let of = |(photo, k): (&Photo, u16)| ScenePhoto::new(k, photo, origin, 1.0);
    let scene = Scene {
        photos: photos.iter().zip(0..).map(of).collect(),
        names: photos.len(),
        mesh,
        pixels,
        masks: None,
        interpolation: Interpolation::Bicubic,
        blend: BlendSettings::default(),
    };
    let canvas = Canvas {
        mosaic: set.plane().mosaic().expect("a plane").local(origin),
        below: Vec::new(),
        tolerance: Tolerance::Fixed(0.02 * set.pixel_size),
    };
    (scene, canvas)
}

fn pixels(folder: &Path, caster: &Caster, photos: &[Photo]) -> PhotoStore {
    let mut entries = Vec::new();
    for photo in photos {
        let path = folder.join(&photo.name);
        let picture = Samples::U8(photograph(caster, photo, Sampling::Edges(2), 3));
        write_picture(&path, &picture).expect("room for a photo");
        let header = read_photo_header(&path).expect("a photo");
        let fingerprint = PhotoFingerprint::of(&photo.name, &path).expect("a photo");
        let store = path.with_extension("tiles");
        PhotoTiles::build(&path, &header, fingerprint, &store).expect("a good photo");
        entries.push((photo.id.0 as usize, store));
    }
    PhotoStore::open(entries, 256 << 20).expect("stores that were just made")
}

fn surface(
    (scene, canvas): (&Scene, &Canvas),
    column: &[PartitionId],
    builder: &mut SurfaceBuilder,
) {
    let mut partition = PartitionBuffer::new();
    builder.start(&canvas.mosaic, BLOCK);
    for &id in column {
        scene.mesh.load(id, &mut partition).expect("a good store");
        builder.add(&canvas.mosaic, &partition.block());
    }
    builder.finish(&canvas.mosaic);
}

/// What is needed to decide where one photo sees a block.
#[derive(Default)]
struct View {
    rays: RayPoints,
    points: BlockPoints,
    cells: PointCells,
    scratch: OcclusionScratch,
    partition: PartitionBuffer,
    shaft: Vec<PartitionId>,
}

impl View {
    /// Which pixels the photo sees; their number.
    fn decide(&mut self, scene: &Scene, sight: &Sight<'_>) -> usize {
        self.points.start(sight, &mut self.rays);
        self.cells.start(sight, &mut self.rays);
        self.shaft.clear();
        let cells = &self.cells;
        scene.mesh.query(|bounds| cells.may_be_hidden_by(bounds), &mut self.shaft);
        for &id in &self.shaft {
            scene.mesh.load(id, &mut self.partition).expect("a good store");
            let block = self.partition.block();
            self.cells.occlude(sight, &block, &mut self.points, &mut self.scratch);
        }
        (0..BLOCK.blocks(SUB_BLOCK).count()).map(|k| self.points.seen_in(k).count()).sum()
    }
}

fn tile(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (scene, canvas) = whole_scene(folder.path());
    let (mut column, block) = (Vec::new(), Block::outline(BLOCK));
    scene.mesh.query(|bounds| block.may_be_shown(&canvas.mosaic, bounds), &mut column);
    let mut group = c.benchmark_group("tile");
    group.throughput(Throughput::Elements(BLOCK.area() as u64)).sample_size(20);

    let mut builder = SurfaceBuilder::default();
    group.bench_function("surface", |b| {
        b.iter(|| surface((&scene, &canvas), &column, &mut builder));
    });
    surface((&scene, &canvas), &column, &mut builder);
    let shown = builder.tile().points.iter().filter(|p| !p.is_nan()).count();
    assert!(BLOCK.area() - shown <= MOST_EMPTY, "{shown} pixels show a surface");

    let photo = &scene.photos[1].view;
    let sight = Sight { photo, surface: builder.tile(), tolerance: canvas.tolerance };
    let mut view = View::default();
    group.bench_function("visibility", |b| b.iter(|| view.decide(&scene, &sight)));
    let seen = view.decide(&scene, &sight);

    let mut renderer = Renderer::new(&scene, &canvas, 1 << 30);
    group.bench_function("whole", |b| {
        b.iter(|| renderer.tile(BLOCK).expect("good stores"));
    });
    renderer.take_statistics();
    let whole: OrthoTile = renderer.tile(BLOCK).expect("good stores");
    assert!(whole.count.data().iter().filter(|&&n| n >= 1).count() >= shown / 10 * 9);
    let found = renderer.take_statistics()[0].photos[1].seen;
    assert_eq!(found, seen as u64, "the renderer and the bench decide alike");
    group.finish();
}

criterion_group!(benches, tile);
criterion_main!(benches);
