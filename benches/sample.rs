//! Samples a second of every kernel: 128 × 128 positions, slightly turned and scaled, in a 512 × 512 window.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec2;
use groundel::geom::{PixelRect, Size};
use groundel::image::{Image, Samples, Window};
use groundel::sample::{Interpolation, sample_into};

/// A horizontal ramp, which every kernel must continue between the centres.
fn window(channels: usize) -> Window {
    let row = (0..512_u16).flat_map(|x| std::iter::repeat_n(x, channels));
    let samples = (0..512).flat_map(|_| row.clone()).collect();
    Window {
        level: 0,
        rect: PixelRect::new(0, 0, 512, 512),
        samples: Samples::U16(Image::from_data(Size::new(512, 512), channels, samples)),
    }
}

fn narrow(window: &Window) -> Window {
    let Samples::U16(i) = &window.samples else { unreachable!("made above") };
    let data = i.data().iter().map(|&v| u8::try_from(v / 2).expect("below 256")).collect();
    Window { samples: Samples::U8(Image::from_data(i.size(), i.channels(), data)), ..*window }
}

/// The ramp again: to 1e-3 in 16 bit, where it is not cut to steps of two.
fn check(bits: u32, kernel: Interpolation, positions: &[DVec2], out: &[[f32; 3]]) {
    let (gain, error) = if bits == 16 { (1.0, 1e-3) } else { (2.0, 1.3) };
    let error = if kernel == Interpolation::Nearest { 1.5 } else { error };
    for (p, [got, ..]) in positions.iter().zip(out) {
        assert!((f64::from(*got) * gain - (p.x - 0.5)).abs() < error, "{p}: {got}");
    }
}

fn sample(c: &mut Criterion) {
    let at = |k: u32| {
        let (x, y) = (f64::from(k % 128), f64::from(k / 128));
        DVec2::new(20.0 + 1.1 * x + 0.07 * y, 30.0 + 1.05 * y - 0.05 * x)
    };
    let positions: Vec<_> = (0..128 * 128).map(at).collect();
    let mut out = vec![[0.0; 3]; positions.len()];
    let mut group = c.benchmark_group("sample");
    group.throughput(Throughput::Elements(positions.len() as u64));
    for (name, channels) in [("grey", 1), ("rgb", 3)] {
        let wide = window(channels);
        for (bits, window) in [(8, narrow(&wide)), (16, wide)] {
            for kernel in [Interpolation::Nearest, Interpolation::Bilinear, Interpolation::Bicubic]
            {
                group.bench_function(format!("{name}{bits}/{kernel:?}"), |b| {
                    b.iter(|| sample_into(&window, kernel, &positions, &mut out));
                    check(bits, kernel, &positions, &out);
                });
            }
        }
    }
}

criterion_group!(benches, sample);
criterion_main!(benches);
