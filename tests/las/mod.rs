//! Point clouds written by the crate `las`, which is none of ours.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use glam::DVec3;
use las::point::{Classification, Format};
use las::{Builder, Point, Transform, Vector, Writer};

/// Steps of the coordinates, metres.
pub(crate) const SCALE: f64 = 0.001;

/// What a file is to be: the number of its point format, and whether its points are compressed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Kind {
    pub(crate) format: u8,
    pub(crate) is_compressed: bool,
}

fn transforms(offset: DVec3) -> Vector<Transform> {
    let axis = |offset| Transform { scale: SCALE, offset };
    Vector { x: axis(offset.x), y: axis(offset.y), z: axis(offset.z) }
}

/// Writes `points`, and among them `noise` as noise and as withheld.
pub(crate) fn write(path: &Path, kind: Kind, offset: DVec3, points: &[DVec3], noise: &[DVec3]) {
    let mut builder = Builder::from(if kind.format < 6 { (1, 2) } else { (1, 4) });
    builder.point_format = Format::new(kind.format).unwrap();
    builder.point_format.is_compressed = kind.is_compressed;
    builder.transforms = transforms(offset);
    let format = builder.point_format;
    let file = BufWriter::new(File::create(path).unwrap());
    let mut writer = Writer::new(file, builder.into_header().unwrap()).unwrap();
    let of = |p: &DVec3, classification, is_withheld| Point {
        x: p.x,
        y: p.y,
        z: p.z,
        classification,
        is_withheld,
        gps_time: format.has_gps_time.then_some(1.5),
        color: format.has_color.then(Default::default),
        nir: format.has_nir.then_some(7),
        return_number: 1,
        number_of_returns: 1,
        ..Point::default()
    };
    let mut noise = noise.iter().enumerate();
    for (k, point) in points.iter().enumerate() {
        if k % 5 == 1
            && let Some((n, bad)) = noise.next()
        {
            let class = [Classification::LowPoint, Classification::Ground][n % 2];
            writer.write_point(of(bad, class, n % 2 == 1)).unwrap();
        }
        writer.write_point(of(point, Classification::Ground, false)).unwrap();
    }
    assert_eq!(noise.next(), None, "too few points to hide the noise among");
    writer.close().unwrap();
}
