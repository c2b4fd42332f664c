//! Properties of all lens models together.

use glam::DVec2;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use super::{Lens, LensError, LensModel};
use crate::geom::Size;

const SIZE: Size = Size { width: 2592, height: 1944 };

/// A lens of any supported model, with the distortion that real lenses have.
fn lenses() -> impl Strategy<Value = Lens> {
    let k = (-0.35..0.35_f64, -0.2..0.4_f64, -0.1..0.1_f64);
    let rest = (-0.2..0.2_f64, -0.1..0.1_f64, -0.05..0.05_f64);
    let p = (-3e-3..3e-3_f64, -3e-3..3e-3_f64);
    let interior = (0.7..3.0_f64, 0.98..1.02_f64, -80.0..80.0_f64, -80.0..80.0_f64);
    (0..16_usize, interior, k, rest, p).prop_map(|(model, (f, aspect, dx, dy), k, rest, p)| {
        let (fx, cx, cy) = (f * 2592.0, 1296.0 + dx, 972.0 + dy);
        let fy = fx * aspect;
        let (model, params) = match model {
            0 => (LensModel::SimplePinhole, vec![fx, cx, cy]),
            1 => (LensModel::Pinhole, vec![fx, fy, cx, cy]),
            2 => (LensModel::SimpleRadial, vec![fx, cx, cy, k.0]),
            3 => (LensModel::Radial, vec![fx, cx, cy, k.0, k.1]),
            4 => (LensModel::OpenCv, vec![fx, fy, cx, cy, k.0, k.1, p.0, p.1]),
            5 => {
                let all = [fx, fy, cx, cy, k.0, k.1, p.0, p.1, k.2, rest.0, rest.1, rest.2];
                (LensModel::FullOpenCv, all.to_vec())
            }
            6 => (LensModel::SimpleFisheye, vec![fx, cx, cy]),
            7 => (LensModel::Fisheye, vec![fx, fy, cx, cy]),
            8 => (LensModel::SimpleRadialFisheye, vec![fx, cx, cy, k.0]),
            9 => (LensModel::RadialFisheye, vec![fx, cx, cy, k.0, k.1]),
            10 => (LensModel::OpenCvFisheye, vec![fx, fy, cx, cy, k.0, k.1, k.2, rest.0]),
            11 => {
                let all = [fx, fy, cx, cy, k.0, k.1, p.0, p.1, k.2, rest.2, p.1, -p.0];
                (LensModel::ThinPrismFisheye, all.to_vec())
            }
            12 => (LensModel::Fov, vec![fx, fy, cx, cy, 4.0 * k.0]),
            13 => {
                let off = [fx, fy, cx, cy, 3e3 * p.0, k.0, k.1, k.2, rest.0, p.0, p.1, dx, dy];
                (LensModel::BrownOffCentre, off.to_vec())
            }
            _ => {
                let own = if model == 14 { LensModel::Brown } else { LensModel::BrownFisheye };
                (own, vec![fx, fy, cx, cy, 3e3 * p.0, k.0, k.1, k.2, rest.0, p.0, p.1])
            }
        };
        Lens::new(model, SIZE, &params).unwrap()
    })
}

/// A point of the unit disc.
fn disc() -> impl Strategy<Value = DVec2> {
    (0.0..1.0_f64, 0.0..std::f64::consts::TAU)
        .prop_map(|(r, a)| DVec2::new(r.sqrt() * a.cos(), r.sqrt() * a.sin()))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, rng_seed: RngSeed::Fixed(20_040_712), ..ProptestConfig::default() })]

    #[test]
    fn a_ray_comes_back_from_its_photo_position(lens in lenses(), at in disc()) {
        let ray = at * lens.valid_radius().min(1.0) * 0.9;
        let px = lens.photo_from_ray(ray).unwrap();
        let back = lens.ray_from_photo(px).unwrap();
        let again = lens.photo_from_ray(back).unwrap();
        prop_assert!((again - px).length() < 1e-9, "{} px", (again - px).length());
        // A tangential part may fold the plane within the valid radius; then another ray may be found.
        let (_, slope) = lens.photo_from_ray_jacobian(ray).unwrap();
        if slope.determinant() > 0.1 * lens.focal_px().x * lens.focal_px().y {
            let off = (back - ray) * lens.focal_px();
            prop_assert!(off.length() < 1e-9, "{} px", off.length());
        }
    }

    #[test]
    fn the_jacobian_is_the_limit_of_differences(lens in lenses(), at in disc()) {
        let ray = at * lens.valid_radius().min(1.0) * 0.9;
        let (px, slope) = lens.photo_from_ray_jacobian(ray).unwrap();
        prop_assert_eq!(Some(px), lens.photo_from_ray(ray));
        let h = 1e-5;
        for (axis, column) in [(DVec2::X, slope.x_axis), (DVec2::Y, slope.y_axis)] {
            let difference = lens.photo_from_ray(ray + axis * h).unwrap()
                - lens.photo_from_ray(ray - axis * h).unwrap();
            let off = (difference / (2.0 * h) - column).length() / lens.focal_px().x;
            prop_assert!(off < 1e-7, "{off}");
        }
    }

    #[test]
    fn the_distorted_radius_grows_up_to_the_valid_radius_and_no_further(lens in lenses()) {
        // The radial part alone: along the axis, tangential terms removed by symmetry.
        let valid = lens.valid_radius();
        let end = valid.min(4.0);
        let radius = |r: f64| {
            let [a, b] = [r, -r].map(|x| lens.photo_from_ray(DVec2::new(x, 0.0)).unwrap());
            a.x - b.x
        };
        let radii: Vec<f64> = (0..=1000).map(|i| radius(end * (1.0 - 1e-9) * f64::from(i) / 1000.0)).collect();
        prop_assert!(radii.windows(2).all(|w| w[1] > w[0]));
        prop_assert_eq!(lens.photo_from_ray(DVec2::new(valid * (1.0 + 1e-12), 0.0)), None);
    }

    #[test]
    fn no_ray_outside_the_bounds_falls_in_the_frame(lens in lenses(), at in disc(), far in 0.0..6.0_f64) {
        let ray = at * lens.valid_radius().min(1.0) * far;
        if lens.photo_from_ray(ray).is_some_and(|px| lens.contains(px))
            && let Some(bounds) = lens.ray_bounds()
        {
            prop_assert!(
                bounds.min.cmple(ray).all() && ray.cmple(bounds.max).all(),
                "{ray} outside {bounds:?}"
            );
        }
    }
}

#[test]
fn the_bounds_of_a_real_lens_are_hardly_greater_than_its_frame() {
    let params = [
        2_984.257_453_938_442,
        2_991.026_545_598_149,
        1_460.794_521_904_823,
        1_109.744_732_781_385,
        -0.252_842_449_468_318,
        0.321_589_041_966_465,
        0.002_179_015_033_812,
        -0.000_788_272_044_643,
    ];
    let lens = Lens::new(LensModel::OpenCv, Size::new(2832, 2128), &params).unwrap();
    let bounds = lens.ray_bounds().unwrap();
    let corners = [(0.0, 0.0), (2832.0, 0.0), (0.0, 2128.0), (2832.0, 2128.0)]
        .map(|(x, y)| lens.ray_from_photo(DVec2::new(x, y)).unwrap());
    let seen = crate::geom::Bounds2::of(corners);
    let ratio = (bounds.max - bounds.min) / (seen.max - seen.min);
    assert!(ratio.min_element() >= 1.0 && ratio.max_element() < 1.1, "{ratio}");
}

#[test]
fn a_photo_position_beyond_the_fold_belongs_to_no_ray() {
    // r − 0.25 r³ reaches at most 0.7698 at r = 1.1547.
    let params = [1000.0, 500.0, 500.0, -0.25];
    let lens = Lens::new(LensModel::SimpleRadial, Size::new(1000, 1000), &params).unwrap();
    assert!((lens.valid_radius() - (4.0_f64 / 3.0).sqrt()).abs() < 1e-12);
    assert!(lens.ray_from_photo(DVec2::new(500.0 + 769.0, 500.0)).is_some());
    assert_eq!(lens.ray_from_photo(DVec2::new(500.0 + 770.0, 500.0)), None);
    assert_eq!(lens.ray_from_photo(DVec2::NAN), None);
    assert_eq!(lens.photo_from_ray(DVec2::NAN), None);
}

#[test]
fn the_frame_is_half_open() {
    let lens = Lens::new(LensModel::SimplePinhole, Size::new(4, 3), &[5.0, 2.0, 1.5]).unwrap();
    assert!(lens.contains(DVec2::ZERO) && lens.contains(DVec2::new(3.999, 2.999)));
    for outside in [(4.0, 1.0), (1.0, 3.0), (-1e-9, 1.0), (1.0, f64::NAN)] {
        assert!(!lens.contains(outside.into()));
    }
}

#[test]
fn parameters_that_make_no_lens_are_refused() {
    let size = Size::new(4, 3);
    let refused = |model, size, params: &[f64]| Lens::new(model, size, params).unwrap_err();
    for (params, what) in [
        (&[1.0, 2.0][..], "3 parameters"),
        (&[-1.0, 2.0, 2.0], "positive focal"),
        (&[f64::NAN, 2.0, 2.0], "finite"),
    ] {
        let message = refused(LensModel::SimplePinhole, size, params).to_string();
        assert!(message.contains(what), "{message}");
    }
    let huge = refused(LensModel::SimpleRadial, size, &[1.0, 2.0, 2.0, 1e13]).to_string();
    assert!(huge.contains("1e12"), "{huge}");
    let empty = refused(LensModel::SimplePinhole, Size::new(0, 3), &[1.0, 2.0, 2.0]).to_string();
    assert!(empty.contains("0 x 3"), "{empty}");
    assert_eq!(refused(LensModel::Eucm, size, &[1.0; 6]), LensError::Unsupported(LensModel::Eucm));
}

#[test]
fn without_distortion_the_centre_stays_and_the_lens_is_a_pinhole() {
    let params = [1000.0, 1010.0, 500.0, 400.0, -0.2, 0.1, 1e-3, 1e-3];
    let lens = Lens::new(LensModel::OpenCv, Size::new(1000, 800), &params).unwrap();
    let plain = lens.without_distortion();
    assert!(plain.model() == LensModel::Pinhole && plain.valid_radius().is_infinite());
    assert_eq!(plain.photo_from_ray(DVec2::ZERO), lens.photo_from_ray(DVec2::ZERO));
    assert_eq!(plain.photo_from_ray(DVec2::new(0.1, 0.2)), Some(DVec2::new(600.0, 602.0)));
    let fisheye = Lens::new(LensModel::OpenCvFisheye, Size::new(1000, 800), &params).unwrap();
    assert_eq!(fisheye.without_distortion(), plain);
}
