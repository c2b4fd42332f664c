//! Block by block as in one: the same triangles, which are those of the definition.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;

use glam::{DVec2, DVec3};
use proptest::prelude::*;

use super::block::Points;
use super::delaunay::{Site, by_definition};
use super::leaves::LeafMaker;
use super::plane::TinPlane;
use super::sort::{Sorter, point_bytes};
use crate::geom::orient2d;
use crate::synthetic::Random;

const TOP: TinPlane = TinPlane { origin: DVec3::ZERO, u: DVec3::X, v: DVec3::Y, n: DVec3::Z };

/// How points lie.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Random,
    /// Dense in a few places, sparse between.
    Clustered,
    /// Whole numbers: every square is a circle of four.
    Grid,
    /// Tenths, far from the origin: squares that are none, in the last bits.
    FarGrid,
    /// Many points on few circles.
    Circles,
    /// All on one line, but for one point.
    Line,
}

const KINDS: [Kind; 6] =
    [Kind::Random, Kind::Clustered, Kind::Grid, Kind::FarGrid, Kind::Circles, Kind::Line];

/// About `n` points, in a mixed order, some of them twice.
fn cloud(kind: Kind, n: usize, seed: u64) -> Vec<DVec3> {
    let mut random = Random::new(seed);
    let mut unit = || (random.bits() >> 11) as f64 / (1_u64 << 53) as f64;
    let side = (n as f64).sqrt().ceil();
    let mut all: Vec<DVec3> = (0..n)
        .map(|k| {
            let (i, j) = (k as f64 % side, (k as f64 / side).floor());
            let at = match kind {
                Kind::Random => DVec2::new(unit(), unit()) * side,
                Kind::Clustered => {
                    let (centre, spread) = (k % 7, [0.01, 0.3, side][k % 3]);
                    let centre = DVec2::new(centre as f64, (centre * 3 % 7) as f64) * side / 7.0;
                    centre + DVec2::new(unit() - 0.5, unit() - 0.5) * spread
                }
                Kind::Grid => DVec2::new(i, j),
                Kind::FarGrid => DVec2::new(5e5 + 0.1 * i, 4.2e6 + 0.1 * j),
                // Whole points on the circle of radius √1105, again and again.
                Kind::Circles => {
                    let points = [
                        (33, 4),
                        (32, 9),
                        (31, 12),
                        (24, 23),
                        (9, 32),
                        (4, 33),
                        (23, 24),
                        (12, 31),
                    ];
                    let (x, y) = points[k % 8];
                    let (sx, sy) = ([1, -1][k / 8 % 2], [1, -1][k / 16 % 2]);
                    DVec2::new(f64::from(x * sx) + 66.0 * (k / 32) as f64, f64::from(y * sy))
                }
                Kind::Line if k == 0 => DVec2::new(3.0, 1.0),
                Kind::Line => DVec2::new(k as f64, 2.0 * k as f64),
            };
            at.extend(unit())
        })
        .collect();
    let twice: Vec<DVec3> = all.iter().step_by(9).map(|&p| p - DVec3::Z).collect();
    all.extend(twice);
    for k in (1..all.len()).rev() {
        all.swap(k, usize::try_from(random.bits() % (k as u64 + 1)).unwrap());
    }
    all
}

/// How a cloud is cut.
#[derive(Debug, Clone, Copy)]
struct Cut {
    leaf: usize,
    wanted: u64,
    held: usize,
}

const WHOLE: Cut = Cut { leaf: 1 << 20, wanted: 1 << 40, held: 1 << 20 };

/// The sites of the TIN, its triangles, and how many blocks they came from.
fn tin(
    cloud: &[DVec3],
    plane: TinPlane,
    max_edge: f64,
    cut: Cut,
) -> (Vec<Site>, Vec<[u32; 3]>, usize) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points");
    let mut file = std::fs::File::create(&path).unwrap();
    let (mut leaves, mut sites) = (LeafMaker::new(cut.leaf), Vec::new());
    let mut sorter = Sorter::new(plane, cut.held, folder.path());
    for &point in cloud {
        sorter.push(point).unwrap();
    }
    let doubles = sorter
        .finish(&mut |point| {
            leaves.push(point);
            sites.push(Site { at: point.at, number: u32::try_from(sites.len()).unwrap() });
            file.write_all(&point_bytes(point.ground)).unwrap();
            Ok(())
        })
        .unwrap();
    assert_eq!(doubles + sites.len() as u64, cloud.len() as u64);
    let leaves = leaves.finish();
    let points = Points { path: &path, at: 0, plane, leaves: &leaves, max_edge };
    let blocks = leaves.blocks(max_edge, cut.wanted, u64::MAX, 1).unwrap();
    let triangles = blocks.iter().flat_map(|block| points.triangles(block).unwrap()).collect();
    (sites, triangles, blocks.len())
}

/// Every edge belongs to one triangle, or to two that lie on different sides of it.
fn assert_valid(sites: &[Site], triangles: &[[u32; 3]]) {
    let mut edges = BTreeSet::new();
    for &[a, b, c] in triangles {
        assert!(a < b && a < c);
        let [p, q, r] = [a, b, c].map(|k| sites[k as usize].at);
        assert!(orient2d(p, q, r) > 0.0);
        for edge in [(a, b), (b, c), (c, a)] {
            assert!(edges.insert(edge), "two triangles on one side of an edge");
        }
    }
    assert!(triangles.is_sorted());
}

fn area(sites: &[Site], triangles: &[[u32; 3]]) -> f64 {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|k| sites[k as usize].at);
        (b - a).perp_dot(c - a) / 2.0
    };
    triangles.iter().map(of).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn blocks_make_the_triangles_of_the_whole(
        kind in 0_usize..6, n in 1_usize..700, seed: u64, leaf in 1_usize..40,
        wanted in 1_u64..300, held in 1_usize..200, edge in 0.05_f64..30.0,
    ) {
        let cloud = cloud(KINDS[kind], n, seed);
        let (sites, whole, _) = tin(&cloud, TOP, edge, WHOLE);
        let (same, blocks, _) = tin(&cloud, TOP, edge, Cut { leaf, wanted, held });
        prop_assert_eq!(&sites, &same);
        assert_valid(&sites, &whole);
        prop_assert_eq!(whole, blocks);
    }

    #[test]
    fn triangles_are_those_of_the_definition(
        kind in 0_usize..6, n in 1_usize..40, seed: u64, leaf in 1_usize..10, edge in 0.5_f64..80.0,
    ) {
        let cloud = cloud(KINDS[kind], n, seed);
        let (sites, found, _) = tin(&cloud, TOP, edge, Cut { leaf, wanted: 10, held: 7 });
        let short = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|k| sites[k as usize].at);
            [a - b, b - c, c - a].iter().all(|e| e.length() <= edge)
        };
        let expected: Vec<_> = by_definition(&sites).into_iter().filter(short).collect();
        prop_assert_eq!(found, expected);
    }
}

#[test]
fn without_a_longest_edge_the_triangles_cover_the_hull_once() {
    for kind in [Kind::Random, Kind::Clustered, Kind::Grid, Kind::FarGrid] {
        let cloud = cloud(kind, 2500, 5);
        let (sites, triangles, blocks) = tin(&cloud, TOP, f64::INFINITY, Cut { leaf: 50, ..WHOLE });
        assert_eq!(blocks, 1);
        assert_valid(&sites, &triangles);
        // Edges without a partner go around the outside once: what they enclose is the hull.
        let mut sides = BTreeSet::new();
        for &[a, b, c] in &triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                if !sides.remove(&(to, from)) {
                    sides.insert((from, to));
                }
            }
        }
        let enclosed: f64 = sides
            .iter()
            .map(|&(a, b)| sites[a as usize].at.perp_dot(sites[b as usize].at) / 2.0)
            .sum();
        let all = area(&sites, &triangles);
        assert!((enclosed / all - 1.0).abs() < 1e-6, "{kind:?}: {enclosed} {all}");
        let at = sides.first().unwrap();
        let next: BTreeMap<u32, u32> = sides.iter().copied().collect();
        let round =
            std::iter::successors(Some(at.1), |k| next.get(k).copied().filter(|_| *k != at.0));
        assert_eq!(round.count(), sides.len(), "{kind:?}: the outside is not one ring");
    }
}

#[test]
fn a_great_cloud_in_many_blocks_is_the_cloud_in_one() {
    for kind in [Kind::Random, Kind::Clustered, Kind::Grid, Kind::FarGrid] {
        let cloud = cloud(kind, 60_000, 11);
        let edge = if kind == Kind::FarGrid { 0.45 } else { 4.5 };
        let (_, whole, _) = tin(&cloud, TOP, edge, WHOLE);
        let cut = Cut { leaf: 300, wanted: 3000, held: 9000 };
        let (sites, blocks, count) = tin(&cloud, TOP, edge, cut);
        assert!(count > 15 && whole.len() > 60_000, "{kind:?}: {count} {}", whole.len());
        assert_valid(&sites, &blocks);
        assert!(whole == blocks, "{kind:?}");
    }
}

#[test]
fn a_grid_is_cut_alike_everywhere_and_covers_its_square() {
    let cloud = cloud(Kind::Grid, 10_000, 3);
    let (sites, triangles, _) = tin(&cloud, TOP, 1.5, Cut { leaf: 64, wanted: 900, held: 5000 });
    assert_eq!(triangles.len(), 2 * 99 * 99);
    assert!((area(&sites, &triangles) - 99.0 * 99.0).abs() < 1e-6);
    for t in triangles {
        // Every diagonal leads from the lower left to the upper right.
        let [a, b, c] = t.map(|k| sites[k as usize].at);
        assert!(
            (b - a) + (c - a) == DVec2::new(1.0, 2.0) || (b - a) + (c - a) == DVec2::new(2.0, 1.0)
        );
    }
}

#[test]
fn the_plane_may_lie_anyhow_and_of_points_above_each_other_the_highest_stays() {
    let plane =
        TinPlane { origin: DVec3::new(0.0, 7.0, 0.0), u: DVec3::X, v: DVec3::Z, n: -DVec3::Y };
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let cloud = [
        at(0.0, 5.0, 0.0),
        at(1.0, 5.0, 0.0),
        at(0.0, 5.0, 1.0),
        at(0.0, 4.0, 1.0),
        at(0.0, 6.0, 1.0),
    ];
    let mut kept = Vec::new();
    let mut sorter = Sorter::new(plane, 2, tempfile::tempdir().unwrap().path());
    // The folder is gone: what fits needs none.
    sorter.push(cloud[0]).unwrap();
    sorter
        .finish(&mut |p| {
            kept.push(p.ground);
            Ok(())
        })
        .unwrap();
    assert_eq!(kept, [cloud[0]]);
    let folder = tempfile::tempdir().unwrap();
    let mut sorter = Sorter::new(plane, 2, folder.path());
    for &point in &cloud {
        sorter.push(point).unwrap();
    }
    kept.clear();
    let doubles = sorter
        .finish(&mut |p| {
            kept.push(p.ground);
            Ok(())
        })
        .unwrap();
    // Elevation is against y: the least y is the highest.
    assert_eq!((doubles, &kept[..]), (2, &[cloud[0], cloud[1], cloud[3]][..]));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let (_, triangles, _) = tin(&cloud, plane, 2.0, WHOLE);
    assert_eq!(triangles, [[0, 1, 2]]);
}

#[test]
fn a_place_with_more_points_than_fit_is_refused_with_figures() {
    let mut leaves = LeafMaker::new(10);
    let mut sorter = Sorter::new(TOP, 1000, tempfile::tempdir().unwrap().path());
    for point in cloud(Kind::Random, 500, 1) {
        sorter.push(point).unwrap();
    }
    sorter
        .finish(&mut |point| {
            leaves.push(point);
            Ok(())
        })
        .unwrap();
    let leaves = leaves.finish();
    let refused = leaves.blocks(100.0, 50, 400, 1 << 20).unwrap_err();
    assert_eq!(refused.exit_code(), 3);
    let said = refused.to_string();
    assert!(
        said.contains("--max-edge 100.0 m") && said.contains("500 MiB, but only 400"),
        "{said}"
    );
    assert!(leaves.blocks(1.0, 50, 400, 1 << 20).unwrap().len() > 5);
}
