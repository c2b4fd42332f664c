#!/usr/bin/env bash
# The paper-sized job: 3 million faces, seven photos of 5 megapixels, a mosaic of 3720 × 2775 pixels, all defaults,
# from raw files with nothing cached, several times; then once more on warm stores, and under --memory 512MiB.
#   scripts/bench_paper.sh [RUNS] [FOLDER]
# Prints wall-clock seconds by stage and the peak resident memory of each run, and the medians.
set -euo pipefail
cd "$(dirname "$0")/.."
runs=${1:-5}
folder=${2:-target/bench/paper}
cargo build --release --locked --quiet
groundel=$PWD/target/release/groundel
[ -s "$folder/project.toml" ] || "$groundel" demo --paper --inputs-only "$folder"
cd "$folder"

one() {
  local label=$1
  shift
  "$groundel" ortho project.toml --quiet --report "report.$label.json" "$@"
}

rm -f report.*.json
for k in $(seq "$runs"); do
  rm -rf .groundel mosaic.*
  one "cold.$k"
  one "warm.$k"
  rm -rf .groundel
  one "512MiB.$k" --memory 512MiB
done
grep -m1 'model name' /proc/cpuinfo | sed 's/.*: //'
echo "$(nproc) processors; $(rustc --version)"
python3 - "$runs" <<'P'
import json, statistics, sys

for label in ("cold", "warm", "512MiB"):
    reports = [json.load(open(f"report.{label}.{k}.json"))["run"] for k in range(1, int(sys.argv[1]) + 1)]
    median = lambda of: statistics.median(of(r) for r in reports)
    stages = [s["name"] for s in reports[0]["stages"]]
    parts = [f"{name} {median(lambda r: r['stages'][i]['seconds']):.2f}" for i, name in enumerate(stages)]
    print(f"{label:>7}: {median(lambda r: r['seconds']):6.2f} s; peak {median(lambda r: r['peak_memory_bytes']) / 2**20:.0f} MiB; {', '.join(parts)}")
P
