//! Good files of every format, small, to be spoilt.

#[path = "../las/mod.rs"]
mod las_files;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::{Parser, parsers};
use groundel::store::photo::{Demand, PhotoSource, Preparation, Reading, prepare_photos};
use groundel::synthetic::{Sampling, scenes};

/// A grid of `n` by `n` squares: vertices, and triangles by vertex.
fn grid(n: usize) -> (Vec<[f32; 3]>, Vec<[usize; 3]>) {
    let at = |i: usize, j: usize| j * (n + 1) + i;
    let coordinate = |k: usize| f32::from(u8::try_from(k).unwrap()) / 8.0;
    let vertices = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| [coordinate(i), coordinate(j), coordinate(i * j % 5)]));
    let squares = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
    let faces = squares.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    (vertices.collect(), faces.collect())
}

fn ply(format: &str) -> Vec<u8> {
    let (vertices, faces) = grid(6);
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment a grid\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        vertices.len(),
        faces.len()
    )
    .into_bytes();
    let big = format == "binary_big_endian";
    let f32s = |v: f32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let i32s = |v: usize| {
        let v = i32::try_from(v).unwrap();
        if big { v.to_be_bytes() } else { v.to_le_bytes() }
    };
    for [x, y, z] in vertices {
        if format == "ascii" {
            writeln!(bytes, "{x} {y} {z} 200").unwrap();
        } else {
            bytes.extend([f32s(x), f32s(y), f32s(z)].concat());
            bytes.push(200);
        }
    }
    for [a, b, c] in faces {
        if format == "ascii" {
            writeln!(bytes, "3 {a} {b} {c}").unwrap();
        } else {
            bytes.push(3);
            bytes.extend([i32s(a), i32s(b), i32s(c)].concat());
        }
    }
    bytes
}

fn obj() -> Vec<u8> {
    let (vertices, faces) = grid(6);
    let mut bytes = b"# a grid\no grid\nvn 0 0 1\nvt 0 0\n".to_vec();
    for [x, y, z] in vertices {
        writeln!(bytes, "v {x} {y} {z}").unwrap();
    }
    for (k, [a, b, c]) in faces.into_iter().enumerate() {
        match k % 3 {
            0 => writeln!(bytes, "f {} {} {}", a + 1, b + 1, c + 1),
            1 => writeln!(bytes, "f {}/1/1 {}/1/1 {}/1/1", a + 1, b + 1, c + 1),
            _ => writeln!(bytes, "f {}//1 {}//1 -1//1", a + 1, b + 1),
        }
        .unwrap();
    }
    bytes
}

fn corners() -> Vec<[[f32; 3]; 3]> {
    let (vertices, faces) = grid(5);
    faces.into_iter().map(|face| face.map(|k| vertices[k])).collect()
}

fn stl_binary() -> Vec<u8> {
    let mut bytes = [b"solid but binary".as_slice(), &[0; 64]].concat();
    bytes.extend(u32::try_from(corners().len()).unwrap().to_le_bytes());
    for triangle in corners() {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flatten().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn stl_ascii() -> Vec<u8> {
    let mut bytes = b"solid grid\n".to_vec();
    for triangle in corners() {
        writeln!(bytes, " facet normal 0 0 1\n  outer loop").unwrap();
        for [x, y, z] in triangle {
            writeln!(bytes, "   vertex {x} {y} {z}").unwrap();
        }
        writeln!(bytes, "  endloop\n endfacet").unwrap();
    }
    writeln!(bytes, "endsolid grid").unwrap();
    bytes
}

fn xyz() -> Vec<u8> {
    let line = |t: [[f32; 3]; 3]| {
        let numbers: Vec<String> = t.iter().flatten().map(ToString::to_string).collect();
        numbers.join(" ") + "\n"
    };
    corners().into_iter().map(line).collect::<String>().into_bytes()
}

fn glb() -> Vec<u8> {
    let (vertices, faces) = grid(6);
    let mut buffer: Vec<u8> = vertices.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    let points = buffer.len();
    for k in faces.iter().flatten() {
        buffer.extend(u16::try_from(*k).unwrap().to_le_bytes());
    }
    let indices = buffer.len() - points;
    while !buffer.len().is_multiple_of(4) {
        buffer.push(0);
    }
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"children":[1],"scale":[2,2,2]}},{{"mesh":0,"translation":[1,2,3]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "buffers":[{{"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{points}}},{{"buffer":0,"byteOffset":{points},"byteLength":{indices}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
        {{"bufferView":1,"componentType":5123,"count":{},"type":"SCALAR"}}]}}"#,
        buffer.len(),
        vertices.len(),
        faces.len() * 3
    );
    while !json.len().is_multiple_of(4) {
        json.push(' ');
    }
    let length = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    [
        b"glTF".to_vec(),
        2_u32.to_le_bytes().to_vec(),
        length(12 + 8 + json.len() + 8 + buffer.len()).to_vec(),
        length(json.len()).to_vec(),
        b"JSON".to_vec(),
        json.into_bytes(),
        length(buffer.len()).to_vec(),
        b"BIN\0".to_vec(),
        buffer,
    ]
    .concat()
}

fn points() -> Vec<glam::DVec3> {
    let (vertices, _) = grid(9);
    vertices.into_iter().map(|v| glam::Vec3::from_array(v).as_dvec3()).collect()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A small picture with structure.
fn pixel(k: u32) -> u8 {
    k.wrapping_mul(2_654_435_761).to_be_bytes()[0] / 4 + u8::try_from(k / 64 % 128).unwrap()
}

fn photos(folder: &Path) -> Vec<String> {
    let rgb: Vec<u8> = (0..48 * 32 * 3).map(pixel).collect();
    let colour = image::RgbImage::from_raw(48, 32, rgb.clone()).unwrap();
    let grey16: Vec<u16> = rgb.chunks_exact(3).map(|p| u16::from_le_bytes([p[0], p[1]])).collect();
    let grey = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(48, 32, grey16.clone()).unwrap();
    colour.save(folder.join("a.jpg")).unwrap();
    colour.save(folder.join("a.png")).unwrap();
    grey.save(folder.join("grey16.png")).unwrap();
    for (name, compression) in [
        ("plain.tif", tiff::encoder::Compression::Uncompressed),
        ("lzw.tif", tiff::encoder::Compression::Lzw),
        ("deflate.tif", tiff::encoder::Compression::Deflate(tiff::encoder::DeflateLevel::Fast)),
        ("packbits.tif", tiff::encoder::Compression::Packbits),
    ] {
        let file = fs::File::create(folder.join(name)).unwrap();
        let mut encoder =
            tiff::encoder::TiffEncoder::new(file).unwrap().with_compression(compression);
        encoder.write_image::<tiff::encoder::colortype::RGB8>(48, 32, &rgb).unwrap();
    }
    let file = fs::File::create(folder.join("grey16.tif")).unwrap();
    let mut encoder = tiff::encoder::TiffEncoder::new(file).unwrap();
    encoder.write_image::<tiff::encoder::colortype::Gray16>(48, 32, &grey16).unwrap();
    let names = [
        "a.jpg",
        "a.png",
        "grey16.png",
        "plain.tif",
        "lzw.tif",
        "deflate.tif",
        "packbits.tif",
        "grey16.tif",
    ];
    names.map(String::from).to_vec()
}

/// Files of other tools and of the user, by name, with their parsers.
pub(crate) fn foreign(folder: &Path) -> Vec<(String, Parser)> {
    let scene = scenes::columns();
    scene.write(folder, Sampling::Box(1), &["face"]).unwrap();
    let meshes = [
        ("ascii.ply", ply("ascii")),
        ("little.ply", ply("binary_little_endian")),
        ("big.ply", ply("binary_big_endian")),
        ("grid.obj", obj()),
        ("grid.obj.gz", gzip(&obj())),
        ("grid.obj.zst", zstd::bulk::compress(&obj(), 1).unwrap()),
        ("binary.stl", stl_binary()),
        ("ascii.stl", stl_ascii()),
        ("grid.xyz", xyz()),
        ("grid.glb", glb()),
    ];
    let mut all: Vec<(String, Parser)> = Vec::new();
    for (name, bytes) in meshes {
        fs::write(folder.join(name), bytes).unwrap();
        all.push((name.into(), parsers::mesh));
    }
    for (name, format, is_compressed) in [
        ("points.las", 1, false),
        ("points6.las", 6, false),
        ("points.laz", 3, true),
        ("points6.laz", 6, true),
        ("points8.laz", 8, true),
    ] {
        let kind = las_files::Kind { format, is_compressed };
        las_files::write(&folder.join(name), kind, glam::DVec3::ZERO, &points(), &[]);
        all.push((name.into(), parsers::points));
    }
    let mut text = b"X Y Z\n".to_vec();
    for p in points() {
        writeln!(text, "{} {} {}", p.x, p.y, p.z).unwrap();
    }
    fs::write(folder.join("points.txt"), text).unwrap();
    all.push(("points.txt".into(), parsers::points));
    all.extend(photos(folder).into_iter().map(|name| (name, parsers::photo as Parser)));
    all.push(("project.toml".into(), parsers::project));
    all.push(("frame.toml".into(), parsers::frame));
    all
}

/// Writes a set of cameras as COLMAP's text or binary files; their names.
pub(crate) fn cameras(folder: &Path, kind: &str) -> Vec<String> {
    fs::create_dir_all(folder).unwrap();
    if kind == "text" {
        groundel::synthetic::write_colmap(folder, &scenes::columns().shots).unwrap();
        return vec!["cameras.txt".into(), "images.txt".into()];
    }
    let mut cameras = 2_u64.to_le_bytes().to_vec();
    // A pinhole camera and one with distortion: id, model, width, height, parameters.
    for (id, model, parameters) in [(1_u32, 1_i32, 4), (7, 4, 8)] {
        cameras.extend(id.to_le_bytes());
        cameras.extend(model.to_le_bytes());
        cameras.extend([320_u64.to_le_bytes(), 240_u64.to_le_bytes()].concat());
        for k in 0..parameters {
            let value: f64 = [300.0, 300.0, 160.0, 120.0].get(k).copied().unwrap_or(0.01);
            cameras.extend(value.to_le_bytes());
        }
    }
    let mut images = 3_u64.to_le_bytes().to_vec();
    for (id, camera, name) in [(1_u32, 1_u32, "a.jpg"), (2, 7, "sub folder/b.jpg"), (9, 1, "c.jpg")]
    {
        images.extend(id.to_le_bytes());
        for value in [1.0, 0.0, 0.0, 0.0, 0.5, -0.25, f64::from(id)] {
            images.extend(value.to_le_bytes());
        }
        images.extend(camera.to_le_bytes());
        images.extend(name.as_bytes());
        images.push(0);
        images.extend(2_u64.to_le_bytes());
        for _ in 0..2 {
            images.extend([1.5_f64.to_le_bytes(), 2.5_f64.to_le_bytes()].concat());
            images.extend(u64::MAX.to_le_bytes());
        }
    }
    fs::write(folder.join("cameras.bin"), cameras).unwrap();
    fs::write(folder.join("images.bin"), images).unwrap();
    vec!["cameras.bin".into(), "images.bin".into()]
}

/// A finished part of a small job, and its manifest.
pub(crate) fn part(folder: &Path) -> PathBuf {
    use groundel::batch::{Manifest, Run, TileAddress, curve_order, run};
    use groundel::geom::Size;
    use groundel::image::Image;
    use groundel::output::{Compression, Layer, Meaning, Raster, TileFormat};
    fs::create_dir(folder).unwrap();
    let format = TileFormat { tile_size: 16, compression: Compression::Deflate };
    let layers = vec![Layer::of(Meaning::Count).unwrap()];
    let manifest = Manifest::new(Size::new(70, 50), format, layers, None, "a").unwrap();
    manifest.save(&folder.join("manifest.json")).unwrap();
    let path = folder.join("part-0");
    let render = |tile: TileAddress| {
        let size = manifest.pyramid().tile_pixels(tile.into());
        Ok(vec![Raster::U8(Image::filled(size, 1, u8::try_from(tile.x * 7 + tile.y).unwrap()))])
    };
    let tiles = curve_order(&manifest.pyramid());
    let job = Run { manifest: &manifest, part: &path, held: None, others: &[], tiles: &tiles };
    run(&job, &render, &|_| Ok(())).unwrap();
    path
}

/// The tile store of a photo, in `folder`.
pub(crate) fn photo_store(photo: &Path, folder: &Path) -> PathBuf {
    store_file(photo, folder, Reading::Tiles)
}

fn store_file(photo: &Path, folder: &Path, reading: Reading) -> PathBuf {
    let (name, path) = ("a".to_string(), photo.to_path_buf());
    let source = PhotoSource { name, path, expected: None, demand: Some(Demand::ALL) };
    let preparation = Preparation {
        folder,
        budget_bytes: 64 << 20,
        beside_bytes: 0,
        threads: 1,
        memory_bytes: 0,
        reading,
    };
    let ready = prepare_photos(&[source], &preparation, &|_| Ok(())).unwrap().remove(0).unwrap();
    ready.store_path().unwrap().to_path_buf()
}
