#!/usr/bin/env bash
# Renders one of the real data sets with all layers, and makes PNGs to look at.
#   scripts/real.sh SET [OUT_DIR] [groundel ortho flags …]
# SET is a folder of DATA (default ../shared/data) with mesh.ply, sparse/, images/ and frame.toml.
set -euo pipefail
cd "$(dirname "$0")/.."
set_name=${1:?usage: scripts/real.sh SET [OUT_DIR] [flags]}
out=${2:-target/real/$set_name}
shift $(($# < 2 ? $# : 2))
data=${DATA:-../shared/data}/$set_name
mkdir -p "$out"
cargo build --release --quiet
/usr/bin/time -f 'wall %e s, user %U s, peak resident %M KiB' \
  target/release/groundel ortho --mesh "$data/mesh.ply" --cameras "$data/sparse" --photos "$data/images" \
  --frame "$data/frame.toml" --layers elevation,face,count,used,coverage,best \
  --out "$out/mosaic.tif" --report "$out/report.json" "$@"
python=$(scripts/venv.sh)
"$python" scripts/preview.py "$out"/mosaic.tif "$out"/mosaic.*.tif
