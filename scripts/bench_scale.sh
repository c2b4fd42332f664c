#!/usr/bin/env bash
# How time, memory and disk grow with the job: series of synthetic jobs under --memory 1GiB, in target/bench/scale.
#   scripts/bench_scale.sh [SERIES …] [--small] [--cold] [--minutes=N]
#     faces     a façade of 10, 100, 300 and 1000 million faces, one mosaic
#     mosaic    0.1, 1 and 10 gigapixels of one façade
#     photos    10, 100 and 1000 photos of 24 megapixels, the same mosaic; then 1000 photos and a growing mosaic
#     threads   one and two threads
#   --minutes=N leaves out mosaics that would take longer, by name;
#   --small     smaller steps, minutes in all; --cold: page caches are dropped before each run (needs root)
# Writes target/bench/scale.csv and scale.png (copy it to benches/, where the README shows it), and says PASS or FAIL for each claim; exit code 1 if one failed. Steps
# that the disk cannot hold are left out by name. Inputs are deleted as soon as no step needs them.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked --quiet
code=0
python3 scripts/bench_scale.py target/release/groundel target/bench "$@" || code=$?
[ "$code" -le 1 ] || exit "$code"

# The plot alone needs these.
venv=target/venv-plot
packages="contourpy==1.3.3 cycler==0.12.1 fonttools==4.68.0 kiwisolver==1.5.1 matplotlib==3.11.2 numpy==2.4.6
packaging==26.3 pillow==13.0.0 pyparsing==3.3.3 python-dateutil==4.0.0 tzdata==2026.6"
if [ "$(cat "$venv/groundel-packages" 2>/dev/null)" != "$packages" ]; then
  rm -rf "$venv"
  python3 -m venv "$venv"
  # shellcheck disable=SC2086 # a word for each package
  "$venv/bin/pip" install --quiet --disable-pip-version-check --only-binary :all: --no-deps $packages
  printf '%s\n' "$packages" > "$venv/groundel-packages"
fi
"$venv/bin/python" scripts/plot_scale.py target/bench/scale.csv target/bench/scale.png
exit "$code"
