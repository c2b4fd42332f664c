//! Claims about the blend, through its public interface.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::*;
use crate::geom::{FaceId, PixelRect};
use crate::image::{Colour, Depth, Samples};
use crate::output;

const GREY: Settings = Settings {
    outliers: Outliers::Sigma,
    beta: 1.0,
    weights: Weights::Area,
    edges: Edges::None,
    blend: Blend::Mean,
    colour: Colour::Grey,
    depth: Depth::Eight,
    undefined: [7, 8, 9],
};

/// The samples of one pixel: photo, colour, weight.
type Pixel = [(u16, [f32; 3], f64)];

fn grey(values: &[f32]) -> Vec<(u16, [f32; 3], f64)> {
    (0..).zip(values).map(|(photo, &v)| (photo, [v; 3], 1.0)).collect()
}

fn push(stack: &mut SampleTile, photo: u16, pixels: &[u32], colours: &[[f32; 3]], weights: &[f64]) {
    stack.push(&PhotoSamples { photo, gain: 1.0, pixels, colours, weights, soft: None });
}

/// A tile of one pixel with a surface, blended from `pixel`.
fn one(settings: &Settings, pixel: &Pixel) -> (OrthoTile, Statistics) {
    let rect = PixelRect::new(40, 50, 41, 51);
    let mut tile = OrthoTile::new(rect, settings);
    tile.set_surface(rect, |_| Some((1.25, FaceId(17))));
    let mut statistics = Statistics::new(1000);
    let mut stack = SampleTile::new();
    stack.begin(rect);
    for &(photo, colour, weight) in pixel {
        push(&mut stack, photo, &[0], &[colour], &[weight]);
    }
    blend_into(settings, &mut stack, &mut tile, &mut statistics);
    statistics.count_tile(&tile);
    (tile, statistics)
}

fn colour(tile: &OrthoTile) -> Vec<u16> {
    match &tile.colour {
        Samples::U8(i) => i.data().iter().map(|v| u16::from(*v)).collect(),
        Samples::U16(i) => i.data().to_vec(),
    }
}

/// Colour, count, used, coverage, best of one blended pixel.
fn row(settings: &Settings, pixel: &Pixel) -> (Vec<u16>, u8, u8, u8, u16) {
    let (t, _) = one(settings, pixel);
    let first = |i: &crate::image::Image<u8>| i.data()[0];
    (colour(&t), first(&t.count), first(&t.used), first(&t.coverage), t.best.data()[0])
}

#[test]
fn the_papers_grey_test_drops_the_column_in_front_of_the_wall() {
    // μ = 115, d = 15, 13, 17, 45, σ² = (225 + 169 + 289 + 2025) / 4 = 677, σ = 26.02: 160 goes.
    let samples = grey(&[100.0, 102.0, 98.0, 160.0]);
    assert_eq!(row(&GREY, &samples), (vec![100, 255], 4, 3, 3, 0));
    // β = 1.8: 46.8 > 45, all stay: 115.
    let wide = Settings { beta: 1.8, ..GREY };
    assert_eq!(row(&wide, &samples), (vec![115, 255], 4, 4, 3, 0));
    let none = Settings { outliers: Outliers::None, ..GREY };
    assert_eq!(row(&none, &samples).0, [115, 255]);
}

#[test]
fn colour_is_tested_by_its_distance_over_the_channels() {
    // In each channel one other sample is off by 12; the last is off by 10 in all, hence by 17.3 in colour.
    let c = |r: f32, g: f32, b: f32| [100.0 + r, 100.0 + g, 100.0 + b];
    let samples = [
        (0, c(0.0, 0.0, 0.0), 1.0),
        (1, c(12.0, 0.0, 0.0), 1.0),
        (2, c(0.0, 12.0, 0.0), 1.0),
        (3, c(0.0, 0.0, 12.0), 1.0),
        (4, c(-10.0, -10.0, -10.0), 1.0),
    ];
    // μ = 100.4 each; d² = 0.48, 134.88, 134.88, 134.88, 324.48; σ² = 145.92: the last alone goes.
    let rgb = Settings { colour: Colour::Rgb, ..GREY };
    assert_eq!(row(&rgb, &samples), (vec![103, 103, 103, 255], 5, 4, 3, 0));
    // Grey looks at channel 0 alone: μ = 100.4, d = 0.4, 11.6, 0.4, 0.4, 10.4, σ² = 48.64: two go.
    assert_eq!(row(&GREY, &samples), (vec![100, 255], 5, 3, 3, 0));
}

#[test]
fn two_samples_are_never_tested() {
    let tight = Settings { beta: 0.0, ..GREY };
    assert_eq!(row(&tight, &grey(&[0.0, 255.0])), (vec![128, 255], 2, 2, 2, 0));
}

#[test]
fn samples_at_equal_distances_are_all_kept() {
    // An equilateral triangle in colour space: every d is σ, up to rounding; in f64 some are above.
    let rgb = Settings { colour: Colour::Rgb, ..GREY };
    for v in [10.0, 33.3, 97.1] {
        let samples = [(0, [v, 0.0, 0.0], 1.0), (1, [0.0, v, 0.0], 1.0), (2, [0.0, 0.0, v], 1.0)];
        assert_eq!(row(&rgb, &samples).2, 3, "{v}");
    }
    // Four on a line, two and two.
    assert_eq!(row(&GREY, &grey(&[10.1, 200.3, 10.1, 200.3])).2, 4);
}

#[test]
fn a_beta_below_one_that_drops_all_leaves_the_nearest_to_the_mean() {
    // μ = 100, d = 40, 39, 79, σ = 56: β = 0.1 drops all.
    let tight = Settings { beta: 0.1, ..GREY };
    assert_eq!(row(&tight, &grey(&[60.0, 61.0, 179.0])), (vec![61, 255], 3, 1, 3, 1));
    // Of equals the lowest id.
    assert_eq!(row(&tight, &grey(&[60.0, 140.0, 60.0, 140.0])), (vec![60, 255], 4, 1, 3, 0));
}

#[test]
fn samples_within_half_a_grey_value_are_all_kept() {
    // d = ⅓, ⅓, ⅔, σ = 0.471 < 0.5: the third would go. Just above: it goes.
    assert_eq!(row(&GREY, &grey(&[100.0, 100.0, 101.0])).2, 3);
    assert_eq!(row(&GREY, &grey(&[100.0, 100.0, 101.1])).2, 2);
    // In 16 bit the floor is 0.5/255 of 65535 = 128.5.
    let wide = Settings { depth: Depth::Sixteen, ..GREY };
    assert_eq!(row(&wide, &grey(&[25700.0, 25700.0, 25957.0])).2, 3);
    assert_eq!(row(&wide, &grey(&[25700.0, 25700.0, 25983.0])).2, 2);
}

#[test]
fn the_mean_is_weighted_and_rounded_half_up_once() {
    let samples = [(2, [100.0; 3], 1.0), (5, [102.0; 3], 2.0), (9, [98.0; 3], 1.0)];
    let all = Settings { outliers: Outliers::None, ..GREY };
    // (100 + 204 + 98) / 4 = 100.5.
    assert_eq!(row(&all, &samples), (vec![101, 255], 3, 3, 3, 5));
    let equal = Settings { weights: Weights::Equal, ..all };
    assert_eq!(row(&equal, &samples), (vec![100, 255], 3, 3, 3, 2));
    let zero = samples.map(|(photo, c, _)| (photo, c, 0.0));
    assert_eq!(row(&all, &zero), (vec![100, 255], 3, 3, 3, 2));
}

#[test]
fn a_dropped_sample_may_be_the_heaviest_and_is_not_the_best() {
    let samples =
        [(3, [100.0; 3], 1.0), (4, [102.0; 3], 3.0), (6, [98.0; 3], 3.0), (8, [160.0; 3], 90.0)];
    let best = Settings { blend: Blend::Best, ..GREY };
    assert_eq!(row(&best, &samples), (vec![102, 255], 4, 3, 3, 4));
    // 100 + (2 · 3 − 2 · 3) / 7.
    assert_eq!(row(&GREY, &samples), (vec![100, 255], 4, 3, 3, 4));
}

#[test]
fn overshoot_is_clamped_after_the_mean_not_before() {
    let samples = grey(&[300.0, 200.0]);
    assert_eq!(row(&GREY, &samples).0, [250, 255]);
    assert_eq!(row(&GREY, &grey(&[300.0])).0, [255, 255]);
    assert_eq!(row(&GREY, &grey(&[-31.0])).0, [0, 255]);
    let wide = Settings { depth: Depth::Sixteen, ..GREY };
    assert_eq!(row(&wide, &grey(&[65535.4])).0, [65535, 65535]);
    assert_eq!(row(&wide, &grey(&[65534.5])).0, [65535, 65535]);
}

#[test]
fn counts_saturate_at_254() {
    let many = grey(&[50.0; 300]);
    let (tile, statistics) = one(&GREY, &many);
    assert_eq!((tile.count.data(), tile.used.data()), (&[254][..], &[254][..]));
    assert_eq!((tile.coverage.data(), colour(&tile)), (&[3][..], vec![50, 255]));
    assert_eq!(statistics.counts[254], 1);
}

#[test]
fn a_surface_that_no_photo_sees_is_transparent_but_has_elevation_and_face() {
    let (tile, statistics) = one(&GREY, &[]);
    assert_eq!(colour(&tile), [7, 0]);
    assert_eq!((tile.elevation.data(), tile.face.data()), (&[1.25][..], &[17][..]));
    let layers = (tile.count.data()[0], tile.used.data()[0], tile.coverage.data()[0]);
    assert_eq!((layers, tile.best.data()[0]), ((0, 0, 0), OrthoTile::NO_PHOTO));
    assert_eq!(statistics.counts[0], 1);
}

#[test]
fn a_pixel_without_surface_has_the_nodata_values_of_the_layers() {
    let rgb16 = Settings { colour: Colour::Rgb, depth: Depth::Sixteen, ..GREY };
    let tile = OrthoTile::new(PixelRect::new(5, 5, 7, 6), &rgb16);
    assert_eq!(colour(&tile), [7, 8, 9, 0, 7, 8, 9, 0]);
    assert!(tile.elevation.data()[0].is_nan());
    assert_eq!(tile.face.data()[0], output::NO_FACE);
    for layer in [&tile.count, &tile.used, &tile.coverage] {
        assert_eq!(layer.data()[0], output::NO_SURFACE);
    }
    assert_eq!(tile.best.data()[0], output::NO_PHOTO);
}

#[test]
fn the_residual_counts_dropped_samples_but_not_lonely_ones() {
    let (_, statistics) = one(&GREY, &grey(&[100.0, 102.0, 98.0, 160.25]));
    let residuals: Vec<_> = statistics.photos[..5].iter().map(PhotoStats::mean_residual).collect();
    assert_eq!(residuals, [Some(0.0), Some(2.0), Some(2.0), Some(60.25), None]);
    let fourth =
        PhotoStats { seen: 1, used: 0, rejected: 1, compared: 1, residual_256: 60 * 256 + 64 };
    assert_eq!(statistics.photos[3], fourth);
    let (_, lonely) = one(&GREY, &grey(&[100.0]));
    assert_eq!(lonely.photos[0], PhotoStats { seen: 1, used: 1, ..PhotoStats::default() });
}

/// Blends a 12 × 8 mosaic in blocks of `side`, block order turned round if `reverse`.
fn mosaic(settings: &Settings, side: i64, reverse: bool) -> (OrthoTile, Statistics) {
    let all = PixelRect::new(0, 0, 12, 8);
    let mut tile = OrthoTile::new(all, settings);
    let mut statistics = Statistics::new(7);
    let mut stack = SampleTile::new();
    let mut blocks: Vec<_> = all.blocks(side).collect();
    if reverse {
        blocks.reverse();
    }
    for block in blocks {
        // A hash of the absolute pixel and the photo decides everything.
        let hash = |k: usize, photo: u16| {
            let (x, y) = (k % block.width(), k / block.width());
            let x = block.x0.unsigned_abs() + x as u64;
            let y = block.y0.unsigned_abs() + y as u64;
            ((x * 31 + y) * 17 + u64::from(photo)).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40
        };
        tile.set_surface(block, |k| (hash(k, 99) % 8 != 0).then_some((1.0, FaceId(1))));
        stack.begin(block);
        let mut part = Statistics::new(7);
        for photo in 0..7 {
            let seen = |k: &usize| hash(*k, 99) % 8 != 0 && hash(*k, photo) % 3 != 0;
            let pixels: Vec<_> = (0..block.area()).filter(seen).collect();
            let value = |k: usize| hash(k, photo + 100) as f32 / 65536.0;
            let colours: Vec<_> = pixels.iter().map(|&k| [value(k), 9.5, value(k) * 0.5]).collect();
            let weights: Vec<_> = pixels.iter().map(|&k| hash(k, photo + 200) as f64).collect();
            let pixels: Vec<_> = pixels.iter().map(|&k| u32::try_from(k).unwrap()).collect();
            push(&mut stack, photo, &pixels, &colours, &weights);
        }
        blend_into(settings, &mut stack, &mut tile, &mut part);
        statistics.merge(&part);
    }
    statistics.count_tile(&tile);
    (tile, statistics)
}

#[test]
fn neither_the_size_nor_the_order_of_the_blocks_changes_anything() {
    let settings = Settings { colour: Colour::Rgb, ..GREY };
    let (mut tile, statistics) = mosaic(&settings, 12, false);
    // NaN would not be equal to itself.
    let clean = |t: &mut OrthoTile| {
        t.elevation.data_mut().iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = -1.0);
    };
    clean(&mut tile);
    assert!(statistics.counts.iter().filter(|n| **n > 0).count() > 4, "a mixed scene");
    assert!(statistics.photos.iter().all(|p| p.rejected > 0 && p.used > 0), "a mixed scene");
    for (side, reverse) in [(1, false), (5, false), (5, true), (3, true)] {
        let (mut other, counted) = mosaic(&settings, side, reverse);
        clean(&mut other);
        assert!(other == tile, "blocks of {side}");
        assert!(counted == statistics, "blocks of {side}");
    }
}

/// The definition, DESIGN.md §1.4 and §1.5, word by word.
fn naive(settings: &Settings, pixel: &Pixel) -> (Vec<usize>, [f64; 3]) {
    let channels = settings.colour.channels();
    let value = |i: usize, c: usize| f64::from(pixel[i].1[c]);
    let n = pixel.len();
    let mut kept: Vec<usize> = (0..n).collect();
    if n > 2 {
        let mu = |c| (0..n).map(|i| value(i, c)).sum::<f64>() / n as f64;
        let d = |i| (0..channels).map(|c| (value(i, c) - mu(c)).powi(2)).sum::<f64>().sqrt();
        let sigma = ((0..n).map(|i| d(i) * d(i)).sum::<f64>() / n as f64).sqrt();
        if sigma >= 0.5 {
            kept.retain(|&i| d(i) <= settings.beta * sigma * (1.0 + 1e-6));
            if kept.is_empty() {
                kept = (0..n).min_by(|&a, &b| d(a).total_cmp(&d(b))).into_iter().collect();
            }
        }
    }
    let total: f64 = kept.iter().map(|&i| pixel[i].2).sum();
    let mean = std::array::from_fn(|c| {
        let sum: f64 = kept.iter().map(|&i| pixel[i].2 * value(i, c)).sum();
        if total > 0.0 {
            sum / total
        } else {
            kept.iter().map(|&i| value(i, c)).sum::<f64>() / kept.len() as f64
        }
    });
    (kept, mean)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(7), ..ProptestConfig::default() })]

    #[test]
    fn every_pixel_is_what_the_definition_says(
        samples in prop::collection::vec((prop::array::uniform3(-20.0..280.0_f32), 0.0..9.0_f64), 1..9),
        beta in 0.0..2.0_f64,
        rgb in any::<bool>(),
    ) {
        let pixel: Vec<_> = (0..).zip(samples).map(|(photo, (c, w))| (photo, c, w.floor())).collect();
        let channels = if rgb { Colour::Rgb } else { Colour::Grey };
        let settings = Settings { beta, colour: channels, ..GREY };
        let (kept, mean) = naive(&settings, &pixel);
        let (tile, statistics) = one(&settings, &pixel);
        for (i, &(photo, ..)) in pixel.iter().enumerate() {
            let used = statistics.photos[usize::from(photo)].used == 1;
            prop_assert_eq!(used, kept.contains(&i), "sample {}", i);
        }
        for (got, mean) in colour(&tile).into_iter().zip(&mean[..settings.colour.channels()]) {
            let error = f64::from(got) - mean.clamp(0.0, 255.0);
            prop_assert!(error.abs() < 0.5 + 1e-6, "{got}, not {mean}");
        }
    }
}

/// A block of 9 × 10 pixels that three photos see here and there, blended; `count` is given samples and tile.
fn patchy(count: impl FnOnce(&mut SampleTile, &mut OrthoTile)) -> OrthoTile {
    let rect = PixelRect::new(2, 3, 11, 13);
    let mut tile = OrthoTile::new(rect, &GREY);
    tile.set_surface(rect, |k| (!k.is_multiple_of(7)).then_some((k as f64, FaceId(5))));
    let mut stack = SampleTile::new();
    stack.begin(rect);
    for photo in 0..3_u16 {
        let sees = |k: &u32| !k.is_multiple_of(7) && !(k + u32::from(photo)).is_multiple_of(4);
        let pixels: Vec<u32> = (0..90).filter(sees).collect();
        let colours: Vec<_> = pixels.iter().map(|&k| [(k * 13 % 200) as f32; 3]).collect();
        let off = colours.iter().map(|c| c.map(|v| v + 5.0 * f32::from(photo))).collect::<Vec<_>>();
        push(&mut stack, photo, &pixels, &off, &vec![1.0; pixels.len()]);
    }
    count(&mut stack, &mut tile);
    tile
}

#[test]
fn samples_counted_by_parts_are_those_counted_together() {
    let (mut whole, mut all) = (Statistics::new(3), Statistics::new(3));
    let tile = patchy(|samples, tile| blend_into(&GREY, samples, tile, &mut whole));
    for part in 0..4_u16 {
        // All in one part, or dealt out: what is counted of a part alone is what is counted of it among others.
        let dealt: Vec<u16> = (0..90).map(|k| u16::from(k % 5 == part)).collect();
        let mut counts = vec![Statistics::new(3); 2];
        all = Statistics::new(3);
        let same = patchy(|samples, tile| {
            let parts = Parts { part_of: &dealt, statistics: &mut counts };
            blend_parts_into(&GREY, samples, tile, &mut all, parts);
        });
        assert_eq!(same.colour, tile.colour);
        assert_eq!(all, whole);
        let mut rest = whole.clone();
        for (photo, rest) in rest.photos.iter_mut().enumerate() {
            assert!(counts[1].photos[photo].seen > 5);
            rest.take_away(&counts[0].photos[photo]);
            let seen = (0..90).filter(|&k| {
                dealt[k] == 1 && !k.is_multiple_of(7) && !(k + photo).is_multiple_of(4)
            });
            assert_eq!(rest.seen, seen.count() as u64);
        }
        assert_eq!(rest, counts[1]);
    }
    assert_eq!(all.photos.len(), 3);
}

#[test]
fn pixels_that_are_the_same_are_taken_over_with_all_layers_and_the_others_stay() {
    let from = patchy(|samples, tile| {
        blend_into(&GREY, samples, tile, &mut Statistics::new(3));
    });
    let blank = OrthoTile::new(from.rect, &GREY);
    let part = PixelRect::new(3, 4, 10, 12);
    let is_same = |k: usize| k % 5 < 2 || k / 7 == 3;
    let mut to = blank.clone();
    to.copy_pixels(&from, part, is_same);
    for y in from.rect.y0..from.rect.y1 {
        for x in from.rect.x0..from.rect.x1 {
            let inside = (3..10).contains(&x) && (4..12).contains(&y);
            let copied = inside && is_same(usize::try_from((y - 4) * 7 + x - 3).unwrap());
            let at = usize::try_from((y - 3) * 9 + x - 2).unwrap();
            let of = if copied { &from } else { &blank };
            assert_eq!(to.elevation.data()[at].to_bits(), of.elevation.data()[at].to_bits());
            assert_eq!(to.face.data()[at], of.face.data()[at]);
            assert_eq!(to.best.data()[at], of.best.data()[at]);
            for layer in [
                |t: &OrthoTile| t.count.clone(),
                |t: &OrthoTile| t.used.clone(),
                |t: &OrthoTile| t.coverage.clone(),
            ] {
                assert_eq!(layer(&to).data()[at], layer(of).data()[at]);
            }
            assert_eq!(colour(&to)[2 * at..2 * at + 2], colour(of)[2 * at..2 * at + 2]);
        }
    }
}

/// A block of 70 pixels under the robust rule: photo 0 sees all, photo 1 the first ten.
fn soft_block(stack: &mut SampleTile, quality: f64, colour: f32) -> OrthoTile {
    let rect = PixelRect::new(0, 0, 70, 1);
    let settings = Settings {
        outliers: Outliers::Robust,
        weights: Weights::Sharp,
        edges: Edges::Guard,
        ..Settings::default()
    };
    let mut tile = OrthoTile::new(rect, &settings);
    tile.set_surface(rect, |_| Some((0.0, FaceId(0))));
    stack.begin(rect);
    for (photo, count) in [(0, 70), (1, 10)] {
        let pixels: Vec<u32> = (0..count).collect();
        let colours = vec![[colour, colour + 9.0, 250.0]; pixels.len()];
        let (quality, ones) = (vec![quality; pixels.len()], vec![1.0_f32; pixels.len()]);
        let soft = SoftSamples { coarse: &colours, quality: &quality, guards: &ones, fades: &ones };
        stack.push(&PhotoSamples {
            photo,
            gain: 1.0,
            pixels: &pixels,
            colours: &colours,
            weights: &quality,
            soft: Some(soft),
        });
    }
    blend_into(&settings, stack, &mut tile, &mut Statistics::new(2));
    tile
}

#[test]
fn what_an_earlier_block_left_behind_reaches_no_pixel_under_soft_weights() {
    let mut used = SampleTile::new();
    // All pixels of photo 1 hold something before it sees the first ten only.
    let rect = PixelRect::new(0, 0, 70, 1);
    used.begin(rect);
    let (pixels, far) = ((0..70).collect::<Vec<u32>>(), vec![[-3e5_f32; 3]; 70]);
    let (quality, ones) = (vec![1e12; 70], vec![1.0_f32; 70]);
    for photo in 0..2 {
        let soft = SoftSamples { coarse: &far, quality: &quality, guards: &ones, fades: &ones };
        used.push(&PhotoSamples {
            photo,
            gain: 1.0,
            pixels: &pixels,
            colours: &far,
            weights: &quality,
            soft: Some(soft),
        });
    }
    for (quality, colour) in [(1e-12, 20.0), (1.0, 100.0), (1e9, 0.0)] {
        let found = soft_block(&mut used, quality, colour);
        assert!(
            format!("{found:?}")
                == format!("{:?}", soft_block(&mut SampleTile::new(), quality, colour))
        );
        let Samples::U8(image) = &found.colour else { unreachable!("8 bit") };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 250")]
        let wanted = [colour as u8, colour as u8 + 9, 250, 255];
        assert!(image.data().chunks(4).all(|pixel| pixel == wanted), "{:?}", image.data());
    }
}
