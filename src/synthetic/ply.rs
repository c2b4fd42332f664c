//! Writes a refined scene as a binary PLY file, streamed.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use glam::DVec3;

use super::Refinement;
use super::random::hash_unit;
use crate::{Error, Result};

/// Number type of the coordinates in a PLY file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PlyScalar {
    /// 32 bits; about 1e-7 of the coordinate.
    Float,
    /// 64 bits.
    #[default]
    Double,
}

/// How a refined scene is written.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PlyOptions {
    /// Number type of the coordinates.
    pub scalar: PlyScalar,
    /// Added to every vertex, metres: such as (500000, 4200000, 100), for a mesh far from the origin.
    pub offset: DVec3,
    /// Each vertex is moved by up to this in x, y and z, metres: a mesh like a scanned one, for benches. With
    /// anything but 0 the mesh is no longer the scene.
    pub noise_m: f64,
    /// Chooses the noise.
    pub seed: u64,
}

/// Writes `mesh` to `path` as binary little-endian PLY: vertices `x y z`, faces `list uchar int vertex_indices`.
///
/// Holds a buffer of 1 MiB, whatever the mesh's size. Face ids are those of [`Refinement::faces`].
///
/// # Errors
/// [`Error::Io`] if the file cannot be written.
pub fn write_ply(path: &Path, mesh: &Refinement<'_>, options: &PlyOptions) -> Result<()> {
    let file = File::create(path).map_err(|e| Error::io(path, e))?;
    let mut out = BufWriter::with_capacity(1 << 20, file);
    write_to(&mut out, mesh, options).and_then(|()| out.flush()).map_err(|e| Error::io(path, e))
}

fn write_to(
    out: &mut impl Write,
    mesh: &Refinement<'_>,
    options: &PlyOptions,
) -> std::io::Result<()> {
    let scalar = match options.scalar {
        PlyScalar::Float => "float",
        PlyScalar::Double => "double",
    };
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty {scalar} x\nproperty {scalar} y\n\
         property {scalar} z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertex_count(),
        mesh.face_count()
    )?;
    for (p, k) in mesh.vertices().zip(0_u64..) {
        let p = p + options.offset + noise(k, options);
        match options.scalar {
            PlyScalar::Float => out.write_all(&floats(p))?,
            PlyScalar::Double => {
                for c in p.to_array() {
                    out.write_all(&c.to_le_bytes())?;
                }
            }
        }
    }
    for ([a, b, c], _) in mesh.faces() {
        let mut record = [3; 13];
        record[1..5].copy_from_slice(&a.to_le_bytes());
        record[5..9].copy_from_slice(&b.to_le_bytes());
        record[9..13].copy_from_slice(&c.to_le_bytes());
        out.write_all(&record)?;
    }
    Ok(())
}

/// The displacement of vertex `k`.
fn noise(k: u64, options: &PlyOptions) -> DVec3 {
    if options.noise_m == 0.0 {
        return DVec3::ZERO;
    }
    let key = options.seed.wrapping_mul(0xd134_2543_de82_ef95).wrapping_add(3 * k);
    DVec3::new(hash_unit(key), hash_unit(key + 1), hash_unit(key + 2)) * (2.0 * options.noise_m)
        - options.noise_m
}

fn floats(p: DVec3) -> [u8; 12] {
    let mut bytes = [0; 12];
    for (chunk, c) in bytes.chunks_exact_mut(4).zip(p.as_vec3().to_array()) {
        chunk.copy_from_slice(&c.to_le_bytes());
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{Part, Placement, SceneBuilder, Texture};

    fn written(options: &PlyOptions) -> (Vec<u8>, Vec<DVec3>, Vec<[u32; 3]>) {
        let mut b = SceneBuilder::new();
        b.cuboid(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0), Part::Plinth);
        let scene = b.build(Placement::IDENTITY, Texture::new(0.02));
        let mesh = Refinement::by_edge_length(&scene, 0.3).unwrap();
        let mut bytes = Vec::new();
        write_to(&mut bytes, &mesh, options).unwrap();
        (bytes, mesh.vertices().collect(), mesh.faces().map(|f| f.0).collect())
    }

    fn body(bytes: &[u8]) -> &[u8] {
        let mark = b"end_header\n";
        let at = bytes.windows(mark.len()).position(|w| w == mark).unwrap();
        &bytes[at + mark.len()..]
    }

    #[test]
    fn a_double_file_holds_every_vertex_to_the_bit_and_every_face() {
        let (bytes, vertices, faces) = written(&PlyOptions::default());
        let body = body(&bytes);
        assert_eq!(body.len(), vertices.len() * 24 + faces.len() * 13);
        for (record, v) in body.chunks_exact(24).zip(&vertices) {
            let read = |k: usize| f64::from_le_bytes(record[8 * k..8 * k + 8].try_into().unwrap());
            assert_eq!(DVec3::new(read(0), read(1), read(2)), *v);
        }
        for (record, f) in body[vertices.len() * 24..].chunks_exact(13).zip(&faces) {
            let read =
                |k: usize| u32::from_le_bytes(record[4 * k + 1..4 * k + 5].try_into().unwrap());
            assert_eq!((record[0], [read(0), read(1), read(2)]), (3, *f));
        }
    }

    #[test]
    fn noise_is_bounded_repeatable_and_of_the_seed() {
        let make = |seed| PlyOptions { noise_m: 0.01, seed, ..PlyOptions::default() };
        let (plain, vertices, _) = written(&PlyOptions::default());
        let (one, again, two) = (written(&make(1)).0, written(&make(1)).0, written(&make(2)).0);
        assert!(one == again && one != two && one != plain);
        for (record, v) in body(&one).chunks_exact(24).zip(&vertices) {
            let x = f64::from_le_bytes(record[..8].try_into().unwrap());
            assert!((x - v.x).abs() <= 0.01);
        }
    }

    #[test]
    fn an_offset_moves_a_float_file_of_half_the_vertex_bytes() {
        let offset = DVec3::new(512.0, 4096.0, 64.0);
        let options = PlyOptions { scalar: PlyScalar::Float, offset, ..PlyOptions::default() };
        let (bytes, vertices, faces) = written(&options);
        assert_eq!(body(&bytes).len(), vertices.len() * 12 + faces.len() * 13);
        let x = f32::from_le_bytes(body(&bytes)[..4].try_into().unwrap());
        assert!((f64::from(x) - (vertices[0].x + 512.0)).abs() < 1e-12);
    }
}
