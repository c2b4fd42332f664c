//! Writes good files of every format into a folder, one sub-folder a fuzz target: what the targets begin with.
#![allow(dead_code, reason = "the parsers themselves are not driven here")]

#[path = "../../hostile/corpus.rs"]
mod corpus;
#[path = "../../hostile/parsers.rs"]
mod parsers;

use std::fs;
use std::path::{Path, PathBuf};

use groundel::input::open_mesh;
use groundel::store::mesh::MeshBuild;

type Parser = fn(&Path) -> groundel::Result<u64>;

fn main() {
    let seeds = PathBuf::from(std::env::args_os().nth(1).expect("a folder for the seeds"));
    let good = seeds.join("good");
    let into = |target: &str, name: &str, bytes: &[u8]| {
        fs::create_dir_all(seeds.join(target)).unwrap();
        fs::write(seeds.join(target).join(name), bytes).unwrap();
    };
    fs::create_dir_all(&good).unwrap();
    for (name, _) in corpus::foreign(&good) {
        let bytes = fs::read(good.join(&name)).unwrap();
        let ending = Path::new(&name).extension().unwrap().to_str().unwrap();
        let target = match ending {
            "jpg" | "png" | "tif" => "photo",
            "toml" => "project",
            "las" | "laz" | "txt" => "points",
            _ => "mesh",
        };
        into(target, &name, &bytes);
        if ending == "jpg" {
            into("photo_index", &name, &bytes);
        }
    }
    for (kind, first) in [("text", 0_u8), ("binary", 1)] {
        for (name, second) in corpus::cameras(&good.join(kind), kind).into_iter().zip([0, 2]) {
            let bytes = fs::read(good.join(kind).join(&name)).unwrap();
            into("cameras", &name, &[&[first | second], bytes.as_slice()].concat());
        }
    }
    into("part", "part-0", &fs::read(corpus::part(&good.join("job"))).unwrap());
    let build =
        MeshBuild { work: good.join("work"), budget_bytes: 16 << 20, resident_limit_bytes: 0 };
    let mesh = open_mesh(&good.join("ascii.ply")).unwrap();
    let store = build.open_or_build(&[mesh.as_ref()], &mut |_, _, _| Ok(())).unwrap();
    into("mesh_store", "store", &fs::read(store.path()).unwrap());
    let tiles = corpus::photo_store(&good.join("a.png"), &good.join("tiles"));
    into("photo_store", "tiles", &fs::read(tiles).unwrap());
    fs::remove_dir_all(&good).unwrap();
}
