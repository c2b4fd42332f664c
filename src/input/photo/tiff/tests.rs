//! TIFF files made byte by byte, of every kind that is read and every kind that is refused.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::input::photo::{PhotoFormat, PhotoHeader, Rows, decode_photo, read_photo_header};
use crate::{Error, Result};

const WIDTH: u64 = 13;
const HEIGHT: u64 = 11;

/// A TIFF file to be: tags, and strips or tiles as they stand in the file.
#[derive(Clone)]
struct File {
    is_big_endian: bool,
    is_big_tiff: bool,
    tags: BTreeMap<u16, (u16, Vec<u64>)>,
    chunks: Vec<Vec<u8>>,
}

impl File {
    /// A page of `samples` a pixel of `bits` in one uncompressed strip, whose bytes are those of [`noise`].
    fn new(samples: u64, bits: u64) -> Self {
        let photometric = if samples < 3 { 1 } else { 2 };
        let tags = [
            (256, (3, vec![WIDTH])),
            (257, (4, vec![HEIGHT])),
            (258, (3, vec![bits; usize::try_from(samples).unwrap()])),
            (262, (3, vec![photometric])),
            (277, (3, vec![samples])),
            (278, (3, vec![HEIGHT])),
        ];
        let data = noise(WIDTH * HEIGHT * samples * bits / 8);
        Self {
            is_big_endian: false,
            is_big_tiff: false,
            tags: tags.into_iter().collect(),
            chunks: vec![data],
        }
    }

    fn with(mut self, tag: u16, values: &[u64]) -> Self {
        self.tags.insert(tag, (3, values.to_vec()));
        self
    }

    /// Cuts the one strip into strips of `rows` rows.
    fn in_strips(mut self, rows: u64) -> Self {
        let row = self.chunks[0].len() / usize::try_from(HEIGHT).unwrap();
        let strips = self.chunks[0].chunks(row * usize::try_from(rows).unwrap());
        self.chunks = strips.map(<[u8]>::to_vec).collect();
        self.with(278, &[rows])
    }

    /// Compresses every chunk.
    fn packed(mut self, compression: u64, pack: impl Fn(&[u8]) -> Vec<u8>) -> Self {
        self.chunks = self.chunks.iter().map(|c| pack(c)).collect();
        self.with(259, &[compression])
    }

    fn bytes(&self) -> Vec<u8> {
        let put = |out: &mut Vec<u8>, value: u64, width: usize| {
            let bytes = value.to_le_bytes();
            if self.is_big_endian {
                out.extend(bytes[..width].iter().rev());
            } else {
                out.extend(&bytes[..width]);
            }
        };
        let (wide, entry) = if self.is_big_tiff { (8, 20) } else { (4, 12) };
        let mut out = if self.is_big_endian { b"MM".to_vec() } else { b"II".to_vec() };
        put(&mut out, if self.is_big_tiff { 43 } else { 42 }, 2);
        if self.is_big_tiff {
            put(&mut out, 8, 2);
            put(&mut out, 0, 2);
        }
        let mut tags = self.tags.clone();
        let is_tiled = tags.contains_key(&322);
        let lengths: Vec<_> = self.chunks.iter().map(|c| c.len() as u64).collect();
        let count_bytes = if self.is_big_tiff { 8 } else { 2 };
        let directory = out.len() as u64 + wide as u64;
        put(&mut out, directory, wide);
        let kind = if self.is_big_tiff { 16 } else { 4 };
        let (offsets_tag, lengths_tag) = if is_tiled { (324, 325) } else { (273, 279) };
        tags.entry(lengths_tag).or_insert((kind, lengths.clone()));
        tags.entry(offsets_tag).or_insert((kind, vec![0; lengths.len()]));
        let width = |kind: u16| match kind {
            1 | 7 => 1,
            3 => 2,
            4 => 4,
            _ => 8,
        };
        // Values that do not fit in their entry stand behind the directory, the chunks behind these.
        let mut at = directory + count_bytes as u64 + entry * tags.len() as u64 + wide as u64;
        let places: BTreeMap<u16, u64> = tags
            .iter()
            .map(|(tag, (kind, values))| {
                let length = (width(*kind) * values.len()) as u64;
                let place = at;
                at += if length > wide as u64 { length } else { 0 };
                (*tag, place)
            })
            .collect();
        if tags[&offsets_tag].1.iter().all(|v| *v == 0) {
            let mut chunk = at;
            for (value, length) in tags.get_mut(&offsets_tag).unwrap().1.iter_mut().zip(&lengths) {
                *value = chunk;
                chunk += length;
            }
        }
        put(&mut out, tags.len() as u64, count_bytes);
        let mut outside = Vec::new();
        for (tag, (kind, values)) in &tags {
            put(&mut out, u64::from(*tag), 2);
            put(&mut out, u64::from(*kind), 2);
            put(&mut out, values.len() as u64, wide);
            let mut own = Vec::new();
            for value in values {
                put(&mut own, *value, width(*kind));
            }
            if own.len() <= wide {
                own.resize(wide, 0);
                out.extend(own);
            } else {
                put(&mut out, places[tag], wide);
                outside.extend(own);
            }
        }
        put(&mut out, 0, wide);
        out.extend(outside);
        self.chunks.iter().for_each(|c| out.extend(c));
        out
    }
}

/// Bytes in which some are equal to their neighbours and some are not.
fn noise(length: u64) -> Vec<u8> {
    (0..length).map(|k| u8::try_from((k / 3 * 7919 + k % 2 * 31) & 255).unwrap()).collect()
}

fn file_of(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photo.tif");
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// All samples, widened.
fn decode(bytes: &[u8]) -> Result<(PhotoHeader, Vec<u16>)> {
    let (_folder, path) = file_of(bytes);
    let header = read_photo_header(&path)?;
    let mut samples = Vec::new();
    decode_photo(&path, &header, &mut |rows| {
        match rows {
            Rows::U8(rows) => samples.extend(rows.iter().map(|&s| u16::from(s))),
            Rows::U16(rows) => samples.extend_from_slice(rows),
        }
        Ok(())
    })?;
    Ok((header, samples))
}

fn message(file: &File) -> String {
    match decode(&file.bytes()) {
        Ok((header, _)) => format!("{header:?}"),
        Err(e) => {
            assert_eq!(e.exit_code(), 2, "{e}");
            e.to_string()
        }
    }
}

/// What [`File::new`] holds, without what is dropped.
fn expected(samples: usize, bits: u64, kept: usize) -> Vec<u16> {
    let bytes = noise(WIDTH * HEIGHT * samples as u64 * bits / 8);
    let all: Vec<u16> = if bits == 16 {
        bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect()
    } else {
        bytes.iter().map(|&b| u16::from(b)).collect()
    };
    all.chunks_exact(samples).flat_map(|p| p[..kept].to_vec()).collect()
}

fn deflate(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut encoder, bytes).unwrap();
    encoder.finish().unwrap()
}

fn lzw(bytes: &[u8]) -> Vec<u8> {
    weezl::encode::Encoder::with_tiff_size_switch(weezl::BitOrder::Msb, 8).encode(bytes).unwrap()
}

/// Literal runs, repeated runs and the byte that means nothing.
fn pack_bits(bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![128];
    for chunk in bytes.chunks(9) {
        if chunk.len() > 1 && chunk.iter().all(|b| *b == chunk[0]) {
            out.extend([u8::try_from(257 - chunk.len()).unwrap(), chunk[0]]);
        } else {
            out.push(u8::try_from(chunk.len() - 1).unwrap());
            out.extend(chunk);
        }
    }
    out
}

#[test]
fn every_number_of_samples_and_depth_is_read_and_what_is_extra_dropped() {
    for (samples, kept) in [(1, 1), (2, 1), (3, 3), (4, 3), (6, 3)] {
        for bits in [8, 16] {
            let mut file = File::new(samples, bits);
            if samples == 2 || samples > 3 {
                file = file.with(338, &vec![2; usize::try_from(samples).unwrap() - kept]);
            }
            let (header, found) = decode(&file.bytes()).unwrap();
            assert_eq!((header.channels, u64::from(header.bits)), (kept, bits));
            assert_eq!((u64::from(header.size.width), u64::from(header.size.height)), (13, 11));
            assert!(matches!(header.format, PhotoFormat::Tiff { .. }));
            let want = expected(usize::try_from(samples).unwrap(), bits, kept);
            assert!(found == want, "{samples} × {bits}");
        }
    }
}

#[test]
fn byte_order_and_big_tiff_change_no_sample() {
    for (is_big_endian, is_big_tiff) in [(false, true), (true, false), (true, true)] {
        let file = File { is_big_endian, is_big_tiff, ..File::new(3, 8).in_strips(4) };
        assert!(decode(&file.bytes()).unwrap().1 == expected(3, 8, 3));
        let mut deep = File { is_big_endian, is_big_tiff, ..File::new(3, 16).in_strips(4) };
        if is_big_endian {
            let swap = |c: &mut Vec<u8>| c.chunks_exact_mut(2).for_each(<[u8]>::reverse);
            deep.chunks.iter_mut().for_each(swap);
        }
        assert!(decode(&deep.bytes()).unwrap().1 == expected(3, 16, 3));
    }
}

#[test]
fn every_compression_gives_the_same_samples() {
    let zstd = |b: &[u8]| zstd::encode_all(b, 3).unwrap();
    for rows in [1, 4, 11] {
        for (samples, bits) in [(1, 8), (3, 16), (4, 8)] {
            let file = File::new(samples, bits).in_strips(rows);
            let kept = if samples < 3 { 1 } else { 3 };
            let want = expected(usize::try_from(samples).unwrap(), bits, kept);
            for file in [
                file.clone().packed(5, lzw),
                file.clone().packed(8, deflate),
                file.clone().packed(32946, deflate),
                file.clone().packed(32773, pack_bits),
                file.clone().packed(50000, zstd),
            ] {
                assert!(decode(&file.bytes()).unwrap().1 == want, "{:?}", file.tags[&259]);
            }
        }
    }
}

#[test]
fn the_predictor_runs_over_extra_samples_too_and_through_every_compression() {
    let differences = |samples: usize| {
        move |bytes: &[u8]| {
            let row = usize::try_from(WIDTH).unwrap() * samples;
            let mut out = bytes.to_vec();
            for line in out.chunks_exact_mut(row) {
                for k in (samples..row).rev() {
                    line[k] = line[k].wrapping_sub(line[k - samples]);
                }
            }
            out
        }
    };
    for samples in [1, 4] {
        let kept = if samples == 1 { 1 } else { 3 };
        let file = File::new(samples as u64, 8).in_strips(3).with(317, &[2]);
        for file in [
            file.clone().packed(8, |b| deflate(&differences(samples)(b))),
            file.clone().packed(5, |b| lzw(&differences(samples)(b))),
        ] {
            assert!(decode(&file.bytes()).unwrap().1 == expected(samples, 8, kept));
        }
        // Without a compression that knows it, the tag means nothing.
        assert!(decode(&file.bytes()).unwrap().1 == expected(samples, 8, kept));
    }
}

#[test]
fn tiles_are_put_in_their_places_and_their_margins_dropped() {
    let plain = expected(3, 8, 3);
    let tile = |x: usize, y: usize, side: usize| -> Vec<u8> {
        let at = |x: usize, y: usize, c: usize| {
            if x < 13 && y < 11 { u8::try_from(plain[(y * 13 + x) * 3 + c]).unwrap() } else { 99 }
        };
        let rows = (0..side).flat_map(|v| (0..side).map(move |u| (u, v)));
        rows.flat_map(|(u, v)| (0..3).map(move |c| (u, v, c)))
            .map(|(u, v, c)| at(x * side + u, y * side + v, c))
            .collect()
    };
    for side in [5, 16] {
        let (across, down) = (13_usize.div_ceil(side), 11_usize.div_ceil(side));
        let mut file = File::new(3, 8).with(322, &[side as u64]).with(323, &[side as u64]);
        file.tags.remove(&278);
        file.chunks = (0..across * down).map(|k| tile(k % across, k / across, side)).collect();
        assert!(decode(&file.bytes()).unwrap().1 == plain, "{side}");
        let packed = file.packed(8, deflate);
        assert!(decode(&packed.bytes()).unwrap().1 == plain, "{side}, Deflate");
    }
}

#[test]
fn white_that_is_zero_is_turned_over() {
    for bits in [8, 16] {
        let white = u16::try_from((1_u32 << bits) - 1).unwrap();
        let (_, found) = decode(&File::new(1, bits).with(262, &[0]).bytes()).unwrap();
        let want: Vec<_> = expected(1, bits, 1).into_iter().map(|s| white - s).collect();
        assert!(found == want);
    }
}

#[test]
fn the_orientation_is_not_applied() {
    let file = File::new(3, 8).with(274, &[6]);
    assert!(decode(&file.bytes()).unwrap().1 == expected(3, 8, 3));
}

#[test]
fn what_is_not_supported_is_named() {
    let rgb = || File::new(3, 8);
    for (file, words) in [
        (rgb().with(284, &[2]), "a plane for each colour"),
        (File::new(1, 8).with(262, &[3]), "a palette TIFF"),
        (File::new(4, 8).with(262, &[5]), "a CMYK TIFF"),
        (rgb().with(262, &[6]), "a YCbCr TIFF without JPEG"),
        (rgb().with(262, &[8]), "a CIE L*a*b* TIFF"),
        (File::new(1, 16).with(262, &[32803]), "a raw TIFF (colour filter array)"),
        (rgb().with(262, &[77]), "photometric interpretation 77"),
        (rgb().with(258, &[8, 8, 16]), "8 + 8 + 16 bits a sample"),
        (File::new(1, 8).with(258, &[1]), "1 bits a sample"),
        (File::new(1, 8).with(258, &[32]), "32 bits a sample"),
        (rgb().with(339, &[3, 3, 3]), "floating-point samples"),
        (rgb().with(339, &[2]), "signed samples"),
        (rgb().with(259, &[4]), "fax compression"),
        (rgb().with(259, &[6]), "old-style JPEG compression"),
        (rgb().with(259, &[50001]), "WebP compression"),
        (rgb().with(259, &[12345]), "number 12345 compression"),
        (rgb().with(259, &[8]).with(317, &[3]), "predictor 3"),
        (rgb().with(266, &[2]), "reversed bits"),
        (rgb().with(50706, &[1, 4, 0, 0]), "a DNG raw photo"),
        (File::new(4, 8).with(259, &[7]), "JPEG in a TIFF of 4 × 8 bits"),
        (File::new(3, 16).with(259, &[7]), "JPEG in a TIFF of 3 × 16 bits"),
        (rgb().packed(5, |_| vec![0, 1, 2, 3]), "old-style LZW"),
        (File { chunks: vec![Vec::new()], ..rgb() }, "an empty strip 0"),
    ] {
        let said = message(&file);
        assert!(said.contains(words) && said.contains("is not supported"), "{words}: {said}");
        assert!(said.contains("photo.tif"), "{said}");
    }
}

#[test]
fn what_contradicts_itself_is_an_error_with_its_place() {
    let rgb = || File::new(3, 8);
    let without = |tag: u16| {
        let mut file = rgb();
        file.tags.remove(&tag);
        file
    };
    for (file, words) in [
        (without(256), "tag 256 (ImageWidth): expected the tag, found none"),
        (without(262), "tag 262 (PhotometricInterpretation): expected the tag"),
        (rgb().with(256, &[0]), "tags 256 and 257: expected a size in pixels, found 0 × 11"),
        (rgb().with(258, &[8, 8]), "tag 258 (BitsPerSample): expected 3 values, found 2"),
        (rgb().with(277, &[2]).with(258, &[8]), "tag 277 (SamplesPerPixel): expected 3 or more"),
        (rgb().with(278, &[0]), "tag 278 (RowsPerStrip): expected 1 or more, found 0"),
        (rgb().with(278, &[5]), "tag 273 (StripOffsets): expected 3 values, found 1"),
        (rgb().with(279, &[428]), "strip 0: expected 429 bytes, found 428"),
        (rgb().with(279, &[60000]), "strip 0: expected 60000 bytes at"),
        (rgb().with(322, &[16]).with(323, &[0]), "tag 323 (TileLength): expected a size in pixels"),
        (rgb().with(259, &[8]), "strip 0: expected whole rows of samples"),
        (
            rgb().packed(8, |b| deflate(&b[1..])),
            "strip 0: expected whole rows of samples, found the",
        ),
        (rgb().packed(5, |b| lzw(&b[1..])), "strip 0: expected whole rows of samples"),
        (rgb().packed(32773, |b| pack_bits(&b[1..])), "strip 0: expected whole rows of samples"),
        (rgb().with(259, &[7]), "JPEG data: expected a start-of-image marker"),
    ] {
        let said = message(&file);
        assert!(said.contains(words), "{words}: {said}");
    }
    let mut texts = rgb();
    texts.tags.insert(256, (2, vec![13]));
    assert!(message(&texts).contains("expected whole numbers, found type 2"));
}

#[test]
fn absurd_sizes_are_refused_before_memory_is_reserved() {
    let mut wide = File::new(1, 8);
    wide.tags.insert(256, (4, vec![u64::from(u32::MAX)]));
    let said = message(&wide);
    assert!(said.contains("longest side in pixels: 4294967295 is beyond the limit"), "{said}");
    let mut many = File::new(1, 8);
    many.tags.insert(256, (4, vec![1 << 20]));
    many.tags.insert(257, (4, vec![1 << 20]));
    assert!(message(&many).contains("number of pixels"));
    let samples = File::new(3, 8).with(277, &[65535]);
    assert!(message(&samples).contains("samples a pixel: 65535 is beyond the limit of 64"));
    let mut tiles = File::new(1, 8).with(322, &[1]).with(323, &[1]);
    tiles.tags.insert(256, (4, vec![1 << 15]));
    tiles.tags.insert(257, (4, vec![1 << 15]));
    assert!(message(&tiles).contains("tiles: 1073741824 is beyond the limit of 1048576"));
    // A directory that says it has 2⁶³ tags.
    let mut bytes = File { is_big_tiff: true, ..File::new(1, 8) }.bytes();
    bytes[16 + 7] = 0x80;
    let e = decode(&bytes).unwrap_err();
    assert!(matches!(e, Error::Limit { .. }), "{e}");
    // Values beyond the end of all numbers.
    let mut far = File { is_big_tiff: true, ..File::new(3, 8) };
    far.tags.insert(273, (16, vec![u64::MAX]));
    assert!(message(&far).contains("strip 0: expected 429 bytes at 18446744073709551615"));
}

#[test]
fn a_checksum_that_does_not_fit_is_an_error() {
    let mut file = File::new(3, 8).packed(8, deflate);
    *file.chunks[0].last_mut().unwrap() ^= 1;
    assert!(message(&file).contains("strip 0"), "{}", message(&file));
}

#[test]
fn every_file_cut_short_is_an_error() {
    let lzw = File::new(3, 8).in_strips(4).packed(5, lzw);
    for file in [File::new(1, 16).in_strips(3), lzw, File::new(4, 8).packed(8, deflate)] {
        let bytes = file.bytes();
        for length in 0..bytes.len() {
            let e = decode(&bytes[..length]).expect_err("a whole picture");
            assert!(e.to_string().contains("photo.tif") && e.exit_code() == 2, "{e}");
        }
        assert!(decode(&bytes).is_ok());
    }
}

#[test]
fn damage_gives_an_error_or_samples_of_the_right_number() {
    let mut random = 7_u64;
    let mut next = move || {
        random =
            random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(random >> 40).unwrap()
    };
    let zstd = |b: &[u8]| zstd::encode_all(b, 3).unwrap();
    let file = || File::new(3, 8).in_strips(4);
    let big = File { is_big_tiff: true, is_big_endian: true, ..file() };
    for file in
        [file(), big, file().packed(5, lzw), file().packed(8, deflate), file().packed(50000, zstd)]
    {
        let bytes = file.bytes();
        let mut refused = 0;
        for _ in 0..1500 {
            let mut damaged = bytes.clone();
            for _ in 0..=next() % 3 {
                let at = next() % damaged.len();
                damaged[at] = u8::try_from(next() & 255).unwrap();
            }
            match decode(&damaged) {
                Ok((header, samples)) => {
                    assert_eq!(samples.len() as u64, header.size.area() * header.channels as u64);
                }
                Err(_) => refused += 1,
            }
        }
        assert!(refused > 100, "{refused}");
    }
}

#[test]
fn memory_follows_rows_and_tiles_not_the_picture() {
    let needed = |file: &File| {
        let (_folder, path) = file_of(&file.bytes());
        match read_photo_header(&path).unwrap().format {
            PhotoFormat::Tiff { decoding_bytes } => decoding_bytes,
            other => panic!("{other:?}"),
        }
    };
    // 16 Mpx that are not there: compressed data may be short.
    let sized = |mut file: File| {
        file.tags.insert(256, (4, vec![4096]));
        file.tags.insert(257, (4, vec![4096]));
        file.packed(5, lzw)
    };
    let one_strip = sized(File::new(3, 8)).with(278, &[4096]);
    assert!(needed(&one_strip) < 2 << 20, "a strip passes row by row");
    let one_tile = sized(File::new(3, 8)).with(322, &[4096]).with(323, &[4096]);
    assert!(needed(&one_tile) < 2 << 20, "so does a tile as wide as the page");
    let mut tiles = sized(File::new(3, 8)).with(322, &[2048]).with(323, &[4096]);
    tiles.chunks = vec![tiles.chunks[0].clone(); 2];
    let whole = 4096 * 4096 * 3;
    assert!((whole..whole + (2 << 20)).contains(&needed(&tiles)), "tiles pass by rows of tiles");
}
