#!/usr/bin/env bash
# Making the TIN of a point cloud under --memory 256MiB: points a second, peak resident memory of the process.
#   scripts/bench_points.sh [POINTS …]     default: 5000000
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked --quiet
groundel=$PWD/target/release/groundel
for points in "${@:-5000000}"; do
  folder=target/bench/points.$points
  [ -s "$folder/cloud.las" ] || {
    "$groundel" demo --inputs-only --quiet "$folder"
    # LAS 1.2 of format 0 over the frame of the demo's façade: places at random, depth in waves.
    python3 - "$folder/cloud.las" "$points" <<'P'
import math, os, random, struct, sys, tomllib

path, count = sys.argv[1], int(sys.argv[2])
random.seed(1)
frame = tomllib.load(open(os.path.dirname(path) + "/frame.toml", "rb"))
o, u, v = frame["origin"], frame["u_axis"], frame["v_axis"]
n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
head = bytearray(227)
head[:4] = b"LASF"
head[24:26] = bytes([1, 2])
struct.pack_into("<HIIBHI", head, 94, 227, 227, 0, 0, 20, count)
struct.pack_into("<6d", head, 131, 1e-5, 1e-5, 1e-5, *o)
with open(path, "wb") as f:
    f.write(head)
    for start in range(0, count, 100000):
        block = bytearray()
        for _ in range(min(100000, count - start)):
            x, z = random.random() * 10, random.random() * 8
            y = 0.1 * math.sin(3 * x) * math.cos(2 * z)
            at = [round((x * a + z * b + y * c) * 1e5) for a, b, c in zip(u, v, n)]
            block += struct.pack("<3iHBBbBH", *at, 0, 9, 2, 0, 0, 0)
        f.write(block)
P
  }
  sed -i 's/^mesh = .*/points = ["cloud.las"]/; s/^out = .*/out = "few.tif"/' "$folder/project.toml"
  for _ in 1 2 3; do
    rm -rf "$folder/.groundel"
    # A mosaic of a few pixels: the time of the other stages does not count.
    "$groundel" ortho "$folder/project.toml" --quiet --memory 256MiB --threads 2 --extent 3,2,3.1,2.1 --report "$folder/report.json"
    python3 - "$folder" <<'P'
import json, sys

report = json.load(open(f"{sys.argv[1]}/report.json"))
tin = report["inputs"]["tin"]
stage = next(s for s in report["run"]["stages"] if s["name"] == "point clouds")
print(f"{tin['points']} points, {tin['triangles']} triangles: {stage['seconds']:.2f} s, {tin['points'] / stage['seconds'] / 1e6:.2f} M points/s, peak {stage['peak_memory_bytes'] / 2**20:.0f} MiB")
P
  done
done
