//! Many rays through one lens: [`Lens::photo_from_ray`] and its Jacobian in loops that become vector instructions.

use glam::{DMat2, DVec2};

use super::Lens;
use super::distortion::Distortion;
use crate::geom::{Kernel, run_widest};

/// Rays of one batch, at most.
pub const RAYS: usize = 64;

/// A batch of rays and where the lens shows them.
#[derive(Debug, Clone)]
pub struct Rays {
    /// x/z of each ray.
    pub x: [f64; RAYS],
    /// y/z of each ray.
    pub y: [f64; RAYS],
    /// Photo position of each ray, pixels; NaN at or beyond the valid radius, or for NaN.
    pub photo_x: [f64; RAYS],
    /// The same, y.
    pub photo_y: [f64; RAYS],
    /// Absolute determinant of the derivative of the photo position by the ray, pixels².
    pub magnification: [f64; RAYS],
}

impl Default for Rays {
    fn default() -> Self {
        let zero = [0.0; RAYS];
        Self { x: zero, y: zero, photo_x: zero, photo_y: zero, magnification: zero }
    }
}

impl Lens {
    /// Fills in the photo positions of the first `count` rays: bit for bit those of
    /// [`photo_from_ray`](Self::photo_from_ray).
    ///
    /// # Panics
    /// If `count` is above [`RAYS`].
    pub fn photos_from_rays(&self, rays: &mut Rays, count: usize) {
        let lens = self;
        match &self.distortion {
            Distortion::None => run_widest(Positions { lens, rays, count, distort: |q| q }),
            Distortion::Radial(d) => {
                run_widest(Positions { lens, rays, count, distort: |q| d.distort(q) });
            }
            Distortion::OpenCv(d) => {
                run_widest(Positions { lens, rays, count, distort: |q| d.distort(q) });
            }
            Distortion::Rational(d) => {
                run_widest(Positions { lens, rays, count, distort: |q| d.distort(q) });
            }
            Distortion::Brown(d) => {
                run_widest(Positions { lens, rays, count, distort: |q| d.distort(q) });
            }
            Distortion::Wide(d) => {
                run_widest(Positions { lens, rays, count, distort: |q| d.distort(q) });
            }
        }
    }

    /// Fills in the photo positions and magnifications of the first `count` rays: bit for bit those of
    /// [`photo_from_ray_jacobian`](Self::photo_from_ray_jacobian) and its determinant.
    ///
    /// # Panics
    /// If `count` is above [`RAYS`].
    pub fn photos_from_rays_jacobian(&self, rays: &mut Rays, count: usize) {
        let lens = self;
        match &self.distortion {
            Distortion::None => {
                run_widest(Jacobians { lens, rays, count, distort: |q| (q, DMat2::IDENTITY) });
            }
            Distortion::Radial(d) => {
                run_widest(Jacobians { lens, rays, count, distort: |q| d.distort_jacobian(q) });
            }
            Distortion::OpenCv(d) => {
                run_widest(Jacobians { lens, rays, count, distort: |q| d.distort_jacobian(q) });
            }
            Distortion::Rational(d) => {
                run_widest(Jacobians { lens, rays, count, distort: |q| d.distort_jacobian(q) });
            }
            Distortion::Brown(d) => {
                run_widest(Jacobians { lens, rays, count, distort: |q| d.distort_jacobian(q) });
            }
            Distortion::Wide(d) => {
                run_widest(Jacobians { lens, rays, count, distort: |q| d.distort_jacobian(q) });
            }
        }
    }
}

struct Positions<'a, D> {
    lens: &'a Lens,
    rays: &'a mut Rays,
    count: usize,
    distort: D,
}

impl<D: Fn(DVec2) -> DVec2> Kernel for Positions<'_, D> {
    type Output = ();

    #[inline(always)]
    #[expect(clippy::inline_always, reason = "compiled for the widest vectors where it is inlined")]
    fn run(self) {
        let Self { lens, rays, count, distort } = self;
        let Lens { focal_px, principal_px, valid_square, .. } = *lens;
        let (x, y) = (&rays.x[..count], &rays.y[..count]);
        let (photo_x, photo_y) = (&mut rays.photo_x[..count], &mut rays.photo_y[..count]);
        for k in 0..count {
            let ray = DVec2::new(x[k], y[k]);
            let at = focal_px * distort(ray) + principal_px;
            let is_valid = ray.length_squared() < valid_square;
            photo_x[k] = if is_valid { at.x } else { f64::NAN };
            photo_y[k] = if is_valid { at.y } else { f64::NAN };
        }
    }
}

struct Jacobians<'a, D> {
    lens: &'a Lens,
    rays: &'a mut Rays,
    count: usize,
    distort: D,
}

impl<D: Fn(DVec2) -> (DVec2, DMat2)> Kernel for Jacobians<'_, D> {
    type Output = ();

    #[inline(always)]
    #[expect(clippy::inline_always, reason = "compiled for the widest vectors where it is inlined")]
    fn run(self) {
        let Self { lens, rays, count, distort } = self;
        let Lens { focal_px, principal_px, valid_square, .. } = *lens;
        let (x, y) = (&rays.x[..count], &rays.y[..count]);
        let (photo_x, photo_y) = (&mut rays.photo_x[..count], &mut rays.photo_y[..count]);
        let magnification = &mut rays.magnification[..count];
        for k in 0..count {
            let ray = DVec2::new(x[k], y[k]);
            let (at, slope) = distort(ray);
            let at = focal_px * at + principal_px;
            let slope = DMat2::from_cols(focal_px * slope.x_axis, focal_px * slope.y_axis);
            let is_valid = ray.length_squared() < valid_square;
            photo_x[k] = if is_valid { at.x } else { f64::NAN };
            photo_y[k] = if is_valid { at.y } else { f64::NAN };
            magnification[k] = slope.determinant().abs();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::LensModel;
    use crate::geom::Size;

    #[test]
    fn a_batch_repeats_each_ray_bit_for_bit() {
        let size = Size::new(3000, 2000);
        let k = [2500.0, 2510.0, 1490.0, 1010.0, -0.21, 0.04, 1e-3, -2e-3, 0.01, 0.02, 0.003, 1e-3];
        let lenses = [
            Lens::new(LensModel::Pinhole, size, &k[..4]),
            Lens::new(LensModel::Radial, size, &[2500.0, 1490.0, 1010.0, -0.3, 0.05]),
            Lens::new(LensModel::OpenCv, size, &k[..8]),
            Lens::new(LensModel::FullOpenCv, size, &k),
            Lens::new(LensModel::Brown, size, &[&k[..4], &[3.0], &k[4..10]].concat()),
            Lens::new(
                LensModel::BrownOffCentre,
                size,
                &[&k[..4], &[3.0], &k[4..10], &[9.0, -7.0]].concat(),
            ),
            Lens::new(LensModel::BrownFisheye, size, &[&k[..4], &[3.0], &k[4..10]].concat()),
            Lens::new(LensModel::Fisheye, size, &k[..4]),
            Lens::new(LensModel::OpenCvFisheye, size, &k[..8]),
            Lens::new(LensModel::ThinPrismFisheye, size, &k),
            Lens::new(LensModel::Fov, size, &[2500.0, 2510.0, 1490.0, 1010.0, 0.9]),
        ];
        for lens in lenses.map(Result::unwrap) {
            let mut rays = Rays::default();
            for i in 0..RAYS {
                let t = i as f64 / 7.0;
                (rays.x[i], rays.y[i]) = (0.4 * t * t.sin(), 0.3 * t * (1.3 * t).cos());
            }
            rays.x[5] = f64::NAN;
            (rays.x[6], rays.y[6]) = (0.0, 0.0);
            (rays.x[7], rays.y[7]) = (1e-170, 1e-9);
            let mut with_slope = rays.clone();
            lens.photos_from_rays(&mut rays, RAYS);
            lens.photos_from_rays_jacobian(&mut with_slope, RAYS);
            for i in 0..RAYS {
                let ray = DVec2::new(rays.x[i], rays.y[i]);
                let got = DVec2::new(rays.photo_x[i], rays.photo_y[i]);
                match lens.photo_from_ray_jacobian(ray) {
                    Some((at, slope)) => {
                        assert_eq!(Some(at), lens.photo_from_ray(ray));
                        assert_eq!(got, at);
                        assert_eq!(got.x.to_bits(), with_slope.photo_x[i].to_bits());
                        let magnification = with_slope.magnification[i].to_bits();
                        assert_eq!(magnification, slope.determinant().abs().to_bits());
                    }
                    None => assert!(got.is_nan() && with_slope.photo_x[i].is_nan()),
                }
            }
        }
    }
}
