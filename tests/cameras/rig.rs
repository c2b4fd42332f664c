//! The rig: a handful of cameras around points, and what they see by formulas of its own.

use std::path::Path;

use glam::{DMat3, DQuat, DVec2, DVec3};
use groundel::camera::CameraSet;
use groundel::geom::Size;
use groundel::image::{Image, Samples};
use groundel::synthetic::{Random, write_picture};

pub(crate) const SIZE: Size = Size { width: 640, height: 480 };

/// How rays bend.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Bend {
    /// Brown: `k1, k2, k3`, `p1, p2` in OpenCV's order.
    Brown([f64; 3], [f64; 2]),
    /// OpenCV's fisheye: `k1 … k4`.
    Fisheye([f64; 4]),
    /// Devernay and Faugeras: `omega`.
    Fov(f64),
    /// A fisheye with `k1 … k4`, `p1, p2`, `sx1, sy1`.
    ThinPrism([f64; 4], [f64; 2], [f64; 2]),
}

#[derive(Debug, Clone)]
pub(crate) struct Camera {
    pub(crate) name: String,
    pub(crate) focal: f64,
    /// Pixels, the first pixel's corner at (0, 0).
    pub(crate) principal: DVec2,
    pub(crate) bend: Bend,
    /// `camera_from_ground`, y down, z forward.
    pub(crate) rotation: DMat3,
    pub(crate) centre: DVec3,
}

impl Camera {
    /// Where it sees a point, pixels.
    pub(crate) fn sees(&self, point: DVec3) -> DVec2 {
        let p = self.rotation * (point - self.centre);
        assert!(p.z > 0.0, "the rig's points are in front");
        let (x, y) = (p.x / p.z, p.y / p.z);
        let r2 = x * x + y * y;
        let bent = match self.bend {
            Bend::Brown([k1, k2, k3], [p1, p2]) => {
                let g = 1.0 + k1 * r2 + k2 * r2.powi(2) + k3 * r2.powi(3);
                DVec2::new(
                    x * g + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * g + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                )
            }
            Bend::Fisheye([k1, k2, k3, k4]) => {
                let (r, a) = (r2.sqrt(), r2.sqrt().atan());
                let bent =
                    a * (1.0 + k1 * a.powi(2) + k2 * a.powi(4) + k3 * a.powi(6) + k4 * a.powi(8));
                DVec2::new(x, y) * (bent / r)
            }
            Bend::Fov(omega) => {
                let r = r2.sqrt();
                DVec2::new(x, y) * ((2.0 * r * (0.5 * omega).tan()).atan() / omega / r)
            }
            Bend::ThinPrism([k1, k2, k3, k4], [p1, p2], [s1, s2]) => {
                // COLMAP's formula on the plane of angles.
                let (r, a) = (r2.sqrt(), r2.sqrt().atan());
                let (u, v, a2) = (x * a / r, y * a / r, a * a);
                let g = 1.0 + k1 * a2 + k2 * a2.powi(2) + k3 * a2.powi(3) + k4 * a2.powi(4);
                DVec2::new(
                    u * g + 2.0 * p1 * u * v + p2 * (a2 + 2.0 * u * u) + s1 * a2,
                    v * g + p1 * (a2 + 2.0 * v * v) + 2.0 * p2 * u * v + s2 * a2,
                )
            }
        };
        bent * self.focal + self.principal
    }

    pub(crate) fn translation(&self) -> DVec3 {
        -(self.rotation * self.centre)
    }

    pub(crate) fn brown(&self) -> ([f64; 3], [f64; 2]) {
        match self.bend {
            Bend::Brown(k, p) => (k, p),
            other => panic!("{other:?} is no Brown lens"),
        }
    }
}

/// Cameras, points, and what the files say of where each is seen.
#[derive(Debug, Clone)]
pub(crate) struct Rig {
    pub(crate) cameras: Vec<Camera>,
    pub(crate) points: Vec<DVec3>,
    /// By camera and point.
    pub(crate) seen: Vec<Vec<DVec2>>,
}

impl Rig {
    /// Six cameras that look at fifty points from all sides, turned about their axes, each with its own lens.
    pub(crate) fn new(bend: impl Fn(&mut Random) -> Bend) -> Self {
        Self::spread(1.5, bend)
    }

    /// The same about points up to `most` metres from the middle in x, y and z.
    fn spread(most: f64, bend: impl Fn(&mut Random) -> Bend) -> Self {
        let mut r = Random::new(11);
        let origin = DVec3::new(512_000.0, -2_300.0, 140.0);
        let near = |r: &mut Random, most: f64| {
            DVec3::new(r.between(-most, most), r.between(-most, most), r.between(-most, most))
        };
        let points: Vec<_> = (0..50).map(|_| origin + near(&mut r, most)).collect();
        let camera = |k: usize, r: &mut Random| {
            let away =
                (near(r, 1.0) + DVec3::new(0.3, -0.2, 0.1)).normalize() * r.between(6.0, 8.0);
            let forward = (near(r, 0.4) - away).normalize();
            let right = forward.cross(near(r, 1.0)).normalize();
            Camera {
                name: format!("IMG {k}.png"),
                focal: r.between(450.0, 650.0),
                principal: DVec2::new(320.0 + r.between(-9.0, 9.0), 240.0 + r.between(-9.0, 9.0)),
                bend: bend(r),
                rotation: DMat3::from_cols(right, forward.cross(right), forward).transpose(),
                centre: origin + away,
            }
        };
        let cameras: Vec<_> = (0..6).map(|k| camera(k, &mut r)).collect();
        Self { cameras, points, seen: Vec::new() }.measured()
    }

    /// Brown's lens with every coefficient.
    pub(crate) fn brown() -> Self {
        Self::new(|r| {
            let k = [r.between(-0.2, -0.1), r.between(0.02, 0.05), r.between(-0.01, 0.01)];
            Bend::Brown(k, [r.between(0.003, 0.005), r.between(-0.005, -0.003)])
        })
    }

    /// What Bundler knows: two radial coefficients about the centre.
    pub(crate) fn radial() -> Self {
        let mut rig = Self::new(|r| Bend::Brown([r.between(-0.2, -0.1), 0.03, 0.0], [0.0; 2]));
        rig.cameras.iter_mut().for_each(|c| c.principal = DVec2::new(320.0, 240.0));
        rig.measured()
    }

    pub(crate) fn fisheye() -> Self {
        Self::new(|r| Bend::Fisheye([r.between(-0.05, 0.05), 0.01, -0.002, 0.001]))
    }

    /// Lenses that see some points more than sixty degrees from their axes.
    pub(crate) fn wide(bend: Bend) -> Self {
        let mut rig = Self::spread(3.2, |_| bend);
        let origin = DVec3::new(512_000.0, -2_300.0, 140.0);
        // The points within a ball, the cameras close to it.
        rig.points.iter_mut().for_each(|p| *p = origin + (*p - origin).clamp_length_max(3.4));
        for camera in &mut rig.cameras {
            camera.focal *= 0.4;
            camera.centre = origin + (camera.centre - origin) * 0.62;
        }
        let rig = rig.measured();
        let angle = |c: &Camera, &p: &DVec3| (c.rotation * (p - c.centre)).angle_between(DVec3::Z);
        let angles = rig.cameras.iter().flat_map(|c| rig.points.iter().map(move |p| angle(c, p)));
        assert!(angles.fold(0.0, f64::max) > 1.05);
        rig
    }

    /// The rig whose positions are those that its cameras see.
    pub(crate) fn measured(mut self) -> Self {
        let seen = |c: &Camera| self.points.iter().map(|&p| c.sees(p)).collect();
        self.seen = self.cameras.iter().map(seen).collect();
        self
    }

    /// Writes pictures of the right size and no content.
    pub(crate) fn write_photos(&self, folder: &Path) {
        for camera in &self.cameras {
            let picture = Samples::U8(Image::filled(SIZE, 1, 7_u8));
            write_picture(&folder.join(&camera.name), &picture).unwrap();
        }
    }

    /// How far read cameras are from the truth, pixels at most.
    pub(crate) fn greatest_error(&self, set: &CameraSet) -> f64 {
        assert_eq!(set.photos.len(), self.cameras.len(), "{:?}", set.left_out);
        let mut most = 0.0_f64;
        for camera in &self.cameras {
            let photo = set.find(&camera.name).expect("under its own name");
            assert_eq!(photo.lens.size(), SIZE);
            for &point in &self.points {
                let p = photo.pose.camera_from_ground(point);
                let at = photo.lens.photo_from_ray(p.truncate() / p.z).expect("within the lens");
                most = most.max((at - camera.sees(point)).length());
            }
        }
        most
    }
}

/// `[w, x, y, z]` of a rotation.
pub(crate) fn quaternion(rotation: DMat3) -> [f64; 4] {
    let q = DQuat::from_mat3(&rotation);
    [q.w, q.x, q.y, q.z]
}
