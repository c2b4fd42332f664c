//! Pixels a second of what is done to a finished tile: encoding with every compression, halving for the overviews.
//!
//! The tile is 512 × 512, RGB + alpha, 8 bit: broad waves with a few grey values of noise, as a photographed wall has.

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use groundel::geom::Size;
use groundel::image::Image;
use groundel::output::{
    Colour, Compression, Depth, Layer, Raster, Scratch, decode_tile, encode_tile, halve,
};

const SIDE: u32 = 512;

fn tile() -> Raster {
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        u8::try_from((state >> 24) % 7).expect("below 7")
    };
    let mut data = Vec::new();
    for y in 0..SIDE {
        for x in 0..SIDE {
            let wave = |period: u32| u8::try_from((x * 3 + y * 2) / period % 128).expect("small");
            data.extend([wave(9) + noise(), wave(11) + 40 + noise(), wave(17) + noise(), 255]);
        }
    }
    Raster::U8(Image::from_data(Size::new(SIDE, SIDE), 4, data))
}

fn output(c: &mut Criterion) {
    let layer = Layer::mosaic(Colour::Rgb, Depth::Eight);
    let tile = tile();
    let mut scratch = Scratch::default();
    let mut group = c.benchmark_group("output");
    group.throughput(Throughput::Elements(u64::from(SIDE * SIDE)));
    let all = [Compression::Deflate, Compression::Zstd, Compression::Lzw, Compression::None];
    for compression in all {
        group.bench_function(format!("encode/{}", compression.name()), |b| {
            b.iter(|| encode_tile(&layer, &tile, SIDE, compression, &mut scratch));
        });
        let bytes = encode_tile(&layer, &tile, SIDE, compression, &mut scratch);
        let mut back = || {
            decode_tile(&layer, &bytes, tile.size(), SIDE, compression, &mut scratch)
                .expect("a whole tile")
        };
        assert_eq!(back(), tile);
        group.bench_function(format!("decode/{}", compression.name()), |b| {
            b.iter_batched(|| (), |()| back(), BatchSize::LargeInput);
        });
    }
    group.bench_function("halve", |b| b.iter(|| halve(&layer, &tile)));
    assert_eq!(halve(&layer, &tile).size(), tile.size().halved());
    group.finish();
}

criterion_group!(benches, output);
criterion_main!(benches);
