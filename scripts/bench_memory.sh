#!/usr/bin/env bash
# The paper-sized job under different memory caps, each run in a control group of the cap's size without swap where
# the machine has such groups: cap × peak × time, and whether the mosaics are the same bytes.
#   scripts/bench_memory.sh [RUNS] [FOLDER]
set -euo pipefail
cd "$(dirname "$0")/.."
runs=${1:-3}
folder=${2:-target/bench/paper}
caps="256MiB 512MiB 1GiB 4GiB"
cargo build --release --locked --quiet
groundel=$PWD/target/release/groundel
[ -s "$folder/project.toml" ] || "$groundel" demo --paper --inputs-only "$folder"
in_cgroup=$PWD/scripts/in_cgroup.sh
"$in_cgroup" 268435456 true 2>/dev/null || { in_cgroup=; echo "no control groups here: the peak alone is measured"; }
cd "$folder"
rm -f memory.*.json sums
for k in $(seq "$runs"); do
  for cap in $caps; do
    rm -rf .groundel mosaic.*
    ${in_cgroup:+"$in_cgroup" "$(numfmt --from=iec-i --suffix=B "$cap" | tr -d B)"} \
      "$groundel" ortho project.toml --colour paper --quiet --memory "$cap" --report "memory.$cap.$k.json" 2>/dev/null
    sha256sum mosaic.tif >> sums
  done
done
echo "$(sort -u sums | wc -l) different mosaic(s) in $(wc -l < sums) runs"
python3 - "$runs" $caps <<'P'
import json, statistics, sys

runs, caps = int(sys.argv[1]), sys.argv[2:]
for cap in caps:
    reports = [json.load(open(f"memory.{cap}.{k}.json"))["run"] for k in range(1, runs + 1)]
    seconds = statistics.median(r["seconds"] for r in reports)
    peak = max(r["peak_memory_bytes"] for r in reports) / 2**20
    held = ", ".join(f"{m['consumer']} {m['peak_bytes'] / 2**20:.0f} of {m['share_bytes'] / 2**20:.0f}" for m in reports[0]["memory"])
    print(f"{cap:>7}: {seconds:5.1f} s, peak {peak:4.0f} MiB ({held})")
P
