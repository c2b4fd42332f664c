//! Stores built from seeded meshes, against the meshes themselves.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::join::Join;
use super::vertices::pack;
use super::{BuildStage, MeshBuild, MeshKey, MeshStore, PartitionBuffer, PartitionId};
use crate::geom::{Bounds3, FaceStream, MeshSource, PolygonFan, TriangleChunk, VertexStream};
use crate::{Error, Result};

/// A mesh in memory, with a file that gives it a name and a content for its key.
#[derive(Debug, Clone)]
struct TestMesh {
    path: PathBuf,
    vertices: Vec<DVec3>,
    faces: Vec<Vec<u32>>,
}

impl MeshSource for TestMesh {
    fn path(&self) -> &Path {
        &self.path
    }
    fn vertex_count(&self) -> u64 {
        self.vertices.len() as u64
    }
    fn face_count(&self) -> u64 {
        self.faces.len() as u64
    }
    fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
        Ok(Box::new(TestVertices(&self.vertices)))
    }
    fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
        Ok(Box::new(TestFaces(&self.faces, 0)))
    }
}

struct TestVertices<'a>(&'a [DVec3]);

impl VertexStream for TestVertices<'_> {
    fn next_vertices(&mut self, max: usize, out: &mut Vec<DVec3>) -> Result<()> {
        let (now, later) = self.0.split_at(max.min(self.0.len()));
        out.clear();
        out.extend_from_slice(now);
        self.0 = later;
        Ok(())
    }
}

struct TestFaces<'a>(&'a [Vec<u32>], u32);

impl FaceStream for TestFaces<'_> {
    fn next_faces(&mut self, max: usize, out: &mut TriangleChunk) -> Result<()> {
        out.clear();
        while let Some((face, rest)) = self.0.split_first().filter(|_| out.triangles.len() < max) {
            let mut fan = PolygonFan::new(self.1);
            for &vertex in face {
                fan.push(vertex, out);
            }
            fan.finish(out);
            (self.0, self.1) = (rest, self.1 + 1);
        }
        Ok(())
    }
}

/// Numbers from a seed: `SplitMix64` (Steele, Lea, Flood 2014, doi:10.1145/2660193.2660195).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
    fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.next() % n as u64).unwrap()
    }
}

/// A bumpy wall of `n` × `n` cells at UTM-like coordinates: triangles and quads mixed, some huge faces, some
/// degenerate ones; in an order without locality if `is_shuffled`.
fn wall(folder: &Path, n: u32, is_shuffled: bool) -> TestMesh {
    let mut random = Random(u64::from(n));
    let at = DVec3::new(500_000.0, 4_200_000.0, 100.0);
    let mut vertices = Vec::new();
    for row in 0..=n {
        for column in 0..=n {
            let (x, z) = (f64::from(column) * 0.01, f64::from(row) * 0.01);
            vertices.push(at + DVec3::new(x, random.unit() * 0.02, z));
        }
    }
    let corner = |row: u32, column: u32| row * (n + 1) + column;
    let mut faces = Vec::new();
    for row in 0..n {
        for column in 0..n {
            let [a, b] = [corner(row, column), corner(row, column + 1)];
            let [c, d] = [corner(row + 1, column + 1), corner(row + 1, column)];
            match random.below(10) {
                0..4 => faces.push(vec![a, b, c, d]),
                4 => faces.extend([vec![a, b, c], vec![a, c, d], vec![a, a, b], vec![d, c]]),
                _ => faces.extend([vec![a, b, c], vec![a, c, d]]),
            }
        }
    }
    faces.push(vec![corner(0, 0), corner(0, n), corner(n, n)]);
    faces.push(vec![corner(0, 0), corner(n / 2, n / 3), corner(n, 0)]);
    if is_shuffled {
        for k in (1..faces.len()).rev() {
            faces.swap(k, random.below(k + 1));
        }
    }
    let path = folder.join(format!("wall-{n}-{is_shuffled}.mesh"));
    std::fs::write(&path, "content").unwrap();
    TestMesh { path, vertices, faces }
}

fn build_in(work: &Path, meshes: &[&dyn MeshSource], budget_bytes: usize) -> Result<MeshStore> {
    let build = MeshBuild { work: work.to_path_buf(), budget_bytes, resident_limit_bytes: 0 };
    build.open_or_build(meshes, &mut |_, _, _| Ok(()))
}

fn partitions_of(store: &MeshStore) -> Vec<PartitionId> {
    (0..u32::try_from(store.partition_count()).unwrap()).map(PartitionId).collect()
}

/// All triangles of a store in ground coordinates, by face id.
fn triangles_of(store: &MeshStore) -> BTreeMap<u32, Vec<[DVec3; 3]>> {
    let mut all: BTreeMap<u32, Vec<[DVec3; 3]>> = BTreeMap::new();
    let mut buffer = PartitionBuffer::new();
    for id in partitions_of(store) {
        store.load(id, &mut buffer).unwrap();
        let block = buffer.block();
        for (k, face) in block.ids.iter().enumerate() {
            all.entry(face.0).or_default().push(block.corners(k).map(|p| p + store.origin()));
        }
    }
    all
}

/// What the store should hold, to half a lattice step.
fn assert_holds(store: &MeshStore, meshes: &[&TestMesh]) {
    let found = triangles_of(store);
    let mut first = 0;
    let mut kept = 0;
    for mesh in meshes {
        for (id, face) in (first..).zip(&mesh.faces) {
            let corner = |k: usize| mesh.vertices[face[k] as usize];
            let fan = (2..face.len()).map(|k| [corner(0), corner(k - 1), corner(k)]);
            let mut expected: Vec<_> =
                fan.filter(|[a, b, c]| (*b - *a).cross(*c - *a).length() > 1e-12).collect();
            kept += usize::from(!expected.is_empty());
            let mut found = found.get(&id).cloned().unwrap_or_default();
            assert_eq!(found.len(), expected.len(), "face {id}");
            // A polygon's triangles may stand in two partitions, in either order.
            let order = |a: &[DVec3; 3], b: &[DVec3; 3]| {
                let key = |t: &[DVec3; 3]| t.map(|p| p.to_array().map(|v| (v * 1e6).round()));
                key(a).partial_cmp(&key(b)).unwrap()
            };
            found.sort_by(order);
            expected.sort_by(order);
            for (found, expected) in found.iter().zip(&expected) {
                for (p, q) in found.iter().zip(expected) {
                    assert!((*p - *q).abs().max_element() <= 1e-9, "face {id}: {p} {q}");
                }
            }
        }
        first += u32::try_from(mesh.faces.len()).unwrap();
    }
    assert_eq!(found.len(), kept);
    let counts = store.counts();
    assert_eq!(counts.faces_kept, kept as u64);
    assert_eq!(counts.faces, u64::from(first));
    assert_eq!(counts.triangles, found.values().map(|t| t.len() as u64).sum::<u64>());
}

#[test]
fn a_store_holds_every_face_with_its_id_and_every_vertex_to_a_nanometre() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (wall(dir.path(), 90, false), wall(dir.path(), 40, true));
    let store = build_in(&dir.path().join("work"), &[&a, &b], 64 << 20).unwrap();
    assert_holds(&store, &[&a, &b]);
    assert!(store.step() < 1e-9 && store.step() > 1e-13);
    assert!(store.partition_count() > 20);
    let short = [&a, &b].iter().flat_map(|m| &m.faces).filter(|f| f.len() < 3).count();
    assert_eq!(store.counts().short_faces, short as u64);
    assert_eq!(store.counts().triangles_dropped, short as u64, "each short face has a flat twin");
    let bounds = Bounds3::of(a.vertices.iter().map(|&p| p - store.origin()));
    assert!((store.bounds().min - bounds.min).length() < 1e-9);
    assert!((store.bounds().max - bounds.max).length() < 1e-9);
}

#[test]
fn the_bytes_depend_on_neither_budget_nor_threads() {
    let dir = tempfile::tempdir().unwrap();
    for is_shuffled in [false, true] {
        let (a, b) = (wall(dir.path(), 120, is_shuffled), wall(dir.path(), 30, true));
        let mut bytes: Vec<Vec<u8>> = Vec::new();
        for (budget_bytes, threads) in
            [(256 << 20, 2), (256 << 20, 1), (1 << 20, 2), (100 << 10, 3)]
        {
            let work = dir.path().join(format!("{is_shuffled}-{budget_bytes}-{threads}"));
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let store = pool.install(|| build_in(&work, &[&a, &b], budget_bytes)).unwrap();
            bytes.push(std::fs::read(store.path()).unwrap());
            let files: Vec<_> = std::fs::read_dir(&work).unwrap().collect();
            assert_eq!(files.len(), 2, "store and lock: {files:?}");
        }
        assert!(bytes.windows(2).all(|pair| pair[0] == pair[1]), "shuffled: {is_shuffled}");
    }
}

#[test]
fn shared_edges_are_bit_identical_across_partitions_at_utm_coordinates() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = wall(dir.path(), 80, false);
    let store = build_in(dir.path(), &[&mesh], 1 << 20).unwrap();
    let mut values: BTreeMap<[u64; 3], DVec3> = BTreeMap::new();
    for (id, triangles) in triangles_of(&store) {
        let face = &mesh.faces[id as usize];
        for corner in triangles.iter().flatten() {
            // The file's vertex within a nanometre, and one stored value for each.
            let nearest = face.iter().map(|&v| mesh.vertices[v as usize]);
            let vertex =
                nearest.min_by(|a, b| (*a - *corner).length().total_cmp(&(*b - *corner).length()));
            let vertex = vertex.unwrap();
            assert!((vertex - *corner).length() < 1e-9);
            let known = values.entry(vertex.to_array().map(f64::to_bits)).or_insert(*corner);
            assert_eq!(*known, *corner);
        }
    }
    assert_eq!(values.len(), mesh.vertices.len());
}

#[test]
fn a_query_gives_every_partition_whose_bounds_match_in_order() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = wall(dir.path(), 150, false);
    let store = build_in(dir.path(), &[&mesh], 1 << 20).unwrap();
    let all = partitions_of(&store);
    let mut random = Random(5);
    let (low, high) = (store.bounds().min, store.bounds().max);
    let mut visited = 0;
    for round in 0..200 {
        let mut point =
            || low + (high - low) * DVec3::new(random.unit(), random.unit(), random.unit());
        let centre = point();
        let half = (high - low) * if round % 2 == 0 { 0.02 } else { 0.3 };
        let shaft = Bounds3 { min: centre - half, max: centre + half };
        let mut found = Vec::new();
        let mut calls = 0;
        let keep = |b: &Bounds3| {
            calls += 1;
            b.intersects(&shaft)
        };
        store.query(keep, &mut found);
        visited += calls;
        let matches = |id: &PartitionId| store.partition_bounds(*id).intersects(&shaft);
        assert_eq!(found, all.iter().copied().filter(matches).collect::<Vec<_>>());
    }
    assert!(visited < 200 * all.len(), "{visited} visits: the tree culls nothing");
    let (mut none, mut every) = (Vec::new(), Vec::new());
    store.query(|_| false, &mut none);
    store.query(|_| true, &mut every);
    assert_eq!((none, every), (vec![], all.clone()));
    let mut buffer = PartitionBuffer::new();
    for id in all {
        store.load(id, &mut buffer).unwrap();
        assert_eq!(buffer.block().bounds, Bounds3::of(buffer.block().positions.iter().copied()));
        assert_eq!(buffer.block().bounds, store.partition_bounds(id));
        assert_eq!(buffer.block().ids.len(), store.partition_triangles(id));
    }
}

#[test]
fn huge_faces_do_not_inflate_the_bounds_of_the_others() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = wall(dir.path(), 150, false);
    let store = build_in(dir.path(), &[&mesh], 1 << 20).unwrap();
    let extent = store.bounds().diagonal();
    let is_huge = |id: &PartitionId| store.partition_bounds(*id).diagonal() > 0.5 * extent;
    assert!(partitions_of(&store).iter().filter(|id| is_huge(id)).count() <= 2);
}

#[test]
fn a_flip_of_any_byte_of_a_store_is_an_error_when_opened_or_loaded() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = wall(dir.path(), 70, false);
    let store = build_in(dir.path(), &[&mesh], 1 << 20).unwrap();
    let path = store.path().to_path_buf();
    let good = std::fs::read(&path).unwrap();
    // Mapped and copied in turn.
    let limit = std::cell::Cell::new(0);
    let use_all = |path: &Path| -> Result<()> {
        limit.set(!limit.get());
        let store = MeshStore::open(path, limit.get())?;
        let mut buffer = PartitionBuffer::new();
        partitions_of(&store).into_iter().try_for_each(|id| store.load(id, &mut buffer))
    };
    let damaged = dir.path().join("damaged");
    std::fs::write(&damaged, &good).unwrap();
    use_all(&damaged).unwrap();
    let places = (0..good.len()).step_by(1999).chain(0..256).chain(good.len() - 500..good.len());
    for place in places {
        let mut bytes = good.clone();
        bytes[place] ^= 1 << (place % 8);
        std::fs::write(&damaged, bytes).unwrap();
        let error = use_all(&damaged).err().unwrap_or_else(|| panic!("byte {place}"));
        assert!(matches!(error, Error::Corrupt { .. }), "byte {place}: {error}");
    }
    for length in [0, 1, 255, 256, 257, good.len() / 2, good.len() - 1] {
        std::fs::write(&damaged, &good[..length]).unwrap();
        assert!(matches!(use_all(&damaged), Err(Error::Corrupt { .. })), "length {length}");
    }
    std::fs::write(&damaged, [&good[..], &[0]].concat()).unwrap();
    assert!(use_all(&damaged).is_err());
}

#[test]
fn a_matching_store_is_reused_and_a_damaged_or_stale_one_rebuilt() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = wall(dir.path(), 30, false);
    let work = dir.path().join("work");
    let build = MeshBuild { work, budget_bytes: 1 << 20, resident_limit_bytes: u64::MAX };
    let mut stages = Vec::new();
    let mut open = || {
        stages.clear();
        let store = build.open_or_build(&[&mesh], &mut |stage, done, total| {
            assert!(done <= total);
            stages.push(stage);
            Ok(())
        });
        (store.unwrap().path().to_path_buf(), stages.clone())
    };
    let (path, first) = open();
    assert!(first.is_sorted() && first.contains(&BuildStage::Partitions));
    assert_eq!(path, build.store_path(MeshKey::of(&[&mesh]).unwrap()));
    assert_eq!(open(), (path.clone(), vec![]));
    let good = std::fs::read(&path).unwrap();
    std::fs::write(&path, &good[..good.len() / 2]).unwrap();
    // What a killed process leaves behind.
    std::fs::create_dir_all(path.with_extension("tmp")).unwrap();
    std::fs::write(path.with_extension("tmp").join("store"), "half").unwrap();
    assert_ne!(open().1, []);
    assert!(std::fs::read(&path).unwrap() == good);
    assert!(!path.with_extension("tmp").exists());
    std::fs::write(&mesh.path, "other content").unwrap();
    let (other, stages) = open();
    assert!(other != path && !stages.is_empty());
}

#[test]
fn two_writers_of_one_store_do_not_meet() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = wall(dir.path(), 60, false);
    let built = std::sync::atomic::AtomicU32::new(0);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                let work = dir.path().join("work");
                let build = MeshBuild { work, budget_bytes: 1 << 20, resident_limit_bytes: 0 };
                let mut was_built = 0;
                let on_progress = &mut |_, _, _| {
                    was_built = 1;
                    Ok(())
                };
                assert_holds(&build.open_or_build(&[&mesh], on_progress).unwrap(), &[&mesh]);
                built.fetch_add(was_built, std::sync::atomic::Ordering::Relaxed);
            });
        }
    });
    assert_eq!(built.into_inner(), 1);
}

#[test]
fn a_vertex_that_is_not_finite_is_an_error_only_if_a_face_uses_it() {
    let dir = tempfile::tempdir().unwrap();
    let mut mesh = wall(dir.path(), 20, false);
    let unused = mesh.vertices.len();
    mesh.vertices.extend([DVec3::NAN, DVec3::INFINITY, DVec3::splat(1e200)]);
    for budget_bytes in [1 << 20, 100 << 10] {
        let work = dir.path().join(budget_bytes.to_string());
        let store = build_in(&work, &[&mesh], budget_bytes).unwrap();
        assert_eq!(store.counts().vertices_unusable, 3);
        assert_holds(&store, &[&mesh]);
        for (k, value) in [f64::NAN, f64::NEG_INFINITY, 1e300].into_iter().enumerate() {
            let mut bad = mesh.clone();
            bad.vertices[unused + k].y = value;
            bad.faces[7].push(u32::try_from(unused + k).unwrap());
            bad.path = dir.path().join(format!("bad-{k}"));
            std::fs::write(&bad.path, "").unwrap();
            let message = build_in(&work, &[&mesh, &bad], budget_bytes).unwrap_err().to_string();
            assert!(message.contains(&format!("bad-{k}")), "{message}");
            assert!(
                message.contains(&format!("vertex {}, used by face 7", unused + k)),
                "{message}"
            );
        }
        let stores = std::fs::read_dir(&work).unwrap().map(|f| f.unwrap().path());
        let left: Vec<_> = stores.filter(|f| f.extension() != Some("lock".as_ref())).collect();
        assert_eq!(left, [store.path()], "nothing but the first store");
    }
}

#[test]
fn a_join_gives_the_corners_of_the_triangles_that_are_left_in_their_order() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = wall(dir.path(), 40, true);
    let point = |v: u32| (v % 50 != 7).then_some([i64::from(v), -5, i64::from(v) * 1000]);
    let vertices = dir.path().join("vertices");
    let all = 0..u32::try_from(mesh.vertices.len()).unwrap();
    std::fs::write(&vertices, all.flat_map(|v| pack(point(v))).collect::<Vec<u8>>()).unwrap();
    for (budget_bytes, chunk, skip) in [(0, 100, 3), (5000, 10, 7), (1 << 20, 1000, 0)] {
        let join = Join { source: &mesh, chunk, skip, folder: dir.path(), budget_bytes };
        let mut answers = join.run(&vertices).unwrap();
        let (mut stream, mut triangles) = (mesh.faces().unwrap(), TriangleChunk::default());
        let mut packed = Vec::new();
        for k in 0.. {
            stream.next_faces(chunk, &mut triangles).unwrap();
            if triangles.is_empty() {
                break;
            }
            if k >= skip {
                answers.take(&triangles.triangles, &mut packed).unwrap();
                let expected = triangles.triangles.iter().flatten().flat_map(|&v| pack(point(v)));
                assert!(packed == expected.collect::<Vec<u8>>(), "chunk {k} of {chunk}");
            }
        }
        drop(answers);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2, "mesh and vertices are left");
    }
}

#[test]
fn meshes_of_nothing_give_a_store_of_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("empty");
    std::fs::write(&path, "").unwrap();
    let one = vec![DVec3::new(5e5, 4e6, 7.0); 3];
    for (vertices, faces) in [(vec![], vec![]), (one, vec![vec![0, 1, 2], vec![]])] {
        let mesh = TestMesh { path: path.clone(), vertices, faces };
        std::fs::write(&path, mesh.faces.len().to_string()).unwrap();
        let store = build_in(dir.path(), &[&mesh], 1 << 20).unwrap();
        assert_eq!((store.partition_count(), store.bounds()), (0, Bounds3::EMPTY));
        assert_eq!(store.counts().faces_dropped(), mesh.faces.len() as u64);
        let mut found = Vec::new();
        store.query(|_| true, &mut found);
        assert_eq!(found, []);
    }
}

#[test]
fn more_faces_than_ids_is_a_limit() {
    #[derive(Debug)]
    struct Endless(PathBuf);
    impl MeshSource for Endless {
        fn path(&self) -> &Path {
            &self.0
        }
        fn vertex_count(&self) -> u64 {
            0
        }
        fn face_count(&self) -> u64 {
            u64::from(u32::MAX) / 2 + 1
        }
        fn vertices(&self) -> Result<Box<dyn VertexStream + '_>> {
            Ok(Box::new(TestVertices(&[])))
        }
        fn faces(&self) -> Result<Box<dyn FaceStream + '_>> {
            Ok(Box::new(TestFaces(&[], 0)))
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let mesh = Endless(dir.path().join("endless"));
    std::fs::write(&mesh.0, "").unwrap();
    assert!(build_in(dir.path(), &[&mesh], 1 << 20).is_ok());
    let error = build_in(dir.path(), &[&mesh, &mesh], 1 << 20).unwrap_err();
    assert!(matches!(error, Error::Limit { found, .. } if found == 1 << 32), "{error}");
}

#[test]
fn a_fan_of_many_triangles_around_one_vertex_survives_any_budget() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("fan");
    std::fs::write(&path, "").unwrap();
    let rim = (0..20_000).map(|k| {
        let angle = f64::from(k) * 3e-4;
        DVec3::new(libm::cos(angle), libm::sin(angle), 0.0)
    });
    let vertices: Vec<DVec3> = std::iter::once(DVec3::ZERO).chain(rim).collect();
    let count = u32::try_from(vertices.len()).unwrap();
    let mesh = TestMesh { path, vertices, faces: vec![(0..count).collect()] };
    let bytes = [64 << 20, 100 << 10].map(|budget_bytes| {
        let store = build_in(&dir.path().join(budget_bytes.to_string()), &[&mesh], budget_bytes);
        let store = store.unwrap();
        assert_eq!(store.counts().triangles, u64::from(count) - 2);
        assert_eq!((store.counts().faces, store.counts().faces_kept), (1, 1));
        std::fs::read(store.path()).unwrap()
    });
    assert!(bytes[0] == bytes[1]);
}
