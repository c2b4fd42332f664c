#!/usr/bin/env bash
# The paper-sized job: 3 million faces, seven photos of 5 megapixels, a mosaic of 3720 × 2775 pixels, by the paper's rule,
# beside its floor: what reading its inputs and writing its output costs anyway (scripts/floor.py). In turn, several
# times: the floor; the job from raw files with nothing cached; the job again on warm stores; the job from raw files
# under --memory 512MiB; and from raw files by the default rule of colour.
#   scripts/bench_paper.sh [RUNS] [FOLDER]
# Prints the median of each stage, of the peak resident memory and of the ratio to the floor of the same round.
# Needs djpeg (Debian: libjpeg-turbo-progs).
set -euo pipefail
cd "$(dirname "$0")/.."
runs=${1:-5}
folder=${2:-target/bench/paper}
command -v djpeg >/dev/null || { echo "djpeg is not installed (libjpeg-turbo-progs)" >&2; exit 2; }
cargo build --release --locked --quiet
scripts/venv.sh
groundel=$PWD/target/release/groundel
python=$PWD/target/venv/bin/python
floor=$PWD/scripts/floor.py
[ -s "$folder/project.toml" ] || "$groundel" demo --paper --inputs-only "$folder"
cd "$folder"

one() {
  local label=$1
  shift
  "$groundel" ortho project.toml --colour "${rule:-paper}" --quiet --threads 2 --report "report.$label.json" "$@"
}

rm -rf report.*.json floor.*.json .groundel mosaic.*
one first
for k in $(seq "$runs"); do
  "$python" "$floor" . >"floor.$k.json"
  rm -rf .groundel mosaic.*
  one "cold.$k"
  one "warm.$k"
  rm -rf .groundel
  one "512MiB.$k" --memory 512MiB
  rm -rf .groundel
  rule=even one "even.$k"
done
grep -m1 'model name' /proc/cpuinfo | sed 's/.*: //'
echo "$(nproc) processors; $(rustc --version)"
"$python" - "$runs" <<'P'
import json, os, statistics, sys

rounds = range(1, int(sys.argv[1]) + 1)
load = lambda name: [json.load(open(name.format(k))) for k in rounds]
floors = load("floor.{}.json")
median = lambda values: statistics.median(values)
parts = ", ".join(f"{name} {median(f[name] for f in floors):.2f}" for name in ("mesh", "photos", "mosaic"))
print(f"  floor: {median(f['all'] for f in floors):6.2f} s; {parts}; GDAL's file {floors[0]['bytes'] / 1e6:.1f} MB, ours {os.path.getsize('mosaic.tif') / 1e6:.1f} MB")
for label in ("cold", "warm", "512MiB", "even"):
    reports = [r["run"] for r in load(f"report.{label}.{{}}.json")]
    seconds = median(r["seconds"] for r in reports)
    ratio = median(r["seconds"] / f["all"] for r, f in zip(reports, floors))
    peak = median(r["peak_memory_bytes"] for r in reports)
    stages = [s["name"] for s in reports[0]["stages"]]
    each = [(name, median(r["stages"][i]["seconds"] for r in reports)) for i, name in enumerate(stages)]
    shown = ", ".join(f"{name} {s:.2f} ({100 * s / seconds:.0f} %)" for name, s in each if s >= 0.005)
    print(f"{label:>7}: {seconds:6.2f} s = {ratio:.2f} x the floor; {3720 * 2775 / 1e6 / seconds:.2f} Mpx/s; peak {peak / 2**20:.0f} MiB; {shown}")
P
