#!/usr/bin/env bash
# Building the mesh store under --memory 256MiB: faces a second, bytes a face, peak resident memory of the process.
#   scripts/bench_mesh.sh [FACES …]     default: 3000000 30000000
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked --quiet
groundel=$PWD/target/release/groundel
for faces in "${@:-3000000 30000000}"; do
  for n in $faces; do
    folder=target/bench/mesh.$n
    [ -s "$folder/project.toml" ] || "$groundel" demo --paper --faces "$n" --inputs-only --quiet "$folder"
    for _ in 1 2 3; do
      rm -rf "$folder/.groundel"
      # A mosaic of a few pixels: the time of the other stages does not count.
      "$groundel" ortho "$folder/project.toml" --quiet --memory 256MiB --extent 3,2,3.1,2.1 --out "$folder/few.tif" \
        --report "$folder/report.json"
      python3 - "$folder" <<'P'
import glob, json, os, sys

folder = sys.argv[1]
report = json.load(open(f"{folder}/report.json"))
faces = sum(m["faces"] for m in report["inputs"]["meshes"])
stage = next(s for s in report["run"]["stages"] if s["name"] == "mesh store")
size = sum(os.path.getsize(f) for f in glob.glob(f"{folder}/.groundel/mesh*"))
print(f"{faces} faces: {stage['seconds']:.2f} s, {faces / stage['seconds'] / 1e6:.2f} M faces/s, {size / faces:.2f} bytes a face, peak {stage['peak_memory_bytes'] / 2**20:.0f} MiB")
P
    done
  done
done
