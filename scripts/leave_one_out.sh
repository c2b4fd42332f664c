#!/usr/bin/env bash
# Draws the views of photos from all the other photos of a real data set, and tells how near each comes to its original.
#   scripts/leave_one_out.sh SET PHOTO…
# SET is a folder of DATA (default ../shared/data) with mesh.ply, sparse/ and images/. For each photo OUT (default
# target/leave_one_out/SET) gets the view as TIFF and PNG, `….difference.png` (four times the difference about a middle
# grey, clear where no other photo sees anything), and the lines of `groundel compare`, which are printed too. Flags for
# `groundel ortho` are taken from FLAGS.
set -euo pipefail
cd "$(dirname "$0")/.."
set_name=${1:?usage: scripts/leave_one_out.sh SET PHOTO…}
shift
[ $# -gt 0 ] || { echo "usage: scripts/leave_one_out.sh SET PHOTO…" >&2; exit 2; }
data=${DATA:-../shared/data}/$set_name
out=${OUT:-target/leave_one_out/$set_name}
mkdir -p "$out"
cargo build --release --quiet
python=$(scripts/venv.sh)
read -ra flags <<<"${FLAGS:---memory 512MiB}"
for photo in "$@"; do
  stem=$out/$(basename "${photo%.*}")
  printf 'kind = "perspective"\nphoto = "%s"\ndistorted = true\n' "$photo" >"$stem.toml"
  target/release/groundel ortho --mesh "$data/mesh.ply" --cameras "$data/sparse" --photos "$data/images" \
    --frame "$stem.toml" --exclude "$photo" --out "$stem.tif" --work "$out/work" --quiet "${flags[@]}"
  echo "$set_name $photo"
  target/release/groundel compare "$stem.tif" "$data/images/$photo" --out "$stem.difference.png" | tee "$stem.txt"
  "$python" -W ignore scripts/preview.py "$stem.tif"
done
