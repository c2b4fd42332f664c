//! Interpolation kernels, one for each of (8 bit | 16 bit) × (grey | RGB) × interpolation.

#![expect(
    clippy::inline_always,
    reason = "loops compiled for the widest vectors where they are inlined into the kernel"
)]

use glam::DVec2;

use super::Interpolation;
use super::taps::{floor, grid_of, half_of, scale_of, taps_of};
use crate::geom::{Kernel, run_widest};
use crate::image::{ImageView, Samples, Window};

/// Colour of each of `positions` (level-0 photo pixels, the top-left pixel's centre at (0.5, 0.5)), into `out`.
///
/// Colours are RGB triplets in the photo's range, 0–255 or 0–65535, neither clamped nor rounded: bicubic
/// overshoots at edges. A grey window gives three equal values.
///
/// Bicubic is the cubic convolution of R. G. Keys (1981), "Cubic convolution interpolation for digital image
/// processing", IEEE Trans. Acoustics, Speech, and Signal Processing 29(6), 1153–1160,
/// doi:10.1109/TASSP.1981.1163711, with a = −½; columns of taps first, then along the row. Departures: taps
/// beyond the edge repeat it (DESIGN.md §1.3) instead of being extrapolated, and each weighted sum is written as the
/// anchor plus weighted differences to it, so that weights which sum to 1 only nearly cannot tint an even area.
/// Arithmetic on colours is f32, positions are f64 down to their fraction.
///
/// # Panics
/// If `out` is not as long as `positions`, if the window has neither 1 nor 3 channels or its samples do not match
/// its rectangle, or if a tap of any position lies outside the window ([`taps_of`] tells what is needed).
pub fn sample_into(
    window: &Window,
    interpolation: Interpolation,
    positions: &[DVec2],
    out: &mut [[f32; 3]],
) {
    assert_eq!(positions.len(), out.len(), "one colour a position");
    check_taps(window, interpolation, positions);
    match &window.samples {
        Samples::U8(i) => sample_typed(window, i.view(), interpolation, positions, out),
        Samples::U16(i) => sample_typed(window, i.view(), interpolation, positions, out),
    }
}

/// Panics unless the window holds all taps: the one check that lets the kernels trust their indices.
fn check_taps(window: &Window, interpolation: Interpolation, positions: &[DVec2]) {
    let (rect, size) = (window.rect, window.samples.size());
    let same =
        (rect.width() as u64, rect.height() as u64) == (size.width.into(), size.height.into());
    assert!(same, "the window's rectangle {rect:?} must match its samples, {size:?}");
    assert!(positions.iter().all(|p| p.is_finite()), "a photo position must be finite");
    let needed = taps_of(interpolation, positions, window.level);
    assert!(rect.contains(&needed), "taps {needed:?} lie outside the window {rect:?}");
}

/// Chooses the kernel for a sample type.
fn sample_typed<T: Copy>(
    window: &Window,
    image: ImageView<'_, T>,
    interpolation: Interpolation,
    positions: &[DVec2],
    out: &mut [[f32; 3]],
) where
    f32: From<T>,
{
    let channels = image.channels();
    let grid = Grid {
        half: half_of(interpolation),
        scale: scale_of(window.level),
        origin: (window.rect.x0 + interpolation.before(), window.rect.y0 + interpolation.before()),
        stride: window.rect.width() * channels,
        channels,
        data: image.data(),
    };
    match (interpolation, channels) {
        (Interpolation::Nearest, 1) => each(&grid, positions, out, nearest::<T, 1>),
        (Interpolation::Nearest, 3) => each(&grid, positions, out, nearest::<T, 3>),
        (Interpolation::Bilinear, 1) => {
            run_widest(Bilinear::<T, 1, 2> { grid: &grid, positions, out });
        }
        (Interpolation::Bilinear, 3) => {
            run_widest(Bilinear::<T, 3, 6> { grid: &grid, positions, out });
        }
        (Interpolation::Bicubic, 1) => {
            run_widest(Bicubic::<T, 1, 4> { grid: &grid, positions, out });
        }
        (Interpolation::Bicubic, 3) => {
            run_widest(Bicubic::<T, 3, 12> { grid: &grid, positions, out });
        }
        _ => unreachable!("a photo has 1 or 3 channels, not {channels}"),
    }
}

/// A window's samples and the way from a position to them.
struct Grid<'a, T> {
    /// Offset of a pixel's centre: ½, or 0 for nearest.
    half: f64,
    /// 2^−level.
    scale: f64,
    /// The anchor, in pixels of the level, whose first tap is the window's first pixel.
    origin: (i64, i64),
    /// Samples a row.
    stride: usize,
    channels: usize,
    data: &'a [T],
}

/// Where a position falls: index of the first sample of the first tap, and the fractions past the anchor.
struct Anchor {
    first: usize,
    fx: f32,
    fy: f32,
}

impl<'a, T> Grid<'a, T> {
    /// The first `N` samples of row `row` of the taps.
    #[inline(always)]
    fn row<const N: usize>(&self, at: &Anchor, row: usize) -> &'a [T; N] {
        self.data[at.first + row * self.stride..].first_chunk().expect("taps were checked")
    }

    #[inline(always)]
    fn anchor(&self, position: DVec2) -> Anchor {
        let grid = grid_of(position, self.scale, self.half);
        let (x, y) = (floor(grid.x), floor(grid.y));
        let column = usize::try_from(i64::from(x) - self.origin.0).expect("taps were checked");
        let row = usize::try_from(i64::from(y) - self.origin.1).expect("taps were checked");
        #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
        let narrow = |v: f64| v as f32;
        Anchor {
            first: row * self.stride + column * self.channels,
            fx: narrow(grid.x - f64::from(x)),
            fy: narrow(grid.y - f64::from(y)),
        }
    }
}

/// Runs one kernel over all positions.
#[inline]
fn each<T>(
    grid: &Grid<'_, T>,
    positions: &[DVec2],
    out: &mut [[f32; 3]],
    kernel: impl Fn(&Grid<'_, T>, &Anchor) -> [f32; 3],
) {
    for (&p, o) in positions.iter().zip(out) {
        *o = kernel(grid, &grid.anchor(p));
    }
}

#[inline]
fn nearest<T: Copy, const C: usize>(grid: &Grid<'_, T>, at: &Anchor) -> [f32; 3]
where
    f32: From<T>,
{
    rgb(grid.row::<C>(at, 0).map(f32::from))
}

/// `C` channels, `N` = 2 `C` samples a row of taps.
struct Bilinear<'a, T, const C: usize, const N: usize> {
    grid: &'a Grid<'a, T>,
    positions: &'a [DVec2],
    out: &'a mut [[f32; 3]],
}

impl<T: Copy, const C: usize, const N: usize> Kernel for Bilinear<'_, T, C, N>
where
    f32: From<T>,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { grid, positions, out } = self;
        for (&position, out) in positions.iter().zip(out) {
            let at = grid.anchor(position);
            let (r0, r1) = (grid.row::<N>(&at, 0), grid.row::<N>(&at, 1));
            let mut column = [0.0; N];
            for k in 0..N {
                let (above, below) = (f32::from(r0[k]), f32::from(r1[k]));
                column[k] = above + at.fy * (below - above);
            }
            let mut colour = [0.0; C];
            for c in 0..C {
                colour[c] = column[c] + at.fx * (column[C + c] - column[c]);
            }
            *out = rgb(colour);
        }
    }
}

/// Positions of one round of [`Bicubic`]; what is known of them stays in the nearest cache.
const ROUND: usize = 64;

/// `C` channels, `N` = 4 `C` samples a row of taps.
struct Bicubic<'a, T, const C: usize, const N: usize> {
    grid: &'a Grid<'a, T>,
    positions: &'a [DVec2],
    out: &'a mut [[f32; 3]],
}

impl<T: Copy, const C: usize, const N: usize> Kernel for Bicubic<'_, T, C, N>
where
    f32: From<T>,
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { grid, positions, out } = self;
        let mut anchors = Anchors::default();
        let mut columns = [[0.0; N]; ROUND];
        for (positions, out) in positions.chunks(ROUND).zip(out.chunks_mut(ROUND)) {
            anchors.find(grid, positions);
            // Down the columns of taps, all of a row at once. They go through memory because that is what makes the
            // compiler use vectors for them.
            for (k, column) in columns[..out.len()].iter_mut().enumerate() {
                down(&grid.data[anchors.first[k] as usize..], grid.stride, anchors.fy[k], column);
            }
            // Then along the row that this leaves.
            for (k, out) in out.iter_mut().enumerate() {
                let (w, column) = (keys(anchors.fx[k]), &columns[k]);
                *out = rgb(std::array::from_fn::<_, C, _>(|c| {
                    convolve(w, [column[c], column[C + c], column[2 * C + c], column[3 * C + c]])
                }));
            }
        }
    }
}

/// Where the positions of one round fall: see [`Anchor`].
struct Anchors {
    first: [u32; ROUND],
    fx: [f32; ROUND],
    fy: [f32; ROUND],
}

impl Default for Anchors {
    fn default() -> Self {
        Self { first: [0; ROUND], fx: [0.0; ROUND], fy: [0.0; ROUND] }
    }
}

impl Anchors {
    /// The same as [`Grid::anchor`] for each of at most [`ROUND`] positions.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_possible_wrap,
        reason = "taps were checked: they lie in a window of less than 2³¹ samples; weights are f32"
    )]
    fn find<T>(&mut self, grid: &Grid<'_, T>, positions: &[DVec2]) {
        let (x0, y0) = (grid.origin.0 as i32, grid.origin.1 as i32);
        let (stride, channels) = (grid.stride as i32, grid.channels as i32);
        for (k, p) in positions.iter().enumerate() {
            let at = grid_of(*p, grid.scale, grid.half);
            let (x, y) = (floor(at.x), floor(at.y));
            let row = y.wrapping_sub(y0).wrapping_mul(stride);
            let column = x.wrapping_sub(x0).wrapping_mul(channels);
            self.first[k] = row.wrapping_add(column) as u32;
            self.fx[k] = (at.x - f64::from(x)) as f32;
            self.fy[k] = (at.y - f64::from(y)) as f32;
        }
    }
}

/// The four rows of taps, convolved into one.
#[inline(always)]
fn down<T: Copy, const N: usize>(taps: &[T], stride: usize, fy: f32, column: &mut [f32; N])
where
    f32: From<T>,
{
    let w = keys(fy);
    let row =
        |k: usize| -> &[T; N] { taps[k * stride..].first_chunk().expect("taps were checked") };
    let (t0, t1, t2, t3) = (row(0), row(1), row(2), row(3));
    for k in 0..N {
        let taps = [f32::from(t0[k]), f32::from(t1[k]), f32::from(t2[k]), f32::from(t3[k])];
        column[k] = convolve(w, taps);
    }
}

/// Tap 0 (the second) plus the weighted differences of the others to it.
#[inline(always)]
fn convolve(w: [f32; 3], [t0, t1, t2, t3]: [f32; 4]) -> f32 {
    t1 + (w[0] * (t0 - t1) + w[1] * (t2 - t1) + w[2] * (t3 - t1))
}

/// Keys' weights with a = −½ of the taps −1, 1 and 2 for a fraction `f` past tap 0, whose own weight is the rest to 1.
#[inline(always)]
fn keys(f: f32) -> [f32; 3] {
    [f * (f * (1.0 - 0.5 * f) - 0.5), f * (f * (2.0 - 1.5 * f) + 0.5), f * f * (0.5 * f - 0.5)]
}

/// Grey replicated, or RGB as it is.
#[inline(always)]
fn rgb<const C: usize>(v: [f32; C]) -> [f32; 3] {
    std::array::from_fn(|k| v[k.min(C - 1)])
}

#[cfg(test)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small coordinates of test images; exact values"
)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;
    use crate::geom::{PixelRect, Size};
    use crate::image::Image;

    const ALL: [Interpolation; 3] =
        [Interpolation::Nearest, Interpolation::Bilinear, Interpolation::Bicubic];

    /// A window whose sample of channel `c` at pixel `(x, y)` of the level is `f(x, y, c)`.
    fn window(
        level: u32,
        rect: PixelRect,
        channels: usize,
        f: impl Fn(i64, i64, i64) -> u16,
    ) -> Window {
        let size =
            Size::new(u32::try_from(rect.width()).unwrap(), u32::try_from(rect.height()).unwrap());
        let mut samples = Vec::with_capacity(rect.area() * channels);
        for y in rect.y0..rect.y1 {
            for x in rect.x0..rect.x1 {
                samples.extend((0..channels as i64).map(|c| f(x, y, c)));
            }
        }
        Window { level, rect, samples: Samples::U16(Image::from_data(size, channels, samples)) }
    }

    /// The same window in 8 bit.
    fn narrow(window: &Window) -> Window {
        let Samples::U16(i) = &window.samples else { unreachable!() };
        let data = i.data().iter().map(|&v| u8::try_from(v).unwrap()).collect();
        let samples = Samples::U8(Image::from_data(i.size(), i.channels(), data));
        Window { samples, ..*window }
    }

    fn sample(window: &Window, interpolation: Interpolation, positions: &[DVec2]) -> Vec<[f32; 3]> {
        let mut out = vec![[f32::NAN; 3]; positions.len()];
        sample_into(window, interpolation, positions, &mut out);
        out
    }

    /// Noise, by Knuth's multiplicative hash of the pixel's absolute place.
    fn noise(x: i64, y: i64, c: i64) -> u16 {
        let k = (x * 7919 + y * 104_729 + c * 1_299_709).unsigned_abs();
        (k.wrapping_mul(2_654_435_761) >> 16 & 0xff) as u16
    }

    /// Keys' kernel as the paper writes it (equation 15), f64, a = −½.
    fn keys_f64(s: f64) -> f64 {
        let s = s.abs();
        if s < 1.0 {
            1.5 * s * s * s - 2.5 * s * s + 1.0
        } else if s < 2.0 {
            -0.5 * s * s * s + 2.5 * s * s - 4.0 * s + 2.0
        } else {
            0.0
        }
    }

    /// The definition: a sum over all pixels, each weighted by the kernel of its distance in x and in y.
    fn naive(
        f: impl Fn(i64, i64) -> f64,
        interpolation: Interpolation,
        level_position: DVec2,
    ) -> f64 {
        let kernel = |d: f64| match interpolation {
            Interpolation::Nearest => f64::from(u8::from((-0.5..0.5).contains(&d))),
            Interpolation::Bilinear => (1.0 - d.abs()).max(0.0),
            Interpolation::Bicubic => keys_f64(d),
        };
        let (cx, cy) = (level_position.x.floor() as i64, level_position.y.floor() as i64);
        let mut sum = 0.0;
        for y in cy - 4..cy + 5 {
            for x in cx - 4..cx + 5 {
                let dx = level_position.x - (x as f64 + 0.5);
                let dy = level_position.y - (y as f64 + 0.5);
                sum += kernel(dx) * kernel(dy) * f(x, y);
            }
        }
        sum
    }

    fn points() -> impl Strategy<Value = Vec<DVec2>> {
        prop::collection::vec((0.0..12.0_f64, 0.0..9.0_f64).prop_map(DVec2::from), 1..40)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(7), ..ProptestConfig::default() })]

        #[test]
        fn every_kernel_is_the_separable_convolution(
            points in points(), level in 0..3_u32, which in 0..3_usize, grey in any::<bool>(), wide in any::<bool>(),
        ) {
            let channels = if grey { 1 } else { 3 };
            let w = window(level, PixelRect::new(-2, -2, 15, 12), channels, noise);
            let w = if wide { w } else { narrow(&w) };
            let scale = f64::from(1_u32 << level);
            let at: Vec<_> = points.iter().map(|&p| p * scale).collect();
            for (&p, got) in points.iter().zip(sample(&w, ALL[which], &at)) {
                for (c, got) in got.into_iter().enumerate() {
                    let c = if grey { 0 } else { c as i64 };
                    let want = naive(|x, y| f64::from(noise(x, y, c)), ALL[which], p);
                    prop_assert!((f64::from(got) - want).abs() < 2e-4, "{p} channel {c}: {got}, not {want}");
                }
            }
        }

        #[test]
        fn an_even_area_keeps_its_colour_to_the_last_bit(
            points in points(), which in 0..3_usize, value in any::<u16>(),
        ) {
            let w = window(0, PixelRect::new(-2, -2, 15, 12), 3, |_, _, c| value.wrapping_add(c as u16 * 9001));
            let want: [f32; 3] = std::array::from_fn(|c| f32::from(value.wrapping_add(c as u16 * 9001)));
            for got in sample(&w, ALL[which], &points) {
                prop_assert_eq!(got, want);
            }
        }

        #[test]
        fn a_linear_ramp_is_continued_between_the_centres(points in points(), cubic in any::<bool>()) {
            let interpolation = if cubic { Interpolation::Bicubic } else { Interpolation::Bilinear };
            let w = window(0, PixelRect::new(-2, -2, 15, 12), 1, |x, y, _| (20 + 3 * x + 5 * y) as u16);
            for (p, [got, ..]) in points.iter().zip(sample(&w, interpolation, &points)) {
                // Pixel x has its centre at x + ½.
                let want = 20.0 + 3.0 * (p.x - 0.5) + 5.0 * (p.y - 0.5);
                prop_assert!((f64::from(got) / want - 1.0).abs() < 1e-5, "{p}: {got}, not {want}");
            }
        }

        #[test]
        fn one_sample_alone_from_its_own_window_equals_the_batch(
            points in points(), which in 0..3_usize, grey in any::<bool>(),
        ) {
            let channels = if grey { 1 } else { 3 };
            let w = window(0, PixelRect::new(-2, -2, 15, 12), channels, noise);
            let all = sample(&w, ALL[which], &points);
            for (&p, together) in points.iter().zip(all) {
                let own = window(0, super::super::taps(ALL[which], p, 0), channels, noise);
                let alone = sample(&narrow(&own), ALL[which], &[p])[0];
                prop_assert_eq!(alone.map(f32::to_bits), together.map(f32::to_bits));
            }
        }
    }

    #[test]
    fn a_pixels_centre_has_that_pixels_colour() {
        let w = window(0, PixelRect::new(-2, -2, 15, 12), 3, noise);
        for interpolation in ALL {
            let got = sample(&w, interpolation, &[DVec2::new(4.5, 6.5)])[0];
            assert_eq!(got, [0, 1, 2].map(|c| f32::from(noise(4, 6, c))));
        }
    }

    #[test]
    fn between_two_pixels_bilinear_is_their_mean_and_nearest_the_right_one() {
        let w = window(0, PixelRect::new(0, 0, 4, 1), 1, |x, _, _| [10, 20, 40, 80][x as usize]);
        let edge = [DVec2::new(2.0, 0.5)];
        assert_eq!(sample(&w, Interpolation::Nearest, &edge), [[40.0; 3]]);
        let tall = window(0, PixelRect::new(0, 0, 4, 2), 1, |x, _, _| [10, 20, 40, 80][x as usize]);
        assert_eq!(sample(&tall, Interpolation::Bilinear, &edge), [[30.0; 3]]);
    }

    #[test]
    fn bicubic_overshoots_and_is_not_clamped() {
        // Keys' weights half-way are −1/16, 9/16, 9/16, −1/16.
        let w = window(0, PixelRect::new(0, 0, 4, 4), 1, |x, _, _| [255, 0, 0, 255][x as usize]);
        let got = sample(&w, Interpolation::Bicubic, &[DVec2::new(2.0, 1.5)]);
        assert_eq!(got, [[-255.0 / 8.0; 3]]);
    }

    #[test]
    fn a_tap_outside_the_window_is_refused_even_where_the_buffer_would_hold_an_index() {
        let w = window(0, PixelRect::new(0, 0, 8, 8), 1, noise);
        for p in [(1.4, 4.0), (6.6, 4.0), (4.0, 1.4), (4.0, 6.6), (f64::NAN, 4.0), (1e300, 4.0)] {
            let points = [DVec2::splat(4.0), DVec2::from(p)];
            let run = || sample(&w, Interpolation::Bicubic, &points);
            assert!(std::panic::catch_unwind(run).is_err(), "{p:?}");
        }
        assert_eq!(
            sample(&w, Interpolation::Bicubic, &[DVec2::splat(1.5), DVec2::splat(6.4)]).len(),
            2
        );
    }

    #[test]
    fn no_positions_need_no_window() {
        let w = window(0, PixelRect::new(5, 5, 5, 5), 3, noise);
        assert!(sample(&w, Interpolation::Bicubic, &[]).is_empty());
    }
}
