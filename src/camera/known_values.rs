//! Lenses that draw angles, and Brown's: positions computed independently, and what holds out to 85°.
//!
//! The positions were computed in Python from the formulas of COLMAP's `models.h` and of the Agisoft Metashape manual
//! (appendix C), term by term as they stand there.

use glam::DVec2;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::wide::MAX_TANGENT;
use super::{Lens, LensModel};
use crate::geom::{Bounds2, Size};

const SIZE: Size = Size { width: 2600, height: 1940 };

/// Distortion coefficients in the order of `THIN_PRISM_FISHEYE`, and in that of the Brown models.
const PRISM: [f64; 8] = [0.03, -0.01, 0.001, -0.002, 0.004, -0.0005, 0.0007, -0.0003];
const FISHEYE_BROWN: [f64; 7] = [2.5, 0.03, -0.01, 0.004, -0.0005, 0.001, -0.002];
const FRAME_BROWN: [f64; 7] = [2.5, -0.2, 0.08, 0.03, -0.02, 0.001, -0.002];

fn lens(model: LensModel, focal: &[f64], k: &[f64]) -> Lens {
    Lens::new(model, SIZE, &[focal, &[1300.0, 970.0], k].concat()).unwrap()
}

/// The lens shows ray (x, y) at (u, v).
fn shows(lens: &Lens, places: &[[f64; 4]]) {
    for &[x, y, u, v] in places {
        let at = lens.photo_from_ray(DVec2::new(x, y)).unwrap();
        let off = (at - DVec2::new(u, v)).length();
        assert!(off < 1e-9, "{} shows ({x}, {y}) at {at}", lens.model().name());
    }
}

#[test]
fn fisheyes_show_rays_where_colmap_does() {
    use LensModel::{Fisheye, OpenCvFisheye, RadialFisheye, SimpleFisheye, SimpleRadialFisheye};
    let (one, two) = (&[900.0][..], &[900.0, 910.0][..]);
    let [k1, k2, .., k3, k4, _, _] = PRISM;
    shows(
        &lens(SimpleFisheye, one, &[]),
        &[
            [0.3, -0.2, 1_559.135_605_630_982_4, 797.242_929_579_345_2],
            [4.0, 6.0, 2_015.396_894_067_547, 2_043.095_341_101_320_6],
        ],
    );
    shows(&lens(Fisheye, two, &[]), &[[-1.5, 0.9, 488.531_404_845_383_7, 1_462.290_947_727_134]]);
    shows(
        &lens(SimpleRadialFisheye, one, &[k1]),
        &[[4.0, 6.0, 2_059.468_689_928_771_3, 2_109.203_034_893_157]],
    );
    shows(
        &lens(RadialFisheye, one, &[k1, k2]),
        &[[-1.5, 0.9, 471.535_623_411_294_3, 1_467.078_625_953_223_3]],
    );
    shows(
        &lens(OpenCvFisheye, two, &[k1, k2, k3, k4]),
        &[
            [0.3, -0.2, 1_560.031_132_465_039_3, 794.719_755_153_195_6],
            [-1.5, 0.9, 467.755_288_472_273_4, 1_474.895_124_993_487_6],
            [4.0, 6.0, 2_047.720_301_754_814, 2_104.042_457_661_468_2],
        ],
    );
}

#[test]
fn thin_prism_and_fov_lenses_show_rays_where_colmap_does() {
    let focal = &[900.0, 910.0];
    shows(
        &lens(LensModel::ThinPrismFisheye, focal, &PRISM),
        &[
            [0.3, -0.2, 1_559.493_093_340_266_3, 795.064_271_525_488_7],
            [-1.5, 0.9, 462.657_180_066_200_1, 1_477.907_489_877_540_5],
            [4.0, 6.0, 2_044.749_060_708_906_7, 2_104.488_064_837_996_7],
        ],
    );
    for omega in [0.9, -0.9] {
        shows(
            &lens(LensModel::Fov, focal, &[omega]),
            &[
                [0.3, -0.2, 1_578.896_278_877_268_5, 782.003_249_053_100_5],
                [-1.5, 0.9, 411.216_352_738_432_2, 1_509.195_412_672_018],
                [4.0, 6.0, 2_092.239_761_404_368_4, 2_171.563_638_129_958_7],
            ],
        );
    }
    // Below 0.01 COLMAP has a series instead.
    shows(
        &lens(LensModel::Fov, focal, &[0.008]),
        &[
            [0.3, -0.2, 1_569.999_308_8, 788.000_465_92],
            [4.0, 6.0, 4_903.974_4, 6_436.027_840_000_001],
        ],
    );
}

#[test]
fn brown_lenses_show_rays_where_metashape_does() {
    shows(
        &lens(LensModel::Brown, &[2000.0, 2010.0], &FRAME_BROWN),
        &[
            [0.3, -0.2, 1_883.280_737_581_099_9, 578.788_796_484_399_9],
            [-0.5, 0.4, 363.546_297_677_8, 1_723.167_484_151_2],
        ],
    );
    shows(
        &lens(LensModel::BrownFisheye, &[900.0, 910.0], &FISHEYE_BROWN),
        &[
            [0.3, -0.2, 1_558.937_148_949_602_7, 795.096_962_860_085_9],
            [-1.5, 0.9, 463.356_832_645_724_35, 1_478.209_318_186_158_7],
            [4.0, 6.0, 2_046.573_628_024_289_5, 2_105.048_667_414_920_6],
        ],
    );
}

#[test]
fn a_fisheye_ends_at_85_degrees_or_where_it_folds() {
    assert!((libm::atan(MAX_TANGENT).to_degrees() - 85.0).abs() < 1e-13);
    let plain = lens(LensModel::SimpleFisheye, &[900.0], &[]);
    assert!((plain.valid_radius() / MAX_TANGENT - 1.0).abs() < 1e-15);
    assert_eq!(plain.photo_from_ray(DVec2::new(0.0, MAX_TANGENT * 1.000_001)), None);
    // θ − 0.25 θ³ turns back at θ = √(4/3), 66.2°.
    let folded = lens(LensModel::SimpleRadialFisheye, &[900.0], &[-0.25]);
    let fold = (4.0_f64 / 3.0).sqrt();
    assert!((folded.valid_radius() / fold.tan() - 1.0).abs() < 1e-12);
    // 900 · 0.7698 px is the farthest that it draws.
    assert!(folded.ray_from_photo(DVec2::new(1300.0 + 692.0, 970.0)).is_some());
    assert_eq!(folded.ray_from_photo(DVec2::new(1300.0 + 693.0, 970.0)), None);
    let fov = lens(LensModel::Fov, &[900.0, 910.0], &[1.2]);
    assert!((fov.valid_radius() / MAX_TANGENT - 1.0).abs() < 1e-15);
}

#[test]
fn the_bounds_of_a_fisheye_are_those_of_its_corners() {
    let lens = lens(LensModel::OpenCvFisheye, &[1400.0, 1400.0], &[0.03, -0.01, 0.0, 0.0]);
    let bounds = lens.ray_bounds().unwrap();
    let corners = [(0.0, 0.0), (2600.0, 0.0), (0.0, 1940.0), (2600.0, 1940.0)]
        .map(|(x, y)| lens.ray_from_photo(DVec2::new(x, y)).unwrap());
    let ratio = (bounds.max - bounds.min) / {
        let b = Bounds2::of(corners);
        b.max - b.min
    };
    assert!(ratio.min_element() >= 1.0 && ratio.max_element() < 1.1, "{ratio}");
    // A frame that no valid ray fills is bounded by the valid radius.
    let bounds = self::lens(LensModel::SimpleFisheye, &[500.0], &[]).ray_bounds().unwrap();
    assert!(bounds.max.x < MAX_TANGENT * 1.000_001 && bounds.min.y > -MAX_TANGENT * 1.000_001);
}

#[test]
fn a_skew_or_an_omega_that_no_lens_has_is_refused() {
    let refused = |model, k: &[f64]| {
        let params = [&[900.0, 910.0, 1300.0, 970.0], k].concat();
        Lens::new(model, SIZE, &params).unwrap_err().to_string()
    };
    assert!(refused(LensModel::Fov, &[3.2]).contains("omega"));
    let skewed = refused(LensModel::Brown, &[900.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert!(skewed.contains("skew"), "{skewed}");
}

/// A lens that draws angles, with the distortion that real ones have.
fn wide_lenses() -> impl Strategy<Value = Lens> {
    let k = (-0.05..0.05_f64, -0.02..0.02_f64, -5e-3..5e-3_f64, -1e-3..1e-3_f64);
    let p = (-1e-3..1e-3_f64, -1e-3..1e-3_f64, -1e-3..1e-3_f64, -1e-3..1e-3_f64);
    let interior = (500.0..1500.0_f64, 0.98..1.02_f64, -5.0..5.0_f64, 0.2..1.5_f64);
    (0..4_usize, interior, k, p).prop_map(|(model, (f, aspect, skew, omega), k, p)| {
        let focal = [f, f * aspect];
        match model {
            0 => lens(LensModel::OpenCvFisheye, &focal, &[k.0, k.1, k.2, k.3]),
            1 => {
                let prism = [k.0, k.1, p.0, p.1, k.2, k.3, p.2, p.3];
                lens(LensModel::ThinPrismFisheye, &focal, &prism)
            }
            2 => lens(LensModel::Fov, &focal, &[omega]),
            _ => {
                let brown = [skew, k.0, k.1, k.2, k.3, p.0, p.1];
                lens(LensModel::BrownFisheye, &focal, &brown)
            }
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, rng_seed: RngSeed::Fixed(19_710_855), ..ProptestConfig::default() })]

    #[test]
    fn rays_far_from_the_axis_come_back(lens in wide_lenses(), part in 0.0..1.0_f64, bearing in 0.0..std::f64::consts::TAU) {
        let angle = part * 0.98 * libm::atan(lens.valid_radius());
        let ray = DVec2::from_angle(bearing) * angle.tan();
        let (px, slope) = lens.photo_from_ray_jacobian(ray).unwrap();
        let Some(back) = lens.ray_from_photo(px) else {
            // Only where the decentering terms themselves fold the plane.
            prop_assert!(part > 0.7, "{ray} is lost");
            return Ok(());
        };
        let again = lens.photo_from_ray(back).unwrap();
        prop_assert!((again - px).length() < 1e-8, "{} px", (again - px).length());
        // The derivative by the angle: a hundredth of the focal length is steep enough to be alone.
        let steep = slope.determinant() * (1.0 + ray.length_squared()).powf(1.5);
        if steep > 0.2 * lens.focal_px().x * lens.focal_px().y {
            prop_assert!((back - ray).length() < 1e-9 * (1.0 + ray.length_squared()), "{back} {ray}");
        }
    }

    #[test]
    fn no_wide_ray_outside_the_bounds_falls_in_the_frame(lens in wide_lenses(), part in 0.0..1.0_f64, bearing in 0.0..std::f64::consts::TAU) {
        let ray = DVec2::from_angle(bearing) * (part * libm::atan(lens.valid_radius())).tan();
        if lens.photo_from_ray(ray).is_some_and(|px| lens.contains(px)) {
            let bounds = lens.ray_bounds().unwrap();
            prop_assert!(bounds.min.cmple(ray).all() && ray.cmple(bounds.max).all(), "{ray} outside {bounds:?}");
        }
    }
}
