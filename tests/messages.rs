//! Every kind of bad input, and what the user is told: exit code and message, word for word, in
//! `tests/golden/messages.txt`, which `scripts/bless.sh` alone renews. Nothing may be left under a final name.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[path = "las/mod.rs"]
mod las_files;

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::DVec3;
use groundel::synthetic::{Sampling, TestScene, scenes};
use las_files::Kind;

/// A good project in which one thing is spoilt, and the flags beside `project.toml`.
struct Case {
    name: &'static str,
    spoil: fn(&Project),
    flags: &'static [&'static str],
}

const fn spoilt(name: &'static str, spoil: fn(&Project)) -> Case {
    Case { name, spoil, flags: &[] }
}

const fn flags(name: &'static str, flags: &'static [&'static str]) -> Case {
    Case { name, spoil: |_| {}, flags }
}

/// A case in which `cloud` is the surface.
const fn cloud(name: &'static str, spoil: fn(&Project)) -> Case {
    Case { name, spoil, flags: &["--points", "cloud"] }
}

/// `bytes` with some of them replaced.
fn patched(mut bytes: Vec<u8>, at: usize, by: &[u8]) -> Vec<u8> {
    bytes[at..at + by.len()].copy_from_slice(by);
    bytes
}

/// Where the points of a LAS file begin.
fn points_at(bytes: &[u8]) -> usize {
    u32::from_le_bytes(*bytes[96..].first_chunk().unwrap()) as usize
}

/// The cloud becomes LAZ.
fn laz(project: &Project) {
    write_cloud(&project.path("cloud"), Kind { format: 0, is_compressed: true });
}

/// A few points of the scene's wall.
fn write_cloud(path: &Path, kind: Kind) {
    let points: Vec<DVec3> = (0..400_u32)
        .map(|k| {
            DVec3::new(f64::from(k % 20) * 0.1, f64::from(k / 20) * 0.1, f64::from(k % 7) * 0.01)
        })
        .collect();
    las_files::write(path, kind, DVec3::ZERO, &points, &[]);
}

struct Project(PathBuf);

impl Project {
    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn edit(&self, name: &str, change: impl FnOnce(Vec<u8>) -> Vec<u8>) {
        let path = self.path(name);
        fs::write(&path, change(fs::read(&path).unwrap())).unwrap();
    }

    fn replace(&self, name: &str, from: &str, to: &str) {
        self.edit(name, |bytes| {
            let text = String::from_utf8(bytes).unwrap();
            assert!(text.contains(from), "{name}: {from}: {text}");
            text.replacen(from, to, 1).into_bytes()
        });
    }

    fn cut(&self, name: &str, per_cent: usize) {
        self.edit(name, |bytes| bytes[..bytes.len() * per_cent / 100].to_vec());
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    /// The value of a key of the frame becomes `value`.
    fn frame(&self, key: &str, value: &str) {
        self.edit("project.toml", |bytes| {
            let text = String::from_utf8(bytes).unwrap();
            let edit = |line: &str| {
                let is_it = line.starts_with(&format!("{key} = "));
                if is_it { format!("{key} = {value}") } else { line.to_owned() }
            };
            text.lines().map(edit).collect::<Vec<_>>().join("\n").into_bytes()
        });
    }

    /// The mesh becomes this ASCII PLY of the given vertices and faces.
    fn mesh(&self, vertices: &[&str], faces: &[&str]) {
        let (n, m) = (vertices.len(), faces.len());
        self.mesh_stating(n, m, &[vertices, faces].concat().join("\n"));
    }

    fn mesh_stating(&self, vertices: usize, faces: usize, body: &str) {
        self.write(
            "mesh.ply",
            &format!(
                "ply\nformat ascii 1.0\nelement vertex {vertices}\nproperty double x\nproperty double y\n\
                 property double z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n{body}\n"
            ),
        );
    }
}

const CORNERS: [&str; 3] = ["0 0 0", "1 0 0", "0 1 0"];

const CASES: &[Case] = &[
    // Meshes.
    spoilt("mesh missing", |p| fs::remove_file(p.path("mesh.ply")).unwrap()),
    spoilt("mesh is a folder", |p| {
        fs::remove_file(p.path("mesh.ply")).unwrap();
        fs::create_dir(p.path("mesh.ply")).unwrap();
    }),
    spoilt("mesh cut in its faces", |p| p.cut("mesh.ply", 95)),
    spoilt("mesh cut in its vertices", |p| p.cut("mesh.ply", 20)),
    spoilt("mesh cut in its header", |p| p.edit("mesh.ply", |b| b[..60].to_vec())),
    spoilt("mesh empty", |p| p.write("mesh.ply", "")),
    spoilt("mesh of no faces", |p| p.mesh(&CORNERS, &[])),
    spoilt("mesh of absurd counts", |p| p.mesh_stating(4_000_000_000_000, 3, "0 0 0")),
    spoilt("mesh of more faces than ids", |p| p.mesh_stating(3, 5_000_000_000, "0 0 0")),
    spoilt("mesh with NaN in use", |p| p.mesh(&["0 0 0", "1 nan 0", "0 1 0"], &["3 0 1 2"])),
    spoilt("mesh with a word for a number", |p| {
        p.mesh(&["0 0 0", "1 one 0", "0 1 0"], &["3 0 1 2"]);
    }),
    spoilt("mesh with an index out of range", |p| p.mesh(&CORNERS, &["3 0 1 2", "3 0 1 3"])),
    spoilt("mesh with a negative index", |p| p.mesh(&CORNERS, &["3 0 1 -1"])),
    spoilt("mesh with too short a line", |p| p.mesh(&["0 0 0", "1 0", "0 1 0"], &["3 0 1 2"])),
    spoilt("OBJ with an index beyond its vertices", |p| {
        p.write("mesh.ply", "v 0 0 0\nv 1 0 0\nf 1 2 3\n");
    }),
    spoilt("OBJ with a word for a number", |p| p.write("mesh.ply", "v 0 0 zero\nf 1 1 1\n")),
    spoilt("binary STL cut short", |p| {
        fs::write(p.path("mesh.stl"), [[0; 80].as_slice(), &[9, 0, 0, 0], &[0; 60]].concat())
            .unwrap();
        p.replace("project.toml", "mesh.ply", "mesh.stl");
    }),
    spoilt("ASCII STL without its last line", |p| {
        p.write(
            "mesh.ply",
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n",
        );
    }),
    spoilt("XYZ with eight numbers", |p| {
        fs::write(p.path("mesh.xyz"), "0 0 0 1 0 0 0 1\n").unwrap();
        p.replace("project.toml", "mesh.ply", "mesh.xyz");
    }),
    spoilt("GLB cut short", |p| {
        fs::write(p.path("mesh.ply"), b"glTF\x02\0\0\0\x40\0\0\0").unwrap();
    }),
    spoilt("gzip cut short", |p| {
        fs::write(p.path("mesh.ply"), [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3, 75]).unwrap();
    }),
    // Point clouds.
    spoilt("neither mesh nor points", |p| p.replace("project.toml", "mesh = [\"mesh.ply\"]", "")),
    flags("points missing", &["--points", "none.las"]),
    flags("points that are a mesh", &["--points", "mesh.ply"]),
    cloud("points in a picture", |p| {
        fs::copy(p.path("photos/a.png"), p.path("cloud")).map(drop).unwrap();
    }),
    cloud("a text of no points", |p| p.write("cloud", "X Y Z\n# none\n")),
    cloud("a point with a word for a number", |p| p.write("cloud", "X Y Z\n1 2 3\n4 five 6\n")),
    cloud("a point of two numbers", |p| p.write("cloud", "1 2 3 255\n4 5\n")),
    cloud("a point that is not finite", |p| p.write("cloud", "1 2 3\n4 nan 6\n")),
    cloud("points on a line", |p| p.write("cloud", "0 0 0\n1 1 0\n2 2 0\n")),
    cloud("LAS cut in its header", |p| p.edit("cloud", |b| b[..200].to_vec())),
    cloud("LAS cut in its points", |p| p.cut("cloud", 90)),
    cloud("LAS of an unknown point format", |p| p.edit("cloud", |b| patched(b, 104, &[11]))),
    cloud("LAS of too short records", |p| p.edit("cloud", |b| patched(b, 105, &[19, 0]))),
    cloud("LAS with a scale of zero", |p| p.edit("cloud", |b| patched(b, 131, &[0; 8]))),
    cloud("LAS of absurd counts", |p| p.edit("cloud", |b| patched(b, 107, &[255; 4]))),
    cloud("compressed LAS without a LASzip record", |p| {
        p.edit("cloud", |b| patched(b, 104, &[0x80]));
    }),
    cloud("LAZ cut in its points", |p| {
        laz(p);
        p.cut("cloud", 50);
    }),
    cloud("LAZ of absurd chunks", |p| {
        laz(p);
        p.edit("cloud", |b| {
            let table =
                usize::try_from(i64::from_le_bytes(*b[points_at(&b)..].first_chunk().unwrap()));
            patched(b, table.unwrap() + 4, &[255; 4])
        });
    }),
    flags("a longest edge without points", &["--max-edge", "1"]),
    flags("a longest edge of nothing", &["--points", "cloud", "--max-edge", "0"]),
    flags("a shorter edge than there is", &["--points", "cloud", "--max-edge", "1e-9"]),
    flags("points for a fitted plane", &["--points", "cloud", "--view", "fit"]),
    spoilt("points for a cylinder", |p| {
        p.write(
            "project.toml",
            "points = [\"cloud\"]\ncameras = \"sparse\"\nphotos = \"photos\"\nout = \"mosaic.tif\"\n[frame]\n\
             kind = \"cylinder\"\norigin = [0, 0, 0]\naxis = [0, 0, 1]\nzero = [1, 0, 0]\nradius = 5.0\nfacing = \"outside\"\n",
        );
    }),
    flags("a shift that is not finite", &["--shift", "1,nan,0"]),
    flags("masks missing", &["--masks", "none"]),
    spoilt("no mask for any photo", |p| {
        fs::create_dir(p.path("masks")).unwrap();
        p.edit("project.toml", |text| [b"masks = \"masks\"\n".as_slice(), &text].concat());
    }),
    spoilt("a mask of the wrong size", |p| {
        fs::create_dir(p.path("masks")).unwrap();
        image::GrayImage::new(10, 10).save(p.path("masks/a.png")).unwrap();
        p.edit("project.toml", |text| [b"masks = \"masks\"\n".as_slice(), &text].concat());
    }),
    // Cameras.
    spoilt("cameras missing", |p| fs::remove_dir_all(p.path("sparse")).unwrap()),
    spoilt("cameras are a file", |p| {
        fs::remove_dir_all(p.path("sparse")).unwrap();
        p.write("sparse", "");
    }),
    spoilt("cameras.txt missing", |p| fs::remove_file(p.path("sparse/cameras.txt")).unwrap()),
    spoilt("no oriented photo", |p| p.write("sparse/images.txt", "# nothing\n")),
    spoilt("a camera of an unknown model", |p| {
        p.replace("sparse/cameras.txt", "OPENCV", "OPENEYE");
    }),
    spoilt("a camera with too few parameters", |p| {
        p.write("sparse/cameras.txt", "1 PINHOLE 320 240 300 300 160\n");
    }),
    spoilt("a camera without a size", |p| {
        p.write("sparse/cameras.txt", "1 PINHOLE 0 240 300 300 160 120\n");
    }),
    spoilt("a photo of no camera", |p| {
        p.write("sparse/images.txt", "1 1 0 0 0 0 0 0 77 a.png\n\n");
    }),
    spoilt("a photo without a rotation", |p| {
        p.write("sparse/images.txt", "1 0 0 0 0 0 0 0 1 a.png\n\n");
    }),
    spoilt("a photo whose pose is not finite", |p| {
        p.write("sparse/images.txt", "1 1 0 0 0 inf 0 0 1 a.png\n\n");
    }),
    spoilt("a photo outside the folder", |p| {
        p.write("sparse/images.txt", "1 1 0 0 0 0 0 0 1 ../../secret.png\n\n");
    }),
    spoilt("a photo name not in UTF-8", |p| {
        fs::write(p.path("sparse/images.txt"), b"1 1 0 0 0 0 0 0 1 \xff.png\n\n").unwrap();
    }),
    spoilt("a photo with an absolute name", |p| {
        p.write("sparse/images.txt", "1 1 0 0 0 0 0 0 1 /etc/passwd\n\n");
    }),
    // Photos.
    spoilt("photos missing", |p| fs::remove_dir_all(p.path("photos")).unwrap()),
    spoilt("photos are a file", |p| {
        fs::remove_dir_all(p.path("photos")).unwrap();
        p.write("photos", "");
    }),
    spoilt("photos of another project", |p| {
        fs::remove_dir_all(p.path("photos")).unwrap();
        fs::create_dir(p.path("photos")).unwrap();
        p.write("photos/other.png", "");
    }),
    spoilt("all photos cut", |p| each_photo(p, |bytes| bytes[..bytes.len() / 2].to_vec())),
    spoilt("all photos are text", |p| each_photo(p, |_| b"not a picture\n".to_vec())),
    spoilt("all photos of half the size", |p| {
        p.edit("sparse/cameras.txt", |text| {
            let text = String::from_utf8(text).unwrap();
            text.replace(" 320 240 ", " 640 480 ").into_bytes()
        });
    }),
    // The frame.
    spoilt("axes not orthonormal", |p| p.frame("u_axis", "[1.0, 0.2, 0.0]")),
    spoilt("an axis of length zero", |p| p.frame("v_axis", "[0.0, 0.0, 0.0]")),
    spoilt("an axis that is not finite", |p| p.frame("u_axis", "[nan, 0.0, 0.0]")),
    spoilt("an axis of two numbers", |p| p.frame("u_axis", "[1.0, 0.0]")),
    spoilt("a pixel size of zero", |p| p.frame("pixel_size", "0.0")),
    spoilt("a negative pixel size", |p| p.frame("pixel_size", "-0.01")),
    spoilt("a pixel size that is not a number", |p| p.frame("pixel_size", "nan")),
    spoilt("a pixel size as text", |p| p.frame("pixel_size", "\"1 cm\"")),
    spoilt("an extent turned about", |p| p.frame("extent", "[1.0, 0.0, 0.0, 1.0]")),
    spoilt("an enormous extent", |p| p.frame("extent", "[-1e9, -1e9, 1e9, 1e9]")),
    spoilt("an extent that is not finite", |p| p.frame("extent", "[0.0, 0.0, inf, 1.0]")),
    spoilt("an extent beside the mesh", |p| p.frame("extent", "[5000.0, 0.0, 5001.0, 1.0]")),
    spoilt("an unknown kind of frame", |p| p.frame("kind", "\"sphere\"")),
    spoilt("an unknown key of the frame", |p| p.frame("pixel_size", "0.01\npixelsize = 0.01")),
    spoilt("no origin", |p| p.replace("project.toml", "origin", "orig")),
    // The project file.
    spoilt("project file missing", |p| fs::remove_file(p.path("project.toml")).unwrap()),
    spoilt("project file with an unknown key", |p| {
        p.replace("project.toml", "photos = ", "fotos = ");
    }),
    spoilt("project file that is no TOML", |p| p.write("project.toml", "mesh = [\n")),
    spoilt("project file not in UTF-8", |p| {
        fs::write(p.path("project.toml"), b"out = \"\xff\"\n").unwrap();
    }),
    // Outputs.
    spoilt("output is a folder", |p| fs::create_dir(p.path("mosaic.tif")).unwrap()),
    flags("output in no folder", &["--out", "none/mosaic.tif"]),
    flags("output of another format", &["--out", "mosaic.jpg"]),
    spoilt("output would overwrite a photo", |p| {
        fs::rename(p.path("photos/a.png"), p.path("photos/mosaic.tif")).unwrap();
        p.replace("sparse/images.txt", "a.png", "mosaic.tif");
        p.replace("project.toml", "out = \"mosaic.tif\"", "out = \"photos/mosaic.tif\"");
    }),
    flags("work folder is a file", &["--work", "mesh.ply"]),
    // Flags.
    flags("too little memory", &["--memory", "100MiB"]),
    flags("memory without a unit", &["--memory", "lots"]),
    flags("no threads", &["--threads", "0"]),
    flags(
        "tiles too large for the memory",
        &["--memory", "256MiB", "--tile-size", "4096", "--threads", "2"],
    ),
    flags("tile size not a multiple of 16", &["--tile-size", "100"]),
    flags("a negative beta", &["--beta", "-1"]),
    flags("a slab turned about", &["--elevation", "2,1"]),
    flags("sections without a step", &["--sections", "0,1"]),
    flags("sections down", &["--sections", "1,0,0.1"]),
    flags("too many sections", &["--sections", "0,100,0.01"]),
    flags("sections with an end of their own", &["--sections", "0,1,0.5", "--elevation", "-1,2"]),
    flags("sections below the slab", &["--sections", "0,1,0.5", "--elevation", "0,inf"]),
    flags("sections below everything", &["--sections", "-99,-98,0.5"]),
    flags("a slab above everything", &["--elevation", "1000,2000"]),
    flags("no photo chosen", &["--exclude", "*"]),
    flags("a pattern that fits nothing", &["--include", "IMG*"]),
    flags("an unknown layer", &["--layers", "height"]),
    flags("an unknown system", &["--crs", "EPSG:1"]),
    flags("a system of degrees", &["--crs", "EPSG:4326"]),
    flags("a colour of two numbers", &["--undefined", "1,2"]),
    flags("more pixels than the photos hold", &["--pixel-size", "0.0001"]),
    flags("a scale that is none", &["--scale", "50", "--dpi", "300"]),
    flags("a scale without dots per inch", &["--scale", "1:50"]),
    flags("a scale and a pixel size", &["--scale", "1:50", "--dpi", "300", "--pixel-size", "0.01"]),
    flags("no dots per inch", &["--dpi", "0"]),
    flags("a drawing of another kind", &["--cad", "dwg"]),
    Case {
        name: "a scale for a perspective view",
        spoil: perspective,
        flags: &["--frame", "view.toml", "--scale", "1:50", "--dpi", "300"],
    },
    Case {
        name: "a world file for a perspective view",
        spoil: perspective,
        flags: &["--frame", "view.toml", "--world-file"],
    },
    Case {
        name: "a drawing of a perspective view",
        spoil: perspective,
        flags: &["--frame", "view.toml", "--cad", "dxf"],
    },
    Case {
        name: "a drawing of a development",
        spoil: |p| {
            p.write(
                "view.toml",
                "kind = \"cylinder\"\norigin = [0, 0, 9]\naxis = [0, 1, 0]\nzero = [0, 0, -1]\nradius = 9.0\n\
                 facing = \"inside\"\n",
            );
        },
        flags: &["--frame", "view.toml", "--cad", "dxf"],
    },
    flags("a drawing of a name it cannot hold", &["--out", "a\tb.tif", "--cad", "dxf"]),
    #[cfg(unix)]
    spoilt("the mesh is a loop of links", |p| {
        fs::remove_file(p.path("mesh.ply")).unwrap();
        std::os::unix::fs::symlink("mesh.ply", p.path("mesh.ply")).unwrap();
    }),
    #[cfg(unix)]
    spoilt("the photos are a loop of links", |p| {
        fs::remove_dir_all(p.path("photos")).unwrap();
        std::os::unix::fs::symlink("photos", p.path("photos")).unwrap();
    }),
];

fn perspective(project: &Project) {
    project.write("view.toml", "kind = \"perspective\"\nphoto = \"b.png\"\n");
}

fn each_photo(project: &Project, change: fn(Vec<u8>) -> Vec<u8>) {
    for shot in scene().shots {
        project.edit(&format!("photos/{}", shot.name), change);
    }
}

fn scene() -> TestScene {
    scenes::columns()
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Exit code and messages of a case.
fn told(case: &Case, good: &Path, folder: &Path) -> String {
    copy(good, folder);
    let project = Project(folder.to_path_buf());
    (case.spoil)(&project);
    let before = fs::read_dir(folder).unwrap().count();
    let run = Command::new(env!("CARGO_BIN_EXE_groundel"))
        .current_dir(folder)
        .args(["ortho", "project.toml", "--quiet"])
        .args(case.flags)
        .output()
        .unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    let code = run.status.code().unwrap_or_else(|| panic!("{}: {said}", case.name));
    assert!((2..=4).contains(&code), "{}: {code}: {said}", case.name);
    assert!(run.stdout.is_empty(), "{}", case.name);
    assert!(!folder.join("mosaic.tif").is_file(), "{}", case.name);
    // The work folder is the only thing that may have come.
    let after = fs::read_dir(folder).unwrap().count();
    let work = usize::from(folder.join(".groundel").exists());
    assert_eq!(after, before + work, "{}", case.name);
    format!("{}\n  {code}\n{}", case.name, indented(&said))
}

fn indented(lines: &str) -> String {
    lines.lines().flat_map(|line| ["  ", line, "\n"]).collect()
}

#[test]
fn the_user_is_told_what_is_wrong_where_and_what_was_expected() {
    let folder = tempfile::tempdir().unwrap();
    let good = folder.path().join("good");
    scene().write(&good, Sampling::Box(1), &[]).unwrap();
    write_cloud(&good.join("cloud"), Kind { format: 0, is_compressed: false });
    let mut all = String::new();
    for (k, case) in CASES.iter().enumerate() {
        let own = folder.path().join(k.to_string());
        let text = told(case, &good, &own).replace(&*own.to_string_lossy(), "PROJECT");
        writeln!(all, "{text}").unwrap();
        fs::remove_dir_all(&own).unwrap();
    }
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/messages.txt");
    if is_blessing() {
        fs::write(&golden, all).unwrap();
        return;
    }
    let known = fs::read_to_string(&golden).unwrap();
    for (found, known) in all.split("\n\n").zip(known.split("\n\n")) {
        assert_eq!(found, known);
    }
    assert_eq!(all.len(), known.len());
}

#[expect(clippy::disallowed_methods, reason = "only scripts/bless.sh sets it")]
fn is_blessing() -> bool {
    std::env::var_os("GROUNDEL_BLESS").is_some()
}
