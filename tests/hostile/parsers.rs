//! Each parser, driven over a whole file: what came out of it, as one number.

use std::hash::Hasher;
use std::path::{Path, PathBuf};

use groundel::batch::{Manifest, PartReader};
use groundel::geom::{POINT_LIMIT_M, PixelRect, TriangleChunk};
use groundel::input::photo::{
    decode_mask, decode_photo, read_mask_header, read_photo_header, read_profile,
};
use groundel::input::{CameraOptions, Project, open_mesh, open_points, read_cameras, read_frame};
use groundel::store::mesh::{MeshStore, PartitionBuffer};
use groundel::store::photo::{
    Demand, PhotoSource, PhotoStore, Preparation, PreparedPhoto, Reading, prepare_photos,
    working_bytes,
};
use groundel::{Error, Result};

/// Elements of a stream that are read at most: a small file may state many.
const MOST: u64 = 1 << 20;
/// Memory that a photo may ask for.
const PHOTO_BYTES: u64 = 64 << 20;

type Digest = std::hash::DefaultHasher;

/// A mesh of any format: its counts, vertices and faces.
pub(crate) fn mesh(path: &Path) -> Result<u64> {
    let mesh = open_mesh(path)?;
    let mut digest = Digest::new();
    digest.write_u64(mesh.vertex_count());
    digest.write_u64(mesh.face_count());
    let (mut vertices, mut points, mut read) = (mesh.vertices()?, Vec::new(), 0);
    loop {
        vertices.next_vertices(1000, &mut points)?;
        for c in points.iter().flat_map(glam::DVec3::to_array) {
            digest.write_u64(c.to_bits());
        }
        read += points.len() as u64;
        if points.is_empty() || read > MOST {
            break;
        }
    }
    let (mut faces, mut chunk, mut read) = (mesh.faces()?, TriangleChunk::default(), 0);
    loop {
        faces.next_faces(1000, &mut chunk)?;
        for corner in chunk.triangles.iter().flatten() {
            assert!(u64::from(*corner) < mesh.vertex_count(), "an index beyond the vertices");
            digest.write_u32(*corner);
        }
        read += chunk.triangles.len() as u64 + chunk.short_faces;
        if chunk.is_empty() || read > MOST {
            break;
        }
    }
    Ok(digest.finish())
}

/// A point cloud: its points, and how many were passed over.
pub(crate) fn points(path: &Path) -> Result<u64> {
    let cloud = open_points(path)?;
    let mut digest = Digest::new();
    let (mut stream, mut points, mut read) = (cloud.points()?, Vec::new(), 0);
    loop {
        stream.next_points(1000, &mut points)?;
        for c in points.iter().flat_map(glam::DVec3::to_array) {
            assert!(c.abs() <= POINT_LIMIT_M, "a point beyond the limit");
            digest.write_u64(c.to_bits());
        }
        read += points.len() as u64;
        if points.is_empty() || read > MOST {
            break;
        }
    }
    digest.write_u64(stream.passed_over());
    Ok(digest.finish())
}

/// A folder of cameras.
pub(crate) fn cameras(folder: &Path) -> Result<u64> {
    let cameras = read_cameras(folder, &CameraOptions::default())?;
    let mut digest = Digest::new();
    digest.write(format!("{cameras:?}").as_bytes());
    Ok(digest.finish())
}

/// A photo: header, colour profile, pixels; the same file as a mask, if it may be one.
pub(crate) fn photo(path: &Path) -> Result<u64> {
    let header = read_photo_header(path)?;
    let mut digest = Digest::new();
    digest.write(format!("{:?}", header.size).as_bytes());
    digest.write(format!("{:?}", read_profile(path, &header)?).as_bytes());
    let needed_bytes = working_bytes(&header);
    if needed_bytes > PHOTO_BYTES {
        return Err(Error::OverBudget {
            what: path.display().to_string(),
            needed_bytes,
            allowed_bytes: PHOTO_BYTES,
            hint: None,
        });
    }
    decode_photo(path, &header, &mut |rows| {
        digest.write(format!("{rows:?}").as_bytes());
        Ok(())
    })?;
    if let Ok(header) = read_mask_header(path) {
        decode_mask(path, &header, &mut |rows| {
            digest.write(format!("{rows:?}").as_bytes());
            Ok(())
        })?;
    }
    Ok(digest.finish())
}

/// A project file and its frame.
pub(crate) fn project(path: &Path) -> Result<u64> {
    let mut digest = Digest::new();
    digest.write(format!("{:?}", Project::read(path)?).as_bytes());
    Ok(digest.finish())
}

/// A frame file.
pub(crate) fn frame(path: &Path) -> Result<u64> {
    let mut digest = Digest::new();
    digest.write(format!("{:?}", read_frame(path)?).as_bytes());
    Ok(digest.finish())
}

/// A mesh store: all partitions.
pub(crate) fn mesh_store(path: &Path) -> Result<u64> {
    let mut digest = Digest::new();
    for limit in [0, u64::MAX] {
        let store = MeshStore::open(path, limit)?;
        let (mut all, mut buffer) = (Vec::new(), PartitionBuffer::default());
        store.query(|_| true, &mut all);
        for id in all {
            store.load(id, &mut buffer)?;
            let block = buffer.block();
            for p in block.positions {
                digest.write(format!("{p:?}").as_bytes());
            }
            for (triangle, id) in block.triangles.iter().zip(block.ids) {
                digest.write(format!("{triangle:?}{id:?}").as_bytes());
            }
        }
    }
    Ok(digest.finish())
}

/// A photo's tile store: all levels.
pub(crate) fn photo_store(path: &Path) -> Result<u64> {
    let store = PhotoStore::open([(0, path.to_path_buf())], 1 << 20)?;
    let mut digest = Digest::new();
    for level in 0..store.levels(0) {
        let size = store.level_size(0, level);
        let side = |n: u32| i64::from(n.min(600));
        let rect = PixelRect::new(0, 0, side(size.width), side(size.height));
        digest.write(format!("{:?}", store.window(0, level, rect)?).as_bytes());
    }
    Ok(digest.finish())
}

/// A job's manifest, and its part beside it: the tiles that are there.
pub(crate) fn part(path: &Path) -> Result<u64> {
    let manifest = Manifest::load(&path.with_file_name("manifest.json"))?;
    let part = PartReader::open(path, &manifest)?;
    let mut digest = Digest::new();
    digest.write_usize(part.len());
    groundel::batch::notes(&manifest, &[PathBuf::from(path)], &mut |note| {
        digest.write(note);
        Ok(())
    })?;
    Ok(digest.finish())
}

/// A photo by its index, compared with the same photo decoded as a whole: what the one takes the other takes too, and
/// shows the same.
pub(crate) fn photo_index(path: &Path) -> Result<u64> {
    let header = read_photo_header(path)?;
    if working_bytes(&header) > 64 << 20 {
        return Ok(0);
    }
    let stores = path.with_extension("stores");
    let ready = |reading| -> Result<PreparedPhoto> {
        let (name, path) = ("a".to_string(), path.to_path_buf());
        let source = PhotoSource { name, path, expected: None, demand: Some(Demand::ALL) };
        let preparation = Preparation {
            folder: &stores,
            budget_bytes: 128 << 20,
            beside_bytes: 0,
            threads: 1,
            memory_bytes: 0,
            reading,
        };
        let ready = prepare_photos(&[source], &preparation, &|_| Ok(()))?.remove(0);
        ready.map_err(|left_out| left_out.reason)
    };
    let (whole, indexed) = (ready(Reading::Memory), ready(Reading::Index));
    std::fs::remove_dir_all(&stores).unwrap();
    assert_eq!(whole.is_ok(), indexed.is_ok(), "{whole:?} {indexed:?}");
    let (whole, indexed) = (PhotoStore::new([(0, whole?)], 0)?, indexed?);
    if !indexed.is_indexed() {
        return Ok(1);
    }
    // Its index is gone.
    let indexed = PhotoStore::new([(0, indexed)], 0)?;
    assert!(indexed.window(0, 0, PixelRect::new(0, 0, 1, 1)).is_err());
    let indexed = PhotoStore::new([(0, ready(Reading::Index)?)], 1 << 20)?;
    for level in 0..whole.levels(0) {
        for rect in whole.level_size(0, level).rect().blocks(77) {
            let windows = [&whole, &indexed].map(|store| store.window(0, level, rect));
            let [whole, indexed] = windows;
            assert_eq!(format!("{:?}", whole?.samples), format!("{:?}", indexed?.samples));
        }
    }
    std::fs::remove_dir_all(&stores).unwrap();
    Ok(2)
}
