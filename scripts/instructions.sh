#!/usr/bin/env bash
# The guard of the kernels: counts the instructions of a small job, not its seconds, and compares them module by module
# with scripts/instructions.json. One thread, under valgrind's callgrind; what compresses, allocates or reads is not
# compared, and neither is a module whose share is less than a hundredth.
#   scripts/instructions.sh           exit code 1 if a module takes 3 % more, or 10 % less, than the file says
#   scripts/instructions.sh --renew   writes the file: what is counted now is what is wanted
# The figures hold for one rustc; with another one, they are shown and nothing fails.
set -euo pipefail
cd "$(dirname "$0")/.."
if ! command -v valgrind >/dev/null; then
  echo "instructions.sh: valgrind is not installed: instructions were NOT compared" >&2
  exit 0
fi
cargo build --release --locked --quiet
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
groundel=target/release/groundel
"$groundel" demo "$folder" --inputs-only --quiet --faces 60000
# Photos are decoded outside of what is counted: their stores are there, the mesh store is not.
job=("$groundel" ortho "$folder/project.toml" --colour paper --quiet --threads 1 --memory 256MiB --pixel-size 0.008 --extent 1.2,1.1,4.2,3.2
  --layers elevation --compress none --work "$folder/work" --out "$folder/few.tif")
"${job[@]}"
rm -f "$folder"/work/mesh-*
valgrind --tool=callgrind --callgrind-out-file="$folder/counts" --log-file="$folder/log" "${job[@]}" ||
  { cat "$folder/log" >&2; exit 2; }
python3 scripts/instructions.py "$folder/counts" scripts/instructions.json "$(rustc --version)" "$@"
