//! Faces a second of building a mesh store from a PLY file of 300,000 faces, and partitions a second of querying it.

mod scene;

use criterion::{BatchSize, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use groundel::frame::Block;

fn build(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, faces) = scene::write_mesh(folder.path());
    let mut group = c.benchmark_group("mesh");
    group.throughput(Throughput::Elements(faces)).sample_size(10).sampling_mode(SamplingMode::Flat);
    group.bench_function("build", |b| {
        let work = || tempfile::tempdir().expect("a temporary folder");
        b.iter_batched(
            work,
            |work| {
                let store = scene::mesh_store(&file, work.path());
                assert_eq!(store.counts().faces, faces);
                // Its folder is removed outside of what is measured.
                (store, work)
            },
            BatchSize::PerIteration,
        );
    });
    group.finish();
}

fn query(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, _) = scene::write_mesh(folder.path());
    let store = scene::mesh_store(&file, folder.path());
    let mosaic = scene::facade().plane().mosaic().expect("a plane").local(store.origin());
    let blocks: Vec<_> = scene::facade().plane().size().rect().blocks(128).collect();
    let all: Vec<_> = {
        let mut all = Vec::new();
        store.query(|_| true, &mut all);
        all
    };
    assert_eq!(all.len(), store.partition_count());
    let mut group = c.benchmark_group("mesh");
    group.throughput(Throughput::Elements(blocks.len() as u64));
    group.bench_function("query", |b| {
        let mut found = Vec::new();
        b.iter(|| {
            for block in &blocks {
                found.clear();
                store.query(
                    |bounds| Block::outline(*block).may_be_shown(&mosaic, bounds),
                    &mut found,
                );
                assert!(found.len() < all.len());
            }
        });
    });
    // What was found last is what a look at every partition finds.
    let last = blocks.last().expect("several blocks");
    let mut found = Vec::new();
    store.query(|bounds| Block::outline(*last).may_be_shown(&mosaic, bounds), &mut found);
    let is_met = |p: &&_| Block::outline(*last).may_be_shown(&mosaic, &store.partition_bounds(**p));
    assert_eq!(found, all.iter().filter(is_met).copied().collect::<Vec<_>>());
    group.finish();
}

criterion_group!(benches, build, query);
criterion_main!(benches);
