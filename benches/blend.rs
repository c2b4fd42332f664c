//! Pixels a second of the blend: a block of 128 × 128 pixels that 1, 3 or 7 photos see, one of them wrong.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use groundel::blend::{OrthoTile, PhotoSamples, SampleTile, Settings, Statistics, blend_into};
use groundel::geom::{FaceId, PixelRect};
use groundel::image::Samples;

fn blend(c: &mut Criterion) {
    let settings = Settings::default();
    let rect = PixelRect::new(0, 0, 128, 128);
    let pixels: Vec<u32> = (0..128 * 128).collect();
    let mut group = c.benchmark_group("blend");
    group.throughput(Throughput::Elements(pixels.len() as u64));
    for photos in [1_u16, 3, 7] {
        let mut tile = OrthoTile::new(rect, &settings);
        tile.set_surface(rect, |_| Some((0.0, FaceId(0))));
        let mut statistics = Statistics::new(usize::from(photos));
        let mut stack = SampleTile::new();
        // The last of several shows something else.
        let colour = |photo: u16| {
            if photo > 0 && photo + 1 == photos { [9.0, 9.0, 200.0] } else { [100.0, 120.0, 140.0] }
        };
        let colours: Vec<_> = (0..photos).map(|p| vec![colour(p); pixels.len()]).collect();
        let weights: Vec<f64> = pixels.iter().map(|k| f64::from(k % 97) + 1.0).collect();
        group.bench_function(format!("{photos}"), |b| {
            b.iter(|| {
                stack.begin(rect);
                for (photo, colours) in (0..).zip(&colours) {
                    stack.push(&PhotoSamples {
                        photo,
                        gain: 1.0,
                        pixels: &pixels,
                        colours,
                        weights: &weights,
                        soft: None,
                    });
                }
                blend_into(&settings, &mut stack, &mut tile, &mut statistics);
            });
            let Samples::U8(i) = &tile.colour else { unreachable!("8 bit by default") };
            assert!(i.data().chunks(4).all(|p| p == [100, 120, 140, 255]));
        });
    }
}

criterion_group!(benches, blend);
criterion_main!(benches);
