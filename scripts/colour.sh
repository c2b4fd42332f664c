#!/usr/bin/env bash
# The default colour rule beside the paper's, on a real data set: time, steps across changes of the set of photos, fine
# contrast, and PNGs to look at.
#   scripts/colour.sh SET [OUT_DIR]
set -euo pipefail
cd "$(dirname "$0")/.."
set_name=${1:?usage: scripts/colour.sh SET [OUT_DIR]}
out=${2:-target/colour/$set_name}
for rule in paper even; do
  scripts/real.sh "$set_name" "$out/$rule" --colour "$rule" --quiet
done
scripts/real.sh "$set_name" "$out/heaviest" --colour paper --outliers none --blend best --quiet
"$(scripts/venv.sh)" scripts/colour.py "$out/heaviest/mosaic.tif" "$out/paper/mosaic.tif" "$out/even/mosaic.tif"
